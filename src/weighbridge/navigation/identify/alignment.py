"""Sensor to body axes, and how late speed and GNSS are."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.kernels.rotation import euler_to_matrix
from weighbridge.limits import MOVES, SURE
from weighbridge.messages import Problem, refused
from weighbridge.navigation.aiding import Fixes, interpolated, resample, speed_from_fixes
from weighbridge.navigation.even import Even
from weighbridge.navigation.identify.mounting import (
    CoarseMounting,
    TooLittleMotionError,
    coarse_mounting,
)
from weighbridge.navigation.identify.timing import estimate_speed_delay
from weighbridge.navigation.sources import undelayed, usable
from weighbridge.signals import Drive, Floats, Signal, moving_mean
from weighbridge.vehicle import Mounting

COARSE_PERIOD: Final = 0.5
"""Clock of the coarse alignment [s]."""

FINE_RATE: Final = 20.0
"""Clock of the delays [Hz]."""

MOST_MOVED: Final = 0.2
"""A mounting further from the one given, and by `SURE` standard deviations, is another [rad]: a
steady drive hardly shows where ahead is."""

_NOD_BAND: Final = (2.0, 20.0)
"""A nod is looked for between means over so long [s]: slower turns are grade."""

_NODS: Final = (0.6, 1.6)
"""Part of a difference of speed and accelerometer that a nod explains where it is the cause [-]."""


@dataclass(frozen=True, slots=True)
class Alignment:
    """How the sensor sits and how late the speed is.

    Attributes
    ----------
    rot_bs : (3, 3) sensor to body axes
    tilt_std, yaw_std : its standard deviations [rad]
    yaw_rate_bias : of the gyro [rad/s]; NaN where not found
    speed_delay : stamp minus the instant the speed was true [s]
    given : the mounting given; None where the sensor was moved since
    """

    rot_bs: Floats
    tilt_std: float
    yaw_std: float
    yaw_rate_bias: float
    speed_delay: float
    given: Mounting | None


def align(
    fine: Even, coarse_imu: Even, reference: Signal, mounting: Mounting | None
) -> tuple[Alignment, tuple[Problem, ...]]:
    """Find how the sensor sits and how late the speed is, from a whole drive.

    Parameters
    ----------
    fine, coarse_imu : inertial samples on the clocks of delays and of the coarse alignment
    reference : speed
    mounting : the one known

    Returns
    -------
    alignment
    notes : what was not found

    Raises
    ------
    DriveError
        The drive is too quiet, or units or axes do not fit together.
    """
    found, notes = _prior(mounting), list[Problem]()
    coarse = None
    for _ in range(2):
        shifted = undelayed(reference, found.speed_delay)
        try:
            coarse = _coarse(coarse_imu, shifted)
        except TooLittleMotionError:
            if found.given is None:
                raise
            coarse = None
        if coarse is not None:
            found, moved = _merged(found, coarse)
            if moved is not None:
                notes.append(moved)
        forward = fine.values[:, :3] @ found.rot_bs[0]
        delay, std = estimate_speed_delay(fine.time, forward, reference)
        found = replace(found, speed_delay=delay if std < 0.1 else 0.0)
    if coarse is not None and reference.name == "vehicle_speed":
        nod = _nod(coarse_imu, coarse, undelayed(reference, found.speed_delay))
        _check_speed_unit(coarse, reference, nod)
    if found.speed_delay == 0.0:
        notes.append(Problem.of("speed.delay_unknown", "vehicle_speed"))
    return found, tuple(notes)


def _prior(mounting: Mounting | None) -> Alignment:
    """Take what is known before the drive."""
    if mounting is None:
        return Alignment(np.eye(3), 0.01, 0.02, math.nan, 0.0, None)
    tilt_std, yaw_std = 0.01, 0.02
    if mounting.std is not None:
        tilt_std = max(mounting.std[0], mounting.std[1], 0.003)
        yaw_std = max(mounting.std[2], 0.005)
    rot = euler_to_matrix(mounting.roll, mounting.pitch, mounting.yaw)
    return Alignment(rot, tilt_std, yaw_std, math.nan, 0.0, mounting)


def _coarse(imu: Even, speed: Signal) -> CoarseMounting:
    at = _coarse_speed(speed, imu.time)
    return coarse_mounting(imu.values[:, :3], imu.values[:, 3:], at, COARSE_PERIOD, at < 0.05)


def _merged(found: Alignment, coarse: CoarseMounting) -> tuple[Alignment, Problem | None]:
    """Take the coarse mounting where none is known, or where it is surely another one."""
    bias = coarse.yaw_rate_bias
    own = Alignment(coarse.rot_bs, coarse.tilt_std, coarse.yaw_std, bias, found.speed_delay, None)
    if found.given is None:
        return own, None
    angle = math.acos(np.clip(0.5 * (np.trace(found.rot_bs @ coarse.rot_bs.T) - 1.0), -1, 1))
    unsure = math.hypot(coarse.yaw_std, coarse.tilt_std, found.tilt_std, found.yaw_std)
    if angle <= max(MOST_MOVED, SURE * unsure):
        return replace(found, yaw_rate_bias=bias), None
    return own, Problem.of("imu.mounting_moved", angle=math.degrees(angle))


def _nod(imu: Even, coarse: CoarseMounting, speed: Signal) -> float:
    """Turn of the sensor per acceleration, nose up, by its gyro [rad per m/s^2]."""
    at = _coarse_speed(speed, imu.time)
    known = np.isfinite(at) & (at > MOVES)
    accel = np.gradient(np.where(known, at, 0.0), imu.time)
    turned = np.cumsum(imu.values[:, 3:] @ coarse.rot_bs[1]) * COARSE_PERIOD
    short, long = (max(3, round(x / COARSE_PERIOD)) for x in _NOD_BAND)
    x, y = (moving_mean(v, short, "edge") - moving_mean(v, long, "edge") for v in (accel, turned))
    inner = moving_mean(known.astype(np.float64), long, "constant") > 1.0 - 1e-9
    spread = float(x[inner] @ x[inner])
    return float(x[inner] @ y[inner]) / spread if spread > 0.0 else 0.0


def _check_speed_unit(coarse: CoarseMounting, reference: Signal, nod: float) -> None:
    """Refuse a speed whose changes are not those of the accelerometer.

    Parameters
    ----------
    coarse, reference
    nod : of `_nod`; where gravity felt by it is most of the difference, the speed is not at fault
    """
    margin = 4.0 * coarse.forward_gain_std
    low = max(coarse.forward_gain + margin, coarse.forward_gain_most) < 0.75
    if not (coarse.forward_gain - margin > 1.3 or low):
        return
    felt = GRAVITY * nod / (coarse.forward_gain - 1.0)
    if _NODS[0] < felt < _NODS[1]:
        raise refused(
            "imu.mount_loose",
            nod=math.degrees(abs(nod)),
            gain=coarse.forward_gain,
            speed=reference.name,
        )
    raise refused("speed.unit_of_accel", speed=reference.name, ratio=1.0 / coarse.forward_gain)


def gnss_delay(drive: Drive, fine: Even, fixes: Fixes | None, rot_bs: Floats) -> float:
    """Find how late GNSS is, from its speed or that between fixes; 0 where not shown [s]."""
    if fixes is None:
        return 0.0
    start, end = float(fine.time[0]), float(fine.time[-1])
    speed = usable(drive.get("gnss_speed"), start, end) or speed_from_fixes(fixes)
    delay, std = estimate_speed_delay(fine.time, fine.values[:, :3] @ rot_bs[0], speed)
    return delay if std < 0.05 else 0.0


def _coarse_speed(speed: Signal, grid: Floats) -> Floats:
    """Take the speed to the coarse clock in the band of the coarse inertial samples."""
    longest = max(2.0, 3.0 * speed.period)
    at = interpolated(speed, grid, longest)
    if speed.period < 0.3 * COARSE_PERIOD:
        smooth_speed = resample(
            speed.time, [speed.values], float(grid[0]), COARSE_PERIOD, grid.size
        )[:, 0]
        return np.where(np.isfinite(at) & (at > 0.05), smooth_speed, at)
    return at
