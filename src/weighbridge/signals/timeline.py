"""One recording without the stamps that no recording makes: memory follows samples, not spans."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from weighbridge.messages import Problem
from weighbridge.signals.catalogue import QUANTITIES
from weighbridge.signals.cleaning import NO_DRIVE, clean_columns
from weighbridge.signals.drive import Drive
from weighbridge.signals.instants import instant
from weighbridge.signals.signal import Floats, Signal

# Shorter times without samples that part a recording, where long ones leave too little in it [s].
_LIMITS: Final = (NO_DRIVE, 3600.0, 600.0, 60.0)
# Span allowed: at least [s], and per time in which something was recorded [-].
_SPARE: Final = 12 * 3600.0
_IDLE: Final = 20.0
STANDS_FOR: Final = 2.0
"""A sample means so long at most [s]."""


@dataclass(frozen=True, slots=True)
class _Piece:
    """Samples ``first`` to ``last`` - 1 of one clock, from ``start`` to ``end`` [s]."""

    start: float
    end: float
    clock: int
    first: int
    last: int


_Part = list[_Piece]


def well_formed(drive: Drive) -> Drive:
    """Leave out stamps that do not rise and values that are not finite, in a drive not read."""
    good: dict[int, bool] = {}
    broken: dict[int, list[Signal]] = {}
    for s in drive.signals.values():
        key = id(s.time)
        if key not in good:
            with np.errstate(invalid="ignore"):
                good[key] = bool(np.isfinite(s.time).all() and (s.time[1:] > s.time[:-1]).all())
        if not good[key] or not np.isfinite(s.values).all():
            broken.setdefault(key, []).append(s)
    for group in broken.values():
        columns = [(s.name, s.values) for s in group]
        found, problems = clean_columns(group[0].time, columns, drive.name)
        drive = drive.without(*(name for name, _ in columns)).with_signals(*found)
        drive = drive.with_problems(*(p for p in problems if p not in drive.problems))
    return drive


def one_recording(drive: Drive) -> Drive:
    """Leave the stamps out that lie hours from the rest of a drive.

    A computer without a clock starts in 1970 and jumps to the date; a damaged stamp lies
    anywhere. Of the parts between which nothing was recorded for hours, the one with most of
    the samples is kept.

    Parameters
    ----------
    drive : well formed, its clocks in seconds

    Returns
    -------
    Drive
        The drive itself where nothing is wrong; else what was left out is in its
        ``problems``. Afterwards the time from first to last sample is bounded by the number of
        samples.
    """
    clocks = {id(s.time): s.time for s in drive.signals.values() if len(s)}
    if not clocks or drive.duration <= NO_DRIVE:
        return drive
    tables = {id(s.time): QUANTITIES[s.name].table for s in drive.signals.values() if len(s)}
    for limit in _LIMITS:
        parts = _parts(clocks, limit)
        best = max(range(len(parts)), key=lambda k: _weight(parts[k], clocks, tables))
        kept = parts[best]
        span = _end(kept) - _start(kept)
        if span <= max(_SPARE, _IDLE * _recorded(kept, clocks)):
            break
    if len(parts) == 1:
        return drive
    return _kept(drive, clocks, tables, parts, best)


def _parts(clocks: dict[int, Floats], limit: float) -> list[_Part]:
    """Part a recording where no clock has a sample for ``limit`` [s]; in order."""
    pieces = []
    for key, time in clocks.items():
        with np.errstate(over="ignore"):
            cuts = np.flatnonzero(np.diff(time) > limit) + 1
        bounds = [0, *cuts.tolist(), time.size]
        pieces += [
            _Piece(float(time[a]), float(time[b - 1]), key, a, b) for a, b in pairwise(bounds)
        ]
    pieces.sort(key=lambda p: p.start)
    parts: list[_Part] = []
    end = -np.inf
    for piece in pieces:
        if parts and piece.start - end <= limit:
            parts[-1].append(piece)
        else:
            parts.append([piece])
        end = max(end, piece.end)
    return parts


def _weight(part: _Part, clocks: dict[int, Floats], tables: dict[int, str]) -> float:
    """Sum over the tables of the part of their samples; all tables count alike."""
    share: dict[str, float] = {}
    for p in part:
        table = tables[p.clock]
        share[table] = share.get(table, 0.0) + (p.last - p.first) / clocks[p.clock].size / sum(
            t == table for t in tables.values()
        )
    return sum(share.values())


def _recorded(part: _Part, clocks: dict[int, Floats]) -> float:
    """Time for which the samples of the best clock of a part stand [s]."""
    return max(
        float(np.minimum(np.diff(clocks[p.clock][p.first : p.last]), STANDS_FOR).sum())
        for p in part
    )


def _kept(
    drive: Drive, clocks: dict[int, Floats], tables: dict[int, str], parts: list[_Part], best: int
) -> Drive:
    """Take the best part."""
    cut = {p.clock: (p.first, p.last) for p in parts[best]}
    for key in clocks.keys() - cut.keys():
        # A table that lies elsewhere as a whole: whoever compares the tables shows that.
        own = max((p for part in parts for p in part if p.clock == key), key=_samples)
        cut[key] = (own.first, own.last)
    shared = {key: clocks[key][first:last] for key, (first, last) in cut.items()}
    signals = {
        name: Signal(name, shared[id(s.time)], s.values[slice(*cut[id(s.time)])])
        if id(s.time) in cut
        else s
        for name, s in drive.signals.items()
    }
    return replace(drive, signals=signals).with_problems(
        *_left_out(clocks, tables, cut, parts, best)
    )


def _samples(piece: _Piece) -> int:
    return piece.last - piece.first


def _left_out(
    clocks: dict[int, Floats],
    tables: dict[int, str],
    cut: dict[int, tuple[int, int]],
    parts: list[_Part],
    best: int,
) -> list[Problem]:
    """Say what was left out; nothing where it is none."""
    lost: dict[str, int] = {}
    for key, (first, last) in cut.items():
        if missing := clocks[key].size - (last - first):
            lost[tables[key]] = max(lost.get(tables[key], 0), missing)
    if not lost:
        return []
    start, end = _start(parts[best]), _end(parts[best])
    k = min(max(best, 1), len(parts) - 1)
    at, beyond = _end(parts[k - 1]), _start(parts[k])
    return [
        Problem.of(
            "clock.jump_cut",
            start=start,
            end=end,
            by=beyond - at,
            at=instant(at),
            length=end - start,
            side="after" if k == best else "before",
            rows=" and ".join(f"{n} of {table}" for table, n in lost.items()),
        )
    ]


def _start(part: _Part) -> float:
    return min(p.start for p in part)


def _end(part: _Part) -> float:
    return max(p.end for p in part)
