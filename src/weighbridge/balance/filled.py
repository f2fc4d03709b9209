"""Where a reading was filled in by a logger, not measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.signals import Bools, Signal
from weighbridge.signals.runs import marked_runs

FILLED_TIME: Final = 10.0
"""A fast reading that runs straight for so long was filled in, not measured [s]."""

FINE: Final = 1e-3
"""Steps of a reading over its range, above which it may well stay on one step for long [-]."""

FILLED_RATE: Final = 5.0
"""Slower readings may well be constant for long [Hz]."""


@dataclass(frozen=True, slots=True)
class Fill:
    """How a reading that was filled in would look on a drive.

    Attributes
    ----------
    least : samples that run straight from which on they were filled in
    tolerance : by which a straight line bends by rounding
    resting : readings that are constant for long: zero of idling, limit of recuperation
    """

    least: int
    tolerance: float
    resting: tuple[float, float]


def identify_fill(signal: Signal) -> Fill | None:
    """Find from a whole drive how filled readings would look; None where they cannot be seen.

    Parameters
    ----------
    signal : sampled faster than `FILLED_RATE` and in steps below `FINE`, else nothing is said
    """
    values = signal.values
    if len(signal) < 3 or signal.period > 1.0 / FILLED_RATE:
        return None
    least = int(FILLED_TIME / signal.period)
    steps = np.abs(np.diff(values))
    step = float(steps[steps > 0.0].min(initial=np.inf))
    if values.size <= least or not step < FINE * float(np.ptp(values)):
        return None
    # Rounding lets a straight line bend by one step of the reading.
    return Fill(least, 1.01 * step, (0.0, float(np.nanmin(values))))


def filled(signal: Signal, fill: Fill | None, *, forward: bool = False) -> Bools:
    """Where a signal holds one value or runs straight for longer than a real one does.

    Loggers and makers of data sets fill gaps so, and the fill looks like data.

    Parameters
    ----------
    signal : of n samples
    fill : of `identify_fill`
    forward : show a run only from where it has lasted so long, not from its begin

    Returns
    -------
    (n,)
    """
    values = signal.values
    if fill is None or values.size <= fill.least:
        return np.zeros(values.size, dtype=bool)
    straight = np.concatenate(([False], np.abs(np.diff(values, 2)) <= fill.tolerance, [False]))
    straight &= ~np.isin(values, fill.resting)
    runs = np.zeros(values.size, dtype=bool)
    for begin, end in zip(*marked_runs(straight), strict=True):
        if end - begin >= fill.least:
            runs[begin + (fill.least - 1 if forward else 0) : end] = True
    return runs
