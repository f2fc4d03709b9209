"""What a whole drive shows once: its motion, what it adds to the vehicle, its clocks."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from weighbridge.balance import ForceBalance, force_balance
from weighbridge.balance.charge import in_this_air
from weighbridge.balance.circumference import on_its_tyres
from weighbridge.balance.delay import clock_shift, estimate_torque_delay
from weighbridge.balance.torque_drift import smoothed_steps
from weighbridge.estimators.judging import lacks_accelerometer
from weighbridge.estimators.squat import of_vehicle
from weighbridge.messages import Problem, phrase, refused
from weighbridge.navigation import (
    BY_SPEED,
    by_accelerometer,
    identify_motion,
    without_accelerometer,
)
from weighbridge.pipeline.notes import other_equipment
from weighbridge.signals import Drive
from weighbridge.vehicle import Vehicle, by_power
from weighbridge.vehicle.as_read import as_read

CLOCKS_APART: Final = 0.6
"""Torque later by so much than in the calibration is another clock [s]: in simulated drives of one
vehicle it differed by less than 0.1 s, and masses are 8 to 12 % light at 1 s."""

ONE_TABLE: Final = 0.4
"""Lateness of speed and torque that differs by less is that of their table [s]: speeds are late by
0 to 0.4 s where their clock is right."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSetup:
    """What a drive is weighed by.

    Attributes
    ----------
    vehicle : that of the file as calibrated with what the drive records, and what the drive shows
        of it: the air that its engine breathes, the scale of its torque by the battery, the tyres
        that it rolls on
    balance : forces and motion, on one clock
    notes : what was found and what is uncertain
    """

    vehicle: Vehicle
    balance: ForceBalance
    notes: tuple[Problem, ...]


def identify(drive: Drive, vehicle: Vehicle) -> DriveSetup:
    """Balance measured or modelled torque against the best motion that the drive allows.

    Parameters
    ----------
    drive : checked and corrected
    vehicle : as its source of torque sees it

    Raises
    ------
    DriveError
        Torque and motion are on clocks that differ, or no way to the motion is open.
    """
    drive, vehicle, left_out = _with_the_same_sensors(drive, vehicle)
    found, navigation = identify_motion(drive, vehicle)
    vehicle, notes = by_power(drive, in_this_air(drive, vehicle))
    motion = of_vehicle(found, vehicle)
    as_calibrated = vehicle.timing.torque_delay or 0.0
    balance = force_balance(drive, vehicle, motion, delay=as_calibrated)
    vehicle, tyres = on_its_tyres(balance, vehicle)
    if tyres is not None:
        notes += (tyres,)
        balance = force_balance(drive, vehicle, motion, delay=as_calibrated)
    drive, drifted, balance = smoothed_steps(drive, vehicle, balance)
    delay, moved = _torque_delay(drive, vehicle, balance)
    if balance.delay != delay:
        balance = force_balance(drive, vehicle, motion, delay=delay)
    notes += (
        left_out
        + motion.notes
        + drifted
        + moved
        + other_equipment(vehicle, balance)
        + balance.notes
    )
    return DriveSetup(vehicle=vehicle, balance=replace(balance, navigation=navigation), notes=notes)


def _with_the_same_sensors(
    drive: Drive, vehicle: Vehicle
) -> tuple[Drive, Vehicle, tuple[Problem, ...]]:
    """Take of a drive and of its vehicle file what both know: the accelerometer, or neither.

    A motion by speed has errors of its own, and a torque that was calibrated by one contains them.
    Of 32 drives of ten vehicles, files made without an accelerometer made those with one 3.7 % too
    heavy in the mean (5.7 % RMS, ten intervals did not hold), and files made with one made those
    without 3.5 % too light; alike, errors are 2.9 % RMS, and all intervals hold.
    """
    made = vehicle.provenance
    if not by_accelerometer(drive):
        known = vehicle.without_accelerometer is not None
        return drive, as_read(vehicle.by_speed()) if known else vehicle, ()
    has_speed = drive.has("vehicle_speed") or drive.has("gnss_speed")
    if made.torque_fitted and made.motion in BY_SPEED and has_speed:
        left_out = Problem.of("imu.file_without", vehicle=vehicle.name)
        return without_accelerometer(drive), vehicle, (left_out,)
    return drive, vehicle, ()


def _torque_delay(
    drive: Drive, vehicle: Vehicle, balance: ForceBalance
) -> tuple[float, tuple[Problem, ...]]:
    """How late the torque is in a drive [s], and what is to be said of it.

    Raises
    ------
    DriveError
        The clocks of torque and motion are `CLOCKS_APART` or more off, and not those of speed
        and motion by as much.
    """
    motion, delay = balance.motion, vehicle.timing.torque_delay
    if delay is None:
        delay = estimate_torque_delay(drive, vehicle, motion, balance)
        if math.isfinite(delay):
            return delay, (Problem.of("torque.delay_found", delay=delay),)
        return 0.0, (Problem.of("torque.delay_unknown"),)
    later = 0.0
    if vehicle.provenance.torque_fitted:
        later = clock_shift(drive, vehicle, motion, balance)
    if not later:
        return delay, ()
    words = phrase("later" if later > 0.0 else "earlier", by=abs(later))
    # As late as the speed beside it: the whole table is, and the shift brings all of it back.
    of_table = motion.speed_delay > CLOCKS_APART and abs(motion.speed_delay - later) < ONE_TABLE
    if abs(later) > CLOCKS_APART and not of_table:
        raise refused("clock.torque_apart", drive=drive.name, later=words, by=later)
    # Against a speed alone, which is late itself, the torque's clock is another one.
    if lacks_accelerometer(vehicle, motion):
        return delay + later, ()
    return delay + later, (Problem.of("torque.clock_moved", later=words, by=later),)
