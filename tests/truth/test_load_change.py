"""Two hypotheses of the load after every stop."""

import numpy as np
import pytest

from weighbridge.kernels import disturbance
from weighbridge.kernels import load_change as kernel


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
    stopped = np.zeros(n, dtype=bool)
    stopped[[40, 90, at, 220]] = True
    params = kernel.LoadParams(
        filter=disturbance.DisturbanceParams(
            time_constant=np.array([np.inf, 30.0]), std=np.array([0.0, 50.0]), gate=5.0, settle=40
        ),
        jump_var=400.0**2,
        prior=-2.2,
        temper=0.4,
        fewest=8,
    )
    start = disturbance.initial_state([0.0, 0.0], np.diag([1500.0**2, 50.0**2]), time[0])
    return kernel.initial_state(start), time, rows, y, noise, stopped, params


@pytest.mark.parametrize("jump", [-300.0, 240.0, 800.0])
def test_a_change_of_load_is_found_at_its_stop_and_nowhere_else(jump):
    state, time, rows, y, noise, stopped, params = drive(jump)
    last, first, _, begins = kernel.run(state, time, rows, y, noise, stopped, params)
    assert np.flatnonzero(begins).tolist() == [150]
    assert last.same.x[0] == pytest.approx(1500.0 + jump, rel=0.02)
    soon = np.searchsorted(time, time[150] + 90.0)
    assert first[soon] == pytest.approx(1500.0 + jump, rel=0.03)
    assert first[149] == pytest.approx(1500.0, rel=0.02)


def test_stops_without_a_change_cost_nothing():
    found = []
    for seed in range(20):
        state, time, rows, y, noise, stopped, params = drive(0.0, seed=seed)
        _, first, _, begins = kernel.run(state, time, rows, y, noise, stopped, params)
        never = np.zeros(time.size, dtype=bool)
        _, alone, _, _ = kernel.run(state, time, rows, y, noise, never, params)
        assert not begins.any()
        found.append(first[-1] / alone[-1] - 1.0)
    assert np.max(np.abs(found)) < 0.005


def test_without_stops_it_is_the_plain_filter():
    state, time, rows, y, noise, _, params = drive(0.0)
    none = np.zeros(time.size, dtype=bool)
    last, first, first_var, _ = kernel.run(state, time, rows, y, noise, none, params)
    plain, mass, var, _, _ = disturbance.run(
        state.same, time, rows, y, noise, np.zeros(y.size), params.filter
    )
    np.testing.assert_array_equal(first, mass)
    np.testing.assert_array_equal(first_var, var)
    assert last.same.log_likelihood == plain.log_likelihood


def test_batch_equals_sample_by_sample_to_the_last_bit():
    state, time, rows, y, noise, stopped, params = drive(240.0)
    _, first, first_var, begins = kernel.run(state, time, rows, y, noise, stopped, params)
    seen = []
    for k in range(y.size):
        state, mass, var, begun = kernel.step(
            state, time[k], rows[k], y[k], noise[k], stopped[k], params
        )
        assert mass == first[k]
        assert var == first_var[k]
        seen.append(begun)
    assert {b for b in seen if b >= 0} == set(np.flatnonzero(begins))
