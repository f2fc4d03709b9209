"""Quantiles of Student's distribution, without a library that is slow to load."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Final

import numpy as np

NORMAL: Final = 1e6
"""With more degrees of freedom it is the normal distribution, to five digits."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)
"""Of Gauss and Legendre's rule between -1 and 1 [-]."""


def student_quantile(freedom: float, probability: float) -> float:
    """Value that a variable of Student's distribution is below with a probability.

    With ``x = sqrt(freedom) tan(angle)`` its density is a power of a cosine, which is integrated by
    Gauss and Legendre's rule, and the angle is found by Newton's method.

    To five digits, of probabilities from 0.0005 to 0.9995.

    Parameters
    ----------
    freedom : degrees of freedom, at least 1; infinite for the normal distribution
    probability : between 0 and 1

    References
    ----------
    Abramowitz and Stegun, Handbook of Mathematical Functions, 1964, eqs. 26.7.1 and 25.4.29.
    """
    normal = NormalDist().inv_cdf(probability)
    if not freedom < NORMAL:
        return normal
    if probability < 0.5:
        return -student_quantile(freedom, 1.0 - probability)
    scale = math.exp(math.lgamma(0.5 * freedom + 0.5) - math.lgamma(0.5 * freedom))
    scale /= math.sqrt(math.pi)
    # The normal quantile is too low, and from below the steps never go beyond.
    angle = math.atan(normal / math.sqrt(freedom))
    for _ in range(100):
        inside = np.cos(0.5 * angle * (_NODES + 1.0)) ** (freedom - 1.0)
        below = 0.5 + scale * 0.5 * angle * float(_WEIGHTS @ inside)
        step = (probability - below) / (scale * math.cos(angle) ** (freedom - 1.0))
        angle += step
        if abs(step) < 1e-12:
            break
    return math.sqrt(freedom) * math.tan(angle)
