"""An accelerometer that was wrong in the calibration is told at each weighing, and widens it."""

from dataclasses import replace

import pytest
from numba import config

import weighbridge as wb
from weighbridge import Problem, Signal
from weighbridge.simulation import Sensors, make_scenario, simulate_car

pytestmark = pytest.mark.skipif(
    bool(config.DISABLE_JIT), reason="whole drives take minutes without the compiler"
)


@pytest.fixture(scope="module", params=[("van-calibration", 71), ("compact-calibration", 72)])
def made(request):
    name, seed = request.param
    scenario = replace(make_scenario(name, seed=seed), sensors=Sensors(imu_rate=50.0))
    return simulate_car(replace(scenario, duration=1500.0))


def scaled(drive, gain):
    ahead = drive.signals["accel_x"]
    return drive.with_signals(Signal(ahead.name, ahead.time, gain * ahead.values))


def calibrated(made, drive):
    mass = made.scenario.mass
    return wb.calibrate(drive, mass, vehicle=wb.Vehicle(kind=made.scenario.car.kind))


@pytest.mark.parametrize("gain", [1.06, 0.94])
def test_a_scale_of_the_calibration_alone_is_told_and_in_the_interval(made, gain):
    mass = made.scenario.mass
    car = calibrated(made, scaled(made.drive, gain))
    (doubt,) = car.provenance.doubts
    assert doubt.startswith("calibration.gain: ")
    alone = wb.weigh(made.drive, replace(car, without_accelerometer=None))
    assert Problem.from_line(doubt) in alone.problems
    assert abs(alone.mass / mass - 1.0) > 0.02
    low, high = alone.interval(0.95)
    assert low < mass < high
    # With what the same drives show without the sensor it is nearer.
    weighed = wb.weigh(made.drive, car)
    assert any(p.id in ("imu.left_out", "imu.weighed_twice") for p in weighed.problems)
    assert abs(weighed.mass - mass) < 0.5 * abs(alone.mass - mass)


def test_a_sound_calibration_is_not_doubted(made):
    car = calibrated(made, made.drive)
    assert car.provenance.doubts == ()
    assert car.provenance.mass_scale_std < 0.02
