"""What a drive holds, how well it was recorded, and how it could be weighed."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from weighbridge.balance.speed_balance import SPEEDS
from weighbridge.checks import correct_drive
from weighbridge.navigation import MotionSource
from weighbridge.pipeline.expected import (
    EXPECTED,
    FAST,
    MOTIONS,
    Excitation,
    chance,
    excitation,
    expected,
)
from weighbridge.pipeline.given import (
    GivenDrive,
    GivenVehicle,
    as_drive,
    as_vehicle,
    home_of,
    mapping_of,
)
from weighbridge.results.writing import number
from weighbridge.signals import QUANTITIES, Drive, Problem, Signal, from_si, resolution
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.signals.shown import in_html, in_lines, plural
from weighbridge.vehicle import (
    TORQUE_SOURCES,
    TorqueSource,
    Vehicle,
    find_power_balance,
    sources_of,
)
from weighbridge.visible import visible_json

GAP_PERIODS: Final = 5.0
"""A gap is a step of the clock longer than this many median periods."""

DRIVEN_NEEDED: Final = "the torque of every driven axle (or driven in the vehicle file)"
REFERENCE_NEEDED: Final = "reference_torque (or reference_torque_nm in the vehicle file)"
"""What a torque in percent needs that its drive does not show."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalReport:
    """How one signal was recorded.

    Attributes
    ----------
    name, meaning : what it is
    unit : suffix of the unit of ``low``, ``high`` and ``step``; empty for counts
    count : samples
    start, end : first and last stamp [s]
    rate : samples per second over all [Hz]; NaN below two samples
    period : median time between samples [s]; NaN below two samples
    jitter : standard deviation of that time, gaps left out [s]
    gaps : steps longer than five median periods
    longest_gap : [s]; 0 without gaps
    low, high : extreme values
    step : smallest step between values; None where they are continuous
    """

    name: str
    meaning: str
    unit: str
    count: int
    start: float
    end: float
    rate: float
    period: float
    jitter: float
    gaps: int
    longest_gap: float
    low: float
    high: float
    step: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """One way a drive could be weighed.

    Attributes
    ----------
    motion : where motion comes from, see `weighbridge.navigation.Motion`
    torque : where torque comes from, see `weighbridge.vehicle.model.TorqueModel`, or
        "speed" where it is taken as proportional to the speed
    possible : whether nothing is missing
    needs : what is missing
    accuracy : what to expect of the mass after a calibration, as a standard deviation, such as
        "0.4–3 %"; ", or no mass" where the drive may be too short or too even; "none" where no mass
        comes of it
    because : what limits it
    chosen : the way `weigh` would go with the vehicle file given
    """

    motion: MotionSource
    torque: str
    possible: bool
    needs: tuple[str, ...]
    accuracy: str
    because: str
    chosen: bool = False

    @property
    def name(self) -> str:
        """The way in words."""
        if self.torque == "speed":
            return "speed without torque (speed-ekf)"
        return f"{MOTIONS[self.motion]} and {TORQUE_SOURCES[self.torque].title}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Inspection:
    """All that `inspect` shows of a drive.

    Attributes
    ----------
    drive : the drive
    signals : one report each, table by table
    problems : found while reading and by the checks; serious ones first
    ways : possible ones first, the most accurate first; last of all the one by speed
        alone, possible or not
    """

    drive: Drive
    signals: tuple[SignalReport, ...]
    problems: tuple[Problem, ...]
    ways: tuple[Way, ...]

    def __repr__(self) -> str:
        return in_lines(self._summary())

    def _repr_html_(self) -> str:
        return in_html(self._summary())

    def _summary(self) -> tuple[str, str, str]:
        """Name and length, the best way to weigh or what it lacks, problems."""
        drive, best = self.drive, self.ways[0]
        count = plural(len(self.signals), "signal")
        way = (
            f"best way: {best.name}, {best.accuracy} expected"
            if best.possible
            else f"nearest way: {best.name}, lacks {', '.join(best.needs)}"
        )
        serious = sum(p.serious for p in self.problems)
        first = f", {serious} serious: {self.problems[0].text}" if self.problems else ""
        return (
            f"Inspection of {drive.name!r}: {drive.duration:.0f} s, {count}",
            way,
            f"{plural(len(self.problems), 'problem')}{first}",
        )

    def to_dict(self) -> dict[str, Any]:
        """Return what ``inspect --json`` prints: numbers, None where unknown."""
        return {
            "drive": self.drive.name,
            "duration_s": number(self.drive.duration),
            "signals": [
                {
                    "name": s.name,
                    "unit": s.unit,
                    "samples": s.count,
                    "start_s": number(s.start),
                    "end_s": number(s.end),
                    "rate_hz": number(s.rate),
                    "gaps": s.gaps,
                    "longest_gap_s": number(s.longest_gap),
                    "lowest": number(s.low),
                    "highest": number(s.high),
                }
                for s in self.signals
            ],
            "problems": [p.to_dict() | {"serious": p.serious} for p in self.problems],
            "ways": [
                {
                    "motion": w.motion,
                    "torque": w.torque,
                    "possible": w.possible,
                    "chosen": w.chosen,
                    "lacks": list(w.needs),
                    "expected": w.accuracy,
                }
                for w in self.ways
            ],
        }

    def to_json(self) -> str:
        """Return `to_dict` as one line of JSON."""
        return visible_json(json.dumps(self.to_dict(), ensure_ascii=False))


def inspect_drive(drive: GivenDrive, vehicle: GivenVehicle | None = None) -> Inspection:
    """Describe the signals of a drive, its problems, and the ways to weigh by it.

    Parameters
    ----------
    drive : as of `read_drive`, or the path or data frame that it is to be read from
    vehicle : the vehicle file, if there is one, or its path

    Returns
    -------
    Inspection
    """
    home = home_of(vehicle)
    vehicle = as_vehicle(vehicle) if vehicle is not None else None
    drive = as_drive(drive, mapping_of(vehicle, home))
    order = list(QUANTITIES)
    signals = sorted(drive.signals.values(), key=lambda s: order.index(s.name))
    corrected = correct_drive(drive, vehicle)
    problems, along = corrected.problems, corrected.get("longitudinal_accel")
    if not any(p.serious for p in problems):
        problems += _by_battery(corrected, vehicle)
    return Inspection(
        drive=drive,
        signals=tuple(describe(s) for s in signals),
        problems=tuple(sorted(dict.fromkeys(problems), key=lambda p: not p.serious)),
        ways=_ways(
            drive if along is None else drive.with_signals(along), vehicle, excitation(corrected)
        ),
    )


def _by_battery(drive: Drive, vehicle: Vehicle | None) -> tuple[Problem, ...]:
    """Return what battery power says of the torque of an electric drive with one gear."""
    if vehicle is None or not vehicle.driveline.single_speed:
        return ()
    found = find_power_balance(drive, vehicle)
    return (found.problem,) if found is not None else ()


def describe(signal: Signal) -> SignalReport:
    """Describe how one signal was recorded."""
    suffix = QUANTITIES[signal.name].suffix
    time, count = signal.time, len(signal)
    values = from_si(signal.values, suffix) if suffix else signal.values
    steps = np.diff(time)
    period = signal.period
    gap = steps > GAP_PERIODS * period
    regular = steps[~gap]
    return SignalReport(
        name=signal.name,
        meaning=QUANTITIES[signal.name].meaning,
        unit=suffix,
        count=count,
        start=float(time[0]) if count else math.nan,
        end=float(time[-1]) if count else math.nan,
        rate=(count - 1) / signal.duration if count > 1 else math.nan,
        period=period,
        jitter=float(np.std(regular)) if regular.size else math.nan,
        gaps=int(np.count_nonzero(gap)),
        longest_gap=float(np.max(steps[gap])) if gap.any() else 0.0,
        low=float(np.min(values)) if count else math.nan,
        high=float(np.max(values)) if count else math.nan,
        step=float(f"{step:.4g}") if (step := resolution(values)) else None,
    )


def _ways(drive: Drive, vehicle: Vehicle | None, moves: Excitation) -> tuple[Way, ...]:
    ways = []
    for motion in MOTIONS:
        for torque in sources_of(vehicle):
            needs = (*_motion_needs(drive, motion), *_torque_needs(drive, torque, vehicle))
            fast = _is_fast(drive, torque)
            made = _made_for(torque, vehicle)
            best, worst = expected(motion, fast=fast, vehicle=made, drive=moves)
            reason = EXPECTED[motion, fast][2]
            if torque.expected:
                best, worst, reason = best + torque.expected, worst + torque.expected, torque.limit
            accuracy = f"{best:g}–{worst:g} %"
            outcome = chance(motion, moves)
            if outcome != "sure":
                reason = "the drive is short, or accelerates too little"
                accuracy = "none" if outcome == "none" else f"{accuracy}, or no mass"
            # Nobody records torque at the wheels for want of another signal.
            rare = bool(needs) and torque.gearing is not None and bool(torque.lacking(drive))
            # What a vehicle file can state need not be recorded.
            recorded = len(set(needs) - {REFERENCE_NEEDED, DRIVEN_NEEDED})
            ways.append(
                (
                    (bool(needs), rare, recorded, len(set(needs)), worst),
                    Way(
                        motion=motion,
                        torque=torque.name,
                        possible=not needs,
                        needs=tuple(dict.fromkeys(needs)),
                        accuracy=accuracy,
                        because=reason,
                    ),
                )
            )
    ways.sort(key=lambda w: w[0])
    return _mark_chosen([*(w for _, w in ways), _by_speed_alone(drive)], vehicle)


def _made_for(torque: TorqueSource, vehicle: Vehicle | None) -> Vehicle | None:
    """Return the vehicle where its file is of that torque, else None."""
    return vehicle if vehicle is not None and vehicle.torque.of_source == torque else None


def _is_fast(drive: Drive, torque: TorqueSource) -> bool:
    """Whether the slowest signal of a torque is read at `FAST` or more."""
    read = [s for name in torque.found(drive) if (s := drive.get(name)) is not None and len(s) > 1]
    return all(s.period > 0.0 and 1.0 / s.period >= FAST for s in read)


def _by_speed_alone(drive: Drive) -> Way:
    """Return the way that nearly every drive could go, and that nearly never ends in a mass."""
    needs = () if any(drive.has(name) for name in SPEEDS) else ("vehicle_speed",)
    return Way(
        motion="speed",
        torque="speed",
        possible=not needs,
        needs=needs,
        accuracy="none",
        because="no mass: speed gives back that of the calibration",
    )


def _mark_chosen(ways: list[Way], vehicle: Vehicle | None) -> tuple[Way, ...]:
    """Mark the way that `weigh` goes: the vehicle file's torque, the best motion."""
    source = vehicle.torque.of_source.name if vehicle is not None else None
    order = list(MOTIONS)
    possible = [w for w in ways if w.possible and w.torque == source]
    best = min(possible, key=lambda w: order.index(w.motion), default=None)
    return tuple(replace(w, chosen=True) if w is best else w for w in ways)


def _motion_needs(drive: Drive, motion: MotionSource) -> list[str]:
    speed = drive.has("vehicle_speed") or drive.has("gnss_speed")
    needs: list[str] = []
    match motion:
        case "inertial":
            needs += drive.missing(IMU_SIGNALS)
            if not speed and not drive.has("latitude", "longitude"):
                needs.append("vehicle_speed")
        case "longitudinal_accel":
            needs += drive.missing(("longitudinal_accel", "vehicle_speed"))
        case "speed_grade":
            if not speed:
                needs.append("vehicle_speed")
            if not drive.has("grade") and not drive.has("altitude"):
                needs.append("altitude or grade")
        case "speed":
            if not speed:
                needs.append("vehicle_speed")
    return needs


def _torque_needs(drive: Drive, torque: TorqueSource, vehicle: Vehicle | None) -> list[str]:
    needs = torque.lacking(drive)
    if torque.needs_reference and not drive.has("reference_torque"):
        known = vehicle is not None and vehicle.torque.reference_torque is not None
        if not known:
            needs.append(REFERENCE_NEEDED)
    line = vehicle.driveline if vehicle is not None else None
    if not needs and torque.refusal(drive, line.driven if line is not None else None):
        needs.append(DRIVEN_NEEDED)
    fixed_gear = torque.gearing is not None or (line is not None and line.single_speed)
    if not fixed_gear and not drive.has("engine_speed") and "engine_speed" not in needs:
        needs.append("engine_speed (or the one gearing of a single-speed car in the vehicle file)")
    return needs
