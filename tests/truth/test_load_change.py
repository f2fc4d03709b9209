"""Two hypotheses of the load after every stop."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numba import config

import weighbridge as wb
from weighbridge import Status, Vehicle
from weighbridge.estimators.joint.load_stops import change_odds, loadable, stood_before
from weighbridge.kernels import disturbance
from weighbridge.kernels import load_change as kernel
from weighbridge.simulation import Loading, Sensors, make_scenario, simulate_car
from weighbridge.vehicle import Driveline


def drive(jump, seed=3, n=300, at=150):
    """Rows of a mass of 1500 kg that changes at ``at``, with a stop there and at others."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(1.0, 4.0, n))
    rows = np.column_stack([rng.normal(0.3, 0.7, n), np.ones(n)])
    mass = 1500.0 + jump * (np.arange(n) >= at)
    slow = np.zeros(n)
    for k in range(1, n):
        keep = np.exp(-(time[k] - time[k - 1]) / 30.0)
        slow[k] = keep * slow[k - 1] + 50.0 * np.sqrt(1.0 - keep**2) * rng.normal()
    noise = np.full(n, 40.0**2)
    y = mass * rows[:, 0] + slow + 40.0 * rng.normal(size=n)
    odds = np.full(n, np.nan)
    odds[[40, 90, at, 220]] = -2.2
    params = kernel.LoadParams(
        filter=disturbance.DisturbanceParams(
            time_constant=np.array([np.inf, 30.0]),
            std=np.array([0.0, 50.0]),
            gate=5.0,
            settle_rows=40,
        ),
        jump_var=np.array([400.0**2, 0.0]),
        temper=0.4,
        fewest=8,
    )
    start = disturbance.initial_state([0.0, 0.0], np.diag([1500.0**2, 50.0**2]), time[0])
    return kernel.initial_state(start), time, rows, y, noise, odds, params


@pytest.mark.parametrize("jump", [-300.0, 240.0, 800.0])
def test_a_change_of_load_is_found_at_its_stop_and_nowhere_else(jump):
    state, time, rows, y, noise, odds, params = drive(jump)
    last, first, _, begins = kernel.run(state, time, rows, y, noise, odds, params)
    assert np.flatnonzero(begins).tolist() == [150]
    assert last.same.x[0] == pytest.approx(1500.0 + jump, rel=0.02)
    soon = np.searchsorted(time, time[150] + 90.0)
    assert first[soon] == pytest.approx(1500.0 + jump, rel=0.03)
    assert first[149] == pytest.approx(1500.0, rel=0.02)


def test_stops_without_a_change_cost_nothing():
    found = []
    for seed in range(20):
        state, time, rows, y, noise, odds, params = drive(0.0, seed=seed)
        _, first, _, begins = kernel.run(state, time, rows, y, noise, odds, params)
        never = np.full(time.size, np.nan)
        _, alone, _, _ = kernel.run(state, time, rows, y, noise, never, params)
        assert not begins.any()
        found.append(first[-1] / alone[-1] - 1.0)
    assert np.max(np.abs(found)) < 0.005


def test_without_stops_it_is_the_plain_filter():
    state, time, rows, y, noise, _, params = drive(0.0)
    none = np.full(time.size, np.nan)
    last, first, first_var, _ = kernel.run(state, time, rows, y, noise, none, params)
    plain, mass, var, _, _ = disturbance.run(
        state.same, time, rows, y, noise, np.zeros(rows.shape), params.filter
    )
    np.testing.assert_array_equal(first, mass)
    np.testing.assert_array_equal(first_var, var)
    assert last.same.log_likelihood == plain.log_likelihood


def test_batch_equals_sample_by_sample_to_the_last_bit():
    state, time, rows, y, noise, odds, params = drive(240.0)
    _, first, first_var, begins = kernel.run(state, time, rows, y, noise, odds, params)
    seen = []
    for k in range(y.size):
        state, mass, var, changed_from = kernel.step(
            state, time[k], rows[k], y[k], noise[k], odds[k], params
        )
        assert mass == first[k]
        assert var == first_var[k]
        seen.append(changed_from)
    assert {b for b in seen if b >= 0} == set(np.flatnonzero(begins))


def test_a_launch_on_a_slipping_clutch_moves_the_running_mass_little():
    state, time, rows, y, noise, odds, params = drive(0.0)
    slipping = y.copy()
    slipping[150:152] += 400.0 * rows[150:152, 0]
    _, first, _, begins = kernel.run(state, time, rows, slipping, noise, odds, params)
    assert not begins.any()
    _, hasty, _, _ = kernel.run(state, time, rows, slipping, noise, odds, params._replace(fewest=1))
    moved, moved_at_once = (np.max(np.abs(m[150:170] / 1500.0 - 1.0)) for m in (first, hasty))
    assert moved_at_once > 0.15
    assert moved < 0.6 * moved_at_once


def test_longer_stops_change_the_load_more_often():
    time = np.arange(0.0, 1000.0, 0.25)
    speed = np.full(time.size, 10.0)
    for begin, duration in ((100.0, 7.0), (300.0, 9.0), (450.0, 25.0), (600.0, 240.0)):
        speed[(time >= begin) & (time < begin + duration)] = 0.0
    kept = (time < 900.0) | (time > 960.0)  # a gap in the log
    table = SimpleNamespace(time=time[kept], moving=speed[kept] > 0.5)
    windows = np.array([50.0, 120.0, 290.0, 330.0, 490.0, 590.0, 850.0, 890.0, 970.0])
    odds = change_odds(stood_before(table, windows))
    assert np.flatnonzero(np.isfinite(odds)).tolist() == [3, 4, 6, 8]
    short, light, long, gap = odds[[3, 4, 6, 8]]
    assert short < np.log(0.03)
    assert short < light < np.log(0.1)
    assert light < gap < long
    assert long > np.log(1.0)


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="whole drives take minutes without a compiler")
@pytest.mark.parametrize("load", [-250.0, 350.0])
def test_a_parcel_handed_over_in_twelve_seconds_is_weighed(load):
    logger = {"duration": 1000.0, "sensors": Sensors(imu_rate=50.0)}
    known = simulate_car(replace(make_scenario("car", payload=250.0, seed=910), **logger))
    mass = float(known.truth.mass[0])
    file = wb.calibrate([known.drive], mass=mass, vehicle=known_vehicle(known))
    made = replace(make_scenario("car", payload=250.0, seed=911), **logger)
    middle = float(np.interp(500.0, *along(simulate_car(made))))
    stop = Loading(distance=middle, duration=12.0, load=load)
    drive = simulate_car(replace(made, loading=(stop,)))
    found = wb.weigh(drive.drive, file)
    assert found.status is Status.CONVERGED, found.reason
    first, last = found.segments
    assert first.mass == pytest.approx(float(drive.truth.mass[0]), rel=0.03)
    assert last.mass == pytest.approx(float(drive.truth.mass[-1]), rel=0.03)


def known_vehicle(made):
    car = made.scenario.car
    return Vehicle(kind=car.kind, driveline=Driveline(wheel_radius=car.wheel_radius))


def along(made):
    return made.truth.time, made.truth.distance


def test_a_stop_loads_no_more_than_its_time_allows():
    """A bus of 13 t boards 130 kg/s after the doors have opened, and never a third of itself."""
    stood = np.array([2.0, 8.0, 13.0, 60.0])
    assert np.allclose(loadable(stood), [0.0, 0.05, 0.10, 0.3])


def test_without_an_accelerometer_no_load_changes_within_a_minute():
    stood = np.array([0.0, 7.0, 9.0, 59.0, 61.0])
    assert np.isfinite(change_odds(stood)).tolist() == [False, False, True, True, True]
    by_speed = change_odds(stood, by_speed=True)
    assert np.isfinite(by_speed).tolist() == [False] * 4 + [True]
    assert by_speed[-1] == change_odds(stood)[-1]
