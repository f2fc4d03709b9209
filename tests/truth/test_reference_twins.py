"""Kernels against the same equations in plain numpy; run with the compiler and without."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import config
from numpy.testing import assert_allclose
from tests import reference

from weighbridge.kernels import disturbance, rls, speed_ekf, two_states


def test_least_squares():
    rng = np.random.default_rng(11)
    n = 120
    time, phi = 0.25 * np.arange(n), rng.normal(size=(n, 2))
    y = phi @ [1500.0, 80.0] + rng.normal(scale=20.0, size=n)
    params = rls.RlsParams(
        forgetting=0.98, cov_limit=np.full(2, 1e12), gate=np.inf, scale_rows=400.0,
        settle_rows=10**9, block=60.0,
    )  # fmt: skip
    start = rls.initial_state([900.0, 0.0], np.diag([1e3, 1e2]))
    state, theta, *_ = rls.run(start, time, phi, y, np.ones(n, bool), params)
    twin, cov = reference.least_squares(time, phi, y, start.theta, start.cov, 0.98)
    assert_allclose(theta, twin, rtol=1e-8)
    assert_allclose(state.cov, cov, rtol=1e-8)


def test_fading_filter():
    rng = np.random.default_rng(12)
    n = 150
    time = np.cumsum(rng.uniform(0.5, 6.0, n))
    rows = np.column_stack([rng.normal(0.4, 0.8, n), np.ones(n), rng.normal(size=n)])
    tau, std = np.array([np.inf, 30.0, 200.0]), np.array([0.0, 60.0, 25.0])
    noise = rng.uniform(50.0, 400.0, n)
    y = 1500.0 * rows[:, 0] + rng.normal(scale=60.0, size=n)
    x0, cov0 = np.array([1000.0, 0.0, 0.0]), np.diag([500.0**2, 60.0**2, 25.0**2])
    params = disturbance.DisturbanceParams(time_constant=tau, std=std, gate=np.inf, settle_rows=0)
    start = disturbance.initial_state(x0, cov0, time[0])
    state, _, _, innovation, _ = disturbance.run(
        start, time, rows, y, noise, np.zeros((n, 3)), params
    )
    x, cov, twin = reference.fading_filter(time, rows, y, noise, x0, cov0, tau, std)
    assert_allclose(state.x, x, rtol=1e-8, atol=1e-8)
    assert_allclose(state.cov, cov, rtol=1e-7, atol=1e-7)
    assert_allclose(innovation, twin, rtol=1e-7, atol=1e-9)


def test_two_states():
    rng = np.random.default_rng(13)
    time, log_ratio = np.cumsum(rng.uniform(0.1, 3.0, 11)), rng.normal(scale=1.5, size=11)
    twin = reference.two_state_posterior(log_ratio, time, 4.0)
    assert_allclose(two_states.posterior(log_ratio, time, 4.0, np.inf), twin, rtol=1e-6)


def test_speed_filter():
    rng = np.random.default_rng(14)
    n = 90
    speed = 12.0 + 6.0 * np.sin(np.arange(n) / 8.0) + rng.normal(scale=0.1, size=n)
    on = (np.arange(n) % 30) > 4
    params = speed_ekf.SpeedEkfParams(
        sample_time=1.0, force_gain=40.0, drag=0.8, gravity=9.81, rotating_mass=60.0,
        corrections=np.array([1.0, -0.5, 0.02, 0.001, 0.05, -0.002, 0.9]),
        process_var=np.array([0.1, 1e-12, 0.005]), speed_var=1e-2,
    )  # fmt: skip
    start = speed_ekf.initial_state(1500.0, 0.01, params)
    state, x, *_ = speed_ekf.run(start, speed, on, params)
    twin, cov = reference.speed_filter(speed, on, params, start.x, start.cov)
    assert_allclose(x, twin, rtol=1e-5)
    assert_allclose(state.cov, cov, rtol=1e-4, atol=1e-16)


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="this is the run without the compiler")
def test_the_same_without_the_compiler():
    here = Path(__file__).parent
    names = ("test_reference_twins", "test_rotation")
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "0", *(here / f"{name}.py" for name in names)],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=here.parents[1],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stdout[-3000:]
