"""Inertial samples, fixes and speeds of a drive, as the filter takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from weighbridge.kernels.lowpass import lowpass_resample
from weighbridge.limits import MOVES
from weighbridge.messages import refused
from weighbridge.navigation.axes import Axes
from weighbridge.navigation.dropouts import false_rows
from weighbridge.navigation.frozen import without_frozen
from weighbridge.navigation.geodesy import LocalFrame
from weighbridge.signals import Bools, Drive, Floats, Signal
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.signals.interpolation import interpolate

_FEWEST = 50
"""Fewer inertial samples show nothing."""

_BRIEF = 30.0
"""Too short to be weighed, whatever its samples are [s]."""

_REACH = 3.0
"""Periods of an even clock to both sides that its low-pass reaches to [-]."""

_AT_ONCE = 1 << 12
"""Outputs low-passed at a time: their samples stay in the processor's cache."""

SLOWEST = 0.11
"""Inertial samples further apart lose what happens between them [s]. Twelve cars and vans with a
sensor of 5 Hz scattered by 3.2 % (OBD at 4 Hz) and 7.4 % (1 Hz) with it, and 2.7 and 3.8 % without
it (studies/car_equipment.md). Twenty-four drives of 14 vehicles of the corpus with an accelerometer
of 5 Hz and no gyroscope scattered by 5.7 %, and by 2.5 % without it."""


@dataclass(frozen=True, slots=True)
class Imu:
    """Inertial samples on one clock, in sensor axes.

    Attributes
    ----------
    time : (n,) strictly increasing [s]
    accel : specific force [m/s^2]
    gyro : angular rate [rad/s]
    period : median distance of samples [s]
    false : part of the samples that could not be and were left out [-]
    """

    time: Floats
    accel: Axes
    gyro: Axes
    period: float
    false: float = 0.0


@dataclass(frozen=True, slots=True)
class Fixes:
    """GNSS fixes in a local frame.

    Attributes
    ----------
    time : (m,) [s]
    ned : (m, 3) north, east, down; down is NaN without height [m]
    frame : of ``ned``
    has_height : whether the drive carries altitude
    """

    time: Floats
    ned: Floats
    frame: LocalFrame
    has_height: bool


def read_imu(drive: Drive) -> Imu:
    """Gather the six inertial signals on the clock of ``accel_x``; frozen stretches are left out.

    Raises
    ------
    DriveError
        Signals are missing, hardly overlap or are far too slow.
    """
    missing = drive.missing(IMU_SIGNALS)
    if missing:
        raise refused("imu.missing", drive=drive.name, missing=", ".join(missing))
    drive = without_frozen(drive, IMU_SIGNALS)
    signals = [drive.signals[n] for n in IMU_SIGNALS]
    start = max(float(s.time[0]) if len(s) else np.inf for s in signals)
    end = min(float(s.time[-1]) if len(s) else -np.inf for s in signals)
    clock = signals[0].time
    keep = (clock >= start) & (clock <= end)
    for s in signals:
        # An axis that has a gap of its own must not be invented across it.
        if s.time is not clock and not np.array_equal(s.time, clock):
            usual = float(np.median(np.diff(clock))) if clock.size > 1 else 0.0
            keep &= s.age(clock) <= 2.0 * max(usual, s.period)
    if keep.sum() < _FEWEST:
        raise refused("imu.few_shared", drive=drive.name, count=int(keep.sum()))
    whole = bool(keep.all())
    # Kernels are compiled for arrays that can be written to and lie in one piece.
    time = np.require(clock if whole else clock[keep], requirements=("C", "W"))
    columns = []
    for s in signals:
        if s.time is not clock and not np.array_equal(s.time, clock):
            columns.append(np.interp(time, s.time, s.values))
        else:
            columns.append(s.values if whole else s.values[keep])
    accel, gyro = Axes(*columns[:3]), Axes(*columns[3:])
    speed = drive.speed
    moving = np.ones(time.size, dtype=bool)
    if speed is not None and len(speed):
        moving = interpolate(time, speed.time, speed.values) > MOVES
    usual = signals[0].period if whole else float(np.median(np.diff(time)))
    imu = Imu(time, accel, gyro, usual)
    if imu.period > SLOWEST:
        raise refused("imu.slow", drive=drive.name, period=imu.period)
    false = false_rows(imu.accel, imu.gyro, moving)
    if not false.any() or time[-1] - time[0] < _BRIEF:
        return imu
    if np.count_nonzero(~false) < _FEWEST:
        raise refused(
            "imu.many_false", drive=drive.name, count=np.count_nonzero(false), samples=false.size
        )
    return replace(_kept(imu, ~false, imu.period), false=float(np.mean(false)))


def _kept(imu: Imu, keep: Bools, period: float) -> Imu:
    return Imu(imu.time[keep], imu.accel.kept(keep), imu.gyro.kept(keep), period)


def read_fixes(
    drive: Drive, start: float, end: float, frame: LocalFrame | None = None
) -> Fixes | None:
    """Gather the GNSS fixes between two instants; None where there are fewer than two.

    The first of them is the origin where no ``frame`` is given.
    """
    lat, lon = drive.get("latitude"), drive.get("longitude")
    if lat is None or lon is None:
        return None
    keep = (lat.time >= start) & (lat.time <= end) & (lon.age(lat.time) < 0.05)
    # receivers without a fix write zeros
    keep &= (lat.values != 0.0) | (lon.at(lat.time) != 0.0)
    if keep.sum() < 2:
        return None
    time = lat.time[keep]
    altitude = drive.get("altitude")
    height = np.full(time.size, np.nan)
    if altitude is not None and len(altitude):
        near = altitude.age(time) < 1.5
        height[near] = altitude.at(time[near])
    has_height = bool(np.isfinite(height).sum() >= 2)
    if frame is None:
        origin = float(height[np.isfinite(height)][0]) if has_height else 0.0
        frame = LocalFrame(float(lat.values[keep][0]), float(lon.at(time)[0]), origin)
    ned = frame.to_ned(lat.values[keep], lon.at(time), np.nan_to_num(height))
    ned[~np.isfinite(height), 2] = np.nan
    return Fixes(time, ned, frame, has_height)


def resample(
    time: Floats, columns: Sequence[Floats], start: float, period: float, count: int
) -> Floats:
    """Low-pass channels (n,) without delay and take them to an even clock; NaN in gaps.

    Returns
    -------
    (count, c)
    """
    out = np.empty((count, len(columns)))
    for first in range(0, count, _AT_ONCE):
        part = out[first : first + _AT_ONCE]
        # One period and one sample more than the low-pass reaches to.
        near = start + period * np.array([first - _REACH - 1.0, first + len(part) + _REACH])
        low, high = np.searchsorted(time, near)
        rows = slice(max(min(low - 1, time.size - 2), 0), max(high + 1, 2))
        values = np.column_stack([column[rows] for column in columns])
        lowpass_resample(
            time[rows], values, start, period, first, _REACH, part, np.empty(len(part))
        )
    return out


def speed_from_fixes(fixes: Fixes) -> Signal:
    """Return the speed between neighbouring fixes at the middle of each pair."""
    stride = max(1, round(1.0 / float(np.median(np.diff(fixes.time)))))
    time, ned = fixes.time[::stride], fixes.ned[::stride]
    dt = np.diff(time)
    good = dt < 5.0
    speed = np.hypot(np.diff(ned[:, 0]), np.diff(ned[:, 1])) / dt
    return Signal("gnss_speed", (time[:-1] + 0.5 * dt)[good], speed[good])


def interpolated(signal: Signal, time: Floats, longest: float) -> Floats:
    """Interpolate a signal linearly; NaN outside and between samples further apart than that."""
    if len(signal) < 2:
        return np.full(time.shape, np.nan)
    right = np.clip(np.searchsorted(signal.time, time), 1, signal.time.size - 1)
    gap = signal.time[right] - signal.time[right - 1]
    return np.where(gap <= longest, signal.at(time), np.nan)
