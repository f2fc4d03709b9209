"""What the steps of a coarse torque reading leave uncertain in a mass."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from weighbridge.messages import Problem
from weighbridge.signals import Bools, Signal

FINE: Final = 0.025
"""Steps of a reading over its range that do no harm [-]: control units send 0.4 and 1 %."""

LEAST: Final = 0.01
"""Uncertainty below this is not reported [-]."""

ROUNDING: Final = 1.0 / math.sqrt(12.0)
"""Standard deviation of an even error over its step [-]."""


def coarse_std(source: Signal, usable: Bools) -> float:
    """Relative standard deviation of a mass by the steps of the torque's reading [-].

    Rounding down takes half a step of every reading, and nothing distinguishes it from rounding to
    the nearest: the error does not average, and goes with the mean reading of the rows that weigh.

    Parameters
    ----------
    source : as recorded, in its own unit, one sample per row
    usable : (n,) rows
    """
    if len(source) < 200 or not usable.any():
        return 0.0
    levels = np.unique(source.values)
    if levels.size < 3:
        return 0.0
    step, span = float(np.median(np.diff(levels))), float(np.ptp(levels))
    mean = float(np.nanmean(np.abs(source.values[usable])))
    if step < FINE * span or not mean > 0.0:
        return 0.0
    return ROUNDING * step / mean


def coarse_note(std: float) -> tuple[Problem, ...]:
    """Say what the steps leave uncertain; nothing where it is little."""
    if std <= LEAST:
        return ()
    return (Problem.of("torque.coarse", share=100.0 * std),)
