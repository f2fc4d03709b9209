"""Leave out the few samples that leap away and return at once, as no vehicle does."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from weighbridge.checks.needed import show
from weighbridge.checks.ranges import FEW
from weighbridge.signals import Bools, Drive, Floats, Problem, Signal
from weighbridge.signals.instants import instant

FEW_ZEROS: Final = 0.1
"""Part of the samples up to which zeros are few [-]; a bus writes them where it has no value.
"""

LONGEST: Final = 3
"""Samples of a spike at most."""

_LASTS: Final = 2.0
"""Time between its neighbours at most, or four periods of a slow signal [s]."""


class _Limit(NamedTuple):
    """How fast a signal changes at most [per s], and by how much it may jump beside that."""

    rate: float
    jump: float


# Tyres hold 10 m/s^2; a free engine gains 3000 rad/s^2 at most, and shifts within 0.2 s.
_LIMITS: Final = {
    "vehicle_speed": _Limit(25.0, 4.0),
    "gnss_speed": _Limit(25.0, 4.0),
    "engine_speed": _Limit(1500.0, 150.0),
}

# Between two samples of one speed, to stop and to be as fast again takes twice its loss by grip.
_GRIP: Final = {name: _Limit(6.0, 1.0) for name in ("vehicle_speed", "gnss_speed")}


def without_spikes(drive: Drive) -> Drive:
    """Leave out spikes of speed and engine speed where they are few.

    Both neighbours of a spike are alike, and further from it than the quantity can change.

    Returns
    -------
    Drive
        With what was left out in its ``problems``; itself where nothing was.
    """
    for name, limit in _LIMITS.items():
        signal = drive.get(name)
        if signal is None or len(signal) < 20 or name in drive.info.trusted:
            continue
        marked = np.zeros(len(signal), dtype=bool)
        if name in _GRIP:
            # First, so that a true sample between two zeros is no spike.
            marked = spikes(signal.time, signal.values, *_GRIP[name]) & (signal.values == 0.0)
            if np.count_nonzero(marked) > FEW_ZEROS * len(signal):
                continue
        rest = np.flatnonzero(~marked)
        leaps = spikes(signal.time[rest], signal.values[rest], limit.rate, limit.jump)
        if np.count_nonzero(leaps) <= max(1.0, FEW * len(signal)):
            marked[rest[leaps]] = True
        count = int(np.count_nonzero(marked))
        if not count:
            continue
        worst = int(np.flatnonzero(marked)[np.argmax(np.abs(signal.values[marked]))])
        drive = drive.with_signals(
            Signal(name, signal.time[~marked], signal.values[~marked])
        ).with_problems(
            Problem.of(
                "range.spikes",
                name,
                start=signal.time[worst],
                end=signal.time[worst],
                count=count,
                samples=len(signal),
                value=show(name, float(signal.values[worst])),
                at=instant(signal.time[worst]),
            )
        )
    return drive


def spikes(time: Floats, values: Floats, rate: float, jump: float) -> Bools:
    """Mark samples that stand alone, up to `LONGEST` in a row.

    Parameters
    ----------
    time : (n,) rising [s]
    values : (n,)
    rate : largest change of the quantity per second
    jump : what it may leap beside that

    Returns
    -------
    (n,) bool
    """
    marked = np.zeros(values.size, dtype=bool)
    period = float(np.median(np.diff(time)))
    for length in range(1, LONGEST + 1):
        if values.size < length + 2:
            break
        first = np.flatnonzero(np.abs(np.diff(values[: values.size - length])) > jump) + 1
        last = first + length - 1
        before, after = values[first - 1], values[last + 1]
        inside = np.stack([values[first + k] for k in range(length)])
        away = np.minimum(np.abs(inside - before), np.abs(inside - after)).min(axis=0)
        lasts = time[last + 1] - time[first - 1]
        alone = away > jump + rate * np.maximum(lasts, period)
        # To one side only, and the neighbours alike.
        alone &= (inside > before).all(axis=0) == (inside > after).all(axis=0)
        alone &= np.abs(after - before) < 0.25 * away
        alone &= lasts <= max(_LASTS, 4.0 * period)
        for k in range(length):
            marked[first[alone] + k] = True
    return marked
