"""Trucks by their data sheet alone: a small bias, an interval that holds, no change of load."""

from dataclasses import replace

import numpy as np
import pytest

import weighbridge as wb
from weighbridge import Vehicle
from weighbridge.simulation import Sensors, make_scenario, simulate_car
from weighbridge.vehicle import VEHICLE_CLASSES, Driveline, RoadLoad, TorqueModel

SEEDS = (61_001, 61_002, 61_003)


def data_sheet(car):
    """Ratios and tyres as they are, everything else as usual for the class."""
    mean, _ = VEHICLE_CLASSES["truck"].road_prior(single_speed=False)
    return Vehicle(
        kind="truck",
        tare=car.mass,
        driveline=Driveline(
            gearings=tuple(g * car.final_drive / car.wheel_radius for g in car.gear_ratios),
            engine_inertia=float(mean[2]),
            wheel_inertia=float(mean[3]),
            wheel_radius=car.wheel_radius,
        ),
        torque=TorqueModel(source="percent"),
        road_load=RoadLoad(drag_area=float(mean[0]), rolling_coefficient=float(mean[1])),
    )


@pytest.fixture(scope="module")
def weighed():
    found = []
    for k, seed in enumerate(SEEDS):
        scenario = make_scenario("truck", seed=seed, mass=9500.0 + 3000.0 * k)
        made = simulate_car(replace(scenario, sensors=Sensors(imu_rate=50.0), duration=1800.0))
        weighing = wb.weigh(made.drive, data_sheet(made.scenario.car))
        found.append((weighing, float(made.truth.mass[-1])))
    return found


def test_masses_are_within_print_and_their_intervals_hold(weighed):
    errors = np.array([w.mass / mass - 1.0 for w, mass in weighed])
    stds = np.array([w.std / mass for w, mass in weighed])
    assert np.all(np.abs(errors) < 2.0 * stds)
    assert abs(errors.mean()) < 0.03
    assert stds.max() < 0.07


def test_no_load_is_found_where_none_changed(weighed):
    for weighing, _ in weighed:
        assert not weighing.load_changed
