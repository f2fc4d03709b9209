"""One recording of one vehicle."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from typing import Final, NamedTuple

import numpy as np

from weighbridge.arguments import (
    check_all,
    check_number,
    check_text,
    check_texts,
    check_type,
)
from weighbridge.messages import Problem
from weighbridge.signals.shown import at_rate, in_html, in_lines, plural
from weighbridge.signals.signal import Floats, Signal

_NUMBERS: Final = (
    "mass",
    "ambient_temperature",
    "barometric_pressure",
    "wind_speed",
    "wind_from",
)
"""Fields of `DriveInfo` that are numbers."""


@dataclass(frozen=True, slots=True)
class DriveInfo:
    """What is known about a drive besides its signals (``drive.toml``).

    Attributes
    ----------
    start_time : when its clock was at 0 s, ISO 8601; in UTC where it names no zone
    vehicle : name of the vehicle
    mass : known mass [kg]
    ambient_temperature : [K]
    barometric_pressure : [Pa]
    wind_speed : reported wind at 10 m height [m/s]
    wind_from : direction the wind blows from, clockwise from north [rad]
    notes : free text
    trusted : signals with values and units that are right, even if they look wrong
    """

    start_time: str | None = None
    vehicle: str | None = None
    mass: float | None = None
    ambient_temperature: float | None = None
    barometric_pressure: float | None = None
    wind_speed: float | None = None
    wind_from: float | None = None
    notes: str | None = None
    trusted: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("start_time", "vehicle", "notes"):
            check_text(name, getattr(self, name), optional=True)
        for name in _NUMBERS:
            check_number(name, getattr(self, name), optional=True)
        check_texts("trusted", self.trusted)


class ClockShift(NamedTuple):
    """How the stamps of a table are brought onto the clock of the others.

    Attributes
    ----------
    at : a stamp [s]
    by : what is added to it [s]
    drift : what is added more for each second after it [-]
    """

    at: float
    by: float
    drift: float = 0.0

    def onto(self, time: Floats) -> Floats:
        """Move stamps (n,) [s]."""
        return np.asarray(time + (self.by + self.drift * (time - self.at)))

    def then(self, other: ClockShift) -> ClockShift:
        """Return one shift for this one and another of the moved stamps."""
        moved = self.at + self.by
        by = self.by + other.by + other.drift * (moved - other.at)
        return ClockShift(self.at, by, self.drift + other.drift + self.drift * other.drift)


@dataclass(frozen=True, slots=True, repr=False)
class Drive:
    """One recording of one vehicle: signals, each on its own clock.

    Attributes
    ----------
    name : the folder's or file's name
    signals : by canonical name, in SI
    info : what is known besides the signals
    problems : what was corrected or is questionable in the data
    contents : what raw bus logs hold, decoded or not, in sentences
    units : suffixes of the units that its file or mapping declares, by signal, where they are known
    shifts : by which the last stamps of a table were moved, by table, where they were
    """

    name: str
    signals: Mapping[str, Signal]
    info: DriveInfo = field(default_factory=DriveInfo)
    problems: tuple[Problem, ...] = ()
    contents: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict, compare=False)
    shifts: Mapping[str, ClockShift] = field(default_factory=dict, compare=False)

    def __post_init__(self) -> None:
        check_text("name of a drive", self.name)
        check_type("signals", self.signals, Mapping, "a dictionary of weighbridge.Signal by name")
        check_all("signals", self.signals.values(), Signal, "weighbridge.Signal")
        check_type("info", self.info, DriveInfo, "a weighbridge.DriveInfo")
        check_all("problems", self.problems, Problem, "weighbridge.Problem")
        check_texts("contents", self.contents)
        check_type("units", self.units, Mapping, "a dictionary of units by name")
        check_type("shifts", self.shifts, Mapping, "a dictionary of ClockShift by table")

    def get(self, name: str) -> Signal | None:
        """Return the signal, or None where the drive lacks it."""
        check_text("name of a signal", name)
        return self.signals.get(name)

    def has(self, *names: str) -> bool:
        """Return whether all the signals are there."""
        check_texts("names", names)
        return all(name in self.signals for name in names)

    def missing(self, names: Iterable[str]) -> list[str]:
        """Name the signals that are not there."""
        check_texts("names", names)
        return [name for name in names if name not in self.signals]

    def __repr__(self) -> str:
        return in_lines(self._summary())

    def _repr_html_(self) -> str:
        return in_html(self._summary())

    def _summary(self) -> tuple[str, str, str]:
        """Name and length, signals with their rates, problems."""
        rates: dict[str, list[str]] = {}
        for s in self.signals.values():
            rates.setdefault(at_rate(s.period), []).append(s.name)
        listed = "; ".join(
            f"{rate + ': ' if rate else ''}{', '.join(names)}" for rate, names in rates.items()
        )
        serious = sum(p.serious for p in self.problems)
        first = min(self.problems, key=lambda p: not p.serious, default=None)
        doubts = ""
        if first is not None:
            many = f"{plural(len(self.problems), 'problem')}, {serious} serious: "
            doubts = f"{many}{first.text}"
        head = f"Drive {self.name!r}: {self.duration:.0f} s, {plural(len(self.signals), 'signal')}"
        return head, listed, doubts or "no problems"

    @property
    def speed(self) -> Signal | None:
        """Speed from the wheels, else over ground; None where the drive has neither."""
        return self.get("vehicle_speed") or self.get("gnss_speed")

    @property
    def start(self) -> float:
        """First time stamp [s]; 0 without signals."""
        return min((float(s.time[0]) for s in self.signals.values() if len(s)), default=0.0)

    @property
    def began(self) -> str | None:
        """Wall-clock time of the first stamp, ISO 8601 in UTC; None where no date is known."""
        try:
            zero = datetime.fromisoformat(self.info.start_time or "")
            zero = zero if zero.tzinfo is not None else zero.replace(tzinfo=UTC)
            first = zero.astimezone(UTC) + timedelta(seconds=self.start)
        except (ValueError, OverflowError):
            return None
        return first.isoformat(timespec="milliseconds")

    @property
    def end(self) -> float:
        """Last time stamp [s]; 0 without signals."""
        return max((float(s.time[-1]) for s in self.signals.values() if len(s)), default=0.0)

    @property
    def duration(self) -> float:
        """Time between the first and the last stamp of any signal [s]."""
        return self.end - self.start

    @property
    def periods(self) -> dict[str, float]:
        """Median time between samples by name [s]; found once for signals that share a clock."""
        found: dict[int, float] = {}
        several = [s for s in self.signals.values() if len(s) > 1]
        for s in several:
            if id(s.time) not in found:
                found[id(s.time)] = s.period
        return {s.name: found[id(s.time)] for s in several}

    def with_signals(self, *signals: Signal) -> Drive:
        """Return a drive in which these signals are added or replaced."""
        check_all("signals", signals, Signal, "weighbridge.Signal")
        return replace(self, signals={**self.signals, **{s.name: s for s in signals}})

    def with_problems(self, *problems: Problem) -> Drive:
        """Return a drive with further problems noted."""
        return replace(self, problems=(*self.problems, *problems))

    def without(self, *names: str) -> Drive:
        """Return a drive that lacks these signals."""
        check_texts("names", names)
        return replace(self, signals={k: v for k, v in self.signals.items() if k not in names})

    def between(self, start: float, end: float) -> Drive:
        """Return the part from ``start`` to ``end`` [s]; no signal is copied."""
        check_number("start", start)
        check_number("end", end)
        cut = {}
        for name, s in self.signals.items():
            a, b = s.time.searchsorted([start, end])
            if b > a:
                cut[name] = Signal(name, s.time[a:b], s.values[a:b])
        return replace(self, signals=cut)
