"""Leave out samples that cannot be true, so that the rest can be weighed."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from weighbridge.checks.false_samples import clipped, isolated, piled
from weighbridge.checks.frozen import frozen
from weighbridge.checks.needed import needed, of_torque, show
from weighbridge.messages import phrase
from weighbridge.signals import Bools, Drive, Problem, Signal
from weighbridge.signals.instants import instant
from weighbridge.vehicle import Vehicle

WIDENED: Final = 1.02
"""Load range of a vehicle file over the highest load its drives had [-]."""

CUT_TO: Final = 0.5
CUT_OFF: Final = 0.2
"""A torque cut off below the one part of the calibration's range, in more than the other of its
samples, makes no mass [-]: rows chosen by what is left made a car 48 % light at 0.38 and 0.32,
and were right at 0.48 and 0.11, and at 0.59 and 0.30."""

ENDS: Final = 60.0
"""A signal that ends, or begins, so long before, or after, the rest is reported [s]."""


def corrected(drive: Drive, vehicle: Vehicle | None = None) -> Drive:
    """Return the drive without samples of torque, engine and vehicle speed that are false.

    Left out are values that freeze, and isolated dropouts. Each makes a problem. Signals that a
    person vouches for (``drive.info.trusted``) stay as they are.

    Parameters
    ----------
    drive, vehicle : as of `weighbridge.checks.check_drive`
    """
    made_of = needed(drive, vehicle)
    names = [
        name
        for name in ("vehicle_speed", "engine_speed", *sorted(of_torque() & made_of))
        if drive.has(name) and len(drive.signals[name]) and name not in drive.info.trusted
    ]
    marks = {name: frozen(drive, name) for name in names}
    for name, marked in marks.items():
        drive = _without_frozen(drive, name, marked)
    for name in names:
        if name in of_torque():
            drive = _without_false(drive, name)
            drive = _without_ends(drive, name, vehicle)
    return drive.with_problems(*_ends(drive, names))


def _without_frozen(drive: Drive, name: str, marked: Bools) -> Drive:
    if not marked.any():
        return drive
    signal = drive.signals[name]
    begins = np.flatnonzero(marked & ~np.concatenate(([False], marked[:-1])))
    lasted = float(np.sum(np.diff(signal.time, prepend=signal.time[0])[marked]))
    often = f"{begins.size} times, " if begins.size > 1 else ""
    found = Problem.of(
        "frozen.signal",
        name,
        start=signal.time[begins[0]],
        end=signal.time[marked][-1],
        often=often,
        at=instant(signal.time[begins[0]]),
        lasted=lasted,
    )
    return drive.with_signals(_without(signal, marked)).with_problems(found)


def _without_false(drive: Drive, name: str) -> Drive:
    signal = drive.signals[name]
    marked = isolated(drive, name)
    if marked.any():
        drive = drive.with_signals(_without(signal, marked)).with_problems(
            Problem.of("torque.dropouts", name, count=np.count_nonzero(marked), samples=len(signal))
        )
    return drive


def _without_ends(drive: Drive, name: str, vehicle: Vehicle | None) -> Drive:
    """Leave out what lies at an end of the reading: the torque is there or beyond."""
    signal = drive.signals[name]
    own = vehicle if vehicle and name == vehicle.torque.of_source.signals[0] else None
    dragged = own.dragged if own is not None else None
    marked, notes = np.zeros(len(signal), dtype=bool), list[Problem]()
    if own is not None and math.isfinite(highest := _highest(own)):
        marked = clipped(signal, highest)
        if marked.any():
            notes.append(
                Problem.of(
                    "torque.cut_off",
                    name,
                    serious=bool(
                        np.mean(marked) > CUT_OFF and signal.values.max() < CUT_TO * highest
                    ),
                    most=show(name, float(signal.values.max())),
                    count=np.count_nonzero(marked),
                    samples=len(signal),
                    highest=show(name, highest),
                )
            )
    # The lowest is looked at of motors alone: an engine that is dragged reads the same for long.
    motor = vehicle is not None and vehicle.driveline.single_speed
    for lowest in (False, True)[: 1 + motor]:
        found = piled(signal, lowest=lowest) & ~marked
        if found.any():
            marked |= found
            notes.append(
                Problem.of(
                    "torque.at_limit",
                    name,
                    word=phrase("falls_below") if lowest else phrase("exceeds"),
                    limit=show(name, float(signal.values[found][0])),
                    count=np.count_nonzero(found),
                    samples=len(signal),
                )
            )
    if dragged is not None and len(signal) > 200:
        floor = min(dragged.level) + 3.0 * dragged.scatter
        if floor < 0.0 <= float(signal.values.min()):
            # What may be the size of a negative reading is as uncertain as a zero.
            questionable = signal.values <= 3.0 * dragged.scatter - min(dragged.level)
            marked = marked | questionable
            notes.append(
                Problem.of(
                    "torque.sign_lost",
                    name,
                    lowest=show(name, min(dragged.level)),
                    count=np.count_nonzero(questionable),
                )
            )
    if not notes or marked.all():
        return drive
    return drive.with_signals(_without(signal, marked)).with_problems(*notes)


def _highest(vehicle: Vehicle) -> float:
    """Return the highest reading of the calibration; infinite where it is not known."""
    model, dragged = vehicle.torque, vehicle.dragged
    if model.load_range is not None:
        # Of other sources the range is not that of the signal.
        return model.load_range[1] / WIDENED if model.of_source.needs_map else math.inf
    return dragged.span + min(dragged.level) if dragged is not None else math.inf


def _without(signal: Signal, marked: Bools) -> Signal:
    return Signal(signal.name, signal.time[~marked], signal.values[~marked])


def _ends(drive: Drive, names: list[str]) -> list[Problem]:
    """Report signals that end long before the drive, or begin long after."""
    ends = [s.time[-1] for s in drive.signals.values() if len(s) > 10]
    starts = [s.time[0] for s in drive.signals.values() if len(s) > 10]
    notes: list[Problem] = []
    for name in names if ends else ():
        signal = drive.signals[name]
        if not len(signal):
            continue
        early, late = max(ends) - signal.time[-1], signal.time[0] - min(starts)
        if early > ENDS:
            notes.append(
                Problem.of(
                    "file.ends_early",
                    name,
                    start=signal.time[-1],
                    end=max(ends),
                    at=instant(signal.time[-1]),
                    early=early,
                )
            )
        if late > ENDS:
            notes.append(
                Problem.of(
                    "file.begins_late",
                    name,
                    start=min(starts),
                    end=signal.time[0],
                    at=instant(signal.time[0]),
                    late=late,
                )
            )
    return notes
