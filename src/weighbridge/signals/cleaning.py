"""From recorded arrays to signals: finite values on a clock that only rises.

What had to be left out is counted and told, never silently mended.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from weighbridge.signals.drive import Problem
from weighbridge.signals.signal import Bools, Floats, Signal


@dataclass(frozen=True, slots=True)
class Clock:
    """A cleaned time axis, shared by the columns of one table.

    Attributes
    ----------
    time : (m,) strictly increasing, finite [s]
    keep : (n,) which of the recorded rows are on it; None where all are
    problems : what was left out
    """

    time: Floats
    keep: Bools | None
    problems: tuple[Problem, ...] = ()

    def select(self, values: Floats) -> Floats:
        """Return the values of the rows kept; no copy where all are."""
        return values if self.keep is None else values[self.keep]


def rising(time: Floats) -> Bools:
    """Mark the stamps of a strictly increasing part of a clock.

    One stamp that lags leaves itself out, one that leads leaves itself out
    too: of the parts found from the front (each stamp above all before) and
    from the back (each below all after) the larger one is taken.

    Parameters
    ----------
    time : (n,) finite [s]

    Returns
    -------
    (n,) bool
    """
    if time.size == 0:
        return np.zeros(0, dtype=bool)
    front = np.ones(time.size, dtype=bool)
    front[1:] = time[1:] > np.maximum.accumulate(time)[:-1]
    back = np.ones(time.size, dtype=bool)
    back[:-1] = time[:-1] < np.minimum.accumulate(time[::-1])[::-1][1:]
    return front if np.count_nonzero(front) >= np.count_nonzero(back) else back


def clean_clock(time: Floats, source: str) -> Clock:
    """Leave out stamps that are missing, repeated or out of order.

    Parameters
    ----------
    time : (n,) as recorded; NaN where missing [s]
    source : the file, for the problems' text

    Returns
    -------
    Clock
    """
    finite = np.isfinite(time)
    if finite.all() and (time[1:] > time[:-1]).all():
        return Clock(time, None)

    problems = []
    keep = finite.copy()
    if missing := int(time.size - np.count_nonzero(finite)):
        problems.append(
            Problem("", f"{source}: {missing} of {time.size} rows have no time and were left out")
        )
    present = time[finite]
    step = np.diff(present)
    repeated = int(np.count_nonzero(step == 0.0))
    good = rising(present)
    keep[finite] = good
    lost = int(present.size - np.count_nonzero(good))
    if repeated:
        problems.append(
            Problem(
                "",
                f"{source}: {repeated} of {time.size} time stamps repeat the one before; "
                "the later rows were left out",
            )
        )
    if lost > repeated:
        at = int(np.argmin(step))
        back = f"{-step[at]:.6g} s" if step[at] < 0.0 else "0 s"
        problems.append(
            Problem(
                "",
                f"{source}: the clock runs backwards (by up to {back}, at {present[at]:.6g} s); "
                f"{lost - repeated} of {time.size} rows were left out; "
                "split the file there if it holds two recordings",
            )
        )
    return Clock(time[keep], keep, tuple(problems))


def clean_columns(
    time: Floats, columns: Sequence[tuple[str, Floats]], source: str
) -> tuple[list[Signal], list[Problem]]:
    """Make signals of the columns of one table.

    Columns with the same rows present share one time array.

    Parameters
    ----------
    time : (n,) as recorded [s]
    columns : names and (n,) values in SI; NaN where a cell is empty
    source : the file, for the problems' text

    Returns
    -------
    signals : those with at least one sample
    problems : what was left out
    """
    clock = clean_clock(time, source)
    problems = list(clock.problems)
    signals: list[Signal] = []
    mask: Bools | None = None
    masked_time = clock.time
    for name, raw in columns:
        values = clock.select(raw)
        finite = np.isfinite(values)
        if finite.all():
            if values.size:
                signals.append(Signal(name, clock.time, values))
            continue
        if infinite := int(np.count_nonzero(np.isinf(values))):
            problems.append(
                Problem(
                    name,
                    f"{source}: {infinite} of {values.size} values of {name} are infinite "
                    "and were left out",
                )
            )
        if not finite.any():
            problems.append(Problem(name, f"{source}: {name} has no value in any row"))
            continue
        if mask is None or not np.array_equal(mask, finite):
            mask, masked_time = finite, clock.time[finite]
        signals.append(Signal(name, masked_time, values[finite]))
    return signals, problems


def clean_signal(
    name: str, time: Floats, values: Floats, source: str
) -> tuple[Signal | None, list[Problem]]:
    """Make one signal on a clock of its own; see `clean_columns`."""
    signals, problems = clean_columns(time, [(name, values)], source)
    return (signals[0] if signals else None), problems
