"""Squat: the body pitches by the traction, uphill and as it accelerates, and the sensor with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.balance.law import squat_column
from weighbridge.constants import GRAVITY, INDEPENDENT
from weighbridge.limits import FEWEST_PIECES, MOVES, POSSIBLE
from weighbridge.messages import Problem, phrase
from weighbridge.navigation import BY_SPEED, Motion, with_squat
from weighbridge.signals import Bools, Floats, moving_mean
from weighbridge.vehicle import Vehicle, VehicleClass

SQUAT: Final = (0.0035, 0.0025)
"""Pitch of the body per specific force of a vehicle of which nothing is known, and its standard
deviation [rad per m/s^2]: four recorded cars had 0.0024 to 0.0051, and stiff trucks squat less."""

DRIVE_STD: Final = 0.0009
"""Standard deviation of the squat that one drive shows, beside what its navigation says
[rad per m/s^2]: heights by GNSS err together for minutes, and hills that happen to go with
acceleration pass for squat. Of 16 drives of two vehicles of another simulator half an hour
long the squat found was off by 0.0009, where the navigation says 0.0003."""

LOADED_STD: Final = 0.0003
"""By how much the squat of a vehicle changes with its load [rad per m/s^2]."""

ANOTHER: Final = 4.0
"""The same from which the sensor, not the body, leans another way [-]: ten undamaged simulated
drives of a car, an electric car and a truck were 0.4 off at most, a holder that swings by 0.5
degrees per m/s^2 by 4 to 8."""

LOADS: Final = (0.9, 1.2)
"""A vehicle is as light, and as heavy, as so many times the masses of its calibration [-]."""

AVERAGED: Final = 1.0
"""Accelerations are compared as means over this time [s]."""

BRIEF: Final = 10.0
"""What changes more slowly is grade and offset, and is taken off [s]."""

LEAST_ACCEL: Final = 0.15
"""Standard deviation of what is left that is needed [m/s^2]."""


SPEED_SCALE_STD: Final = 0.015
"""Scale of the speed by the wheels, relative standard deviation [-]: that of the tyres' radius."""

ACCEL_SCALE_STD: Final = 0.01
"""Scale of an accelerometer in a vehicle, relative standard deviation [-]."""


def squat_at(squat: float, mass: float, masses: Sequence[float], kind: VehicleClass) -> float:
    """Squat at a mass [rad per m/s^2], of a vehicle whose ``squat`` is that of its calibration.

    Parameters
    ----------
    squat : at the mean of ``masses`` [rad per m/s^2]
    mass : [kg]
    masses : of the calibration [kg]; where there are none the squat is taken as it is
    kind : class of the vehicle
    """
    if not masses or not mass > 0.0:
        return squat
    return float(squat * (mass / np.mean(masses)) ** kind.squat_growth)


def pooled(
    motions: Sequence[Motion], masses: Sequence[float], kind: VehicleClass
) -> tuple[float, float] | None:
    """Squat of a vehicle from several drives and its standard deviation; None where none shows.

    It is that at the mean of the drives' masses [rad per m/s^2].
    """
    found = [
        (
            m.squat / squat_at(1.0, mass, masses, kind),
            float(np.hypot(m.squat_std or 0.0, DRIVE_STD)),
        )
        for m, mass in zip(motions, masses, strict=True)
        if m.squat is not None and m.source not in BY_SPEED
    ]
    if not found:
        return None
    # What squat is usual counts as another drive.
    value, std = np.array([*found, SQUAT]).T
    weight = 1.0 / std**2
    return float(np.average(value, weights=weight)), float(1.0 / np.sqrt(np.sum(weight)))


def of_vehicle(motion: Motion, vehicle: Vehicle) -> Motion:
    """Hold the squat with which the torque was calibrated, unless the drive shows quite another.

    What a calibration gets wrong of it is in its torque as well and cancels; what a drive
    gets wrong does not. A sensor in a soft holder leans by more than the body, and another
    holder by as much again: then each drive has its own.
    """
    mounting = vehicle.mounting
    if mounting is None or mounting.squat is None or not vehicle.provenance.torque_fitted:
        return motion
    if motion.squat is None:
        return motion
    masses, kind = vehicle.provenance.masses, vehicle.of_class
    ends = [
        squat_at(mounting.squat, part * mass, masses, kind)
        for part, mass in zip(
            LOADS, (min(masses, default=0.0), max(masses, default=0.0)), strict=True
        )
    ]
    off = motion.squat - float(np.clip(motion.squat, min(ends), max(ends)))
    own_std = float(np.hypot(DRIVE_STD, motion.squat_std or 0.0))
    sureness = abs(off) / float(np.hypot(own_std, mounting.squat_std or 0.0))
    if sureness < POSSIBLE:
        return with_squat(motion, mounting.squat, LOADED_STD)
    leans = phrase("leans", now=np.degrees(motion.squat), then=np.degrees(mounting.squat))
    if sureness < ANOTHER:
        doubted = with_squat(motion, mounting.squat, 0.5 * abs(motion.squat - mounting.squat))
        note = Problem.of("imu.lean_doubtful", leans=leans)
        return replace(doubted, notes=(*motion.notes, note))
    note = Problem.of("imu.lean", leans=leans)
    return replace(motion, squat_std=own_std, own_squat=True, notes=(*motion.notes, note))


@dataclass(frozen=True, slots=True)
class ResidualSquat:
    """Squat that is still in the specific force.

    Attributes
    ----------
    squat : pitch per specific force to take out; negative to put back [rad per m/s^2]
    std : what stays unknown of it
    """

    squat: float
    std: float

    def squat_accel(self, force: Floats) -> Floats:
        """What the squat adds to the specific force (n,) [m/s^2].

        Parameters
        ----------
        force : with the squat that is to be taken out, or without that to be put back [m/s^2]
        """
        read = 1.0 + GRAVITY * max(self.squat, 0.0)
        return np.asarray(self.squat / read * squat_column(force))

    @property
    def relative_std(self) -> float:
        """Relative standard deviation of the mass [-]."""
        return GRAVITY * self.std


def share_of_accel(accel: Floats, phi: Floats, used: Bools) -> float:
    """Part of what weighs that is acceleration, not hills [-].

    Parameters
    ----------
    accel, phi : (n,) acceleration and regressor of the mass [m/s^2]
    used : (n,)
    """
    if np.count_nonzero(used) < 2:
        return 0.0
    weight = phi[used] - phi[used].mean()
    share = float(weight @ accel[used]) / max(float(weight @ weight), 1e-9)
    return float(np.clip(share, 0.0, 1.0))


def squat_by_speed(motion: Motion) -> tuple[float, float] | None:
    """Find squat as what one accelerometer reads too much of the wheels' acceleration.

    Over some seconds what the road's grade adds has little to do with how the driver
    accelerates. So the slope of the specific force on the rate of the speed is 1 + g k,
    times the scale of the accelerometer over that of the speed, which stays open.

    Parameters
    ----------
    motion : by an accelerometer along the vehicle

    Returns
    -------
    Pitch per acceleration and its standard deviation [rad per m/s^2]; None where too little
    accelerates.
    """
    rate = motion.rate
    moving = motion.valid & (motion.speed > MOVES)
    around = max(round(AVERAGED * rate), 1), max(round(BRIEF * rate), 1)
    parts = [
        moving_mean(x, around[0], "symmetric") - moving_mean(x, around[1], "symmetric")
        for x in (motion.specific_force, np.gradient(motion.speed, 1.0 / rate))
    ]
    inside = moving_mean(moving.astype(np.float64), around[1], "symmetric") > 0.999
    block = (motion.time[inside] // INDEPENDENT).astype(np.int64)
    read, rolled = (x[inside] for x in parts)
    _, block = np.unique(block, return_inverse=True)
    if block.size == 0 or block.max() < FEWEST_PIECES:
        return None
    cross = np.bincount(block, weights=read * rolled)
    square = np.bincount(block, weights=rolled**2)
    if square.sum() / read.size < LEAST_ACCEL**2:
        return None
    slope = float(cross.sum() / square.sum())
    left_out = (cross.sum() - cross) / (square.sum() - square)
    many = left_out.size
    scatter = (many - 1) / many * float(np.sum((left_out - left_out.mean()) ** 2))
    std = float(np.sqrt(scatter + SPEED_SCALE_STD**2 + ACCEL_SCALE_STD**2))
    return (slope - 1.0) / GRAVITY, std / GRAVITY


def residual_squat(balance: ForceBalance, vehicle: Vehicle, mass: float) -> ResidualSquat:
    """Find what squat the rows and the torque of the vehicle do not have in common.

    Parameters
    ----------
    balance, vehicle
    mass : rough, for squat that grows with it [kg]

    An accelerometer that leans by k per specific force reads it 1 + g k times too
    large. The navigation takes that out where the drive shows k. A torque that
    was calibrated against such readings has the factor in it, and must meet it
    again; one of a data sheet, or calibrated by speed, must not.
    """
    motion, made, mounting = balance.motion, vehicle.provenance, vehicle.mounting
    given = mounting.squat if mounting is not None else None
    given_std = (mounting.squat_std or 0.0) if mounting is not None else 0.0
    found_std = motion.squat_std or 0.0
    if motion.own_squat:
        return ResidualSquat(0.0, found_std)
    if made.torque_fitted and given is None and made.motion is None:
        # The file does not say what its torque has met: most likely the same.
        return ResidualSquat(0.0, found_std)
    rows_hold_squat = motion.source not in BY_SPEED and motion.squat is None
    torque_holds_squat = made.torque_fitted and given is None and made.motion not in BY_SPEED
    if rows_hold_squat == torque_holds_squat:
        if rows_hold_squat or given is None or motion.squat is None or not made.torque_fitted:
            return ResidualSquat(0.0, found_std)
        return ResidualSquat(
            squat_at(given, mass, made.masses, vehicle.of_class) - motion.squat, found_std
        )
    if rows_hold_squat:
        if given is not None:
            return ResidualSquat(squat_at(given, mass, made.masses, vehicle.of_class), given_std)
        seen = squat_by_speed(motion) if motion.source == "longitudinal_accel" else None
        return ResidualSquat(*SQUAT) if seen is None else ResidualSquat(*_mean(SQUAT, seen))
    if motion.squat is not None:
        return ResidualSquat(-motion.squat, found_std)
    return ResidualSquat(-SQUAT[0], SQUAT[1])


def _mean(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    """Return the mean weighted by variance of two values with standard deviations, and its own."""
    weight = b[1] ** 2 / (a[1] ** 2 + b[1] ** 2)
    return weight * a[0] + (1.0 - weight) * b[0], float(np.sqrt(weight)) * a[1]
