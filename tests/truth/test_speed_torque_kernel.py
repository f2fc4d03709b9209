"""The filter of speed and torque: Jacobian by differences, one step and a run, known states."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from weighbridge.kernels import speed_torque_ekf as kernel

PARAMS = kernel.SpeedTorqueParams(
    gravity=9.81, rolling=0.01, rolling_speed=1e-4, speed_var=1e-2, accel_density=1e-3,
    gust_speed=15.0, slope_var=4e-4, slope_length=200.0, slope_walk=0.0, rolling_var=1e-6,
    rolling_time=900.0, mass_walk=0.0, gate=6.0,
)  # fmt: skip


def row(**given):
    usual = {
        "length": 1.0, "speed": 15.0, "force": 900.0, "force_var": 0.0, "drag": 0.4,
        "headwind": 2.0, "rotating": 70.0, "grade": 0.02, "accel": np.nan,
        "columns": np.array([50.0, 12.0]), "on": True,
    }  # fmt: skip
    return kernel.Step(**(usual | given))


@pytest.mark.parametrize("speed", [3.0, 25.0])
def test_jacobian_is_that_of_differences(speed):
    x = np.array([speed, 1.0 / 1400.0, 0.01, 0.002, 3.0, -1.0])
    _, jacobian = kernel.acceleration(x, row(), PARAMS)
    for place, by in enumerate((1e-4, 1e-8, 1e-5, 1e-6, 1e-3, 1e-3)):
        ends = []
        for sign in (-1.0, 1.0):
            moved = x.copy()
            moved[place] += sign * by
            ends.append(kernel.acceleration(moved, row(), PARAMS)[0])
        assert_allclose(jacobian[place], (ends[1] - ends[0]) / (2.0 * by), rtol=1e-5)


def test_at_the_models_own_acceleration_both_linearisations_agree():
    x = np.array([15.0, 1.0 / 1400.0, 0.0, 0.0, 0.0, 0.0])
    accel, by_model = kernel.acceleration(x, row(), PARAMS)
    _, by_motion = kernel.acceleration(x, row(accel=accel), PARAMS)
    assert_allclose(by_motion, by_model, rtol=1e-12)


def columns(n=400, mass=1400.0, seed=1):
    """Speeds that follow the model exactly, each from the one before."""
    rng = np.random.default_rng(seed)
    force = 900.0 + 900.0 * np.sin(np.arange(n) / 9.0) + rng.normal(scale=200.0, size=n)
    grade = 0.03 * np.sin(np.arange(n) / 31.0)
    speed = np.empty(n)
    x = np.array([15.0, 1.0 / mass, 0.0, 0.0])
    for k in range(n):
        one = row(force=force[k], grade=grade[k], columns=np.zeros(0), headwind=0.0)
        half = x.copy()
        half[0] += 0.5 * kernel.acceleration(x, one, PARAMS)[0]
        x[0] += kernel.acceleration(half, one, PARAMS)[0]
        speed[k] = x[0]
    full = np.ones(n)
    return kernel.Columns(
        length=full, speed=speed, force=force, force_var=0.0 * full, drag=0.4 * full,
        headwind=0.0 * full, rotating=70.0 * full, grade=grade,
        accel=np.diff(speed, prepend=speed[0]),
        columns=np.zeros((n, 0)), on=np.ones(n, dtype=bool),
    )  # fmt: skip


def start(mass):
    cov = np.diag([1e-2, (0.3 / mass) ** 2, 1e-8, 1e-12])
    return kernel.SpeedTorqueState(np.array([0.0, 1.0 / mass, 0.0, 0.0]), cov, False)


EXACT = PARAMS._replace(speed_var=1e-8, accel_density=1e-10, slope_var=1e-12, rolling_var=1e-16)


@pytest.mark.parametrize("first", [1000.0, 2000.0])
def test_without_errors_the_mass_is_exact(first):
    """Runs linearised about the mass of the one before: the first is far from straight."""
    mass = first
    for _ in range(4):
        state, x, var, *_ = kernel.run(start(mass), columns(), EXACT)
        mass = 1.0 / state.x[1]
    assert mass == pytest.approx(1400.0, rel=1e-3)
    assert var[-1, 1] < 1e-4 * var[1, 1]
    assert x[-1, 2] == pytest.approx(0.0, abs=1e-5)


def test_a_run_is_its_steps_and_the_likelihood_is_theirs():
    table = columns()
    table.on[50:60] = False
    table.speed[200] = np.nan
    table.speed[300] += 4.0
    state, total = start(1200.0), 0.0
    whole = kernel.run(state, table, PARAMS)
    for k in range(table.speed.size):
        state, innovation, var, taken = kernel.step(state, kernel.row_at(table, k), PARAMS)
        assert np.array_equal(state.x, whole[1][k])
        assert taken == whole[5][k]
        if np.isfinite(innovation):
            total -= 0.5 * (min(innovation**2 / var, PARAMS.gate**2) + np.log(var))
    assert np.array_equal(state.cov, whole[0].cov)
    assert kernel.log_likelihood(start(1200.0), table, PARAMS) == total
    assert not whole[5][[50, 59, 200, 201, 300, 301]].any()
    assert whole[5][[49, 60, 202, 303]].all()


def test_rows_without_force_hold_the_mass_and_open_the_slope():
    table = columns()
    _, x, var, *_ = kernel.run(start(1200.0), table, PARAMS)
    table.on[100:200] = False
    _, held, held_var, *_ = kernel.run(start(1200.0), table, PARAMS)
    assert np.all(held[100:200, 1] == held[99, 1])
    assert held_var[199, 2] == pytest.approx(PARAMS.slope_var, rel=1e-3)
    assert held_var[199, 1] == held_var[99, 1]
    assert held_var[-1, 1] > var[-1, 1]
    assert_allclose(x[:100], held[:100])


def test_covariance_stays_symmetric_and_positive():
    state, *_ = kernel.run(start(900.0), columns(4000), PARAMS)
    assert_allclose(state.cov, state.cov.T, atol=0.0)
    scale = 1.0 / np.sqrt(np.diag(state.cov))
    assert np.linalg.eigvalsh(state.cov * np.outer(scale, scale)).min() > 0.0


def test_normalised_innovations_are_one_in_the_mean():
    """Noise as the filter has it: NIS is chi2(1), so its mean is 1 within its own error."""
    values = []
    for seed in range(8):
        rng = np.random.default_rng(100 + seed)
        table = columns(600, seed=seed)
        noise = np.sqrt(PARAMS.speed_var)
        read = table._replace(speed=table.speed + rng.normal(scale=noise, size=600))
        exact = PARAMS._replace(accel_density=1e-12, slope_var=1e-12, rolling_var=1e-16)
        _, _, _, innovation, var, taken = kernel.run(start(1400.0), read, exact)
        values.append((innovation**2 / var)[taken])
    nis = np.concatenate(values)
    assert abs(nis.mean() - 1.0) < 4.0 * np.sqrt(2.0 / nis.size)
