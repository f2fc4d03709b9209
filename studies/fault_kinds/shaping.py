"""What a fault is, and the few ways in which a drive can be changed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from weighbridge.signals import QUANTITIES, Bools, Drive, Floats, Signal

Stage = Literal["drive", "splice", "files", "vehicle", "calibration"]

USUAL: Final = ("car", "van", "electric")
"""Vehicles that a fault is put into unless it says otherwise."""

ACCEL: Final = ("accel_x", "accel_y", "accel_z")
GYRO: Final = ("gyro_x", "gyro_y", "gyro_z")
IMU: Final = (*ACCEL, *GYRO)


@dataclass(frozen=True)
class Fault:
    """One kind of fault.

    Attributes
    ----------
    apply : by stage
        drive: ``(drive, severity, rng) -> Drive``; splice: the same with another vehicle's
        drive behind; files: ``(folder, severity, rng) -> None``, which edits written tables;
        vehicle: ``(vehicle, mass, severity) -> Vehicle``; calibration:
        ``(masses, severity) -> masses`` [kg]
    severities : in the unit that the function tells
    words : regular expression of a warning that names the damaged signal or the cause, which no
        warning of another signal holds
    vehicles : names of the subjects it is put into
    harmless : must be weighed
    must_tell : the mass is right, and something else is wrong that a warning must tell
    """

    group: str
    apply: Callable[..., Any]
    severities: tuple[float, ...]
    words: str = "$^"
    vehicles: tuple[str, ...] = USUAL
    stage: Stage = "drive"
    harmless: bool = False
    must_tell: bool = False

    @property
    def name(self) -> str:
        return str(self.apply.__name__)


def of_table(drive: Drive, *tables: str) -> list[str]:
    """Names of the drive's signals that stand in these tables."""
    return [name for name in drive.signals if QUANTITIES[name].table in tables]


def torque_of(drive: Drive) -> str:
    """Name of the signal that the torque is made from."""
    return next(
        n for n in ("engine_torque", "engine_torque_fraction", "engine_load") if n in drive.signals
    )


def changed(
    drive: Drive, names: Iterable[str], change: Callable[[Floats, Floats], Floats]
) -> Drive:
    """Change the values of signals: ``change(time, values)``; those the drive lacks are left."""
    found = [s for name in names if (s := drive.get(name)) is not None]
    return drive.with_signals(*(Signal(s.name, s.time, change(s.time, s.values)) for s in found))


def kept(drive: Drive, names: Iterable[str], keep: Callable[[Floats], Bools]) -> Drive:
    """Keep some rows of signals: ``keep(time)``, called once for each clock."""
    masks: dict[int, tuple[Bools, Floats]] = {}
    made = []
    for name in names:
        s = drive.get(name)
        if s is None:
            continue
        if id(s.time) not in masks:
            mask = keep(s.time)
            masks[id(s.time)] = mask, s.time[mask]
        mask, time = masks[id(s.time)]
        if time.size:
            made.append(Signal(name, time, s.values[mask]))
        else:
            drive = drive.without(name)
    return drive.with_signals(*made)


def retimed(drive: Drive, names: Iterable[str], change: Callable[[Floats], Floats]) -> Drive:
    """Change the clocks of signals: ``change(time)``; rows that then run backwards are left out.

    The readers leave them out in the same way.
    """
    clocks: dict[int, tuple[Bools, Floats]] = {}
    made = []
    for name in names:
        s = drive.get(name)
        if s is None:
            continue
        if id(s.time) not in clocks:
            time = change(s.time)
            rising = np.ones(time.size, dtype=bool)
            rising[1:] = time[1:] > np.maximum.accumulate(time)[:-1]
            clocks[id(s.time)] = rising, time[rising]
        rising, time = clocks[id(s.time)]
        made.append(Signal(name, time, s.values[rising]))
    return drive.with_signals(*made)


def middle(drive: Drive, part: float = 0.5) -> float:
    """Time at a part of the drive [s]."""
    return drive.start + part * drive.duration


def stretches(
    drive: Drive, share: float, length: float, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Starts and ends of stretches of equal length that cover a share of the drive [s]."""
    count = max(1, round(share * drive.duration / length))
    room = drive.duration / count
    starts = drive.start + room * np.arange(count)
    starts = starts + rng.uniform(0.0, max(room - length, 1e-3), count)
    return starts, starts + min(length, room)


def inside(time: Floats, starts: Floats, ends: Floats) -> Bools:
    """Mark the times within any of the stretches."""
    place = np.searchsorted(starts, time, side="right") - 1
    return np.asarray((place >= 0) & (time < ends[np.maximum(place, 0)]))


def scaled(drive: Drive, names: Iterable[str], factor: float, begin: float = -np.inf) -> Drive:
    """Multiply signals from a time on."""
    return changed(drive, names, lambda t, x: np.where(t >= begin, factor * x, x))


def ramped(drive: Drive, names: Iterable[str], factor: float) -> Drive:
    """Multiply signals by a factor that goes from one to ``factor`` over the drive."""
    start, duration = drive.start, drive.duration
    return changed(drive, names, lambda t, x: x * (1.0 + (factor - 1.0) * (t - start) / duration))
