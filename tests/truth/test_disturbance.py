"""The filter of constants and fading disturbances against dense generalised least squares."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from weighbridge.kernels import disturbance as kernel

NO_JUMPS = np.zeros((300, 3))


def problem(n=300, seed=1):
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.5, 6.0, n))
    rows = np.column_stack([rng.normal(0.4, 0.8, n), np.ones(n), rng.normal(size=n)])
    tau, std = np.array([np.inf, 30.0, 200.0]), np.array([0.0, 60.0, 25.0])
    noise = rng.uniform(50.0, 400.0, n)
    fading = [
        np.exp(-np.abs(time[:, None] - time) / tau[i])
        * std[i] ** 2
        * np.outer(rows[:, i], rows[:, i])
        for i in (1, 2)
    ]
    cov = sum(fading) + np.diag(noise)
    y = 1500.0 * rows[:, 0] + np.linalg.cholesky(cov) @ rng.normal(size=n)
    params = kernel.DisturbanceParams(time_constant=tau, std=std, gate=np.inf, settle_rows=0)
    start = kernel.initial_state([1000.0, 0.0, 0.0], np.diag([500.0**2, 60.0**2, 25.0**2]), time[0])
    return time, rows, y, noise, params, start, cov


def test_equals_generalised_least_squares_with_the_dense_covariance():
    time, rows, y, noise, params, start, cov = problem()
    state, *_ = kernel.run(start, time, rows, y, noise, NO_JUMPS, params)
    phi, weight = rows[:, 0], np.linalg.inv(cov)
    information = phi @ weight @ phi + 1.0 / 500.0**2
    expected = (phi @ weight @ y + 1000.0 / 500.0**2) / information
    assert_allclose(state.x[0], expected, rtol=1e-9)
    assert_allclose(state.cov[0, 0], 1.0 / information, rtol=1e-9)


def test_likelihood_is_that_of_the_dense_covariance():
    time, rows, y, noise, params, start, cov = problem()
    state, *_ = kernel.run(start, time, rows, y, noise, NO_JUMPS, params)
    whole = cov + 500.0**2 * np.outer(rows[:, 0], rows[:, 0])
    residual = y - 1000.0 * rows[:, 0]
    _, log_det = np.linalg.slogdet(whole)
    expected = -0.5 * (log_det + residual @ np.linalg.solve(whole, residual))
    assert state.log_likelihood == pytest.approx(expected, rel=1e-9)


def test_batch_equals_sample_by_sample_to_the_last_bit():
    time, rows, y, noise, params, start, _ = problem()
    last, first, var, innovation, taken = kernel.run(start, time, rows, y, noise, NO_JUMPS, params)
    state = start
    for k in range(y.size):
        state, e, took = kernel.step(state, time[k], rows[k], y[k], noise[k], params)
        assert e == innovation[k]
        assert took == taken[k]
        assert state.x[0] == first[k]
        assert state.cov[0, 0] == var[k]
    assert_array_equal(state.cov, last.cov)


def test_outliers_are_left_out():
    time, rows, y, noise, params, start, _ = problem()
    spoiled = y.copy()
    spoiled[50::40] += 3000.0
    gated = params._replace(gate=5.0, settle_rows=20)
    state, _, _, _, taken = kernel.run(start, time, rows, spoiled, noise, NO_JUMPS, gated)
    clean, *_ = kernel.run(start, time, rows, y, noise, NO_JUMPS, gated)
    assert not taken[50::40].any()
    assert state.x[0] == pytest.approx(clean.x[0], rel=0.005)


def test_a_start_three_times_too_heavy_or_too_light_ends_alike():
    time, rows, y, noise, params, _, _ = problem()
    ends = []
    for guess in (500.0, 1500.0, 4500.0):
        prior = np.diag([guess**2, 60.0**2, 25.0**2])
        start = kernel.initial_state([guess, 0.0, 0.0], prior, time[0])
        state, *_ = kernel.run(start, time, rows, y, noise, NO_JUMPS, params)
        ends.append(state.x[0])
    assert max(ends) - min(ends) < 0.005 * 1500.0


def test_smoothing_equals_the_conditional_mean_of_the_dense_covariance():
    time, rows, y, noise, params, start, _ = problem()
    added = np.zeros(rows.shape)
    added[120, :2] = 300.0**2, 40.0**2
    x, var, _, weight = kernel.smooth(start, time, rows, y, noise, added, params)
    jumped = (np.arange(y.size) >= 120).astype(float)
    left = jumped * np.exp(-np.maximum(time - time[119], 0.0) / 30.0)
    span = np.abs(time[:, None] - time)
    states = [
        500.0**2 + 300.0**2 * np.outer(jumped, jumped),
        60.0**2 * np.exp(-span / 30.0) + 40.0**2 * np.outer(left, left),
        25.0**2 * np.exp(-span / 200.0),
    ]
    whole = sum(c * np.outer(rows[:, i], rows[:, i]) for i, c in enumerate(states))
    whole = whole + np.diag(noise)
    residual = y - 1000.0 * rows[:, 0]
    for i, cov in enumerate(states):
        cross = cov * rows[:, i]
        expected = cross @ np.linalg.solve(whole, residual) + (1000.0 if i == 0 else 0.0)
        spread = np.diag(cov) - np.sum(cross * np.linalg.solve(whole, cross.T).T, axis=1)
        assert_allclose(x[:, i], expected, rtol=1e-6, atol=1e-6)
        assert_allclose(var[:, i], spread, rtol=1e-5, atol=1e-6)
    assert_allclose(weight, np.diag(np.linalg.inv(whole)), rtol=1e-6)


def test_smoothing_ends_where_the_filter_ends():
    time, rows, y, noise, params, start, _ = problem()
    state, *_ = kernel.run(start, time, rows, y, noise, NO_JUMPS, params)
    x, var, *_ = kernel.smooth(start, time, rows, y, noise, NO_JUMPS, params)
    assert_allclose(x[-1], state.x, rtol=1e-12)
    assert_allclose(var[-1], np.diag(state.cov), rtol=1e-9)


def test_a_false_row_after_a_jump_does_not_close_the_gate_to_right_ones():
    time, rows, y, noise, params, start, _ = problem()
    jumped = np.arange(y.size) >= 120
    heavier = y + 400.0 * jumped * rows[:, 0]
    heavier[120] += 900.0
    added = np.zeros(rows.shape)
    added[120, 0] = 300.0**2
    gated = params._replace(gate=5.0, settle_rows=20, jump_rows=8)
    state, _, _, _, taken = kernel.run(start, time, rows, heavier, noise, added, gated)
    assert taken[120:128].all()
    assert np.mean(taken[128:]) > 0.95
    assert abs(state.x[0] - 1900.0) < 4.0 * np.sqrt(state.cov[0, 0])
