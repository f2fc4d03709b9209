"""Where a reading was filled in by a logger, not measured."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.signals import Bools, Floats, Signal
from weighbridge.signals.runs import marked_runs

FILLED_TIME: Final = 10.0
"""A fast reading that runs straight for so long was filled in, not measured [s]."""

FINE: Final = 1e-3
"""Steps of a reading over its range, above which it may well stay on one step for long [-]."""

FILLED_RATE: Final = 5.0
"""Slower readings may well be constant for long [Hz]."""


def filled(signal: Signal, time: Floats) -> Bools:
    """Where a signal holds one value or runs straight for longer than a real one does.

    Loggers and makers of data sets fill gaps so, and the fill looks like data.

    Parameters
    ----------
    signal : sampled faster than `FILLED_RATE` and in steps below `FINE`, else nothing is said
    time : (n,) instants asked about [s]

    Returns
    -------
    (n,)
    """
    values = signal.values
    least = int(FILLED_TIME / signal.period) if len(signal) > 2 else 0
    if len(signal) < 3 or signal.period > 1.0 / FILLED_RATE or values.size <= least:
        return np.zeros(time.size, dtype=bool)
    steps = np.abs(np.diff(values))
    step = float(steps[steps > 0.0].min(initial=np.inf))
    if not step < FINE * float(np.ptp(values)):
        return np.zeros(time.size, dtype=bool)
    # Rounding lets a straight line bend by one step of the reading.
    tolerance = 1.01 * step
    straight = np.concatenate(([False], np.abs(np.diff(values, 2)) <= tolerance, [False]))
    # Idling and coasting read a constant zero for long, recuperation its limit.
    straight &= ~np.isin(values, (0.0, np.nanmin(values)))
    runs = np.zeros(values.size, dtype=bool)
    for begin, end in zip(*marked_runs(straight), strict=True):
        if end - begin >= least:
            runs[begin:end] = True
    index = np.clip(np.searchsorted(signal.time, time), 0, values.size - 1)
    return np.asarray(runs[index])
