"""The motion without smoother, as it is found while driving."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.unit.test_navigation import simulate

from weighbridge.constants import GRAVITY
from weighbridge.navigation import find_motion, identify_motion
from weighbridge.navigation.forward import forward_motion, lateness
from weighbridge.signals import STEP


@pytest.fixture(scope="module")
def hills():
    drive, truth = simulate(duration=240.0, seed=4)
    return drive, truth, identify_motion(drive)[1]


def test_setup_holds_what_the_motion_tells(hills):
    drive, _, setup = hills
    motion = find_motion(drive)
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
    setup = identify_motion(drive)[1]
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
    before = m.time < 100.0 - lateness(setup)
    whole = forward_motion(drive, setup)
    assert_array_equal(m.grade[before], whole.grade[before])
    assert_array_equal(m.time, whole.time)
