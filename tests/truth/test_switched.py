"""A force that is switched on and off, beside states that fade."""

from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose

from weighbridge.kernels import disturbance
from weighbridge.kernels import switched as kernel


def drive(force, *, n=300, seed=3, noise=30.0):
    """Rows of a mass of 1500 kg beside a disturbance, and a force that goes on and off."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(2.0, 4.0, n))
    rows = np.column_stack([rng.normal(0.3, 0.7, n), np.ones(n)])
    slow, on = np.zeros(n), np.zeros(n)
    for k in range(1, n):
        span = time[k] - time[k - 1]
        keep = np.exp(-span / 30.0)
        slow[k] = keep * slow[k - 1] + 40.0 * np.sqrt(1.0 - keep**2) * rng.normal()
        turned = rng.random() < 0.5 * (1.0 - np.exp(-span / 10.0))
        on[k] = 1.0 - on[k - 1] if turned else on[k - 1]
    y = 1500.0 * rows[:, 0] + slow + force * on + noise * rng.normal(size=n)
    params = kernel.SwitchParams(
        filter=disturbance.DisturbanceParams(
            time_constant=np.array([np.inf, 30.0]),
            std=np.array([0.0, 40.0]),
            gate=5.0,
            settle_rows=40,
        ),
        on_time=20.0,
        off_time=20.0,
    )
    start = disturbance.initial_state([0.0, 0.0], np.diag([1500.0**2, 40.0**2]), time[0])
    return start, time, rows, y, np.full(n, noise**2), np.zeros((n, 2)), params, on


@pytest.mark.parametrize("seed", [3, 8, 11, 14])
def test_probabilities_are_those_of_all_ways_it_can_be_switched(seed):
    """Against one Kalman filter for each of 2^10 ways."""
    _, time, rows, y, noise, added, params, _ = drive(100.0, n=10, seed=seed)
    start = disturbance.initial_state([1500.0, 0.0], np.diag([20.0**2, 40.0**2]), time[0])
    force = np.full(10, 100.0)
    stay = 0.5 * (1.0 + np.exp(-np.diff(time) / 10.0))
    logs, ways = [], np.array(list(product((0.0, 1.0), repeat=10)))
    for way in ways:
        state, *_ = disturbance.run(start, time, rows, y - force * way, noise, added, params.filter)
        turned = np.where(way[1:] == way[:-1], stay, 1.0 - stay)
        logs.append(state.log_likelihood + np.log(0.5) + np.log(turned).sum())
    share = np.exp(np.array(logs) - max(logs))
    exact = share @ ways / share.sum()
    on, told = kernel.run(
        kernel.initial_state(start, params), time, rows, y, noise, force, added, params
    )
    assert_allclose(on, exact, atol=0.12)
    assert np.mean(np.abs(on - exact)) < 0.04
    assert told == pytest.approx(max(logs) + np.log(share.sum()), abs=0.1)


def test_without_a_force_it_is_the_plain_filter():
    start, time, rows, y, noise, added, params, _ = drive(0.0)
    added[150, 0] = 400.0**2
    plain, *_ = disturbance.run(start, time, rows, y, noise, added, params.filter)
    state = kernel.initial_state(start, params)
    on, told = kernel.run(state, time, rows, y, noise, np.zeros(300), added, params)
    assert_allclose(on, 0.5, rtol=1e-9)
    assert told == pytest.approx(plain.log_likelihood, rel=1e-9)
    for k in range(300):
        state = kernel.step(state, time[k], rows[k], y[k], noise[k], 0.0, added[k], params)
    assert_allclose(state.x[0], plain.x, rtol=1e-9)
    assert_allclose(state.cov[1], plain.cov, rtol=1e-8)


def test_a_force_of_twice_the_noise_is_seen_and_frees_the_mass():
    start, time, rows, y, noise, added, params, truly = drive(200.0)
    force = np.full(300, 200.0)
    on, told = kernel.run(
        kernel.initial_state(start, params), time, rows, y, noise, force, added, params
    )
    assert np.mean((on > 0.5) == (truly > 0.5)) > 0.95
    _, without = kernel.run(
        kernel.initial_state(start, params), time, rows, y, noise, 0.0 * force, added, params
    )
    assert told - without > 50.0
    freed, *_ = disturbance.run(start, time, rows, y - force * on, noise, added, params.filter)
    assert freed.x[0] == pytest.approx(1500.0, rel=0.01)


def test_what_is_far_out_moves_neither_estimate_nor_probability():
    start, time, rows, y, noise, added, params, _ = drive(200.0)
    force = np.full(300, 200.0)
    begin = kernel.initial_state(start, params)
    spoiled = y.copy()
    spoiled[200] += 1e9
    on, _ = kernel.run(begin, time, rows, y, noise, force, added, params)
    with_it, _ = kernel.run(begin, time, rows, spoiled, noise, force, added, params)
    assert np.isfinite(with_it).all()
    assert_allclose(with_it[:190], on[:190], atol=1e-3)
    assert_allclose(with_it[210:], on[210:], atol=0.02)
