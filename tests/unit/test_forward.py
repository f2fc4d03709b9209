"""The forward pass: near the smoothed answer, and causal to the last bit."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import weighbridge as wb
from weighbridge.balance.averaging import WINDOW
from weighbridge.errors import ConfigError, DriveError
from weighbridge.pipeline.forward import forward_weigh, identify_forward, lateness
from weighbridge.signals.recent import STEP
from weighbridge.simulation import MIDSIZE, Scenario, short_route, simulate_car


@pytest.fixture(scope="module")
def made():
    return simulate_car(Scenario(name="forward", car=MIDSIZE, route=short_route(), seed=42_001))


@pytest.fixture(scope="module")
def weighing(made):
    car = wb.calibrate(made.drive, mass=made.scenario.mass)
    other = simulate_car(
        Scenario(name="loaded", car=MIDSIZE, route=short_route(), payload=250.0, seed=42_002)
    )
    return wb.weigh(other.drive, car)


@pytest.fixture(scope="module")
def setup(weighing):
    return identify_forward(weighing)


@pytest.fixture(scope="module")
def whole(weighing, setup):
    return forward_weigh(weighing.drive, setup)


def test_the_forward_pass_ends_near_the_smoothed_answer(weighing, whole):
    assert whole.mass[-1] == pytest.approx(weighing.mass, rel=0.01)
    assert whole.std[-1] == pytest.approx(weighing.std, rel=0.25)
    assert whole.state.windows > 50
    # What is left open falls as the drive goes on.
    assert whole.std[0] > 1.2 * whole.std[-1]


@pytest.mark.parametrize("part", [0.3, 0.62, 0.9])
def test_what_comes_later_changes_no_bit(weighing, setup, whole, part):
    drive = weighing.drive
    cut = drive.start + part * drive.duration
    begun = forward_weigh(drive.between(drive.start, cut), setup)
    count = begun.time.size
    assert count > 10
    assert_array_equal(begun.time, whole.time[:count])
    assert_array_equal(begun.mass, whole.mass[:count])
    assert_array_equal(begun.std, whole.std[:count])
    # Windows are known soon after they end.
    waiting = lateness(setup) + STEP + 2.0 * WINDOW
    assert count >= np.count_nonzero(whole.time < cut - waiting)
    assert lateness(setup) - setup.delay - setup.navigation.clocks.speed_delay < 1.01


def test_a_drive_that_pauses_goes_on(weighing, setup):
    """Bus and sensor are silent for a while; what comes after is weighed as before."""
    drive = weighing.drive
    middle = drive.start + 0.5 * drive.duration
    gap = drive.with_signals(
        *(
            replace(s, time=s.time[keep], values=s.values[keep])
            for s in drive.signals.values()
            for keep in [(s.time < middle) | (s.time > middle + 60.0)]
        )
    )
    track = forward_weigh(gap, setup)
    assert track.mass[-1] == pytest.approx(weighing.mass, rel=0.02)
    assert not ((track.time > middle + 1.0) & (track.time < middle + 60.0)).any()
    assert (track.time > middle + 60.0).sum() > 20


@pytest.mark.parametrize("lost", [("engine_load",), ("accel_x",), ("vehicle_speed",)])
def test_a_signal_that_ends_adds_no_windows(weighing, setup, lost):
    drive = weighing.drive
    middle = drive.start + 0.5 * drive.duration
    cut = drive.with_signals(
        *(
            replace(s, time=s.time[s.time < middle], values=s.values[s.time < middle])
            for s in drive.signals.values()
            if s.name in lost
        )
    )
    track = forward_weigh(cut, setup)
    assert track.time.size > 20
    # GNSS goes on for the motion; a torque or an accelerometer nothing replaces.
    if lost != ("vehicle_speed",):
        assert track.time[-1] < middle + 3.0
    assert track.mass[-1] == pytest.approx(weighing.mass, rel=0.02)


def test_a_setup_needs_a_mass_by_joint_and_an_inertial_sensor(weighing):
    with pytest.raises(ConfigError, match="weighing of method joint"):
        identify_forward(wb.weigh(weighing.drive, weighing.vehicle, "rls"))
    blind = weighing.drive.without(*(f"{k}_{a}" for k in ("accel", "gyro") for a in "xyz"))
    with pytest.raises(DriveError, match="needs accel_x"):
        identify_forward(wb.weigh(blind, weighing.vehicle))
