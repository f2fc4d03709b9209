"""The forward pass: near the smoothed answer, and causal to the last bit."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import weighbridge as wb
from weighbridge.errors import ConfigError, DriveError
from weighbridge.pipeline.forward import AHEAD, forward_weigh, identify_forward
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
    return forward_weigh(weighing.drive, weighing.vehicle, setup)


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
    begun = forward_weigh(drive.between(drive.start, cut), weighing.vehicle, setup)
    settled = begun.time < cut - 2.0 * AHEAD - setup.delay - 2.5
    assert np.count_nonzero(settled) > 10
    count = int(np.count_nonzero(settled))
    assert_array_equal(begun.time[:count], whole.time[:count])
    assert_array_equal(begun.mass[:count], whole.mass[:count])
    assert_array_equal(begun.std[:count], whole.std[:count])


def test_a_setup_needs_a_mass_by_joint_and_an_inertial_sensor(weighing):
    with pytest.raises(ConfigError, match="weighing of method joint"):
        identify_forward(wb.weigh(weighing.drive, weighing.vehicle, "rls"))
    blind = weighing.drive.without(*(f"{k}_{a}" for k in ("accel", "gyro") for a in "xyz"))
    with pytest.raises(DriveError, match="needs accel_x"):
        identify_forward(wb.weigh(blind, weighing.vehicle))
