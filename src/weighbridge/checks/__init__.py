"""Plausibility of a drive: wrong units, stuck or swapped signals, clocks that disagree.

A serious problem is one that would make a mass wrong without any other sign;
`weigh` refuses then. Thresholds leave room for real sensors: what a sane drive
can show never counts as serious.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Final

from weighbridge.checks.clocks import (
    check_overlap,
    check_pauses,
    check_rates,
    without_slow,
)
from weighbridge.checks.correcting import corrected
from weighbridge.checks.derived import without_derived
from weighbridge.checks.digits import with_half_digits
from weighbridge.checks.engine import (
    check_engine_speed,
    check_friction,
    check_idle,
    check_torque_sign,
)
from weighbridge.checks.frozen_imu import check_frozen, check_limit
from weighbridge.checks.inertial import check_imu
from weighbridge.checks.ranges import check_range, within_ranges, without_strays
from weighbridge.checks.second_signals import check_reading
from weighbridge.checks.smoothed_imu import check_needed, without_smoothed
from weighbridge.checks.speed import check_scales
from weighbridge.checks.spikes import without_spikes
from weighbridge.checks.travel import check_standstill
from weighbridge.checks.values import check_load, check_retarder, check_stuck
from weighbridge.checks.vehicle import check_vehicle
from weighbridge.navigation.along import with_forward_accel
from weighbridge.navigation.clock_drift import correct_clocks
from weighbridge.registry import Registry
from weighbridge.signals import Drive, Problem, longest_part
from weighbridge.signals.catalogue import REPORTED_LOAD
from weighbridge.signals.held import without_repeats
from weighbridge.signals.timeline import one_recording, well_formed
from weighbridge.vehicle import Vehicle

__all__ = ["CHECKS", "Check", "check_drive", "correct_drive", "refuse_serious"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """Something that a drive may show of its data.

    Attributes
    ----------
    name : of the check
    find : of a drive and its vehicle, None where that is unknown; returns what was found. A serious
        problem withholds the mass
    cleaned : it looks at what is left, without frozen values, dropouts and false samples
    """

    name: str
    find: Callable[[Drive, Vehicle | None], Iterable[Problem]]
    cleaned: bool = False


CHECKS: Final = Registry(
    Check,
    "weighbridge.checks",
    (
        Check(name="stuck", find=check_stuck),
        Check(name="frozen", find=check_frozen),
        Check(name="limit", find=check_limit),
        Check(name="needed", find=check_needed),
        Check(name="load", find=check_load),
        Check(name="retarder", find=check_retarder),
        Check(name="torque_sign", find=check_torque_sign),
        Check(name="friction", find=check_friction),
        Check(name="engine_speed", find=check_engine_speed),
        Check(name="idle", find=check_idle),
        Check(name="standstill", find=check_standstill),
        Check(name="scales", find=check_scales),
        Check(name="imu", find=check_imu),
        Check(name="range", find=check_range),
        Check(name="vehicle", find=check_vehicle, cleaned=True),
        Check(name="reading", find=check_reading, cleaned=True),
    ),
)
"""Every check by its name, in the order they are made."""


def correct_drive(drive: Drive, vehicle: Vehicle | None = None) -> Drive:
    """Judge a drive, bring its clocks together, and leave out of it what cannot be so.

    Clocks come first: what is laid on an even grid later grows with the time from first to last
    stamp. Where they are seriously wrong, nothing else is looked at.

    Parameters
    ----------
    drive : the drive as read, or as made
    vehicle : its gearings help to judge the speed's unit

    Returns
    -------
    Drive
        On clocks that rise, within physical ranges, without samples that are false. What the
        vehicle reports of its own load (`REPORTED_LOAD`) changes none of it. What was found
        is added to its ``problems``, serious ones first. What is wrong with a signal that a person
        vouches for (``drive.info.trusted``) is never serious.
    """
    found = _corrected(drive.without(*REPORTED_LOAD), vehicle)
    beside = drive.without(*(name for name in drive.signals if name not in REPORTED_LOAD))
    if not (beside.signals and found.signals):
        return found
    reported = within_ranges(well_formed(beside)).between(found.start, found.end)
    return found.with_signals(*reported.signals.values())


def _corrected(drive: Drive, vehicle: Vehicle | None) -> Drive:
    """Correct a drive without what the vehicle reports of its own load."""
    earlier = drive.problems
    drive = well_formed(drive)
    if found := tuple(check_rates(drive, vehicle)):
        return drive.with_problems(*found)
    drive = without_slow(longest_part(one_recording(drive)))
    found = tuple(check_overlap(drive, vehicle))
    if any(p.serious for p in found):
        return drive.with_problems(*found)
    drive = without_repeats(drive)
    drive = without_derived(drive)
    drive = with_half_digits(without_spikes(without_strays(drive, vehicle)))
    # Before rows are left out: a pause is one of the recording.
    found = (*found, *check_pauses(drive, vehicle))
    if not any(p.serious for p in check_range(drive, vehicle)):
        drive = without_smoothed(correct_clocks(drive), vehicle)
    problems = [*drive.problems[len(earlier) :], *found]
    if not any(p.serious for p in problems):
        problems += _found(drive, vehicle, cleaned=False)
    problems.sort(key=lambda p: not p.serious)
    clean = replace(within_ranges(drive), problems=(*earlier, *problems))
    if any(p.serious for p in problems):
        return clean
    clean = with_forward_accel(corrected(clean, vehicle))
    problems = [*clean.problems[len(earlier) :], *_found(clean, vehicle, cleaned=True)]
    problems.sort(key=lambda p: not p.serious)
    return replace(clean, problems=(*earlier, *problems))


def _found(drive: Drive, vehicle: Vehicle | None, *, cleaned: bool) -> Iterator[Problem]:
    """What checks find; never serious of a signal that a person vouches for."""
    for check in CHECKS.values():
        for p in check.find(drive, vehicle) if check.cleaned == cleaned else ():
            yield replace(p, serious=False) if p.signal in drive.info.trusted else p


def refuse_serious(name: str, problems: Iterable[Problem]) -> None:
    """Raise `DriveError` with the first serious problem of the drive of that name."""
    for problem in problems:
        if problem.serious:
            raise problem.at(name).error()


def check_drive(drive: Drive, vehicle: Vehicle | None = None) -> tuple[Problem, ...]:
    """Look for what cannot be so in a drive; parameters as of `correct_drive`.

    Returns
    -------
    What was found, serious problems first. The drive's own ``problems`` (from
    reading it) are not repeated.
    """
    return correct_drive(drive, vehicle).problems[len(drive.problems) :]
