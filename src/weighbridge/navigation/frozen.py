"""Stretches in which an axis of the inertial sensor repeats one value though the vehicle moves."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from weighbridge.limits import MANY, MOVES
from weighbridge.signals import Bools, Drive, Floats, Signal
from weighbridge.signals.runs import marked_runs

SHORTEST: Final = 0.5
"""Shorter runs are bridged by the samples around them, as gaps are [s]."""

_RARE: Final = 1e-9
"""Chance of a run below which no rounding explains it [-]."""

_LONG: Final = 1.0
"""Runs as long say nothing of how often neighbours are alike by rounding [s]."""

_COARSE: Final = 0.5
"""With a larger share of neighbours alike, rounding hides small motion altogether [-]:"""

_COARSE_RUN: Final = 20.0
"""only longer runs are no smooth road [s]."""


def frozen_stretches(signal: Signal, speed: Signal | None) -> Floats:
    """Find where an inertial axis repeats one value for longer than rounding explains.

    Neighbours of a coarse sensor are often alike; the share of such neighbours outside of long
    runs says how long a run may be. A sensor at rest may repeat itself, so only runs during
    which the vehicle moves count.

    Parameters
    ----------
    signal : one axis
    speed : shows motion; without it every such run counts

    Returns
    -------
    (k, 2) first and last instant of each stretch [s]
    """
    nothing = np.empty((0, 2))
    if signal.longest_repeat < SHORTEST:
        return nothing
    same = signal.values[1:] == signal.values[:-1]
    first, last = marked_runs(same)
    length = signal.time[last] - signal.time[first]
    repeats = last - first
    short = length < _LONG
    others = same.size - int(repeats[~short].sum())
    share = float(repeats[short].sum()) / others if others > 0 else 0.0
    fewest = np.log(_RARE) / np.log(share) if 0.0 < share < 1.0 else 1.0
    shortest = _COARSE_RUN if share > _COARSE else SHORTEST
    long = (length >= shortest) & (repeats > max(fewest, 4.0))
    first, last = first[long], last[long]
    found = np.column_stack([signal.time[first], signal.time[last]])
    if speed is None or not len(speed) or not found.size:
        return found
    fast = speed.time[np.abs(speed.values) > MOVES]
    # The speed is rounded and late: what it says at the very ends does not count.
    begun = np.searchsorted(fast, found[:, 0] + 0.5 * SHORTEST)
    ended = np.searchsorted(fast, found[:, 1] - 0.5 * SHORTEST, side="right")
    return np.asarray(found[ended > begun])


def inside(stretches: Floats, time: Floats) -> Bools:
    """Mark the instants (n,) that lie in one of the stretches (k, 2), ends included."""
    if not stretches.size:
        return np.zeros(time.size, dtype=bool)
    k = np.searchsorted(stretches[:, 0], time, side="right") - 1
    return np.asarray((k >= 0) & (time <= stretches[np.maximum(k, 0), 1]))


def without_frozen(drive: Drive, names: Iterable[str]) -> Drive:
    """Leave the frozen stretches out of the axes named; a drive without any is returned as is."""
    speed = drive.speed
    corrected = []
    for name in names:
        s = drive.get(name)
        if s is None or len(s) < 2:
            continue
        lost = inside(frozen_stretches(s, speed), s.time)
        if lost.any() and np.count_nonzero(~lost) >= MANY:
            corrected.append(Signal(name, s.time[~lost], s.values[~lost]))
    return drive.with_signals(*corrected) if corrected else drive
