"""Does an answer follow the load? Slope and rank correlation of answers over true masses."""

from __future__ import annotations

import numpy as np
from scipy.stats import spearmanr

from weighbridge.signals import Floats


def slope(masses: Floats, answers: Floats) -> tuple[float, float]:
    """Regress answers on true masses.

    Parameters
    ----------
    masses, answers : (n,) [kg]

    Returns
    -------
    slope, std : kg answered per kg loaded, and its standard error [-]
    """
    away = masses - masses.mean()
    power = float(np.sum(away**2))
    found = float(away @ answers) / power
    residual = answers - answers.mean() - found * away
    return found, float(np.sqrt(residual @ residual / (masses.size - 2) / power))


def rank_correlation(masses: Floats, answers: Floats) -> float:
    """Spearman's: 1 where heavier drives always get heavier answers; wild answers do no harm."""
    return float(spearmanr(masses, answers).statistic)
