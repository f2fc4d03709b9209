"""Whether the signals that a drive needs arrive, and how fast."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.limits import STANDS
from weighbridge.live.records import Records
from weighbridge.live.source import Samples
from weighbridge.live.weighing import SILENT, SignalHealth
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.vehicle import TORQUE_SOURCES

if TYPE_CHECKING:
    from weighbridge.vehicle import Vehicle

_SPEEDS: Final = (("vehicle_speed",), ("gnss_speed",))


_INERTIAL: Final = "inertial sensor"
_POSITION: Final = "position"

_BY_SENSORS: Final = frozenset((*IMU_SIGNALS, "gnss_speed"))
"""Signals that come of sensors of their own, whether the vehicle reports or not."""

RATE_SPAN: Final = 10.0
"""Time over which the rate of a signal is measured [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Need:
    """Something that a drive needs.

    Attributes
    ----------
    name : for people
    sets : sets of signals, any of which does; the first is named where none comes
    why : what a drive without it lacks
    """

    name: str
    sets: tuple[tuple[str, ...], ...]
    why: str


def needs(vehicle: Vehicle | None = None) -> tuple[Need, ...]:
    """Return what a drive needs.

    Parameters
    ----------
    vehicle : whose torque source is needed; None for any source
    """
    sources = list(TORQUE_SOURCES.values())
    if vehicle is not None and vehicle.torque.stated:
        sources = [vehicle.torque.of_source]
    torque = tuple(dict.fromkeys(s for source in sources for s in (source.signals, *source.others)))
    geared = vehicle is None or not (
        vehicle.driveline.single_speed or all(source.gearing is not None for source in sources)
    )
    engine = Need(
        name="engine speed", sets=(("engine_speed",),), why="gears are not found without it"
    )
    return (
        Need(name="speed", sets=_SPEEDS, why="no drive is weighed without it"),
        Need(name="torque", sets=torque, why="the mass is not found without it"),
        *((engine,) if geared else ()),
        Need(name=_INERTIAL, sets=(IMU_SIGNALS,), why="the road's slope is uncertain"),
        Need(name=_POSITION, sets=(("latitude", "longitude"),), why="the heading is uncertain"),
    )


def needed_signals(vehicle: Vehicle, came: Iterable[str]) -> tuple[str, ...]:
    """Name the signals that a vehicle is weighed by on the way.

    Of what can be shown by several sets of signals it is the set that came, else the first. An
    inertial sensor is needed once it has come; without one the mass is that of all records so
    far, each time they are looked at.

    Parameters
    ----------
    vehicle
    came : names of the signals of which samples came
    """
    known = set(came)
    found: list[str] = []
    for need in needs(vehicle):
        whole = next((s for s in need.sets if known.issuperset(s)), None)
        if need.name == _POSITION or (need.name == _INERTIAL and known.isdisjoint(*need.sets)):
            continue
        found += whole or need.sets[0]
    return tuple(dict.fromkeys(found))


def health_of(
    records: Records, needed: tuple[str, ...], silence: float, *, parked: bool = False
) -> tuple[SignalHealth, ...]:
    """Return how each signal comes, those that are needed first.

    Parameters
    ----------
    records
    needed : of `needed_signals`
    silence : time since any sample came last [s]
    parked : whether the vehicle is, see `is_parked`
    """
    return tuple(
        SignalHealth(
            name=name,
            rate=records.rate(name, RATE_SPAN),
            age=_age(records, name, silence),
            period=float(records.gaps(name).max(initial=0.0)) or math.nan,
            late=records.late.get(name, 0),
            unfit=records.unfit.get(name, 0),
            needed=name in needed,
            rests=parked and math.isfinite(records.newest_of(name)),
        )
        for name in dict.fromkeys((*needed, *records.names()))
    )


def is_parked(records: Records, needed: tuple[str, ...], silence: float) -> bool:
    """Return whether a vehicle is parked: it stands, and has stopped reporting.

    It stands by the newest speed of any sensor. It reports while any signal that a weighing needs
    of it comes at least each `SILENT`; one that is off is asked much more seldom, and answers.

    Parameters
    ----------
    records
    needed : of `needed_signals`
    silence : time since any sample came last [s]
    """
    speeds = [name for names in _SPEEDS for name in names]
    last = max(speeds, key=records.newest_of)
    if not records.newest_value(last) <= STANDS:
        return False
    came = [
        name
        for name in needed
        if name not in _BY_SENSORS and math.isfinite(records.newest_of(name))
    ]
    return bool(came) and all(_pause(records, name, silence) > SILENT for name in came)


def _age(records: Records, name: str, silence: float) -> float:
    """Time since the newest sample of a signal [s]; infinite where none came."""
    now = records.newest + silence
    return now - records.newest_of(name) if math.isfinite(now) else math.inf


def _pause(records: Records, name: str, silence: float) -> float:
    """Time that a signal has paused, or before its newest sample did [s]."""
    gaps = records.gaps(name)
    return max(_age(records, name, silence), float(gaps[-1]) if gaps.size else 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrival:
    """How something that is needed arrives.

    Attributes
    ----------
    need : what
    signals : of the set that is complete, or nearest to it
    lacking : those of them that have not come
    rate : of the slowest that has come, by its stamps [Hz]; NaN below two samples
    """

    need: Need
    signals: tuple[str, ...]
    lacking: tuple[str, ...]
    rate: float


class Arrivals:
    """Counts samples of each signal as they come."""

    def __init__(self) -> None:
        self._count: dict[str, int] = {}
        self._first: dict[str, float] = {}
        self._last: dict[str, float] = {}

    def add(self, blocks: Iterable[Samples]) -> None:
        """Count the samples of some blocks; those that are not finite do not count."""
        for samples in blocks:
            for name, (time, values) in samples.items():
                known = np.asarray(time)[np.isfinite(time) & np.isfinite(values)]
                if known.size:
                    low, high = float(known.min()), float(known.max())
                    self._count[name] = self._count.get(name, 0) + int(known.size)
                    self._first[name] = min(self._first.get(name, low), low)
                    self._last[name] = max(self._last.get(name, high), high)

    @property
    def names(self) -> tuple[str, ...]:
        """Signals that have come."""
        return tuple(self._count)

    @property
    def count(self) -> int:
        """Samples that have come."""
        return sum(self._count.values())

    def rate(self, name: str) -> float:
        """Samples per second of a signal, by its stamps [Hz]; NaN below two samples."""
        count = self._count.get(name, 0)
        span = self._last.get(name, 0.0) - self._first.get(name, 0.0)
        return (count - 1) / span if count > 1 and span > 0.0 else float("nan")

    def of(self, need: Need) -> Arrival:
        """Return how something that is needed arrives."""
        lacking = [tuple(n for n in signals if n not in self._count) for signals in need.sets]
        best = min(range(len(lacking)), key=lambda k: len(lacking[k]) / len(need.sets[k]))
        rates = [self.rate(n) for n in need.sets[best] if n in self._count]
        known = [r for r in rates if r == r]
        return Arrival(
            need=need,
            signals=need.sets[best],
            lacking=lacking[best],
            rate=min(known) if known and len(known) == len(rates) else float("nan"),
        )
