"""From recorded arrays to signals: finite values on a clock that only rises.

What had to be left out is counted and reported, never silently corrected.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.messages import Problem
from weighbridge.signals.instants import instant
from weighbridge.signals.signal import Bools, Floats, Signal

Rows = NDArray[np.intp]

COARSE: Final = 0.05
"""Stamps in steps below this are as fine as a drive needs [s]."""

MOST_COARSE: Final = 20.0
"""Rows that are spread over a longer step stand too far from when they were recorded: a vehicle
starts, brakes and stops within it [s]."""

SHARED: Final = 0.25
"""Part of the rows with the stamp of the row before, from which the clock is coarse and the
stamps are no mistake [-]."""

NO_DRIVE: Final = 6 * 3600.0
"""Nothing of one drive is recorded for so long [s]."""

_STRAYS: Final = 0.01
"""Part of the rows from which stamps far from their neighbours are no mistake but a unit [-]."""

_DISORDER: Final = 0.02
"""Part of the rows out of order below which they are left out [-]."""

_FEWEST_RUNS: Final = 8
"""Fewer runs of rising stamps are recordings or clocks set anew, not rows out of order."""

_MIXED: Final = 8.0
"""Changes from run to run in the order of time, for each run: more, and runs report the same
time, so that the clock was set back. Shuffled rows have 2, those sorted as text 1 [-]."""

FEWEST_ROWS: Final = 20
"""Fewer rows do not show a coarse clock from repeated rows."""


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


def _strays(time: Floats) -> Bools:
    """Mark the few stamps that lie hours from both neighbours, (n,)."""
    with np.errstate(over="ignore"):
        far = np.abs(np.diff(time)) > NO_DRIVE
    alone = np.ones(time.size, dtype=bool)
    alone[1:] &= far
    alone[:-1] &= far
    return alone if 0 < np.count_nonzero(alone) <= _STRAYS * time.size else np.zeros_like(alone)


def order_of_time(time: Floats) -> Rows | None:
    """Order in which the stamps of rows rise, where whole rows were shuffled, sorted or reversed.

    Parameters
    ----------
    time : (n,) as recorded; NaN where missing [s]

    Returns
    -------
    (n,) rows, those without time last; None where few are out of order, where many share a
    stamp, or where the clock was set back and stamps come twice.
    """
    present = time[np.isfinite(time)]
    if present.size < FEWEST_ROWS or (np.diff(present) >= 0.0).all():
        return None
    falls = np.diff(present) < 0.0
    runs = int(np.count_nonzero(falls)) + 1
    lost = np.count_nonzero(~rising(present))
    if runs < _FEWEST_RUNS or lost < _DISORDER * present.size:
        return None
    run = np.concatenate(([0], np.cumsum(falls)))
    rows = np.argsort(present, kind="stable")
    shared = np.count_nonzero(np.diff(present[rows]) == 0.0)
    mixed = np.count_nonzero(np.diff(run[rows]))
    if shared > SHARED * present.size or mixed > _MIXED * runs:
        return None
    return np.argsort(time, kind="stable")


def sorted_by(time: Floats, columns: Sequence[tuple[str, Floats]]) -> str:
    """Name of the column whose values rise, or fall, from row to row where the time does not.

    No signal of a drive does so over many runs of its clock, but an odometer whose clock was set
    back; a table that was sorted does.

    Parameters
    ----------
    time : (n,) as recorded; NaN where missing [s]
    columns : names and (n,) values; NaN where a cell is empty

    Returns
    -------
    Empty where there is none.
    """
    timed = np.isfinite(time)
    if (np.diff(time[timed]) >= 0.0).all():
        return ""
    for name, raw in columns:
        if name == "odometer":
            continue
        there = timed & np.isfinite(raw)
        steps = np.diff(raw[there])
        falls = np.count_nonzero(np.diff(time[there]) < 0.0)
        if min(falls, np.count_nonzero(steps)) < _FEWEST_RUNS or steps.size < FEWEST_ROWS:
            continue
        if (steps >= 0.0).all() or (steps <= 0.0).all():
            return name
    return ""


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
    if missing := int(time.size - np.count_nonzero(finite)):
        problems.append(Problem.of("clock.no_time", source=source, missing=missing, rows=time.size))
    stray = _strays(time[finite])
    if count := int(np.count_nonzero(stray)):
        problems.append(
            Problem.of(
                "clock.stray",
                source=source,
                count=count,
                rows=time.size,
                first=time[finite][stray][0],
            )
        )
        finite[finite] = ~stray
    keep = finite.copy()
    present = time[finite]
    step = np.diff(present)
    repeated = int(np.count_nonzero(step == 0.0))
    good = rising(present)
    keep[finite] = good
    lost = int(present.size - np.count_nonzero(good))
    if repeated:
        problems.append(Problem.of("clock.repeated", source=source, count=repeated, rows=time.size))
    if lost > repeated:
        at = int(np.argmin(step))
        back = f"{-step[at]:.6g} s" if step[at] < 0.0 else "0 s"
        problems.append(
            Problem.of(
                "clock.backwards",
                source=source,
                back=back,
                at=instant(present[at]),
                lost=lost - repeated,
                rows=time.size,
            )
        )
    return Clock(time[keep], keep, tuple(problems))


def spread_rows(time: Floats) -> tuple[Floats, float] | None:
    """Spread rows that share the stamp of a coarse clock evenly over its step.

    A logger that writes several rows a second and stamps them in whole seconds gives each
    row the second it was written in. The rows of the first stamp are the last of their
    step, where they are fewer than usual.

    Parameters
    ----------
    time : (n,) as recorded; NaN where missing [s]

    Returns
    -------
    time : (n,) [s]
    step : of the clock [s]

    None where the clock is not coarse.
    """
    places = np.flatnonzero(np.isfinite(time))
    present = time[places]
    steps = np.diff(present)
    shared = np.count_nonzero(steps == 0.0)
    if present.size < FEWEST_ROWS or shared < SHARED * present.size:
        return None
    ahead = steps[steps > 0.0]
    if ahead.size < 2 or (step := float(ahead.min())) < COARSE:
        return None
    if (np.abs(ahead / step - np.rint(ahead / step)) > 1e-3).any():
        return None
    starts = np.flatnonzero(np.concatenate(([True], steps != 0.0)))
    count = np.diff(np.append(starts, present.size))
    usual = int(np.median(count))
    rank = np.arange(present.size) - np.repeat(starts, count)
    rank[: count[0]] += max(usual - int(count[0]), 0)
    size = np.maximum(
        count, np.where(np.isin(np.arange(count.size), (0, count.size - 1)), usual, 1)
    )
    spread = time.copy()
    spread[places] = present + step * rank / np.repeat(size, count)
    return spread, step


def _one_to_a_row(time: Floats, columns: Sequence[tuple[str, Floats]]) -> bool:
    """Whether stamps repeat only because values read together lie one to a row."""
    if len(columns) < 2 or not np.any(np.diff(time) == 0.0):
        return False
    for _, values in columns:
        stamps = time[np.isfinite(values)]
        if stamps.size < 2 or not (np.diff(stamps) > 0.0).all():
            return False
    return True


def _first_present(time: Floats, columns: Sequence[tuple[str, Floats]]) -> list[tuple[str, Floats]]:
    """Fill an empty cell from the next row with the same stamp that has one.

    Of rows that share a stamp the first is kept, and it may be the empty one.
    """
    same = np.flatnonzero(time[1:] == time[:-1]) + 1
    if not same.size:
        return list(columns)
    start = np.arange(time.size)
    start[same] = 0
    start = np.maximum.accumulate(start)
    filled = []
    for name, raw in columns:
        # From the back, so that of several rows the earliest is written last.
        rows = same[np.isfinite(raw[same]) & ~np.isfinite(raw[start[same]])][::-1]
        if rows.size:
            raw = raw.copy()
            raw[start[rows]] = raw[rows]
        filled.append((name, raw))
    return filled


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
    signals: list[Signal] = []
    if _one_to_a_row(time, columns):
        for name, raw in columns:
            there = np.isfinite(raw)
            signals.append(Signal(name, time[there], raw[there]))
        return signals, []
    problems: list[Problem] = []
    order, by = order_of_time(time), "not in the order of their time"
    if order is None and (name := sorted_by(time, columns)):
        order, by = np.argsort(time, kind="stable"), f"sorted by {name}, not by time"
    if order is not None:
        time, columns = time[order], [(name, raw[order]) for name, raw in columns]
        problems.append(Problem.of("clock.sorted", source=source, by=by))
    coarse = spread_rows(time)
    if coarse is not None:
        time, step = coarse
        blind = step > MOST_COARSE
        id = "clock.minutes" if blind else "clock.coarse"
        problems.append(Problem.of(id, serious=blind, source=source, step=step))
    columns = _first_present(time, columns)
    clock = clean_clock(time, source)
    problems += clock.problems
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
                Problem.of(
                    "file.infinite", name, source=source, count=infinite, samples=values.size
                )
            )
        if not finite.any():
            problems.append(Problem.of("file.empty_column", name, source=source))
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
