"""What a data sheet leaves open where no accelerometer tells the motion."""

from dataclasses import replace

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.estimators.joint.load_stops import unseen_std
from weighbridge.simulation import make_scenario, simulate_car, usual_polling
from weighbridge.vehicle import Known, describe


def slow_bus(seed, mass):
    """A city bus without passengers that tells its values once a second, and no inertial sensor."""
    made = make_scenario("bus-urban", mass=mass, seed=seed)
    fast = ("engine_torque_fraction", "engine_speed", "vehicle_speed", "brake_switch",
            "retarder_torque")  # fmt: skip
    polling = replace(usual_polling(made.car), rate=1.0, speed_step=1.0, fast=fast)
    sensors = replace(made.sensors, imu_rate=0.0)
    return simulate_car(
        replace(made, loading=(), polling=polling, sensors=sensors, duration=1200.0)
    )


@pytest.mark.parametrize(("seed", "mass"), [(8716, 8600.0), (8717, 11_900.0)])
def test_the_interval_of_a_slow_bus_holds_by_data_sheet(seed, mass):
    bus = describe(Known(kind="bus", tare=7000.0, gross=13_500.0, torque="percent")).vehicle
    made = slow_bus(seed, mass)
    w = wb.weigh(made.drive, bus)
    low, high = w.interval(0.95)
    assert low < made.truth.mass[-1] < high
    # As wide as such drives are off, and no wider than a mass may be.
    assert 0.07 < w.std / w.mass < 0.10
    without = wb.weigh(made.drive.without("retarder_torque"), bus)
    assert 0.10 < without.std / without.mass < 0.15


def test_stops_at_which_no_change_is_looked_for_leave_the_load_open():
    stood = np.array([0.0, 5.0, 20.0, 30.0, 45.0, 90.0])
    assert unseen_std(stood, 0.025) == pytest.approx(0.025)
    assert unseen_std(stood, 0.0) == 0.0
    # A load that wanders at 300 stops, at its end against its mean.
    rng = np.random.default_rng(8718)
    load = np.cumsum(0.025 * rng.standard_normal((4000, 300)), axis=1)
    spread = float(np.std(load[:, -1] - load.mean(axis=1)))
    assert unseen_std(np.full(300, 20.0), 0.025) == pytest.approx(spread, rel=0.05)
