"""Correlations beside those of NumPy."""

import numpy as np
import pytest

from weighbridge.signals.correlation import correlation, correlations, inner


def test_correlations_are_those_of_numpy():
    rng = np.random.default_rng(3)
    a = rng.normal(size=500) + 1e3
    others = [a + s * rng.normal(size=500) for s in (0.0, 0.5, 5.0)] + [-a]
    wanted = [np.corrcoef(a, b)[0, 1] for b in others]
    assert correlations(a, others) == pytest.approx(wanted, abs=1e-9)
    assert correlation(a, others[1]) == pytest.approx(wanted[1], abs=1e-9)
    assert inner(a, others[2]) == pytest.approx(float(np.dot(a, others[2])), rel=1e-12)


def test_what_does_not_vary_goes_with_nothing():
    a = np.arange(10.0)
    assert correlation(a, np.ones(10)) == 0.0
    assert correlation(np.ones(10), a) == 0.0
