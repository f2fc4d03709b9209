"""Lags: where a misfit is lowest, where two series go together best, and how sure that is."""

import numpy as np
import pytest

from weighbridge.signals import best_lag, find_lag, lag_std, lag_std_at, lowest, parabola

SHIFTS = np.arange(-2.0, 2.01, 0.25)


def found(misfit):
    return find_lag(misfit, -0.4, 1.2, farthest=2.4)


def test_the_lowest_point_is_found_between_grid_points():
    assert found(lambda d: (d - 0.137) ** 2) == pytest.approx(0.137, abs=1e-6)
    assert found(lambda d: abs(d - 0.213) ** 1.5) == pytest.approx(0.213, abs=0.005)


def test_no_lag_is_told_at_an_end_or_without_rows():
    assert np.isnan(found(lambda d: d))
    assert np.isnan(found(lambda d: float("nan")))


@pytest.mark.parametrize("true", [-1.37, -0.55, 1.83])
def test_the_search_goes_on_beyond_an_end(true):
    assert found(lambda d: (d - true) ** 2) == pytest.approx(true, abs=1e-6)
    assert np.isnan(find_lag(lambda d: (d - true) ** 2, -0.4, 1.2))


def test_the_search_goes_no_farther_than_its_farthest():
    tried = []
    assert np.isnan(found(lambda d: tried.append(d) or d))
    assert min(tried) == pytest.approx(-2.4)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_series_go_together_best_at_their_lag(sign):
    time = np.arange(0.0, 60.0, 0.1)
    moved = [sign * np.sin(1.1 * (time - 0.4 + shift)) for shift in SHIFTS]
    lag = best_lag(np.sin(1.1 * time), moved, SHIFTS)
    assert lag.at == pytest.approx(0.4, abs=0.02)
    assert sign * lag.correlation > 0.98


def test_series_whose_best_is_at_an_end_have_no_lag():
    time = np.arange(0.0, 60.0, 0.1)
    lag = best_lag(time**2, [(time + shift) ** 3 for shift in SHIFTS], SHIFTS)
    assert np.isnan(lag.at)


@pytest.mark.parametrize("points", [3, 9])
def test_the_parabola_is_exact_for_parabolas(points):
    x = 0.2 * np.arange(points) - 0.2
    assert parabola(x, 3.0 * (x - 0.07) ** 2 + 5.0) == pytest.approx((0.07, 6.0))
    assert lowest(x, 3.0 * (x - 0.07) ** 2 + 5.0) == pytest.approx((0.07, 5.0))
    assert lowest(x, x) == pytest.approx((-0.2, -0.2))


def test_the_parabola_ends_where_its_values_do():
    x = np.array([0.0, 0.1, 0.2])
    assert parabola(x, (x - 3.0) ** 2).at == pytest.approx(0.2)
    assert parabola(x, -((x - 0.1) ** 2)) == pytest.approx((0.1, -2.0))


def test_the_std_is_that_of_lags_found_in_noise():
    """Against the scatter of lags of a sine in white noise, each by its own search."""
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 20.0, 0.05)
    lags, stds = [], []
    for _ in range(300):
        seen = np.sin(time - 0.3) + rng.normal(0.0, 0.5, time.size)

        def left(lag, seen=seen):
            return float(np.mean((seen - np.sin(time - lag)) ** 2))

        lags.append(found(left))
        stds.append(lag_std_at(left, lags[-1], time.size))
    assert np.mean(lags) == pytest.approx(0.3, abs=0.01)
    assert np.mean(stds) == pytest.approx(np.std(lags), rel=0.12)


def test_what_does_not_bend_shows_no_lag():
    assert lag_std(1.0, 0.0, 100.0) == np.inf
    assert lag_std(1.0, 2.0, 0.0) == np.inf
