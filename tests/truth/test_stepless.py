"""A car with a stepless gearbox: its ratio is measured, and its engine gains speed by itself."""

from dataclasses import replace

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.balance.force_balance import force_balance
from weighbridge.navigation.select import find_motion
from weighbridge.simulation import make_scenario, simulate_car
from weighbridge.vehicle.gear import UNSLIPPED
from weighbridge.vehicle.model import Driveline, Vehicle


def drive(payload, seed, name="cvt-calibration"):
    scenario = replace(make_scenario(name, payload=payload, seed=seed), duration=700.0)
    return simulate_car(scenario)


@pytest.fixture(scope="module")
def known():
    return [drive(0.0, 1), drive(350.0, 2)]


@pytest.fixture(scope="module")
def calibrated(known):
    recorded = [made.drive for made in known]
    return wb.calibrate(recorded, [made.scenario.mass for made in known])


def test_it_is_calibrated_and_weighed(known, calibrated):
    low, high = calibrated.driveline.gearing_range
    assert calibrated.driveline.gearings == ()
    ends = known[0].scenario.car.gearings
    assert 0.98 * ends[1] < low < 1.05 * ends[1]
    assert high < 1.03 * ends[0]
    assert calibrated.driveline.engine_inertia == pytest.approx(0.15, rel=0.15)
    made = drive(180.0, 3, "cvt")
    weighed = wb.weigh(made.drive, calibrated)
    assert weighed.status == "converged"
    assert weighed.mass == pytest.approx(made.truth.mass[-1], rel=0.03)
    assert abs(weighed.mass - made.truth.mass[-1]) < 2.5 * weighed.std


def test_ratio_and_rate_of_its_engine_are_those_of_the_simulation(known):
    made = known[0]
    car, truth = made.scenario.car, made.truth
    known_car = Vehicle(driveline=Driveline(gearing_range=(car.gearings[1], car.gearings[0])))
    known_car = replace(known_car, torque=replace(known_car.torque, source="percent"))
    motion = find_motion(made.drive, known_car)
    table = force_balance(made.drive, known_car, motion, delay=0.1).table
    assert np.all(table.speed[table.usable] >= UNSLIPPED)
    gearing = np.interp(table.time, truth.time, truth.engine_speed / np.maximum(truth.speed, 0.1))
    rate = np.interp(table.time, truth.time, np.gradient(truth.engine_speed, truth.time))
    use = table.usable & np.isfinite(table.engine_accel)
    assert np.median(np.abs(table.gearing / gearing - 1.0)[use]) < 0.01
    spun = (table.gearing * table.engine_accel)[use]
    assert np.corrcoef(spun, rate[use])[0, 1] > 0.95
    # Far from what a fixed gear would make of it.
    assert np.corrcoef((table.gearing * table.accel)[use], rate[use])[0, 1] < 0.6


def test_ratios_beyond_those_of_the_calibration_are_another_vehicles(calibrated):
    line = replace(calibrated.driveline, gearing_range=(20.0, 60.0))
    weighed = wb.weigh(drive(180.0, 3, "cvt").drive, replace(calibrated, driveline=line))
    assert weighed.status == "inconsistent"
    assert weighed.reason_id == "gear.foreign"
