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
from weighbridge.checks.smoothed_imu import check_smoothed
from weighbridge.navigation.clock_drift import correct_clocks
from weighbridge.navigation.clock_lag import Integrated
from weighbridge.navigation.identify import gain
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
    mended = correct_clocks(day)
    assert mended.problems == day.problems
    assert all(mended.signals[name].time is s.time for name, s in day.signals.items())


@pytest.mark.parametrize("ppm", [50.0, -50.0])
def test_a_sensor_that_drifts_by_seconds_in_a_day_is_brought_back(day, ppm):
    """50 ppm are 1.4 s in eight hours, and no more than 0.02 s from one piece to the next."""
    mended = correct_clocks(retimed(day, "imu", lambda t: t * (1.0 + 1e-6 * ppm)))
    told = mended.problems[-1]
    assert has([told], "clock.moved", table="obd and gnss", other="imu")
    assert says(told.text, "clock_drifts", slope=-ppm)
    assert mended.signals["vehicle_speed"].time is day.signals["vehicle_speed"].time
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
    assert correct_clocks(coarse).problems == coarse.problems


def test_a_step_of_the_clock_of_a_coarse_speed_is_found(short):
    late = retimed(in_steps(short, 5.0 / 3.6), "obd", lambda t: t + 2.0 * (t > 1500.0))
    told = correct_clocks(late).problems[-1]
    assert has([told], "clock.moved", table="obd", most=pytest.approx(2.0, abs=0.2))
    assert says(told.text, "clock_jumps")


def test_a_day_is_looked_at_in_parts_and_found_as_in_one(monkeypatch):
    time = np.cumsum(np.random.default_rng(1).uniform(0.0, 40.0, 3001))
    minutes = gain._starts(time)
    monkeypatch.setattr(gain, "SAMPLES_AT_ONCE", 7)
    assert_array_equal(minutes, gain._starts(time))
    minute = (time - time[0]) // 60.0
    assert_array_equal(minutes, np.searchsorted(minute, np.unique(minute)))


def test_the_memory_of_a_day_is_that_of_its_samples():
    """Eleven hours at 200 Hz: neither the clocks nor the shaking need a column's room again."""
    rng = np.random.default_rng(2)
    time = 0.005 * np.arange(8_000_000)
    shaken = [Signal(f"accel_{a}", time, rng.standard_normal(time.size)) for a in "xyz"]
    slow = np.arange(0.0, time[-1], 1.0)
    speed = Signal("vehicle_speed", slow, 15.0 + 5.0 * np.sin(0.1 * slow))
    drive = Drive("day", {s.name: s for s in (*shaken, speed)})
    assert [s.period for s in shaken] == [pytest.approx(0.005)] * 3
    tracemalloc.start()
    try:
        force = Integrated.of(shaken)
        assert tracemalloc.get_traced_memory()[1] < 2.0 * time.nbytes
        assert sum(x.nbytes for x in force.integrals) < time.nbytes
        del force
        tracemalloc.reset_peak()
        assert list(check_smoothed(drive, None)) == []
        assert tracemalloc.get_traced_memory()[1] < 1.5 * time.nbytes
    finally:
        tracemalloc.stop()


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
