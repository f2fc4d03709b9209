"""The filter of the joint estimator: innovations and errors are as large as it says."""

import numpy as np
import pytest
from scipy.stats import chi2

from weighbridge.kernels import disturbance as kernel

RUNS, ROWS = 60, 160
TIME_CONSTANT = np.array([np.inf, 30.0, 900.0])
STD = np.array([0.0, 60.0, 25.0])
MASS, MASS_STD = 1500.0, 150.0


def drives(seed):
    """Run the filter on drives drawn from its model: errors (3,), covariance and innovations."""
    rng = np.random.default_rng(seed)
    params = kernel.DisturbanceParams(
        time_constant=TIME_CONSTANT, std=STD, gate=np.inf, settle_rows=0
    )
    spread = np.array([MASS_STD, *STD[1:]])
    for _ in range(RUNS):
        time = np.cumsum(rng.uniform(2.0, 5.0, ROWS))
        rows = np.column_stack([rng.normal(0.3, 0.7, ROWS), np.ones(ROWS), np.ones(ROWS)])
        rows[:, 2] = 1.0 + 0.02 * np.cumsum(rng.normal(size=ROWS))
        noise = rng.uniform(40.0, 120.0, ROWS) ** 2
        x = np.array([MASS, 0.0, 0.0]) + spread * rng.normal(size=3)
        y = np.empty(ROWS)
        for k in range(ROWS):
            if k:
                keep = np.exp(-(time[k] - time[k - 1]) / TIME_CONSTANT)
                x = keep * x + STD * np.sqrt(1.0 - keep**2) * rng.normal(size=3)
            y[k] = rows[k] @ x + np.sqrt(noise[k]) * rng.normal()
        start = kernel.initial_state([MASS, 0.0, 0.0], np.diag(spread**2), time[0])
        last, _, _, innovation, _ = kernel.run(
            start, time, rows, y, noise, np.zeros((ROWS, 3)), params
        )
        yield last.x - x, last.cov, innovation


@pytest.fixture(scope="module")
def made():
    return list(drives(51))


def bounds(degrees):
    return chi2.ppf((0.0005, 0.9995), degrees)


def test_errors_have_the_covariance_they_are_said_to_have(made):
    low, high = bounds(3 * RUNS)
    assert low < sum(e @ np.linalg.solve(cov, e) for e, cov, _ in made) < high


def test_the_error_of_the_mass_has_its_standard_deviation(made):
    low, high = bounds(RUNS)
    assert low < sum(e[0] ** 2 / cov[0, 0] for e, cov, _ in made) < high


def test_innovations_are_white_and_of_unit_variance(made):
    every = np.array([innovation for *_, innovation in made])
    low, high = bounds(every.size)
    assert low < np.sum(every**2) < high
    lagged = np.sum(every[:, 1:] * every[:, :-1]) / every[:, 1:].size
    assert abs(lagged) < 3.3 / np.sqrt(every[:, 1:].size)
