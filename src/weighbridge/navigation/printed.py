"""Motion by the navigation filter of Jensen et al. 2022 as printed (sec. 5, 7.1).

One pass forward, the paper's noise, no lean of the body, no lateness: what `rls` weighs by with
``printed=true``. Other drives are weighed by `weighbridge.navigation.select.find_motion`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
import pymap3d

from weighbridge.constants import GRAVITY
from weighbridge.errors import ConfigError, DriveError
from weighbridge.kernels import ins_printed as kernel
from weighbridge.kernels.rotation import euler_to_matrix, euler_to_quaternion
from weighbridge.navigation.aiding import Fixes, Imu, read_fixes, read_imu
from weighbridge.navigation.motion import Motion, noise_level
from weighbridge.signals import Drive, Floats, Signal
from weighbridge.vehicle import Mounting


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedFilterSettings:
    """Tables 2 and 3 and the rules of sec. 7.1; the defaults are the paper's.

    Attributes
    ----------
    position_std, velocity_std : before the drive [m], [m/s]
    tilt_std, yaw_std : of roll and pitch, of yaw, before the drive [rad]
    accel_bias_start, gyro_bias_start : before the drive [m/s^2], [rad/s]
    accel_std, gyro_std : noise per sample [m/s^2], [rad/s]
    accel_bias_std, gyro_bias_std : steps of the biases per sample [m/s^2], [rad/s]
    horizontal_std, vertical_fix_std : of fixes [m]
    speed_std, lateral_std, vertical_std : of vehicle speed and constraints [m/s]
    still_std : of the constraints at a standstill [m/s]; the paper says "greatly reduced"
    rest_samples : inertial samples at rest behind the first gyro bias, roll and pitch
    chord_fixes : fixes after the start whose chord is the first yaw: 2 in the paper
    window : samples of the linearly weighted moving average over the specific force
    attitude_term : velocity rows see the attitude. Eq. 46 leaves that out; simulated drives then
        lose the attitude altogether
    plumb_line : down follows the plumb line; the paper's stays that of the start
    """

    position_std: float = 2.0
    velocity_std: float = 0.5
    tilt_std: float = 5e-3
    yaw_std: float = 1e-2
    accel_bias_start: float = 0.005
    gyro_bias_start: float = 8e-4
    accel_std: float = 0.03
    gyro_std: float = 1e-5
    accel_bias_std: float = 1e-3
    gyro_bias_std: float = 1e-6
    horizontal_std: float = 2.0
    vertical_fix_std: float = 5.0
    speed_std: float = 0.5
    lateral_std: float = 5.0
    vertical_std: float = 15.0
    still_std: float = 0.1
    rest_samples: int = 200
    chord_fixes: int = 2
    window: int = 25
    attitude_term: bool = True
    plumb_line: bool = False

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name.endswith(("_std", "_start")) and not value > 0.0:
                raise ConfigError(f"{item.name} must be positive, got {value:g}")
        for name, least in (("rest_samples", 10), ("chord_fixes", 2), ("window", 1)):
            if getattr(self, name) < least:
                raise ConfigError(f"{name} must be {least} or more, got {getattr(self, name)}")

    @property
    def noise(self) -> kernel.PrintedNoise:
        """What the kernel takes."""
        return kernel.PrintedNoise(
            gravity=GRAVITY,
            accel_std=self.accel_std,
            gyro_std=self.gyro_std,
            accel_bias_std=self.accel_bias_std,
            gyro_bias_std=self.gyro_bias_std,
            fix_std=np.array([self.horizontal_std, self.horizontal_std, self.vertical_fix_std]),
            speed_std=self.speed_std,
            lateral_std=self.lateral_std,
            vertical_std=self.vertical_std,
            still_std=self.still_std,
            attitude_term=float(self.attitude_term),
        )

    def covariance(self) -> Floats:
        """Error covariance before the drive (15, 15), Table 2."""
        return np.diag(
            np.square(
                [
                    *(self.position_std,) * 3,
                    *(self.velocity_std,) * 3,
                    self.tilt_std,
                    self.tilt_std,
                    self.yaw_std,
                    *(self.accel_bias_start,) * 3,
                    *(self.gyro_bias_start,) * 3,
                ]
            )
        )


_STRIDE = 10
"""Inertial samples per row of the motion: 20 Hz of the paper's 200 Hz."""


def mounting_of(
    drive: Drive, known: Mounting | None, settings: PrintedFilterSettings | None = None
) -> Floats:
    """Sensor to vehicle axes (3, 3): those of a vehicle file, else of `level_mounting`."""
    if known is None:
        return level_mounting(drive, settings)
    return np.asarray(euler_to_matrix(known.roll, known.pitch, known.yaw))


def level_mounting(drive: Drive, settings: PrintedFilterSettings | None = None) -> Floats:
    """Sensor to vehicle axes (3, 3), from gravity at rest on a flat place; yaw is not seen.

    Raises
    ------
    DriveError
        The drive does not begin at rest.
    """
    imu = read_imu(drive)
    roll, pitch = _tilt(_at_rest(drive, imu, settings or PrintedFilterSettings())[0])
    return np.asarray(euler_to_matrix(roll, pitch, 0.0))


def printed_motion(
    drive: Drive, mounting: Floats, settings: PrintedFilterSettings | None = None
) -> Motion:
    """Find the motion of a drive by the printed filter.

    Parameters
    ----------
    drive : with inertial samples, ``vehicle_speed`` and fixes of GNSS; begins at rest
    mounting : (3, 3) sensor to vehicle axes, as of `level_mounting`
    settings : the paper's when None

    Returns
    -------
    Motion
        Grade and pitch are the same: the paper takes the pitch of the body for the slope.

    Raises
    ------
    DriveError
        A signal is missing, or the drive does not begin at rest.

    References
    ----------
    Jensen et al. 2022, Algorithm 1, sec. 7.1.
    """
    settings = settings or PrintedFilterSettings()
    imu = read_imu(drive)
    speed = drive.get("vehicle_speed")
    fixes = read_fixes(drive, float(imu.time[0]), float(imu.time[-1]))
    if speed is None or fixes is None:
        raise DriveError(f"{drive.name}: the filter as printed takes vehicle_speed and GNSS")
    ned = fixes.ned if settings.plumb_line else _tangent(drive, fixes)
    rest_accel, rest_gyro = _at_rest(drive, imu, settings)
    roll, pitch = _tilt(mounting @ rest_accel)
    x = np.zeros(kernel.STATES)
    x[6:10] = euler_to_quaternion(roll, pitch, _chord_yaw(speed, fixes.time, ned, settings))
    x[13:16] = -mounting @ rest_gyro
    found = np.empty((imu.time.size, kernel.SHOWN))
    kernel.run(
        x,
        settings.covariance(),
        imu.time,
        np.ascontiguousarray(imu.accel[:] @ mounting.T),
        np.ascontiguousarray(imu.gyro[:] @ mounting.T),
        _aid(imu, speed, fixes.time, ned),
        settings.noise,
        found,
    )
    return _laid_out(imu.time, found, fixes, settings)


def _laid_out(time: Floats, found: Floats, fixes: Fixes, settings: PrintedFilterSettings) -> Motion:
    """Smooth the specific force as sec. 7.1 has it, and take all to an even clock."""
    weights = np.arange(settings.window, 0.0, -1.0)
    smooth = np.convolve(found[:, 0], weights / weights.sum())[: time.size]
    period = _STRIDE * float(np.median(np.diff(time)))
    even = np.arange(time[0], time[-1], period)
    rows = np.column_stack([np.interp(even, time, column) for column in found.T])
    force, pitch = np.interp(even, time, smooth), rows[:, 2]
    yaw = np.unwrap(found[:, 3])
    step = np.maximum(rows[:, 4], 0.0)
    return Motion(
        source="inertial",
        time=even,
        speed=rows[:, 4],
        accel=force - GRAVITY * np.sin(pitch),
        specific_force=force,
        grade=pitch,
        pitch=pitch,
        roll=rows[:, 1],
        heading=np.mod(np.interp(even, time, yaw), 2.0 * math.pi),
        distance=np.concatenate([[0.0], np.cumsum(period * 0.5 * (step[1:] + step[:-1]))]),
        altitude=fixes.frame.altitude - rows[:, 7],
        valid=np.ones(even.size, dtype=bool),
        specific_force_std=noise_level(force),
        grade_std=np.full(even.size, settings.tilt_std),
    )


def _at_rest(drive: Drive, imu: Imu, settings: PrintedFilterSettings) -> tuple[Floats, Floats]:
    """Mean specific force (3,) and angular rate (3,) of the first samples, in sensor axes."""
    count = settings.rest_samples
    speed = drive.get("vehicle_speed")
    moves = speed is None or bool(np.any(speed.values[speed.time <= imu.time[count]] > 0.0))
    if moves:
        raise DriveError(
            f"{drive.name}: the filter as printed begins at rest, for {count} inertial samples"
        )
    return np.mean(imu.accel[:count], axis=0), np.mean(imu.gyro[:count], axis=0)


def _tilt(rest: Floats) -> tuple[float, float]:
    """Roll and pitch [rad] of axes that read a specific force (3,) at rest."""
    x, y, z = rest
    return math.atan2(-y, -z), math.atan2(x, math.hypot(y, z))


def _chord_yaw(speed: Signal, time: Floats, ned: Floats, settings: PrintedFilterSettings) -> float:
    """Direction of the chord of the first fixes after the vehicle moved [rad]."""
    moved = speed.time[np.argmax(speed.values > 0.0)]
    first = int(np.searchsorted(time, moved))
    last = min(first + settings.chord_fixes - 1, time.size - 1)
    north, east, _ = ned[last] - ned[first]
    return math.atan2(east, north)


def _tangent(drive: Drive, fixes: Fixes) -> Floats:
    """Positions (m, 3) in the tangent plane of the first fix (eqs. 12-16) [m]."""
    height = fixes.frame.height(fixes.ned)
    latitude, longitude = drive.signals["latitude"], drive.signals["longitude"]
    n, e, d = pymap3d.geodetic2ned(
        latitude.at(fixes.time),
        longitude.at(fixes.time),
        np.where(np.isfinite(height), height, fixes.frame.altitude),
        fixes.frame.latitude,
        fixes.frame.longitude,
        fixes.frame.altitude,
        deg=False,
    )
    return np.column_stack([n, e, np.where(np.isfinite(height), d, np.nan)])


def _aid(imu: Imu, speed: Signal, time: Floats, ned: Floats) -> kernel.PrintedAid:
    """Put speed and fixes to the sample that follows them; stamps are taken as they are."""
    count = imu.time.size
    speeds = np.full(count, np.nan)
    at = np.searchsorted(imu.time, speed.time)
    inside = at < count
    speeds[at[inside]] = speed.values[inside]
    fix = np.full(count, -1, dtype=np.int64)
    at = np.searchsorted(imu.time, time)
    inside = at < count
    fix[at[inside]] = np.flatnonzero(inside)
    return kernel.PrintedAid(speeds, fix, np.ascontiguousarray(ned))
