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
# A sample means so long at most [s].
_STANDS_FOR: Final = 2.0
# A clock set forward in motion: all tables go on within so long, and speed as it was.
_AT_ONCE: Final = 5.0  # [s]
_MOVING: Final = 2.0  # [m/s]
_AS_BEFORE: Final = 3.0  # [m/s]
# Less of a recording is not worth joining [s].
_SHORTEST: Final = 10.0


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
    the samples is kept. The part before or after it is joined where the vehicle moved on at the
    same speed, so that the clock was set and the recording went on.

    Parameters
    ----------
    drive : well formed, its clocks in seconds

    Returns
    -------
    Drive
        The drive itself where nothing is wrong; else what was left out or joined is in its
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
        float(np.minimum(np.diff(clocks[p.clock][p.first : p.last]), _STANDS_FOR).sum())
        for p in part
    )


def _kept(
    drive: Drive, clocks: dict[int, Floats], tables: dict[int, str], parts: list[_Part], best: int
) -> Drive:
    """Take the best part, and its neighbours where the clock alone was set between them."""
    moved = {best: 0.0}
    for step in (-1, 1):
        k = best + step
        while 0 <= k < len(parts):
            before, after = (parts[k], parts[k - step])[::-step]
            by = _clock_set(drive, before, after, clocks, tables)
            if by is None:
                break
            moved[k] = moved[k - step] + step * -by
            k += step
    there = {p.clock for k in moved for p in parts[k]}
    cut: dict[int, list[tuple[int, int, float]]] = {}
    for k, by in sorted(moved.items()):
        for p in parts[k]:
            cut.setdefault(p.clock, []).append((p.first, p.last, by))
    for key in clocks.keys() - there:
        # A table that lies elsewhere as a whole: whoever compares the tables shows that.
        own = max((p for part in parts for p in part if p.clock == key), key=_samples)
        cut[key] = [(own.first, own.last, 0.0)]
    signals = {}
    shared: dict[int, Floats] = {}
    for name, s in drive.signals.items():
        key = id(s.time)
        pieces = cut.get(key)
        if pieces is None:
            signals[name] = s
            continue
        if key not in shared:
            shared[key] = np.concatenate([s.time[a:b] + by for a, b, by in pieces])
        signals[name] = Signal(
            name, shared[key], np.concatenate([s.values[a:b] for a, b, _ in pieces])
        )
    return replace(drive, signals=signals).with_problems(
        *_reported(clocks, tables, cut, parts, best, moved)
    )


def _samples(piece: _Piece) -> int:
    return piece.last - piece.first


def _clock_set(
    drive: Drive, before: _Part, after: _Part, clocks: dict[int, Floats], tables: dict[int, str]
) -> float | None:
    """By how much the clock was set between two parts in which the vehicle moved on [s]."""
    speed = drive.speed
    if speed is None:
        return None
    end, start = _end(before), _start(after)
    if min(end - _start(before), _end(after) - start) < _SHORTEST:
        return None
    if {tables[p.clock] for p in before} != {tables[p.clock] for p in after}:
        return None
    # Rarely sampled signals, such as a temperature, need not be there at once.
    last = {tables[p.clock]: -np.inf for p in before}
    first = {tables[p.clock]: np.inf for p in after}
    for p in before:
        last[tables[p.clock]] = max(last[tables[p.clock]], p.end)
    for p in after:
        first[tables[p.clock]] = min(first[tables[p.clock]], p.start)
    if min(last.values()) < end - _AT_ONCE or max(first.values()) > start + _AT_ONCE:
        return None
    k = int(np.searchsorted(speed.time, start))
    if not 0 < k < len(speed):
        return None
    v0, v1 = float(speed.values[k - 1]), float(speed.values[k])
    if min(v0, v1) < _MOVING or abs(v1 - v0) > _AS_BEFORE:
        return None
    # The fastest clock shows best how long the step was.
    fastest = min(float(np.median(np.diff(t))) for t in clocks.values() if t.size > 1)
    return start - end - fastest


def _reported(
    clocks: dict[int, Floats],
    tables: dict[int, str],
    cut: dict[int, list[tuple[int, int, float]]],
    parts: list[_Part],
    best: int,
    moved: dict[int, float],
) -> list[Problem]:
    """Say what was joined and what was left out."""
    start, end = _start(parts[best]), _end(parts[best])
    problems = []
    if len(moved) > 1:
        k = min(moved)
        at = _end(parts[k])
        problems.append(
            Problem.of(
                "clock.jump_joined", start=at, end=at, by=_start(parts[k + 1]) - at, at=instant(at)
            )
        )
    lost: dict[str, int] = {}
    for key, pieces in cut.items():
        missing = clocks[key].size - sum(b - a for a, b, _ in pieces)
        if missing:
            lost[tables[key]] = max(lost.get(tables[key], 0), missing)
    if lost:
        k = min(max(best, 1), len(parts) - 1)
        at, beyond = _end(parts[k - 1]), _start(parts[k])
        side = "after" if k == best else "before"
        rows = " and ".join(f"{n} of {table}" for table, n in lost.items())
        problems.append(
            Problem.of(
                "clock.jump_cut",
                start=start,
                end=end,
                by=beyond - at,
                at=instant(at),
                length=end - start,
                side=side,
                rows=rows,
            )
        )
    return problems


def _start(part: _Part) -> float:
    return min(p.start for p in part)


def _end(part: _Part) -> float:
    return max(p.end for p in part)
