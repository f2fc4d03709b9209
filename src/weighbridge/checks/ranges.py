"""Values that no road vehicle can have are left out of use, not only reported."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from weighbridge.checks.needed import needed, show
from weighbridge.messages import phrase
from weighbridge.signals import QUANTITIES, Bools, Drive, Problem, Signal
from weighbridge.signals.instants import instant
from weighbridge.vehicle import Vehicle

FEW: Final = 0.01
"""Part of the values outside their range from which the unit is uncertain, and the mass
withheld."""

# Times the range's larger bound: no unit under another's name is so far off (units differ by 3600
# at most), and squares and cubes of what is left cannot overflow.
_ABSURD: Final = 1e4


def without_strays(drive: Drive, vehicle: Vehicle | None) -> Drive:
    """Leave out the few values outside the physical range, and those beyond any unit.

    More than a hundredth of a signal is left for the checks, which know what another unit would
    make of it; what no unit explains is left out whatever its number, and is serious in a signal
    the mass is made from.

    Returns
    -------
    Drive
        With what was left out in its ``problems``; itself where nothing was.
    """
    made_of: frozenset[str] | None = None
    for s in drive.signals.values():
        outside = _outside(s)
        if outside is None:
            continue
        trusted = s.name in drive.info.trusted
        absurd = np.abs(s.values) > _ABSURD * _bound(s.name)
        few = np.count_nonzero(outside) <= FEW * len(s)
        out = outside if few and not trusted else absurd
        if not out.any():
            continue
        made_of = made_of if made_of is not None else needed(drive, vehicle)
        serious = not few and not trusted and s.name in made_of
        drive = _cut(drive, s, out, serious=serious)
    return drive


def within_ranges(drive: Drive) -> Drive:
    """Leave out every value outside the physical range that the checks let pass."""
    for s in drive.signals.values():
        outside = None if s.name in drive.info.trusted else _outside(s)
        if outside is not None:
            drive = _cut(drive, s, outside, noted=False)
    return drive


def check_range(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find values no road vehicle can have: many of them are another unit."""
    made_of = needed(drive, vehicle)
    for s in drive.signals.values():
        out = _outside(s)
        if out is not None:
            many = bool(np.count_nonzero(out) > FEW * len(s))
            yield _problem(s, out, "", serious=many and s.name in made_of)


def _bound(name: str) -> float:
    q = QUANTITIES[name]
    return max(abs(q.low), abs(q.high))


def _outside(s: Signal) -> Bools | None:
    """Mark values outside the range (n,); None where there are none."""
    q = QUANTITIES[s.name]
    if not len(s) or (float(s.values.min()) >= q.low and float(s.values.max()) <= q.high):
        return None
    return np.asarray((s.values < q.low) | (s.values > q.high))


def _cut(
    drive: Drive, s: Signal, out: Bools, *, serious: bool = False, noted: bool = True
) -> Drive:
    if noted:
        drive = drive.with_problems(_problem(s, out, phrase("left_out"), serious=serious))
    if out.all():
        return drive.without(s.name)
    return drive.with_signals(Signal(s.name, s.time[~out], s.values[~out]))


def _problem(s: Signal, out: Bools, done: str, *, serious: bool) -> Problem:
    q = QUANTITIES[s.name]
    k = int(np.argmax(np.where(out, np.abs(s.values), -1.0)))
    return Problem.of(
        "range.outside",
        s.name,
        serious=serious,
        count=np.count_nonzero(out),
        samples=len(s),
        low=show(s.name, q.low),
        high=show(s.name, q.high),
        value=show(s.name, float(s.values[k])),
        at=instant(s.time[k]),
        done=done,
    )
