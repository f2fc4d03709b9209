"""The best way to the motion that a drive allows."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from weighbridge.errors import LostError
from weighbridge.messages import Problem, refused
from weighbridge.navigation.longitudinal import longitudinal_motion
from weighbridge.navigation.motion import Motion
from weighbridge.navigation.settings import RATE, NavigationSettings
from weighbridge.navigation.sources import read_sources
from weighbridge.navigation.speed import speed_motion
from weighbridge.signals import Drive, Signal
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.vehicle import Vehicle

if TYPE_CHECKING:
    from weighbridge.navigation.identify.setup import Setup

_OF_FIXES: Final = ("latitude", "longitude", "gnss_speed", "gnss_course")
"""Signals that go with positions which fit no motion."""


def find_motion(drive: Drive, vehicle: Vehicle | None = None) -> Motion:
    """Find the motion of a drive the best way its signals allow; see `identify_motion`."""
    return identify_motion(drive, vehicle)[0]


def identify_motion(drive: Drive, vehicle: Vehicle | None = None) -> tuple[Motion, Setup | None]:
    """Find the motion of a drive the best way its signals allow, and what it was found by.

    In this order: IMU with speed or GNSS, one accelerometer along the vehicle
    with speed, speed with grade or height, speed alone. Where the drive itself
    does not show the scale of its vehicle speed, the vehicle's is taken off.

    Returns
    -------
    motion
    setup : of the inertial navigation; None where it was found another way

    Raises
    ------
    DriveError
        No way is open; the sentence names what is missing.
    """
    if _inertial_sensor(drive):
        try:
            return _inertial(drive, vehicle)
        except LostError as lost:
            if not drive.has("vehicle_speed"):
                raise
            motion, setup = _inertial(drive.without(*_OF_FIXES), vehicle)
            left_out = Problem.from_error(lost)
            return replace(motion, notes=(replace(left_out, serious=False), *motion.notes)), setup
    if drive.has("longitudinal_accel", "vehicle_speed"):
        return longitudinal_motion(true_speed(drive, vehicle)), None
    if drive.has("vehicle_speed") or drive.has("gnss_speed"):
        return speed_motion(true_speed(drive, vehicle)), None
    raise refused("speed.missing", drive=drive.name)


def _inertial_sensor(drive: Drive) -> bool:
    """Whether a drive can be navigated by an inertial sensor."""
    has_speed = drive.has("vehicle_speed") or drive.has("gnss_speed")
    return drive.has(*IMU_SIGNALS) and (has_speed or drive.has("latitude", "longitude"))


def by_accelerometer(drive: Drive) -> bool:
    """Whether the motion of a drive is found with an accelerometer."""
    return _inertial_sensor(drive) or drive.has("longitudinal_accel", "vehicle_speed")


def _inertial(drive: Drive, vehicle: Vehicle | None) -> tuple[Motion, Setup]:
    """Find the motion by inertial navigation; see `identify_motion`."""
    from weighbridge.navigation.identify.rounds import navigate

    mounting = vehicle.mounting if vehicle is not None else None
    sources = read_sources(drive)
    known = scaled_for_navigation(drive, vehicle, positions=sources.fixes is not None)
    if known is not drive:
        sources = read_sources(known)
    setup, motion = navigate(sources, mounting, NavigationSettings(), RATE)
    return motion, setup


def without_accelerometer(drive: Drive) -> Drive:
    """Return the drive as one that recorded no inertial sensor; its motion is then by speed."""
    return drive.without(*IMU_SIGNALS, "longitudinal_accel")


def scaled_for_navigation(drive: Drive, vehicle: Vehicle | None, *, positions: bool) -> Drive:
    """Return a drive as inertial navigation takes it, of a whole drive as on the way.

    Parameters
    ----------
    drive, vehicle
    positions : fixes of GNSS show the scale of its speed; else the vehicle's is taken off
    """
    return drive if positions else true_speed(drive, vehicle)


def true_speed(drive: Drive, vehicle: Vehicle | None) -> Drive:
    """Take the vehicle's known speed scale off its indicated speed."""
    speed = drive.get("vehicle_speed")
    if speed is None or vehicle is None or vehicle.driveline.speed_scale == 1.0:
        return drive
    true = speed.values / vehicle.driveline.speed_scale
    return drive.with_signals(Signal(speed.name, speed.time, true))
