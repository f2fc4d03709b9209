"""Runs: of samples that a mask marks, and of one value in a signal."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from weighbridge.signals.signal import Bools, Floats, Ints, Signal


class Runs(NamedTuple):
    """Runs of equal samples, one after another.

    Attributes
    ----------
    first : (m,) index of the first sample of each
    length : (m,) samples in each
    duration : (m,) from its first to its last sample [s]
    """

    first: Ints
    length: Ints
    duration: Floats


def marked_runs(mask: Bools) -> tuple[Ints, Ints]:
    """Find the runs of True: index of the first of each (m,), and of the one behind its last."""
    edges = np.diff(np.concatenate(([0], mask.astype(np.int8), [0])))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)


def runs_of(signal: Signal) -> Runs:
    """Cut a signal with one sample or more into runs of equal values."""
    new = np.concatenate(([True], signal.values[1:] != signal.values[:-1]))
    first = np.flatnonzero(new)
    length = np.diff(np.concatenate((first, [len(signal)])))
    return Runs(first, length, signal.time[first + length - 1] - signal.time[first])
