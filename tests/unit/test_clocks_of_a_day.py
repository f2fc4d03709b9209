"""Drives of a working day: clocks that are right are left alone, and slow drifts are found."""

import tracemalloc
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import has, says

import weighbridge as wb
from weighbridge import Drive, Signal
from weighbridge.checks import correct_drive
from weighbridge.signals import QUANTITIES
from weighbridge.simulation import (
    MIDSIZE,
    Scenario,
    Sensors,
    highway_route,
    jensen_route,
    simulate_car,
)

DAY = 8 * 3600.0
PPM = 50e-6


@pytest.fixture(scope="module")
def short():
    """A drive of 50 minutes, from standstill to standstill."""
    scenario = Scenario(name="shift", car=MIDSIZE, route=jensen_route(1450), seed=9450)
    return simulate_car(replace(scenario, duration=3000.0, sensors=Sensors(imu_rate=20.0))).drive


@pytest.fixture(scope="module")
def day(short):
    return repeated(short, round(DAY / short.duration))


def repeated(drive, times):
    """Put a drive behind itself, with a minute between."""
    span = drive.duration + 60.0
    clocks = {id(s.time): s.time for s in drive.signals.values()}
    long = {k: np.concatenate([t + n * span for n in range(times)]) for k, t in clocks.items()}
    return drive.with_signals(
        *(Signal(s.name, long[id(s.time)], np.tile(s.values, times))
          for s in drive.signals.values())
    )  # fmt: skip


def retimed(drive, table, change):
    """Change the stamps of a table; its signals go on sharing clocks."""
    here = [s for s in drive.signals.values() if QUANTITIES[s.name].table == table]
    clocks = {id(s.time): s.time for s in here}
    moved = {k: change(t) for k, t in clocks.items()}
    return drive.with_signals(*(replace(s, time=moved[id(s.time)]) for s in here))


def one_after_another(routes):
    """Join roads, each going on in the direction in which the one before ended."""
    ends = np.cumsum([r.heading[-1] - r.heading[0] for r in routes])
    begins = routes[0].heading[0] + np.concatenate(([0.0], ends[:-1]))
    before = np.cumsum([0, *(r.grade.size for r in routes[:-1])])
    rows = ("grade", "bank", "limit", "surface", "roughness", "exposure", "stop_chance")
    return replace(
        routes[0],
        heading=np.concatenate(
            [r.heading - r.heading[0] + b for r, b in zip(routes, begins, strict=True)]
        ),
        stops=np.concatenate([r.stops + b for r, b in zip(routes, before, strict=True)]),
        **{name: np.concatenate([getattr(r, name) for r in routes]) for name in rows},
    )


def test_sound_clocks_of_a_day_are_left_to_the_last_bit(day):
    mended = correct_drive(day)
    assert not any(p.id == "clock.moved" for p in mended.problems)
    for name in ("accel_x", "vehicle_speed", "latitude"):
        assert_array_equal(mended.signals[name].time, day.signals[name].time)


@pytest.mark.parametrize("ppm", [50.0, -50.0])
def test_a_sensor_that_drifts_by_seconds_in_a_day_is_brought_back(day, ppm):
    """50 ppm are 1.4 s in eight hours, and no more than 0.02 s from one piece to the next."""
    mended = correct_drive(retimed(day, "imu", lambda t: t * (1.0 + 1e-6 * ppm)))
    (told,) = (p for p in mended.problems if p.id == "clock.moved")
    assert has([told], "clock.moved", table="obd and gnss", other="imu")
    assert says(told.text, "clock_drifts", slope=-ppm)
    assert_array_equal(mended.signals["vehicle_speed"].time, day.signals["vehicle_speed"].time)
    before, after = day.signals["accel_x"].time, mended.signals["accel_x"].time
    assert_allclose(after, before, rtol=0.0, atol=0.1)


def in_steps(drive, step):
    """Round the vehicle speed to steps [m/s]."""
    s = drive.signals["vehicle_speed"]
    return drive.with_signals(replace(s, values=step * np.round(s.values / step)))


def test_a_coarse_speed_on_a_motorway_is_no_clock_that_jumps():
    """Steps of 5 km/h while cruising are rounding, not motion that the sensor should have felt."""
    made = Scenario(name="motorway", car=MIDSIZE, route=highway_route(9453, length=30e3), seed=9453)
    drive = simulate_car(replace(made, duration=1800.0, sensors=Sensors(imu_rate=20.0))).drive
    coarse = in_steps(drive, 5.0 / 3.6)
    assert correct_drive(coarse).problems == coarse.problems


def test_a_step_of_the_clock_of_a_coarse_speed_is_found(short):
    late = retimed(in_steps(short, 5.0 / 3.6), "obd", lambda t: t + 2.0 * (t > 1500.0))
    told = correct_drive(late).problems[-1]
    assert has([told], "clock.moved", table="obd", most=pytest.approx(2.0, abs=0.2))
    assert says(told.text, "clock_jumps")


def memory(count):
    """Bytes that the checks take at most, of a sensor at 200 Hz [B]."""
    rng = np.random.default_rng(2)
    time = 0.005 * np.arange(count)
    shaken = [Signal(f"accel_{a}", time, rng.standard_normal(time.size)) for a in "xyz"]
    slow = np.arange(0.0, time[-1], 1.0)
    speed = Signal("vehicle_speed", slow, 15.0 + 5.0 * np.sin(0.1 * slow))
    drive = Drive("day", {s.name: s for s in (*shaken, speed)})
    assert [s.period for s in shaken] == [pytest.approx(0.005)] * 3
    tracemalloc.start()
    try:
        assert not any(p.id.startswith("clock.") for p in correct_drive(drive).problems)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_the_memory_of_a_day_is_that_of_its_samples():
    """Half an hour more of three axes takes less than one axis of it and a quarter."""
    # What is loaded and compiled on the way is no part of it.
    memory(1000)
    first, half_an_hour = 700_000, 360_000
    assert memory(first + half_an_hour) - memory(first) < 1.25 * 16 * half_an_hour


@pytest.mark.slow
def test_a_drift_of_a_sensor_over_a_day_costs_no_mass():
    route = one_after_another([jensen_route(1451 + k) for k in range(7)])
    simulate = partial(Scenario, car=MIDSIZE, sensors=Sensors(imu_rate=20.0))
    known = simulate_car(simulate(name="known", route=jensen_route(1460), seed=9451))
    car = wb.calibrate([known.drive], mass=known.scenario.mass)
    made = simulate_car(simulate(name="day", route=route, payload=220.0, seed=9452, duration=DAY))
    assert made.drive.duration > 0.99 * DAY
    sound = wb.weigh(made.drive, car)
    assert not any(problem.id.startswith("clock.") for problem in sound.problems)
    drifted = wb.weigh(retimed(made.drive, "imu", lambda t: t * (1.0 + PPM)), car)
    assert any(warning.id == "clock.moved" for warning in drifted.problems)
    assert drifted.mass == pytest.approx(sound.mass, rel=2e-3)
    assert sound.mass == pytest.approx(made.truth.mass[-1], rel=0.03)
