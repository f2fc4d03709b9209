"""The navigation filter as a fold, and the motion without smoother."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.unit.test_navigation import simulate

from weighbridge.constants import GRAVITY
from weighbridge.kernels.ins_model import (
    ERRORS,
    MEASUREMENTS,
    SCALE,
    STATES,
    TIME,
    Z_D,
    Z_HVAR,
    Z_N,
    Z_PITCH_MOVED,
    Z_SPEED,
    Z_SPEED_VAR,
    Z_STILL,
    Z_VVAR,
    Z_YAW_MOVED,
    Q,
    V,
)
from weighbridge.navigation.filter import (
    Block,
    State,
    run,
    run_smoothed,
)
from weighbridge.navigation.forward import forward_motion, lateness
from weighbridge.navigation.identify import Setup, identify
from weighbridge.navigation.inertial import inertial_motion
from weighbridge.navigation.rows import AHEAD, Clocks, place_nodes
from weighbridge.navigation.settings import NavigationSettings
from weighbridge.signals.recent import STEP


def _setup():
    x = np.zeros(STATES)
    x[V], x[Q], x[SCALE], x[TIME] = 15.0, 1.0, 1.0, np.nan
    return Setup(
        settings=NavigationSettings(),
        rate=20.0,
        rot_bs=np.eye(3),
        clocks=Clocks(0.0, 0.0, 0.2, 1.0, 1.0, 0.2, 0.0),
        noise=NavigationSettings().noise(),
        start=State(x, np.eye(ERRORS) * 1e-2),
        given=None,
        changes=(),
        moved_time=np.empty(0),
        moved_var=np.empty((0, 2)),
    )


def _block(n=3000):
    """Samples with a gap, fixes, stops, and a mounting that opens."""
    rng = np.random.default_rng(8)
    time = np.cumsum(rng.uniform(0.004, 0.006, n))
    time[2 * n // 3 :] += 2.0
    accel = np.array([0.1, 0.2, -GRAVITY]) + rng.normal(scale=0.2, size=(n, 3))
    gyro = rng.normal(scale=0.01, size=(n, 3))
    nodes = place_nodes(time, time[::203], 20.0, 0.5)
    z = np.full((nodes.size, MEASUREMENTS), np.nan)
    z[:, Z_STILL] = (np.arange(nodes.size) % 100 > 90) * 2.0
    z[:, Z_SPEED] = 15.0 + rng.normal(scale=0.3, size=nodes.size)
    z[:, Z_SPEED_VAR] = 0.3
    z[::17, Z_N : Z_D + 1] = rng.normal(scale=3.0, size=(z[::17].shape[0], 3))
    z[::17, Z_HVAR], z[::17, Z_VVAR] = 4.0, 25.0
    z[nodes.size // 2, [Z_PITCH_MOVED, Z_YAW_MOVED]] = 4e-4, 2.5e-3
    return Block(time, accel, gyro, nodes, z)


@pytest.mark.parametrize("size", [1, 7, 500])
def test_any_split_of_the_samples_gives_the_same(size):
    block, setup = _block(1500), _setup()
    whole, nodes = run(setup.start, block, setup)
    state, states, stds = setup.start, [], []
    for first in range(0, block.time.size, size):
        before = state.x.copy(), state.cov.copy()
        after, part = run(state, block.part(first, first + size), setup)
        assert_array_equal(before[0], state.x)
        assert_array_equal(before[1], state.cov)
        state = pickle.loads(pickle.dumps(after))
        states.append(part.states)
        stds.append(part.grade_std)
    assert_array_equal(state.x, whole.x)
    assert_array_equal(state.cov, whole.cov)
    assert_array_equal(np.vstack(states), nodes.states)
    assert_array_equal(np.concatenate(stds), nodes.grade_std)
    assert_array_equal(whole.cov, whole.cov.T)
    assert whole.time == block.time[-1]


def test_an_open_mounting_is_less_sure():
    block, setup = _block(600), _setup()
    closed = block.z.copy()
    closed[:, [Z_PITCH_MOVED, Z_YAW_MOVED]] = np.nan
    moved, _ = run(setup.start, block, setup)
    fixed, _ = run(setup.start, block._replace(z=closed), setup)
    assert moved.cov[15, 15] > fixed.cov[15, 15] + 1e-4


@pytest.mark.parametrize("fault", [math.nan, math.inf])
def test_samples_that_are_no_numbers_or_late_are_left_out(fault):
    block, setup = _block(600), _setup()
    usual, _ = run(setup.start, block, setup)
    accel, gyro, time = block.accel.copy(), block.gyro.copy(), block.time.copy()
    accel[100], gyro[201] = fault, fault
    time[303] = time[250]
    state, nodes = run(setup.start, Block(time, accel, gyro, block.nodes, block.z), setup)
    assert np.isfinite(state.x).all()
    assert np.isfinite(nodes.grade_std).all()
    assert_allclose(state.x[V : V + 3], usual.x[V : V + 3], atol=0.05)


def test_the_forward_pass_carries_no_log():
    block, setup = _block(600), _setup()
    ahead, nodes = run(setup.start, block, setup)
    end, smoothed = run_smoothed(setup.start, block, setup)
    assert_array_equal(ahead.x, end.x)
    assert_array_equal(ahead.cov, end.cov)
    assert_array_equal(nodes.grade_std, smoothed.grade_std)
    assert_allclose(smoothed.states[-1], nodes.states[-1], atol=1e-12)
    assert np.abs(smoothed.states[0] - nodes.states[0]).max() > 1e-6


@pytest.fixture(scope="module")
def hills():
    drive, truth = simulate(duration=240.0, seed=4)
    return drive, truth, identify(drive)


def test_setup_holds_what_the_motion_tells(hills):
    drive, _, setup = hills
    motion = inertial_motion(drive)
    assert setup.speed_delay == motion.speed_delay
    assert setup.notes == motion.notes
    assert setup.specific_force_std == motion.specific_force_std
    assert setup.use_squat == (motion.squat is not None)
    again = pickle.loads(pickle.dumps(setup))
    assert_array_equal(again.start.x, setup.start.x)


def test_forward_motion_is_near_the_truth(hills):
    drive, truth, setup = hills
    m = forward_motion(drive, setup)
    late = m.valid & (m.time > 60.0)
    for of, most in (("grade", 0.005), ("speed", 0.2), ("accel", 0.08)):
        error = getattr(m, of) - np.interp(m.time, truth.time, getattr(truth, of))
        assert np.std(error[late]) < most, of
    assert_allclose(m.specific_force, m.accel + GRAVITY * np.sin(m.grade), atol=1e-12)


@pytest.mark.parametrize("without", [(), ("altitude",), ("latitude", "longitude", "altitude")])
@pytest.mark.parametrize("cut", [60.0, 151.03])
def test_forward_motion_looks_ahead_by_no_more_than_it_says(hills, cut, without):
    drive = hills[0].without(*without)
    setup = identify(drive)
    whole = forward_motion(drive, setup)
    part = forward_motion(drive.between(drive.start, cut), setup)
    assert part.time[-1] > cut - lateness(setup) - STEP - 0.05
    for name in ("speed", "accel", "specific_force", "grade", "pitch", "heading", "valid",
                 "grade_std", "distance", "altitude"):  # fmt: skip
        a, b = getattr(whole, name)[: part.time.size], getattr(part, name)
        assert_array_equal(a, b, err_msg=name)


def test_a_gap_is_known_only_after_it(hills):
    drive, _, setup = hills
    gone = drive.with_signals(
        *(
            replace(s, time=s.time[keep], values=s.values[keep])
            for n, s in drive.signals.items()
            if n.startswith(("accel", "gyro"))
            for keep in [(s.time < 100.0) | (s.time > 104.0)]
        )
    )
    m = forward_motion(gone, setup)
    inside = (m.time > 100.1) & (m.time < 103.9)
    assert not m.valid[inside].any()
    assert np.isfinite(m.specific_force).all()
    before = m.time < 100.0 - AHEAD
    whole = forward_motion(drive, setup)
    assert_array_equal(m.grade[before], whole.grade[before])
    assert_array_equal(m.time, whole.time)
