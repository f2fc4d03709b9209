"""The last seconds of a drive, for stages that go forward with it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from weighbridge.signals.catalogue import QUANTITIES
from weighbridge.signals.drive import ClockShift, Drive
from weighbridge.signals.signal import Floats, Signal

STEPS: Final = (0.25, 0.5, 1.0, 2.0, 4.0)
"""The stages take a drive in steps between whole multiples of one of these [s]: powers of two, so
that no sum of them is rounded."""

STEP: Final = 1.0
"""The one of them that they take unless another is asked for [s]."""

LONGEST_STEP: Final = STEPS[-1]
"""The one that they take where nobody waits for what is shown on the way [s]."""

BEHIND: Final = 15.0
"""They look back so far [s]: a reading that runs straight for 10 s was filled in, and filters
have forgotten by then."""

FEWEST_SAMPLES: Final = 16
"""They see so many samples of a slow signal at least, however old."""


def recent(drive: Drive, until: float, step: float = STEP) -> Drive:
    """Return the part of a drive that a ``step`` up to ``until`` [s] reads; no signal is copied."""
    cut = {}
    for name, s in drive.signals.items():
        first, last = s.time.searchsorted([until - step - BEHIND, until])
        first = max(min(first, last - FEWEST_SAMPLES), 0)
        if last > first:
            cut[name] = Signal(name, s.time[first:last], s.values[first:last])
    return replace(drive, signals=cut)


def shifted(drive: Drive, shifts: Mapping[str, ClockShift]) -> Drive:
    """Bring tables onto the clock of the others; signals that share stamps go on sharing them.

    Parameters
    ----------
    drive : or the last seconds of one
    shifts : by table
    """
    clocks: dict[int, Floats] = {}
    moved = []
    for name, s in drive.signals.items():
        shift = shifts.get(QUANTITIES[name].table)
        if shift is not None:
            time = clocks.get(id(s.time))
            clocks[id(s.time)] = time = shift.onto(s.time) if time is None else time
            moved.append(Signal(name, time, s.values))
    return drive.with_signals(*moved) if moved else drive


def looking(drive: Drive, ahead: float, periods: Mapping[str, float]) -> Drive:
    """Return a drive whose signals are read no further than ``ahead`` past an instant [s].

    So each row is the same, whether the rest of the drive is there or still to come.

    Parameters
    ----------
    drive : or the last seconds of one
    ahead : [s]
    periods : median time between samples of each signal of the whole drive [s]
    """
    seen = {
        name: Signal(name, s.time, s.values, ahead, periods.get(name))
        for name, s in drive.signals.items()
    }
    return replace(drive, signals=seen)


def first_instant(time: float, step: float = STEP) -> float:
    """Return the end of the ``step`` that an instant lies in [s]."""
    return (math.floor(time / step) + 1) * step


def last_instant(time: float) -> float:
    """Return where the last step ends of a drive that ends at an instant [s]: it is shorter."""
    return math.floor(time / STEPS[0]) * STEPS[0]


def step_ends(drive: Drive, step: float = STEP) -> Floats:
    """Ends of the steps (n,) of so long that a drive is taken in [s].

    There are none where all signals have been silent for longer than `BEHIND`.
    """
    stamps = [s.time for s in drive.signals.values() if len(s)]
    if not stamps:
        return np.empty(0)
    steps = np.unique(np.concatenate([np.floor(t / step) for t in stamps]))
    after = 1.0 + np.arange(round(BEHIND / step) + 1)
    ends = np.append(np.unique(steps[:, None] + after) * step, last_instant(drive.end))
    return np.unique(ends[ends <= drive.end])
