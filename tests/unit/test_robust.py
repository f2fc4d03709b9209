"""Robust statistics against an optimiser of SciPy, and against what was put in."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import least_squares

from weighbridge.constants import HUBER
from weighbridge.signals import huber, resolution, robust_fit, robust_fits, spread


def test_fits_together_are_those_alone():
    """Some are settled at once, some after a few rounds, some never."""
    rng = np.random.default_rng(9)
    x = rng.uniform(0.0, 10.0, (6, 80))
    y = 3.0 * x + 5.0 + rng.standard_t(1.5, size=x.shape) * np.arange(6)[:, None]
    columns = np.stack([x, np.ones_like(x)], axis=2)
    found, weight = robust_fits(columns, y)
    alone = [robust_fit(*one) for one in zip(columns, y, strict=True)]
    assert_allclose(found, [one[0] for one in alone], rtol=1e-12)
    assert_allclose(weight, [one[1] for one in alone], rtol=1e-9)
    assert len({tuple(row) for row in weight.round(6).tolist()}) == 6


def test_a_fit_is_the_optimum_of_hubers_loss():
    rng = np.random.default_rng(8)
    x = rng.uniform(0.0, 10.0, 400)
    y = 3.0 * x + 5.0 + 0.1 * rng.standard_t(2.0, size=400)
    y[100:150] += 8.0
    columns = np.column_stack([x, np.ones_like(x)])
    found, weight = robust_fit(columns, y)
    scale = spread(y - columns @ found)
    optimum = least_squares(
        lambda p: y - columns @ p, (1.0, 0.0), loss="huber", f_scale=HUBER * scale, xtol=1e-12
    ).x
    assert_allclose(found, optimum, rtol=1e-3)
    assert_allclose(found, [3.0, 5.0], atol=0.1)
    assert weight[100:150].max() < 0.1
    assert weight.min() > 0.0


def test_a_perfect_fit_leaves_no_outlier():
    columns = np.column_stack([np.arange(50.0), np.ones(50)])
    found, weight = robust_fit(1e4 * columns, 1e4 * columns @ [2.0, 1.0])
    assert_allclose(found, [2.0, 1.0], rtol=1e-9)
    assert_array_equal(weight, 1.0)


def test_weights_fall_with_the_size_beyond_the_threshold():
    assert_allclose(huber(np.array([0.0, -1.0, 2.0, -4.0]), 1.0, 2.0), [1.0, 1.0, 1.0, 0.5])
    assert_allclose(huber(np.array([0.0, 1.0]), 0.0)[0], 1.0)


def test_spread_is_that_of_normal_values_without_outliers():
    values = np.random.default_rng(3).normal(scale=0.2, size=20_000)
    values[::50] = 1e6
    assert spread(values) == pytest.approx(0.2, rel=0.05)
    assert spread(values[:0]) == 0.0


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_resolution(kind):
    speed = np.linspace(0.0, 30.0, 500)
    steps = (np.round(speed * 3.6) / 3.6).astype(kind).astype(np.float64)
    assert resolution(steps) == pytest.approx(1 / 3.6, rel=1e-4)
    values = np.random.default_rng(2).uniform(0.0, 100.0, 5000)
    assert resolution(np.round(values / 0.39) * 0.39) == pytest.approx(0.39)
    assert resolution(np.random.default_rng(0).normal(size=500)) == 0.0
    # Far levels are many steps apart: what rounding adds up to there counts no more.
    accel = np.append(np.round(values / 100.0 / 0.0012) * 0.0012, [13.2, -12.0])
    assert resolution(accel.astype(kind).astype(np.float64)) == pytest.approx(0.0012, rel=1e-3)
    assert resolution(np.ones(10)) == 0.0
    assert resolution(np.zeros(10)) == 0.0
