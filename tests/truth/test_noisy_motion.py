"""Noise of the motion draws the mass down by as much as is reckoned."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from weighbridge.estimators.noisy_motion import (
    attenuation,
    between_samples,
    left_open,
    unmeasured_noise,
)
from weighbridge.kernels import disturbance as kernel

MASS = 1500.0
NOISE = 0.06
"""Of the motion [m/s^2], beside a true specific force of 0.25 m/s^2."""


def weighed(seed, n=400):
    """Mass of one drive as the filter has it, and with what the noise takes put back."""
    rng = np.random.default_rng(seed)
    time = 2.5 * np.arange(n)
    true = rng.normal(0.0, 0.25, n)
    keep = np.exp(-2.5 / 30.0)
    wander = np.zeros(n)
    for k in range(1, n):
        wander[k] = keep * wander[k - 1] + rng.normal(0.0, 60.0 * np.sqrt(1.0 - keep**2))
    motion = true + rng.normal(0.0, NOISE, n)
    y = MASS * true + wander + rng.normal(0.0, 30.0, n)
    noise = np.full(n, 30.0**2 + (MASS * NOISE) ** 2)
    params = kernel.DisturbanceParams(
        time_constant=np.array([np.inf, 30.0]),
        std=np.array([0.0, 60.0]),
        gate=np.inf,
        settle_rows=0,
    )
    start = kernel.initial_state([MASS, 0.0], np.diag([MASS**2, 60.0**2]), 0.0)
    rows = np.column_stack([motion, np.ones(n)])
    none = np.zeros(rows.shape)
    x, var, _, weight = kernel.smooth(start, time, rows, y, noise, none, params)
    mass = x[-1, 0]

    def put_back(variance):
        return mass * (1.0 + attenuation(weight, variance, var[:, 0], np.zeros(n, dtype=bool))[-1])

    def by_scatter(short, grade_std, fast_var=noise):
        known = np.full(n, 30.0**2), np.full(n, short), np.full(n, grade_std), mass, var[-1, 0]
        return put_back(unmeasured_noise(weight, fast_var, *known))

    by_size = put_back(np.full(n, NOISE**2))
    by_whole = by_scatter(short=True, grade_std=NOISE, fast_var=np.zeros(n))
    by_none = by_scatter(short=False, grade_std=NOISE, fast_var=np.zeros(n))
    return mass, by_size, by_scatter(short=False, grade_std=NOISE), by_whole, by_none


def test_the_mean_over_many_drives_is_right_once_the_noise_is_put_back():
    found = np.mean([weighed(seed) for seed in range(60)], axis=0) / MASS - 1.0
    as_it_is, by_size, by_fast, by_whole, by_none = found
    assert -0.07 < as_it_is < -0.03
    # To first order: what is left is the square of what was taken.
    assert by_size == pytest.approx(0.0, abs=0.006)
    assert by_fast == pytest.approx(0.0, abs=0.006)
    # Where power is short all of the scatter counts, whatever is fast in it.
    assert by_whole == pytest.approx(0.0, abs=0.006)
    # A driver who answers what lasts leaves no noise.
    assert by_none == pytest.approx(as_it_is, abs=1e-6)


def test_each_load_counts_its_own_windows():
    begins = np.array([False, False, True, False, True])
    weight = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    mass_var = np.array([1.0, 1.0, 0.5, 0.5, 2.0])
    low = attenuation(weight, np.full(5, 0.02), mass_var, begins)
    noise = np.array([0.06, 0.06, 0.07, 0.07, 0.2])
    assert_allclose(low, noise / (1.0 - noise))


def test_where_most_is_noise_the_mass_is_left_open():
    most = attenuation(np.ones(1), np.full(1, 0.7), np.ones(1), np.zeros(1, dtype=bool))[0]
    assert left_open(most, 0.1) == 1.0
    assert left_open(0.9 * most, 0.1) == pytest.approx(0.09 * most)


def test_samples_stand_for_a_random_walk_as_well_as_is_reckoned():
    rng = np.random.default_rng(3)
    fine, count = 50, 4000
    walk = np.cumsum(rng.normal(0.0, 100.0, fine * count + 1))
    time, force = np.arange(count + 1.0), walk[::fine]
    line = 0.5 * (force[1:] + force[:-1])
    mean = (0.5 * (walk[1:] + walk[:-1])).reshape(count, fine).mean(axis=1)
    usable = np.ones(count + 1, dtype=bool)
    assert between_samples(time, force, usable) == pytest.approx(np.var(mean - line), rel=0.06)
    # What was left out between two samples is no change from one to the next.
    force[1000:] += 1e6
    usable[1000] = False
    assert between_samples(time, force, usable) == pytest.approx(np.var(mean - line), rel=0.06)
    usable[:] = False
    assert between_samples(time, force, usable) == 0.0
