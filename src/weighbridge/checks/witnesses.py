"""Is the torque's reading what other signals of the engine say it is?"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from weighbridge.balance.disagreement import DOUBTFUL, Finding, difference, findings
from weighbridge.balance.witness import BY_SIGNAL
from weighbridge.checks.frozen import frozen
from weighbridge.checks.steps import check_steps
from weighbridge.signals import Drive, Problem, Signal
from weighbridge.signals.instants import instant
from weighbridge.vehicle.model import Vehicle
from weighbridge.vehicle.torque import source_of


def check_reading(drive: Drive, vehicle: Vehicle | None) -> tuple[Problem, ...]:
    """Hold the torque's reading against its witnesses, and against the steps of the calibration.

    Where the reading was altered after it was sent, a witness that doubts it is believed.

    Parameters
    ----------
    drive : without samples that are known to be false
    vehicle : with the witnesses of its calibration; None where there is none
    """
    found = witnessed(drive, vehicle)
    steps = tuple(check_steps(drive, vehicle, found))
    return (*steps, *check_witnesses(drive, vehicle, found, altered=bool(steps)))


def witnessed(drive: Drive, vehicle: Vehicle | None) -> tuple[Finding, ...]:
    """What the witnesses of a vehicle file say of the reading; nothing where there are none."""
    if vehicle is None or not vehicle.witnesses:
        return ()
    return findings(_thawed(drive, vehicle), vehicle)


def check_witnesses(
    drive: Drive,
    vehicle: Vehicle | None,
    found: tuple[Finding, ...] | None = None,
    *,
    altered: bool = False,
) -> tuple[Problem, ...]:
    """Hold the torque's reading against the witnesses of the vehicle file.

    One witness that agrees with the reading clears it: those that do not are then off themselves.

    Parameters
    ----------
    drive : without samples that are known to be false
    vehicle : with the witnesses of its calibration; None where there is none
    found : what they say, if it is known already
    altered : the reading's steps say that it was altered after it was sent

    Returns
    -------
    Problems, of the reading, or of witnesses that are off
    """
    found = witnessed(drive, vehicle) if found is None else found
    if vehicle is None or not found:
        return ()
    reading = source_of(vehicle).found(drive)[0]
    off = [f for f in found if f.verdict != "agrees"]
    # What only the unknown air makes agree clears nothing.
    agree = [f.signal for f in found if f.verdict == "agrees" and abs(f.scale - 1.0) <= DOUBTFUL]
    if agree and not _outvoted(off):
        return tuple(_witness_off(reading, f, agree) for f in off)
    if not off:
        return ()
    worst = max(off, key=lambda f: (f.verdict == "serious", abs(f.scale - 1.0)))
    together = [f for f in off if (f.blur > 0.0, f.sign) == (worst.blur > 0.0, worst.sign)]
    serious = (altered or worst.verdict == "serious") and reading not in drive.info.trusted
    return (
        Problem(
            reading, _reading_off(reading, vehicle, worst, together, len(off)), serious=serious
        ),
    )


def _thawed(drive: Drive, vehicle: Vehicle) -> Drive:
    """Leave out where a witness froze: it tells nothing there."""
    for name in {n for relation in vehicle.witnesses for n in BY_SIGNAL[relation.signal].needs}:
        signal = drive.get(name)
        marked = frozen(drive, name) if signal is not None else None
        if signal is not None and marked is not None and marked.any() and not marked.all():
            kept = Signal(name, signal.time[~marked], signal.values[~marked])
            drive = drive.with_signals(kept)
    return drive


def _outvoted(off: Sequence[Finding]) -> bool:
    """Tell whether two witnesses are off by the same: then it is the reading."""
    scales = sorted(f.scale for f in off if f.scaled and f.blur == 0.0 and not _part(f))
    return any(b - a < DOUBTFUL for a, b in pairwise(scales))


def _reading_off(
    reading: str, vehicle: Vehicle, worst: Finding, together: Sequence[Finding], many: int
) -> str:
    """Say by how much the reading is off, by which witnesses, and what to do."""
    names = " and ".join(f.signal for f in together)
    if worst.before:
        source = f"from {instant(worst.start)} on against before"
    else:
        source = f"by the calibration of {vehicle.name}{_when(worst)}"
    if worst.blur > 0.0:
        return (
            f"{reading} follows {names} with a time constant of {worst.blur:.2g} s, as it did not "
            f"in the calibration of {vehicle.name}: something smooths the load or torque; record "
            "it as the vehicle sends it"
        )
    if len(together) > 1:
        which = f"{reading} is wrong"
    elif many > 1:
        which = "they do not agree with each other either, and one of them is wrong"
    else:
        which = "one of the two is wrong"
    if any(BY_SIGNAL[f.signal].per_turn for f in together):
        which = which.replace("of the two is wrong", "of the two, or engine_speed, is wrong")
    two = " (or the recording is of two vehicles)" if _part(worst) else ""
    tells = (
        f"{'as' if worst.scaled else 'than'} {names} {'tells' if len(together) == 1 else 'tell'}"
    )
    return (
        f"{reading} reads {difference(worst)} {tells} {source}: {which}, and a mass from it is off "
        f"by as much{two}; check the unit and scale of {reading} in the log and its mapping, or "
        "calibrate again"
    )


def _witness_off(reading: str, finding: Finding, agree: Sequence[str]) -> Problem:
    if finding.blur > 0.0:
        how = f"{reading} follows it with a time constant of {finding.blur:.2g} s"
    else:
        than = "as" if finding.scaled else "than"
        how = f"{reading} reads {difference(finding)} {than} it tells{_when(finding)}"
    return Problem(
        finding.signal,
        f"{finding.signal} is off: {how}, and {' and '.join(agree)} "
        f"{'agrees' if len(agree) == 1 else 'agree'} with {reading}; nothing is taken from it",
    )


def _part(finding: Finding) -> bool:
    return bool(np.isfinite(finding.start) or np.isfinite(finding.end))


def _when(finding: Finding) -> str:
    """In which part of the drive, in words."""
    if np.isfinite(finding.start):
        return f" from {instant(finding.start)} on"
    return f" until {instant(finding.end)}" if np.isfinite(finding.end) else ""
