"""Published methods that know no grade, within their papers' claims on their papers' conditions."""

from dataclasses import replace

import numpy as np
import pytest

from weighbridge import Vehicle
from weighbridge.balance.law import force_on_mass
from weighbridge.constants import GRAVITY
from weighbridge.estimators import ESTIMATORS
from weighbridge.kernels import multiple_forgetting
from weighbridge.papers.jensen2022_drives import without_weather
from weighbridge.pipeline.setup import identify
from weighbridge.simulation import (
    DIESEL_AUTOMATIC,
    TRUCK18,
    Braking,
    Effects,
    Polling,
    Sensors,
    make_scenario,
    simulate_car,
    straight_route,
    usual_polling,
)
from weighbridge.vehicle import Driveline, Mounting, Provenance, RoadLoad, TorqueModel

METHODS = ("vahidi-rls", "holm-ekf", "ritter-batch", "fathy-events")
PAPERS = Effects.only(
    shift_gap=1.0, torque_lag=1.0, imu_noise=1.0, gnss_white=1.0, obd_delay=1.0,
    obd_quantisation=1.0,
)  # fmt: skip
"""The papers know torque, losses and resistances; noise, rounding, lateness and shifts are left."""


def known(car):
    """Return a vehicle of which nothing is in doubt."""
    roll, pitch, yaw = Sensors().mounting
    return Vehicle(
        kind=car.kind,
        tare=car.mass,
        driveline=Driveline(
            gearings=tuple(g * car.final_drive / car.wheel_radius for g in car.gear_ratios),
            engine_inertia=car.engine_inertia,
            wheel_inertia=car.wheel_inertia,
            wheel_radius=car.wheel_radius,
            efficiency=1.0,
        ),
        torque=TorqueModel(source="percent" if car.kind == "truck" else "measured"),
        road_load=RoadLoad(drag_area=car.drag_area, rolling_coefficient=car.rolling_coefficient),
        mounting=Mounting(roll=roll, pitch=pitch, yaw=yaw, std=(1e-3, 1e-3, 1e-3)),
        provenance=Provenance(mass_scale_std=0.0),
    )


def driven(car, mass, seed, *, every, polling):
    """Weighable balance of five minutes that brake ``every`` seconds, on grades up to 1 %."""
    route = straight_route(length=14_000.0)
    place = np.linspace(0.0, route.length, route.grade.size)
    route = replace(route, grade=0.01 * np.sin(2.0 * np.pi * place / 1500.0))
    scenario = replace(
        make_scenario("car", seed=seed),
        car=car,
        payload=mass - car.mass,
        route=route,
        brakings=tuple(Braking(time=t, duration=4.0, decel=1.6) for t in range(35, 300, every)),
        effects=PAPERS,
        wind_speed=0.0,
        polling=polling,
        sensors=Sensors(imu_rate=100.0),
        start_rest=5.0,
        duration=300.0,
    )
    made, car = simulate_car(scenario), known(car)
    return identify(without_weather(made.drive), car).balance, car


@pytest.fixture(scope="module")
def truck():
    """Return a loaded truck on grades of 1 %."""
    return driven(TRUCK18, 14_000.0, 20, every=45, polling=usual_polling(TRUCK18))


@pytest.fixture(scope="module")
def suv():
    """Return a loaded car with an automatic."""
    names = ("engine_torque", "engine_speed", "vehicle_speed", "gear", "brake_switch")
    return driven(DIESEL_AUTOMATIC, 2000.0, 2, every=30, polling=Polling(fast=names, rate=20.0))


@pytest.mark.parametrize(
    ("method", "settings", "claim"),
    [
        ("vahidi-rls", {}, 0.05),
        ("holm-ekf", {}, 0.05),
        ("holm-ekf", {"graded": True}, 0.02),
        ("ritter-batch", {}, 0.05),
    ],
)
def test_a_truck_is_weighed_within_the_claim_of_the_paper(truck, method, settings, claim):
    balance, car = truck
    estimator = ESTIMATORS[method]
    track = estimator.track(balance, car, estimator.settings_of(settings))
    assert track.status == "converged"
    assert abs(track.mass / 14_000.0 - 1.0) < claim
    assert abs(track.mass - 14_000.0) < 2.0 * track.std


def test_events_weigh_a_car_within_three_standard_deviations(suv):
    balance, car = suv
    track = ESTIMATORS["fathy-events"].track(balance, car)
    assert track.status == "converged"
    assert abs(track.mass / 2000.0 - 1.0) < 0.03
    assert abs(track.mass - 2000.0) < 3.0 * track.std
    stricter = ESTIMATORS["fathy-events"].settings_of({"full_change": 4.0, "least_change": 3.0})
    assert ESTIMATORS["fathy-events"].track(balance, car, stricter).reason.id == "motion.few_rows"


@pytest.mark.parametrize("method", METHODS)
def test_no_measured_grade_is_read(truck, method):
    balance, car = truck
    tilted = replace(
        balance.table,
        grade=balance.table.grade + 0.05,
        specific_force=balance.table.specific_force + 0.05 * GRAVITY,
    )
    first = ESTIMATORS[method].track(balance, car)
    then = ESTIMATORS[method].track(replace(balance, table=tilted), car)
    assert then.mass == first.mass
    np.testing.assert_array_equal(then.running_mass, first.running_mass)


@pytest.mark.parametrize("method", METHODS)
def test_no_row_is_no_mass(truck, method):
    balance, car = truck
    none = replace(balance.table, reason=np.full_like(balance.table.reason, 4))
    track = ESTIMATORS[method].track(replace(balance, table=none), car)
    assert track.status == "not_excited"
    assert np.isnan(track.mass)


def test_rows_settle_after_each_interruption(truck):
    balance, car = truck
    batch = ESTIMATORS["ritter-batch"]
    taken = np.flatnonzero(batch.track(balance, car, batch.settings_of({"settle": 2.0})).used)
    used = balance.table.usable
    before = [used[max(k - 39, 0) : k + 1].all() for k in taken]
    assert all(before)
    assert 0.5 < taken.size / np.count_nonzero(used) < 0.95


def test_without_gravity_the_recursion_is_least_squares_that_forgets():
    rng = np.random.default_rng(2)
    force, keep = rng.normal(3000.0, 900.0, 80), 0.9
    accel = force / 2500.0 + rng.normal(0.0, 0.1, 80)
    start = multiple_forgetting.ForgettingState(np.array([1e-3, 0.0]), np.array([1e-7, 1.0]))
    _, theta = multiple_forgetting.run(start, force, 0.0, accel, np.array([keep, 0.5]))
    weight = keep ** np.arange(80)[::-1]
    power = keep**80 / 1e-7 + weight @ force**2
    least = (keep**80 / 1e-7 * 1e-3 + weight @ (force * accel)) / power
    assert theta[-1, 0] == pytest.approx(least, rel=1e-9)


def test_the_grade_takes_what_its_forgetting_leaves_it():
    """Joined gains add up: a row is explained by mass and grade as their gains are."""
    start = multiple_forgetting.ForgettingState(np.array([1e-3, 0.0]), np.array([1e-8, 1e-2]))
    found, _ = multiple_forgetting.run(
        start, np.array([2000.0]), 10.0, np.array([3.0]), np.array([0.8, 0.5])
    )
    shares = np.array([1e-8 * 2000.0**2 / 0.8, 1e-2 * 10.0**2 / 0.5])
    explained = np.array([2000.0, -10.0]) * (found.theta - [1e-3, 0.0])
    np.testing.assert_allclose(explained, shares / (1.0 + shares.sum()), rtol=1e-12)


def test_the_batch_is_one_least_squares_of_mass_and_every_grade(truck):
    balance, car = truck
    settings = ESTIMATORS["ritter-batch"].settings()
    taken = np.flatnonzero(ESTIMATORS["ritter-batch"].track(balance, car).used)[:400]
    reason = balance.table.reason.copy()
    reason[taken[-1] + 1 :] = 4
    short = replace(balance, table=replace(balance.table, reason=reason))
    time, accel = balance.table.time[taken], balance.table.accel[taken]
    force = force_on_mass(balance.table, car)[taken]
    n = taken.size
    walk = GRAVITY * settings.grade_walk * np.sqrt(np.diff(time))
    errors = np.column_stack([1e-4 * force, np.eye(n)]) / settings.accel_noise
    changes = np.column_stack([np.zeros(n - 1), np.diff(np.eye(n), axis=0) / walk[:, None]])
    wanted = np.concatenate([accel / settings.accel_noise, np.zeros(n - 1)])
    solved = np.linalg.lstsq(np.vstack([errors, changes]), wanted, rcond=None)[0]
    assert ESTIMATORS["ritter-batch"].track(short, car).mass == pytest.approx(
        1e4 / solved[0], rel=1e-6
    )
