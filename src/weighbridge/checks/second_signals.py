"""Is the torque's reading what other signals of the engine say it is?"""

from __future__ import annotations

from collections.abc import Sequence

from weighbridge.balance.disagreement import QUESTIONABLE, Finding, difference, findings
from weighbridge.balance.second_signal import BY_SIGNAL
from weighbridge.checks.steps import check_steps
from weighbridge.messages import phrase
from weighbridge.signals import Drive, Problem
from weighbridge.vehicle import Vehicle, source_of


def check_reading(drive: Drive, vehicle: Vehicle | None) -> tuple[Problem, ...]:
    """Compare the torque's reading with its second signals, and the steps of the calibration.

    Where the reading was altered after it was sent, a second signal that questions it is believed.

    Parameters
    ----------
    drive : without samples that are known to be false
    vehicle : with the second signals of its calibration; None where there is none
    """
    found = compared(drive, vehicle)
    steps = tuple(check_steps(drive, vehicle, found))
    return (*steps, *check_second_signals(drive, vehicle, found, altered=bool(steps)))


def compared(drive: Drive, vehicle: Vehicle | None) -> tuple[Finding, ...]:
    """What the second signals of a vehicle file say of the reading; nothing without any."""
    if vehicle is None or not vehicle.witnesses:
        return ()
    return findings(drive, vehicle)


def check_second_signals(
    drive: Drive,
    vehicle: Vehicle | None,
    found: tuple[Finding, ...] | None = None,
    *,
    altered: bool = False,
) -> tuple[Problem, ...]:
    """Hold the torque's reading against the second signals of the vehicle file.

    One that agrees with the reading clears it: those that do not are then off themselves.

    Parameters
    ----------
    drive : without samples that are known to be false
    vehicle : with the second signals of its calibration; None where there is none
    found : what they say, if it is known already
    altered : the reading's steps say that it was altered after it was sent

    Returns
    -------
    Problems, of the reading, or of second signals that are off
    """
    found = compared(drive, vehicle) if found is None else found
    if vehicle is None or not found:
        return ()
    reading = source_of(vehicle).found(drive)[0]
    off = [f for f in found if f.verdict != "agrees"]
    # What only the unknown air makes agree clears nothing.
    agree = [
        f.signal for f in found if f.verdict == "agrees" and abs(f.scale - 1.0) <= QUESTIONABLE
    ]
    if agree:
        return tuple(_second_signal_off(reading, f, agree) for f in off)
    if not off:
        return ()
    worst = max(off, key=lambda f: (f.verdict == "serious", abs(f.scale - 1.0)))
    together = [f for f in off if f.sign == worst.sign]
    serious = altered or worst.verdict == "serious"
    return (_reading_off(reading, vehicle, worst, together, len(off), serious=serious),)


def _reading_off(
    reading: str,
    vehicle: Vehicle,
    worst: Finding,
    together: Sequence[Finding],
    many: int,
    *,
    serious: bool,
) -> Problem:
    """Say by how much the reading is off, by which second signals, and what to do."""
    names = " and ".join(f.signal for f in together)
    turning = any(BY_SIGNAL[f.signal].per_turn for f in together)
    if len(together) > 1:
        which = phrase("reading_wrong", reading=reading)
    elif many > 1:
        which = phrase("one_witness_wrong")
    else:
        which = phrase("one_of_three_wrong" if turning else "one_of_two_wrong")
    return Problem.of(
        "torque.witness",
        reading,
        serious=serious,
        by=difference(worst),
        scale=worst.scale,
        than="as" if worst.scaled else "than",
        witnesses=names,
        verb="shows" if len(together) == 1 else "show",
        source=phrase("by_calibration", vehicle=vehicle.name),
        which=which,
    )


def _second_signal_off(reading: str, finding: Finding, agree: Sequence[str]) -> Problem:
    how = phrase(
        "reads_than_it",
        reading=reading,
        by=difference(finding),
        than="as" if finding.scaled else "than",
    )
    return Problem.of(
        "witness.off",
        finding.signal,
        how=how,
        agree=" and ".join(agree),
        verb="agrees" if len(agree) == 1 else "agree",
        reading=reading,
    )
