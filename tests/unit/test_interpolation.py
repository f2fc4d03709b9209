"""Interpolation and means of windows against NumPy."""

from itertools import groupby, pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import cumulative_trapezoid

from weighbridge.kernels.interpolation import (
    distance_to_nearest,
    integral,
    interpolate,
    longest_repeat,
    mixed,
    moved_changes,
    rows_before,
    seen_windows,
    shares,
    trapezoid_means,
)
from weighbridge.kernels.shaking import widest_spread


@np.errstate(invalid="ignore")  # NumPy says nothing of infinite values, its scalars do.
@pytest.mark.parametrize("seed", range(5))
def test_interpolation_is_that_of_numpy_to_the_last_bit(seed):
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(0.0, 50.0, 300))
    time[40:43] = time[40]
    values = rng.normal(size=time.size)
    values[100:103], values[200] = np.inf, np.nan
    rising = np.sort(rng.uniform(-3.0, 53.0, 500))
    mixed_up = rng.permutation(np.concatenate([rising, time, [np.nan, np.inf, -np.inf]]))
    for at in (rising, rising[::-1].copy(), mixed_up, np.empty(0)):
        for ends in ((values[0], values[-1]), (np.nan, 1.0)):
            expected = np.interp(at, time, values, *ends)
            assert_array_equal(interpolate(at, time, values, *ends), expected)
    ends = (values[0], values[0])
    assert_array_equal(interpolate(rising, time[:1], values[:1], *ends), np.full(500, values[0]))


def test_the_nearest_point_is_that_of_all():
    rng = np.random.default_rng(5)
    time = np.cumsum(rng.uniform(0.1, 3.0, 200))
    at = np.concatenate([rng.uniform(-5.0, time[-1] + 5.0, 400), time, [np.inf]])
    expected = np.abs(at[:, None] - time).min(axis=1)
    for order in (np.arange(at.size), np.argsort(at)):
        assert_array_equal(distance_to_nearest(at[order], time), expected[order])
    assert np.isnan(distance_to_nearest(np.array([np.nan]), time)).all()
    assert_array_equal(distance_to_nearest(at, time[:1]), np.abs(at - time[0]))


def test_rows_are_found_and_mixed_but_across_a_silence():
    rng = np.random.default_rng(5)
    time, values = np.sort(rng.uniform(0.0, 50.0, 300)), rng.normal(size=300)
    at = np.concatenate([np.sort(rng.uniform(-1.0, 51.0, 500)), time[::-7]])
    row = rows_before(at, time)
    assert_array_equal(row, np.maximum(np.searchsorted(time, at, side="right") - 1, 0))
    share = shares(at, time, row, 0.5)
    silent = np.diff(time)[np.minimum(row, 298)] >= 0.5
    known = (at >= time[0]) & (at <= time[-1]) & ~silent
    assert 0 < np.count_nonzero(silent) < np.count_nonzero(known)
    assert_array_equal(np.isfinite(share), known)
    expected = np.interp(at, time, values)[known]
    assert_allclose(mixed(values, row, share)[known], expected, atol=1e-12)


@pytest.mark.parametrize("stride", [1, 7, 13])
def test_an_integral_is_that_by_trapezia_at_every_so_many_samples_and_the_last(stride):
    rng = np.random.default_rng(8)
    time, values = np.cumsum(rng.uniform(0.01, 0.02, 92)), rng.normal(size=92)
    whole = cumulative_trapezoid(values - 0.3, time, initial=0.0)
    expected = [*whole[::stride], *whole[-1:][: int(91 % stride > 0)]]
    assert_allclose(integral(time, values, 0.3, stride), expected, atol=1e-12)


def test_changes_moved_by_a_delay_are_those_of_two_interpolations():
    rng = np.random.default_rng(6)
    time = 0.1 * np.arange(600)
    integral = np.cumsum(rng.normal(size=600))
    begins = np.sort(rng.uniform(1.0, 55.0, 400))
    ends, whole, width = begins + 1.5, rng.uniform(size=400) < 0.9, 31
    moved = np.interp(ends - 0.3, time, integral) - np.interp(begins - 0.3, time, integral)
    moved = np.where(whole, moved, 0.0)
    padded = np.pad(moved, width // 2, mode="edge")
    total = np.concatenate([[0.0], np.cumsum(padded)])
    expected = moved - (total[width:] - total[:-width]) / width
    found = moved_changes(begins, ends, 0.3, time, integral, whole, width)
    assert_array_equal(found, expected[whole])


def test_windows_are_those_of_whole_integrals_and_of_the_gaps_they_touch():
    rng = np.random.default_rng(7)
    time = np.sort(rng.uniform(10.0, 90.0, 900))
    time = np.delete(time, slice(300, 340))
    values, edges, limit = rng.normal(size=time.size), np.arange(0.0, 101.0, 2.0), 0.5
    area = np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) * 0.5 * np.diff(time))])
    expected = np.diff(np.interp(edges, time, area)) / np.diff(edges)
    assert_array_equal(trapezoid_means(edges, time, values), expected)
    gaps = [(a, b) for a, b in pairwise(time) if b - a > limit]
    seen = [
        a >= time[0] - limit
        and b <= time[-1] + limit
        and not any(start < b and end > a for start, end in gaps)
        for a, b in pairwise(edges)
    ]
    assert 0 < sum(seen) < len(seen) - len(gaps)
    assert_array_equal(seen_windows(edges, time, limit), seen)


def test_the_longest_repeat_is_that_of_the_runs_of_a_signal():
    rng = np.random.default_rng(9)
    time = np.cumsum(rng.uniform(0.01, 0.02, 2000))
    for levels in (1, 2, 5, 10**9):
        values = rng.integers(levels, size=2000).astype(float)
        runs = [list(rows) for _, rows in groupby(range(2000), key=lambda k, v=values: v[k])]
        assert longest_repeat(time, values) == max(time[rows[-1]] - time[rows[0]] for rows in runs)
    assert longest_repeat(np.empty(0), np.empty(0)) == 0.0


@pytest.mark.parametrize("half", [1, 9])
def test_the_widest_spread_is_that_of_windows_whose_ends_are_held(half):
    values = np.random.default_rng(10).normal([0.0, 3.0, -9.8], size=(500, 3))
    held = np.pad(values, ((half, half), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(held, 2 * half + 1, axis=0)
    assert_allclose(widest_spread(values, half), windows.std(axis=-1).max(axis=1), atol=1e-9)
