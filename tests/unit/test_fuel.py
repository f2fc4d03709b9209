"""Fuel that is burnt is no longer carried."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import weighbridge as wb
from weighbridge import Drive, Signal, Vehicle
from weighbridge.balance.law import mass_column
from weighbridge.estimators import ESTIMATORS
from weighbridge.simulation import MIDSIZE, Polling, Scenario, Sensors, short_route, simulate_car
from weighbridge.vehicle import Burnt, Driveline, fuel_burnt, fuel_flow

joint = ESTIMATORS["joint"]

GEARED = Vehicle(kind="car", driveline=Driveline(gearings=(12.0, 7.0, 4.0)))
HOUR = np.arange(0.0, 3600.5, 0.5)

DENSITY = 790.0
"""Of the middle of petrol and diesel [kg/m^3]."""

SEEN = 10.0
"""Of a gap between two rows no more is counted [s]."""


def drive(**signals):
    found = {
        name: Signal(name, HOUR, np.broadcast_to(np.asarray(v, dtype=float), HOUR.shape).copy())
        for name, v in signals.items()
    }
    return Drive(name="hour", signals=found)


def burnt(made, vehicle=GEARED, *, time=HOUR, torque=40.0, speed=200.0):
    full = np.full(time.size, 1.0)
    return fuel_burnt(time, fuel_flow(made, vehicle, time, torque * full, speed * full))


def test_a_fuel_rate_is_integrated():
    found = burnt(drive(fuel_rate=8e-3 / 3600.0))
    assert found[0] == 0.0
    assert np.all(np.diff(found) > 0.0)
    assert_allclose(found[-1], 8e-3 * DENSITY, rtol=1e-9)


def test_air_flow_tells_the_fuel_where_the_mixture_is_known():
    air = drive(mass_air_flow=14.7e-3, lambda_1=1.0)
    assert_allclose(burnt(air)[-1], 3.6, rtol=1e-9)
    lean = drive(mass_air_flow=14.7e-3, lambda_1=2.0)
    assert_allclose(burnt(lean)[-1], 1.8, rtol=1e-9)
    # Without it the engine may be a diesel, whose air says nothing of its fuel.
    unknown = drive(mass_air_flow=14.7e-3)
    assert_allclose(burnt(unknown), burnt(drive()))


def test_work_tells_the_fuel_where_nothing_else_does():
    # Engines burn 200 to 400 g for each kWh on the shaft, and 0.3 to 1.2 L in an hour at idle.
    assert 8.0 * 0.2 < burnt(drive())[-1] < 8.0 * 0.4
    torque = np.where(HOUR < 300.0, 200.0, 0.0)
    found = burnt(drive(), torque=torque, speed=80.0)
    idle = (found[-1] - found[HOUR < 300.0][-1]) / (3300.0 / 3600.0)
    assert 0.3e-3 * DENSITY < idle < 1.2e-3 * DENSITY


def test_an_electric_car_burns_none():
    electric = Vehicle(kind="car", driveline=Driveline(gearings=(30.0,)))
    assert not burnt(drive(fuel_rate=8e-3 / 3600.0), electric).any()


def test_gaps_and_unknown_values_count_little_and_never_backwards():
    time = np.concatenate((HOUR[HOUR < 600.0], HOUR[HOUR > 3000.0]))
    rate = 8e-3 / 3600.0
    found = burnt(drive(fuel_rate=rate), time=time)
    assert_allclose(found[-1], rate * DENSITY * (600.0 + 600.0 + SEEN), rtol=0.01)
    assert_allclose(burnt(drive(), torque=np.nan, speed=np.nan), 0.0)
    assert burnt(drive(), time=HOUR[:1]).tolist() == [0.0]


def test_it_goes_on_from_where_it_was_to_the_last_bit():
    rng = np.random.default_rng(7)
    time, flow = np.cumsum(rng.uniform(0.1, 0.5, 500)), rng.uniform(0.0, 3e-3, 500)
    whole = fuel_burnt(time, flow)
    since = Burnt(float(time[299]), float(flow[299]), float(whole[299]))
    # The rows of earlier on may be seen again, or not.
    for first in (0, 250, 300):
        again = fuel_burnt(time[first:], flow[first:], since)
        assert_array_equal(again[300 - first :], whole[300:])
        assert_allclose(again[: 300 - first], whole[first:300], rtol=1e-12)


@pytest.fixture(scope="module")
def weighed():
    made = simulate_car(
        Scenario(
            name="fuel",
            car=MIDSIZE,
            route=short_route(),
            seed=71,
            sensors=Sensors(imu_rate=50.0),
            polling=Polling(fast=(*Polling().fast, "fuel_rate")),
        )
    )
    car = wb.calibrate([made.drive], mass=made.scenario.mass)
    return made, car, wb.weigh(made.drive, car)


def test_a_simulated_drive_tells_what_its_tank_lost(weighed):
    made, _, weighing = weighed
    lost = made.truth.mass[0] - made.truth.mass[-1]
    # The density of the fuel is not known.
    assert_allclose(weighing.result.balance.table.fuel_burnt[-1], lost, rtol=0.1)


def test_the_mass_is_that_at_the_end_of_the_drive(weighed):
    """A tank of 200 kg that empties during the drive, against the drive as it was."""
    _, car, weighing = weighed
    balance = weighing.result.balance
    table = balance.table
    tank = 200.0 * (table.time - table.time[0]) / (table.time[-1] - table.time[0])
    phi = mass_column(table, car)
    lighter = replace(table, traction_force=table.traction_force - tank * phi)
    told = joint.estimate(
        replace(balance, table=replace(lighter, fuel_burnt=table.fuel_burnt + tank)), car
    )
    assert_allclose(told.mass, weighing.mass - 200.0, atol=0.5)
    assert_allclose(told.segments[-1].mass, told.mass, atol=1e-6)
    early = np.flatnonzero(np.isfinite(told.running_mass))[0]
    assert_allclose(
        told.running_mass[early], weighing.result.running_mass[early] - tank[early], rtol=1e-3
    )
    # Stops would be taken for the places where the tank lost it.
    untold = joint.estimate(replace(balance, table=lighter), car, load_changes=False)
    assert untold.mass > told.mass + 40.0
