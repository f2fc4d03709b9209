"""The bounded fit of eq. 48 against synthetic truth, SciPy and the grid."""

import numpy as np
import pytest
from scipy.optimize import minimize

from weighbridge.calibration import TABLE_5, grid_search
from weighbridge.calibration.regression import TorqueRows, driven_slope, fit
from weighbridge.vehicle import VEHICLE_CLASSES

TORQUE = np.array([-15.0, 900.0, 0.03])
ROAD = np.array([0.62, 0.0093, 0.17, 5.0])


def rows(rng, n=6000, noise=3.0, road=ROAD):
    speed = rng.uniform(3.0, 33.0, n)
    accel = rng.uniform(0.05, 2.5, n)
    grade = rng.normal(0.0, 0.02, n)
    gearing = rng.choice([42.0, 29.0, 20.0, 14.0, 9.8, 7.4, 5.7], n)
    engine = np.clip(gearing * speed, 90.0, 600.0)
    mass, radius = 1580.0, 0.319
    columns = np.column_stack(
        [
            -0.5 * 1.24 * speed**2 / gearing,
            -mass * 9.81 * np.cos(grade) / gearing,
            -gearing * accel,
            -accel / (radius**2 * gearing),
        ]
    )
    target = mass * (accel + 9.81 * np.sin(grade)) / gearing
    # What load must have been for the torque to do this.
    load = (target - columns @ road - TORQUE[0] - TORQUE[2] * engine) / TORQUE[1]
    design = np.column_stack([np.ones(n), load, engine, columns])
    return TorqueRows(
        design=design,
        target=target + rng.normal(0.0, noise, n),
        time=np.arange(n) * 0.3,
    )


def test_truth_is_found_within_its_standard_deviations():
    made = rows(np.random.default_rng(1))
    found = fit(made, *VEHICLE_CLASSES["car"].road_bounds)
    both = np.concatenate([found.coefficients, found.road])
    pull = (both - np.concatenate([TORQUE, ROAD])) / np.sqrt(np.diag(found.cov))
    assert np.abs(pull).max() < 4.5
    assert found.at_bound == ()
    assert found.r_squared > 0.95


def test_outliers_do_not_move_the_fit():
    rng = np.random.default_rng(2)
    made = rows(rng)
    spoiled = made.target.copy()
    spoiled[rng.random(spoiled.size) < 0.05] += 150.0
    clean = fit(made, *VEHICLE_CLASSES["car"].road_bounds)
    robust = fit(
        TorqueRows(design=made.design, target=spoiled, time=made.time),
        *VEHICLE_CLASSES["car"].road_bounds,
    )
    plain = np.linalg.lstsq(made.design, spoiled, rcond=None)[0]
    assert abs(robust.coefficients[0] - clean.coefficients[0]) < 1.0
    assert abs(plain[0] - clean.coefficients[0]) > 3.0


def test_bounds_hold_and_are_named():
    made = rows(np.random.default_rng(3), road=np.array([0.62, 0.0093, 0.17, 1.0]))
    found = fit(made, *VEHICLE_CLASSES["car"].road_bounds)
    assert found.road[3] == pytest.approx(2.0)
    assert found.at_bound == ("wheel_inertia",)
    assert found.cov[-1].tolist() == [0.0] * 7


def test_grid_and_bounded_fit_agree_to_the_grid_s_resolution():
    made = rows(np.random.default_rng(4))
    found = fit(made, *VEHICLE_CLASSES["car"].road_bounds)
    coefficients, road, cost = grid_search(made, found.weight)
    steps = np.array([axis[1] - axis[0] for axis in TABLE_5])
    # Neighbouring points trade one parameter for another, so a point may be two steps off.
    assert np.all(np.abs(road - found.road) <= 2.01 * steps)
    exact = np.sum(found.weight * found.residual**2)
    assert exact <= cost <= 1.02 * exact
    residual = made.target - made.design @ np.concatenate([coefficients, road])
    assert np.sum(found.weight * residual**2) == pytest.approx(cost, rel=1e-6)


def test_grid_point_equals_a_regression_of_its_own():
    made = rows(np.random.default_rng(5), n=800)
    axes = tuple(np.array([x]) for x in ROAD)
    coefficients, _, cost = grid_search(made, np.ones(800), axes)
    left = made.target - made.design[:, 3:] @ ROAD
    expected, *_ = np.linalg.lstsq(made.design[:, :3], left, rcond=None)
    assert coefficients == pytest.approx(expected, rel=1e-6)
    assert cost == pytest.approx(np.sum((left - made.design[:, :3] @ expected) ** 2), rel=1e-6)


def test_huber_optimum_agrees_with_a_general_minimiser():
    made = rows(np.random.default_rng(6), n=1500)
    found = fit(made, *VEHICLE_CLASSES["car"].road_bounds, iterations=60)
    knee = 1.345 * found.residual_std

    def loss(parameters):
        r = np.abs(made.target - made.design @ parameters)
        return np.sum(np.where(r <= knee, 0.5 * r**2, knee * (r - 0.5 * knee)))

    start = np.concatenate([found.coefficients, found.road])
    scale = np.maximum(np.abs(start), 1e-3)
    better = minimize(lambda z: loss(z * scale), start / scale, method="Powell")
    assert loss(start) <= better.fun * (1.0 + 1e-6)


def test_slope_of_the_torque_is_told_where_the_engine_was_driven():
    rng = np.random.default_rng(7)
    made = rows(rng, noise=8.0)
    engine = made.design[:, 2]
    # Full load torque grows with engine speed: at zero load and zero speed the map is flat.
    lean, bend = 0.55, 20.0
    torque = made.target - made.design[:, 3:] @ ROAD - TORQUE[0] - TORQUE[2] * engine
    load = 2.0 * torque / (lean * engine + np.sqrt((lean * engine) ** 2 + 4.0 * bend * torque))
    load = load + rng.normal(0.0, 0.02, load.size)
    columns = [np.ones_like(load), load, engine, load * engine, load**2]
    curved = TorqueRows(
        design=np.column_stack([*columns, made.design[:, 3:]]), target=made.target, time=made.time
    )
    found = fit(curved, *VEHICLE_CLASSES["car"].road_bounds)
    alone, std_alone = found.coefficients[1], np.sqrt(found.cov[1, 1])
    assert alone < 3.0 * std_alone
    slope, std = driven_slope(found, curved, curved=True)
    assert slope > 30.0 * std
    assert slope == pytest.approx(np.mean(lean * engine + 2.0 * bend * load), rel=0.1)
    straight = fit(made, *VEHICLE_CLASSES["car"].road_bounds)
    assert driven_slope(straight, made, curved=False)[0] == pytest.approx(TORQUE[1], rel=0.02)
