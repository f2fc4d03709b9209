"""The measurements of a drive, laid out for the filter."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.kernels.ins import (
    MEASUREMENTS,
    Z_D,
    Z_HVAR,
    Z_N,
    Z_SPEED,
    Z_SPEED_VAR,
    Z_STILL,
    Z_VE,
    Z_VEL_VAR,
    Z_VN,
    Z_VVAR,
    lowpass_resample,
)
from weighbridge.navigation.dropouts import false_rows, repeated_rows
from weighbridge.navigation.frozen import thawed
from weighbridge.navigation.geodesy import LocalFrame
from weighbridge.navigation.settings import NavigationSettings
from weighbridge.signals import Bools, Drive, Floats, Ints, Signal
from weighbridge.signals.catalogue import IMU_SIGNALS

_AXES = ("x", "y", "z")

_FEWEST = 50
"""Fewer inertial samples show nothing."""

_BRIEF = 30.0
"""Too short to be weighed, whatever its samples are [s]."""

_MOVES = 1.0
"""Slower, a sensor may well repeat itself or read zero [m/s]."""

_SLOWEST = 0.11
"""Inertial samples further apart lose what happens between them [s]."""

_HEIGHT_PERIOD, _HEIGHT_TIME = 10.0, 300.0
"""Without heights, distance of the pseudo-heights and how long hills last [s]."""


@dataclass(frozen=True, slots=True)
class Imu:
    """Inertial samples on one clock, in sensor axes.

    Attributes
    ----------
    time : (n,) strictly increasing [s]
    accel : (n, 3) specific force [m/s^2]
    gyro : (n, 3) angular rate [rad/s]
    period : median distance of samples [s]
    false : part of the samples that could not be and were left out [-]
    """

    time: Floats
    accel: Floats
    gyro: Floats
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
        raise DriveError(f"{drive.name}: inertial navigation lacks {', '.join(missing)}")
    drive = thawed(drive, IMU_SIGNALS)
    signals = [drive.signals[n] for n in IMU_SIGNALS]
    start = max(float(s.time[0]) if len(s) else np.inf for s in signals)
    end = min(float(s.time[-1]) if len(s) else -np.inf for s in signals)
    clock = signals[0].time
    keep = (clock >= start) & (clock <= end)
    usual = float(np.median(np.diff(clock))) if clock.size > 1 else 0.0
    for s in signals:
        # An axis that has a gap of its own must not be invented across it.
        if s.time is not clock and not np.array_equal(s.time, clock):
            keep &= s.age(clock) <= 2.0 * max(usual, s.period)
    if keep.sum() < _FEWEST:
        raise DriveError(
            f"{drive.name}: accel and gyro have only {int(keep.sum())} samples in common: "
            "check their time stamps"
        )
    time = np.ascontiguousarray(clock[keep])
    data = {kind: np.empty((time.size, 3)) for kind in ("accel", "gyro")}
    for kind, block in data.items():
        for i, axis in enumerate(_AXES):
            s = drive.signals[f"{kind}_{axis}"]
            same = s.time is clock or np.array_equal(s.time, clock)
            block[:, i] = s.values[keep] if same else np.interp(time, s.time, s.values)
    speed = drive.speed
    moving = np.ones(time.size, dtype=bool)
    if speed is not None and len(speed):
        moving = np.interp(time, speed.time, speed.values) > _MOVES
    imu = Imu(time, data["accel"], data["gyro"], float(np.median(np.diff(time))))
    repeated = repeated_rows(imu.accel, imu.gyro, moving)
    own = time[moving & ~repeated]
    if repeated.any() and own.size >= _FEWEST:
        imu = _kept(imu, ~repeated, float(np.median(np.diff(own))))
        moving = moving[~repeated]
    if imu.period > _SLOWEST:
        raise DriveError(
            f"{drive.name}: inertial samples come every {imu.period:.2f} s; navigation needs "
            "0.1 s or less: leave accel_x..z and gyro_x..z out to weigh by speed alone"
        )
    false = false_rows(imu.accel, imu.gyro, moving, imu.period)
    if not false.any() or time[-1] - time[0] < _BRIEF:
        return imu
    if np.count_nonzero(~false) < _FEWEST:
        raise DriveError(
            f"{drive.name}: {np.count_nonzero(false)} of {false.size} inertial samples are zeros, "
            "spikes or at a limit of the sensor: record accel_x..z and gyro_x..z again"
        )
    return replace(_kept(imu, ~false, imu.period), false=float(np.mean(false)))


def _kept(imu: Imu, keep: Bools, period: float) -> Imu:
    return Imu(
        np.ascontiguousarray(imu.time[keep]),
        np.ascontiguousarray(imu.accel[keep]),
        np.ascontiguousarray(imu.gyro[keep]),
        period,
    )


def read_fixes(drive: Drive, start: float, end: float) -> Fixes | None:
    """Gather the GNSS fixes between two instants; None where there are fewer than two."""
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
    origin = float(height[np.isfinite(height)][0]) if has_height else 0.0
    frame = LocalFrame(float(lat.values[keep][0]), float(lon.at(time)[0]), origin)
    ned = frame.to_ned(lat.values[keep], lon.at(time), np.nan_to_num(height, nan=origin))
    ned[~np.isfinite(height), 2] = np.nan
    return Fixes(time, ned, frame, has_height)


def resample(time: Floats, values: Floats, start: float, period: float, count: int) -> Floats:
    """Low-pass channels (n, c) without delay and take them to an even clock; NaN in gaps."""
    out = np.empty((count, values.shape[1]))
    lowpass_resample(time, values, start, period, count, 3.0, out, np.empty(count))
    return out


def resolution(values: Floats) -> float:
    """Return the step a signal is quantised to, 0 where none shows."""
    levels = np.unique(values[:20_000])
    if levels.size < 3:
        return 0.0
    gaps = np.diff(levels)
    step = float(gaps.min())
    # a lattice has all its gaps at whole multiples of the smallest
    ratio = gaps / step
    return step if np.abs(ratio - np.round(ratio)).max() < 0.1 else 0.0


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


def place_nodes(time: Floats, fixes: Floats, rate: float, max_gap: float) -> Ints:
    """Choose the samples at which covariance and measurements are processed.

    An even ``rate``, and the sample nearest to each GNSS fix, so that no fix is
    used at another instant than its own; both sides of each gap.
    """
    slots = np.floor((time - time[0]) * rate + 1e-6).astype(np.int64)
    even = np.flatnonzero(np.diff(slots, prepend=-1) > 0)
    right = np.clip(np.searchsorted(time, fixes), 1, time.size - 1)
    nearest = np.where(fixes - time[right - 1] < time[right] - fixes, right - 1, right)
    nearest = nearest[np.abs(time[nearest] - fixes) < 0.1]
    after = np.flatnonzero(np.diff(time) > max_gap)
    return np.unique(np.concatenate([even, nearest, after, after + 1, [0, time.size - 1]]))


def still_state(
    node_time: Floats, speed: Signal | None, grid_time: Floats, accel: Floats, gyro: Floats,
    slow: Bools,
) -> Floats:  # fmt: skip
    """Tell standing from moving: 0 moving, 1 wheels stand, 2 the body rests too.

    Parameters
    ----------
    node_time : (m,) [s]
    speed : speed of the wheels, which shows standing as zero; None without
    grid_time, accel, gyro : (k,), (k, 3), (k, 3) low-passed inertial samples
    slow : (k,) other sources do not show movement
    """
    period = float(grid_time[1] - grid_time[0])
    half = max(1, round(0.5 / period))

    def spread(y: Floats) -> Floats:
        z = np.nan_to_num(y, nan=1e3)
        top = np.full(y.shape[0], 0.0)
        for c in range(3):
            pad = np.pad(z[:, c], half, mode="edge")
            s1 = np.concatenate([[0.0], np.cumsum(pad)])
            s2 = np.concatenate([[0.0], np.cumsum(pad**2)])
            n = 2 * half + 1
            mean = (s1[n:] - s1[:-n]) / n
            top = np.maximum(top, np.sqrt(np.maximum((s2[n:] - s2[:-n]) / n - mean**2, 0.0)))
        return top

    quiet = (spread(accel) < 0.12) & (spread(gyro) < 0.008)
    index = np.clip(np.round((node_time - grid_time[0]) / period), 0, quiet.size - 1)
    at = index.astype(np.int64)
    still = np.zeros(node_time.size)
    if speed is not None and len(speed):
        zero = np.abs(speed.values) < 0.05
        moving = speed.time[~zero]
        stands = np.ones(node_time.size, dtype=bool)
        if moving.size:
            right = np.clip(np.searchsorted(moving, node_time), 0, moving.size - 1)
            left = np.maximum(right - 1, 0)
            away = np.minimum(np.abs(moving[right] - node_time), np.abs(node_time - moving[left]))
            stands = away > max(0.4, 1.1 * speed.period)
        stands &= speed.age(node_time) < max(1.0, 1.5 * speed.period)
        still[stands] = 1.0
        still[stands & quiet[at]] = 2.0
    else:
        calm = quiet & (spread(accel) < 0.05) & (spread(gyro) < 0.004) & slow
        still[calm[at]] = 2.0
    return still


def measurements(
    node_time: Floats,
    settings: NavigationSettings,
    *,
    speed: Signal | None,
    fixes: Fixes | None,
    drive: Drive,
    gnss_delay: float,
    still: Floats,
) -> Floats:
    """Lay all measurements out, one row (11,) per node, NaN where there is none."""
    z = np.full((node_time.size, MEASUREMENTS), np.nan)
    z[:, Z_STILL] = still
    if speed is not None and len(speed) > 1:
        values = interpolated(speed, node_time, max(1.6, 3.0 * speed.period))
        # one row per sample received: interpolating makes no information
        seen = np.searchsorted(speed.time, node_time)
        fresh = np.diff(seen, prepend=seen[0] - 1) > 0
        values[~fresh] = np.nan
        step = resolution(speed.values)
        rate = 1.0 / max(speed.period, float(np.median(np.diff(node_time))))
        var = settings.speed_std**2 + step**2 / 12.0 + (settings.speed_slip_std * values) ** 2
        z[:, Z_SPEED] = values
        z[:, Z_SPEED_VAR] = var * max(1.0, 2.0 * settings.constraint_time * rate)
    if fixes is not None:
        time = fixes.time - gnss_delay
        right = np.clip(np.searchsorted(node_time, time), 1, node_time.size - 1)
        node = np.where(time - node_time[right - 1] < node_time[right] - time, right - 1, right)
        near = np.abs(node_time[node] - time) < 0.1
        node = node[near]
        z[node, Z_N : Z_D + 1] = fixes.ned[near]
        rate = 1.0 / float(np.median(np.diff(fixes.time)))
        inflate = max(1.0, rate * settings.gnss_time)
        horizontal = np.full(node.size, settings.gnss_horizontal_std)
        accuracy, hdop = drive.get("gnss_accuracy"), drive.get("hdop")
        if accuracy is not None and len(accuracy):
            horizontal = np.clip(accuracy.held(fixes.time[near]), 1.0, 1e3)
        elif hdop is not None and len(hdop):
            horizontal = settings.gnss_horizontal_std * np.clip(hdop.held(fixes.time[near]), 1, 50)
        horizontal = np.where(np.isfinite(horizontal), horizontal, settings.gnss_horizontal_std)
        ratio = settings.gnss_vertical_std / settings.gnss_horizontal_std
        z[node, Z_HVAR] = horizontal**2 * inflate
        z[node, Z_VVAR] = (horizontal * ratio) ** 2 * inflate
        _gnss_velocity(z, node_time, settings, drive, gnss_delay)
    if fixes is None or not fixes.has_height:
        # nobody drives far up or down for long: without heights this alone keeps
        # a bias of the accelerometer from being taken for an endless hill
        every = np.flatnonzero(np.diff(np.floor(node_time / _HEIGHT_PERIOD), prepend=-1.0) > 0)
        z[every, Z_D] = 0.0
        z[every, Z_VVAR] = settings.height_range**2 * _HEIGHT_TIME / _HEIGHT_PERIOD
    return z


def _gnss_velocity(
    z: Floats, node_time: Floats, settings: NavigationSettings, drive: Drive, delay: float
) -> None:
    """Add velocity over ground where the receiver gives speed and course."""
    over_ground, course = drive.get("gnss_speed"), drive.get("gnss_course")
    if over_ground is None or course is None or len(over_ground) < 2 or len(course) < 2:
        return
    time = over_ground.time - delay
    good = (over_ground.values > 2.0) & (course.age(over_ground.time) < 0.05)
    right = np.clip(np.searchsorted(node_time, time), 1, node_time.size - 1)
    node = np.where(time - node_time[right - 1] < node_time[right] - time, right - 1, right)
    good &= np.abs(node_time[node] - time) < 0.05
    node = node[good]
    angle = course.values[
        np.clip(np.searchsorted(course.time, over_ground.time[good] - 0.05), 0, len(course) - 1)
    ]
    inflate = max(1.0, settings.gnss_time / over_ground.period)
    z[node, Z_VN] = over_ground.values[good] * np.cos(angle)
    z[node, Z_VE] = over_ground.values[good] * np.sin(angle)
    # a course is worse the slower the vehicle: its error across grows as 1 degree of speed
    z[node, Z_VEL_VAR] = (
        settings.gnss_velocity_std**2 + (0.02 * over_ground.values[good]) ** 2
    ) * inflate
