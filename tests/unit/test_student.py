"""Quantiles of Student's distribution against those of SciPy."""

import math

import pytest
from scipy.special import stdtrit

from weighbridge.signals import student_quantile


@pytest.mark.parametrize("freedom", [1.0, 1.7, 2.0, 3.4, 8.0, 29.0, 400.0, 9e4, 2e6, math.inf])
@pytest.mark.parametrize("probability", [0.01, 0.3, 0.5, 0.84, 0.975, 0.9995])
def test_quantiles_are_those_of_scipy(freedom, probability):
    known = float(stdtrit(min(freedom, 1e12), probability))
    assert student_quantile(freedom, probability) == pytest.approx(known, rel=5e-6, abs=1e-12)


def test_more_freedom_is_closer_to_the_normal_distribution():
    found = [student_quantile(freedom, 0.975) for freedom in (2.0, 5.0, 50.0, math.inf)]
    assert found == sorted(found, reverse=True)
    assert found[-1] == pytest.approx(1.959964, abs=1e-6)
