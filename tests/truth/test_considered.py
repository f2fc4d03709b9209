"""What the calibration leaves open, against finite differences and dense least squares."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from weighbridge import Vehicle
from weighbridge.balance import force_balance
from weighbridge.estimators.considered import (
    fit_consider_std,
    force_columns,
    from_triangle,
    pinned,
    sensitivity,
    triangle,
)
from weighbridge.estimators.joint.terms import design
from weighbridge.kernels import disturbance as kernel
from weighbridge.navigation import find_motion
from weighbridge.simulation import MIDSIZE, Scenario, short_route, simulate_car
from weighbridge.vehicle import Driveline, Provenance, RoadLoad, TorqueModel

MASS = 1700.0
CAR = Vehicle(
    driveline=Driveline(
        gearings=tuple(r * MIDSIZE.final_drive / MIDSIZE.wheel_radius for r in MIDSIZE.gear_ratios),
        wheel_radius=MIDSIZE.wheel_radius,
        engine_inertia=0.2,
        wheel_inertia=5.0,
    ),
    road_load=RoadLoad(drag_area=0.7, rolling_coefficient=0.012),
    torque=TorqueModel(
        source="load", coefficients=(-30.0, 900.0, 0.05, -2e-4), curvature=(0.3, 120.0)
    ),
)


def changed(k, step):
    """Return the vehicle with its parameter number ``k`` larger by ``step``."""
    torque, road, line = CAR.torque, CAR.road_load, CAR.driveline
    values = [*torque.coefficients, *torque.curvature, road.drag_area, road.rolling_coefficient,
              line.engine_inertia, line.wheel_inertia]  # fmt: skip
    values[k] += step
    return replace(
        CAR,
        torque=replace(torque, coefficients=tuple(values[:4]), curvature=tuple(values[4:6])),
        road_load=replace(road, drag_area=values[6], rolling_coefficient=values[7]),
        driveline=replace(line, engine_inertia=values[8], wheel_inertia=values[9]),
    )


def test_columns_are_what_a_change_of_each_parameter_does_to_the_balance():
    made = simulate_car(Scenario(name="d", car=MIDSIZE, route=short_route(), seed=5, wind_speed=0))
    motion = find_motion(made.drive, CAR)
    balance = force_balance(made.drive, CAR, motion)

    def left_over(vehicle):
        rows, y = design(force_balance(made.drive, vehicle, motion).table, vehicle)
        return y - MASS * rows[:, 0]

    known = balance.table.usable & np.isfinite(left_over(CAR))
    assert known.sum() > 500
    columns = force_columns(balance, CAR, MASS)[known]
    steps = (1.0, 5.0, 0.01, 1e-5, 0.01, 5.0, 0.01, 1e-4, 0.01, 0.1)
    assert columns.shape[1] == len(steps)
    for k, step in enumerate(steps):
        differ = (left_over(changed(k, step)) - left_over(CAR))[known] / step
        scale = np.abs(differ).max()
        assert_allclose(columns[:, k], differ, rtol=1e-6, atol=1e-6 * scale)


def problem(n=200):
    rng = np.random.default_rng(4)
    time = np.cumsum(rng.uniform(1.0, 4.0, n))
    rows = np.column_stack([rng.normal(0.2, 0.4, n), np.ones(n)])
    noise = rng.uniform(50.0, 400.0, n)
    params = kernel.DisturbanceParams(
        time_constant=np.array([np.inf, 30.0]), std=np.array([0.0, 60.0]), gate=3.0, settle_rows=0
    )
    start = kernel.initial_state([1500.0, 0.0], np.diag([1e4**2, 60.0**2]), time[0])
    return time, rows, noise, params, start, rng.normal(size=(n, 3))


def test_sensitivity_equals_generalised_least_squares_of_the_rows_taken():
    time, rows, noise, params, start, columns = problem()
    taken = np.ones(time.size, dtype=bool)
    taken[::7] = False
    found = sensitivity(columns, time, rows, noise, np.zeros(rows.shape), taken, start, params)
    cov = 60.0**2 * np.exp(-np.abs(time[:, None] - time) / 30.0) + np.diag(noise)
    weight = np.linalg.inv(cov[np.ix_(taken, taken)])
    phi = rows[taken, 0]
    information = phi @ weight @ phi + 1e-8
    assert_allclose(found, phi @ weight @ columns[taken] / information, rtol=1e-6)


def test_what_is_pinned_is_known_and_the_rest_is_conditioned_on_it():
    rng = np.random.default_rng(2)
    root = rng.normal(size=(4, 4))
    cov, direction = root @ root.T, rng.normal(size=4)
    left = pinned(cov, direction)
    assert direction @ left @ direction == pytest.approx(0.0, abs=1e-12)
    # By the information form: an exact measurement is one of nearly no noise.
    sharp = np.linalg.inv(np.linalg.inv(cov) + np.outer(direction, direction) / 1e-9)
    assert_allclose(left, sharp, atol=1e-6)
    assert_allclose(from_triangle(triangle(left)), left, rtol=0, atol=1e-15)


def test_a_drive_like_the_calibration_is_as_sure_as_its_scale_and_another_is_not():
    cov = np.diag([4.0, 9.0])
    alike, other = np.array([30.0, 20.0]), np.array([45.0, 0.0])
    car = replace(CAR, provenance=Provenance(fit_cov=triangle(pinned(cov, alike))))
    assert fit_consider_std(car, 1.1 * alike, 1000.0) == pytest.approx(0.0, abs=1e-9)
    # By hand: the first parameter keeps 1 / (1/4 + 30^2 / (20^2 * 9)) of its variance.
    assert fit_consider_std(car, other, 1000.0) == pytest.approx(0.045 * np.sqrt(2.0))
    assert fit_consider_std(CAR, other, 1000.0) == 0.0
