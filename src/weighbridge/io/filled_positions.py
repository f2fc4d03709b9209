"""Positions that a table on one clock fills in between fixes: only the fixes are taken.

Tools that lay all signals of a log on one clock draw straight lines from fix to fix, through gaps
as well. A fix is where the line bends.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from weighbridge.messages import phrase
from weighbridge.signals import QUANTITIES, Bools, Floats, Ints, Problem, Signal

SHORTEST: Final = 0.005
"""Rows nearer together are not looked at one by one [s]: too short to see a bend between."""

ROUNDING: Final = 64.0 * np.finfo(float).eps
"""Part of a position by which a filled one may be off its line [-]: what interpolation rounds."""

STRAIGHT: Final = 0.7
"""Part of the rows of a moving position that lie on a line, from which it was filled [-]: one that
was recorded has noise in each row."""

FEWEST: Final = 200
"""Rows of a moving position below which nothing is said."""

GAP: Final = 3.0
"""Longer than so many times from fix to fix is a gap."""


def true_fixes(signals: Mapping[str, Signal]) -> tuple[dict[str, Signal], list[Problem]]:
    """Leave out what was filled in between fixes.

    Parameters
    ----------
    signals : of a drive, by name

    Returns
    -------
    signals : those of the GNSS table at the fixes alone, where the rest was filled in
    problems : what was left out
    """
    found = dict(signals)
    latitude, longitude = signals.get("latitude"), signals.get("longitude")
    if latitude is None or longitude is None or len(latitude) < FEWEST:
        return found, []
    time = latitude.time
    if not np.array_equal(time, longitude.time):
        return found, []
    fixes = fix_rows(time, np.column_stack((latitude.values, longitude.values)))
    if fixes is None or fixes.size < 2:
        return found, []
    stamps = time[fixes]
    for name, signal in signals.items():
        if QUANTITIES[name].table == "gnss":
            rows = np.isin(signal.time, stamps)
            if np.count_nonzero(rows) > 0.5 * stamps.size:
                found[name] = Signal(name, signal.time[rows], signal.values[rows])
    steps = np.diff(stamps)
    period = float(np.median(steps))
    gaps = steps[steps > GAP * period]
    more = phrase("filled_gaps", longest=gaps.max()) if gaps.size else ""
    text = Problem.of(
        "position.filled",
        "latitude",
        positions=time.size,
        fixes=stamps.size,
        period=period,
        more=more,
    )
    return found, [text]


def fix_rows(time: Floats, position: Floats) -> Ints | None:
    """Find the rows at which the straight lines of a position meet.

    Parameters
    ----------
    time : (n,) rising [s]
    position : (n, 2) latitude and longitude [rad]

    Returns
    -------
    Rows of the fixes; None where the position was not filled in
    """
    slot = np.floor((time - time[0]) / SHORTEST)
    rows = np.flatnonzero(np.diff(slot, prepend=-1.0) > 0.0)
    if rows.size < FEWEST:
        return None
    off, bends = _bends(time[rows], position[rows])
    moving = np.any(np.diff(position[rows], axis=0)[1:] != 0.0, axis=1)
    if np.count_nonzero(moving) < FEWEST or np.mean(~bends[moving]) < STRAIGHT:
        return None
    inside = np.flatnonzero(bends) + 1
    # A bend between two rows shows at both; the nearer one shows it more.
    first = np.flatnonzero(np.diff(inside, prepend=-2) > 1)
    group = np.cumsum(np.isin(np.arange(inside.size), first)) - 1
    order = np.lexsort((-off[bends], group))
    best = inside[order[np.unique(group[order], return_index=True)[1]]]
    return rows[_with_stops(time[rows], position[rows], best)]


def _bends(time: Floats, position: Floats) -> tuple[Floats, Bools]:
    """How far each row but the ends lies off the line of its neighbours, and whether it bends."""
    share = ((time[1:-1] - time[:-2]) / (time[2:] - time[:-2]))[:, None]
    line = position[:-2] + share * (position[2:] - position[:-2])
    off = np.abs(position[1:-1] - line)
    bound = ROUNDING * np.max(np.abs(position), axis=0)
    return np.max(off / np.maximum(bound, np.finfo(float).tiny), axis=1), np.any(
        off > bound, axis=1
    )


def _with_stops(time: Floats, position: Floats, fixes: Ints) -> Ints:
    """Add rows as often as fixes come where the position stands still from one to the next."""
    if fixes.size < 2:
        return fixes
    period = float(np.median(np.diff(time[fixes])))
    interval = np.searchsorted(fixes, np.arange(time.size), side="right") - 1
    inside = (interval >= 0) & (interval < fixes.size - 1)
    place = np.clip(interval, 0, fixes.size - 2)
    # The rows at a bend may lie a little before or behind it.
    still = np.all(position[fixes[:-1] + 1] == position[fixes[1:] - 1], axis=1)
    number = np.floor((time - time[fixes][place]) / period)
    ahead = time[fixes][place + 1] - time
    fresh = np.diff(number, prepend=0.0) > 0.0
    extra = np.flatnonzero(inside & still[place] & fresh & (ahead > 0.5 * period))
    return np.union1d(fixes, extra)
