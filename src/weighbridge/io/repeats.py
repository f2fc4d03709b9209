"""One signal in several files of a drive: one after another, or recorded twice at the same time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from weighbridge.constants import EARTH_RADIUS
from weighbridge.errors import DriveError
from weighbridge.io.log import Log
from weighbridge.signals import QUANTITIES, Floats, Problem, Signal
from weighbridge.signals.instants import instant

_SPEEDS: Final = ("gnss_speed", "vehicle_speed")
_POSITION: Final = ("latitude", "longitude")

_WHOLE: Final = frozenset(("gnss", "imu", "ride"))
"""Tables of sensors that two devices of one drive may both have."""

_ALIKE: Final = 0.9
"""Correlation of one speed in two files of one drive, at least [-]."""

_APART: Final = 1.5
"""Root mean square by which they may differ: a receiver is late while the vehicle brakes [m/s]."""

_NEAR: Final = 50.0
"""How far positions of two receivers in one vehicle may lie apart, in the median [m]."""

_SHARED: Final = 0.7
"""Part of the longer of two records that both have [-]; beyond it one is no more than the other."""

_FEWEST: Final = 30
"""Values in common, at least."""


def settle_repeats(logs: Sequence[Log]) -> list[Problem]:
    """Keep one of two records of a sensor that two devices made of one drive at the same time.

    Whether it is one drive is seen from speed or position, which both have and which agree. What
    the vehicle itself shows is not chosen from: two logs of it may be those of two drives.

    Parameters
    ----------
    logs : of the drive, on one clock; those that lose signals are changed in place

    Returns
    -------
    What was left out of which file.
    """
    problems = []
    for i, j in _meeting(logs):
        a, b = logs[i], logs[j]
        twice = _recorded_twice(a, b)
        if not twice or not _one_drive(a, b):
            continue
        for table in dict.fromkeys(QUANTITIES[name].table for name in twice):
            names = [name for name in twice if QUANTITIES[name].table == table]
            kept, other = (a, b) if _better(a, b, table) else (b, a)
            other.signals = [s for s in other.signals if s.name not in names]
            problems.append(
                Problem.of(
                    "file.repeated",
                    first=kept.path.name,
                    second=other.path.name,
                    names=", ".join(names),
                )
            )
    return problems


def _meeting(logs: Sequence[Log]) -> list[tuple[int, int]]:
    """Pairs of files of which one begins before the other ends, by their places."""
    spans = [log.span for log in logs]
    by_begin = sorted(range(len(logs)), key=lambda k: spans[k][0])
    found = []
    for place, i in enumerate(by_begin):
        for j in by_begin[place + 1 :]:
            if spans[j][0] > spans[i][1]:
                break
            found.append((min(i, j), max(i, j)))
    return sorted(found)


def _recorded_twice(a: Log, b: Log) -> list[str]:
    """Quantities of a sensor that both files have at the same time."""
    second = {s.name: s for s in b.signals}
    return [
        x.name
        for x in a.signals
        if x.name in second and QUANTITIES[x.name].table in _WHOLE and _overlap(x, second[x.name])
    ]


def _overlap(x: Signal, y: Signal) -> bool:
    """Whether one of two records can stand for both: they share most of their time."""
    if not (len(x) and len(y)):
        return False
    shared = min(x.time[-1], y.time[-1]) - max(x.time[0], y.time[0])
    return bool(shared > _SHARED * max(x.duration, y.duration))


def _better(a: Log, b: Log, table: str) -> bool:
    """Whether the first of two files has more quantities of a table, else more values of it."""
    counts = []
    for log in (a, b):
        of_table = [len(s) for s in log.signals if QUANTITIES[s.name].table == table]
        counts.append((len(of_table), sum(of_table)))
    return counts[0] >= counts[1]


def _one_drive(a: Log, b: Log) -> bool:
    """Whether two files show the same motion."""
    first, second = ({s.name: s for s in log.signals} for log in (a, b))
    if all(name in signals for name in _POSITION for signals in (first, second)):
        return _one_place(first, second)
    mine = next((first[n] for n in _SPEEDS if n in first), None)
    other = next((second[n] for n in _SPEEDS if n in second), None)
    return mine is not None and other is not None and _one_speed(mine, other)


def _one_speed(x: Signal, y: Signal) -> bool:
    own, other = x.values, y.at(x.time)
    good = np.isfinite(own) & np.isfinite(other)
    own, other = own[good], other[good]
    if own.size < _FEWEST or min(np.ptp(own), np.ptp(other)) <= 0.0:
        return False
    apart = float(np.sqrt(np.mean((own - other) ** 2)))
    return bool(np.corrcoef(own, other)[0, 1] > _ALIKE and apart < _APART)


def _one_place(first: dict[str, Signal], second: dict[str, Signal]) -> bool:
    time = first["latitude"].time
    north, east = (first[n].at(time) - second[n].at(time) for n in _POSITION)
    way = EARTH_RADIUS * np.hypot(north, east * np.cos(first["latitude"].at(time)))
    way = way[np.isfinite(way)]
    return bool(way.size >= _FEWEST and np.median(way) < _NEAR)


def joined_signal(
    name: str, parts: list[tuple[Log, Signal]], clocks: dict[tuple[int, ...], Floats]
) -> Signal:
    """Put the pieces of one signal from several files one after another.

    Parameters
    ----------
    name : of the signal
    parts : its pieces, each with the file that has it
    clocks : joined stamps by those they are made of, so that signals go on sharing a clock

    Raises
    ------
    DriveError
        Two pieces overlap in time.
    """
    parts = sorted(parts, key=lambda p: float(p[1].time[0]))
    for (log_a, a), (log_b, b) in pairwise(parts):
        if b.time[0] <= a.time[-1]:
            raise DriveError(
                f"{name} is both in {log_a.path} (up to {instant(float(a.time[-1]))}) and "
                f"in {log_b.path} (from {instant(float(b.time[0]))}); read them as drives of "
                "their own, or leave one out: the file, or its column in the mapping"
            )
    key = tuple(id(s.time) for _, s in parts)
    if key not in clocks:
        clocks[key] = np.concatenate([s.time for _, s in parts])
    return Signal(name, clocks[key], np.concatenate([s.values for _, s in parts]))
