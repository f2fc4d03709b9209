"""Recursive least squares against normal equations and the paper's own formulas."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from weighbridge.kernels import rls


def params(forgetting=0.99, limit=1e12, gate=np.inf, settle=10**9, n=1):
    return rls.RlsParams(
        forgetting=forgetting,
        cov_limit=np.full(n, limit),
        gate=gate,
        scale_rows=400.0,
        settle_rows=settle,
        block=60.0,
    )


def rows(n, seed=1, mass=1500.0):
    rng = np.random.default_rng(seed)
    phi = rng.normal(0.3, 0.8, size=(n, 1))
    y = phi[:, 0] * mass + rng.normal(scale=200.0, size=n)
    return np.arange(n) * 0.25, phi, y


def test_equals_weighted_least_squares_in_two_parameters():
    rng = np.random.default_rng(2)
    n, forgetting = 300, 0.99
    phi = rng.normal(size=(n, 2))
    y = phi @ [1500.0, 80.0] + rng.normal(scale=20.0, size=n)
    prior = np.diag([1e3, 1e2])
    state, *_ = rls.run(
        rls.initial_state([0.0, 0.0], prior),
        np.arange(n) * 0.25,
        phi,
        y,
        np.ones(n, bool),
        params(forgetting, n=2),
    )
    weight = forgetting ** np.arange(n)[::-1]
    info = (phi.T * weight) @ phi + forgetting**n * np.linalg.inv(prior)
    assert_allclose(state.theta, np.linalg.solve(info, (phi.T * weight) @ y), rtol=1e-9)
    assert_allclose(state.cov, np.linalg.inv(info), rtol=1e-9)


def test_equals_equations_7_to_9_of_jensen_2022():
    time, phi, y = rows(500)
    _, theta, *_ = rls.run(
        rls.initial_state([1000.0], [[1000.0]]), time, phi, y, np.ones(500, bool), params(0.9995)
    )
    mass, gain, expected = 1000.0, 1000.0, []
    for p, force in zip(phi[:, 0], y, strict=True):
        gain = (gain - gain * p * p * gain / (0.9995 + p * gain * p)) / 0.9995
        mass = mass + gain * p * (force - p * mass)
        expected.append(mass)
    assert_allclose(theta[:, 0], expected, rtol=1e-9)


def test_batch_equals_sample_by_sample_to_the_last_bit():
    time, phi, y = rows(2000)
    valid = np.arange(2000) % 7 != 0
    chosen = params(0.999, gate=3.0, settle=50)
    last, theta, var, innovation, taken = rls.run(
        rls.initial_state([1000.0], [[1000.0]]), time, phi, y, valid, chosen
    )
    state = rls.initial_state([1000.0], [[1000.0]])
    for k in np.flatnonzero(valid):
        state, e, took = rls.step(state, time[k], phi[k], y[k], chosen)
        assert e == innovation[k]
        assert took == taken[k]
        assert state.theta[0] == theta[k, 0]
        assert rls.variance(state, 0) == var[k]
    assert_array_equal(state.cov, last.cov)


def test_a_long_cruise_without_excitation_does_not_wind_up():
    time, phi, y = rows(4000)
    quiet = 400_000
    phi = np.vstack([phi, np.zeros((quiet, 1))])
    y = np.concatenate([y, np.zeros(quiet)])
    time = np.arange(y.size) * 0.25
    state, theta, *_ = rls.run(
        rls.initial_state([1000.0], [[1000.0]]),
        time,
        phi,
        y,
        np.ones(y.size, bool),
        params(0.9995, limit=1000.0),
    )
    assert np.isfinite(theta).all()
    assert 0.0 < state.cov[0, 0] <= 1000.0 / 0.9995
    assert theta[-1, 0] == pytest.approx(1500.0, rel=0.02)


def test_without_the_guard_the_same_cruise_overflows():
    time, phi, y = rows(1_500_000)
    phi[:] = 0.0
    state, *_ = rls.run(
        rls.initial_state([1000.0], [[1000.0]]),
        time,
        phi,
        y * 0.0,
        np.ones(y.size, bool),
        params(0.9995, limit=np.inf),
    )
    assert not np.isfinite(state.cov[0, 0])


def test_outliers_are_left_out_and_a_changed_mass_is_not():
    time, phi, y = rows(6000)
    y[3000::50] += 20_000.0
    _, theta, _, _, taken = rls.run(
        rls.initial_state([1000.0], [[1000.0]]),
        time,
        phi,
        y,
        np.ones(y.size, bool),
        params(0.999, gate=5.0, settle=200),
    )
    assert not taken[3000::50].any()
    assert theta[-1, 0] == pytest.approx(1500.0, rel=0.02)

    time, phi, y = rows(12_000)
    y[4000:] += 8000.0 * phi[4000:, 0]
    _, theta, *_ = rls.run(
        rls.initial_state([1000.0], [[1000.0]]),
        time,
        phi,
        y,
        np.ones(y.size, bool),
        params(0.998, gate=5.0, settle=200),
    )
    assert theta[-1, 0] == pytest.approx(9500.0, rel=0.03)


def test_the_standard_deviation_grows_with_dependence_between_rows():
    rng = np.random.default_rng(5)
    n = 40_000
    time = np.arange(n) * 0.25
    phi = np.repeat(rng.normal(0.3, 0.8, n // 100), 100)[:, None]
    slow = np.repeat(rng.normal(scale=200.0, size=n // 100), 100)
    fast = rng.normal(scale=200.0, size=n)
    stds = {}
    for name, noise in (("slow", slow), ("fast", fast)):
        state, *_ = rls.run(
            rls.initial_state([1000.0], [[1000.0]]),
            time,
            phi,
            1500.0 * phi[:, 0] + noise,
            np.ones(n, bool),
            params(0.9999, settle=200, gate=10.0),
        )
        stds[name] = np.sqrt(rls.variance(state, 0))
    assert stds["slow"] > 4.0 * stds["fast"]
