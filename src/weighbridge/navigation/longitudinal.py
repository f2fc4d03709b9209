"""Motion from one accelerometer along the vehicle and its speed."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.messages import Problem, refused
from weighbridge.navigation.motion import Motion
from weighbridge.signals import Bools, Drive, Floats, Signal
from weighbridge.signals.catalogue import IMU_SIGNALS

GRADE_BAND: Final = 0.08
"""Grade is what differs between accelerometer and speed below this [Hz]."""

LONGEST_GAP: Final = 1.5
"""A longer gap in speed or acceleration leaves no motion [s]."""


def longitudinal_motion(drive: Drive, *, rate: float = 20.0) -> Motion:
    """Find the motion from specific force along the vehicle and its speed.

    The accelerometer reads ``v' + g sin(grade)`` and an offset that differs
    from drive to drive. Over a drive the work it reports must equal the gain
    of kinetic energy, known from speed, and of potential energy, known from
    height: that gives the offset. Without height the drive is taken to end as
    high as it began. Grade is the slow difference to the rate of speed.

    Parameters
    ----------
    drive : with longitudinal_accel and vehicle_speed, better with altitude
    rate : of the result, at most that of the accelerometer [Hz]

    Raises
    ------
    DriveError
        A signal is missing or too short.
    """
    missing = drive.missing(["longitudinal_accel", "vehicle_speed"])
    if missing:
        raise refused("motion.missing", drive=drive.name, missing=" and no ".join(missing))
    force, speed = drive.signals["longitudinal_accel"], drive.signals["vehicle_speed"]
    start, end = max(force.time[0], speed.time[0]), min(force.time[-1], speed.time[-1])
    rate = min(rate, 1.0 / force.period)
    if not end - start > 20.0:
        raise refused("motion.overlap", drive=drive.name, overlap=max(end - start, 0.0))
    time = start + np.arange(int((end - start) * rate)) / rate
    valid = (force.age(time) < LONGEST_GAP) & (speed.age(time) < LONGEST_GAP)
    read = lowpass(resample(force, time), rate, 0.25 * rate)
    v = lowpass(resample(speed, time), rate, 0.2 * rate)

    delay = _lateness(read, np.gradient(v, 1.0 / rate), valid, rate)
    v = np.interp(time + delay, time, v)
    rate_of_speed = np.gradient(v, 1.0 / rate)
    altitude = drive.get("altitude")
    height = resample(altitude, time) if altitude is not None and len(altitude) else None
    offset, offset_known = _offset(read, v, height, valid, rate)
    read = read - offset
    distance = np.cumsum(np.where(valid, v, 0.0)) / rate
    slope = lowpass(np.where(valid, read - rate_of_speed, 0.0), rate, GRADE_BAND)
    grade = np.arcsin(np.clip(slope / GRAVITY, -0.5, 0.5))
    accel = read - GRAVITY * np.sin(grade)
    nowhere = np.full(time.size, np.nan)
    notes = [Problem.of("motion.offset", "longitudinal_accel", offset=offset)]
    if drive.has(*IMU_SIGNALS[:3]) and not drive.has(*IMU_SIGNALS):
        notes.append(Problem.of("motion.no_gyro"))
    if not offset_known:
        notes.append(Problem.of("motion.no_altitude"))
    residual = (read - lowpass(read, rate, 0.5))[valid]
    return Motion(
        source="longitudinal_accel",
        time=time,
        speed=np.maximum(v, 0.0),
        accel=accel,
        specific_force=read,
        grade=grade,
        pitch=grade,
        roll=np.zeros(time.size),
        heading=nowhere,
        distance=distance,
        altitude=height if height is not None else nowhere,
        valid=valid,
        specific_force_std=float(np.std(residual)) if residual.size else float("nan"),
        grade_std=np.full(time.size, 0.01),
        speed_delay=delay,
        notes=tuple(notes),
    )


def resample(signal: Signal, time: Floats) -> Floats:
    """Interpolate on an even clock, ends held (SI)."""
    return np.interp(time, signal.time, signal.values)


def lowpass(values: Floats, rate: float, band: float) -> Floats:
    """Zero-phase second-order Butterworth below ``band`` [Hz]; as is where too short."""
    if band >= 0.45 * rate or values.size < 32:
        return values
    from scipy.signal import butter, sosfiltfilt  # Slow to load.

    sos = butter(2, band, fs=rate, output="sos")
    return np.asarray(sosfiltfilt(sos, values, padlen=min(values.size - 1, int(3 * rate / band))))


def _lateness(read: Floats, derivative: Floats, valid: Bools, rate: float) -> float:
    """How late speed is against the accelerometer [s], 0 where they do not agree."""
    band = min(0.5, 0.2 * rate)
    a = np.where(valid, read - lowpass(read, rate, 0.03), 0.0)
    b = np.where(valid, derivative - lowpass(derivative, rate, 0.03), 0.0)
    a, b = lowpass(a, rate, band), lowpass(b, rate, band)
    most = int(1.0 * rate)
    shifts = np.arange(-most, most + 1)
    middle = a[most : a.size - most]
    scores = np.array([np.dot(middle, b[most + k :][: middle.size]) for k in shifts])
    best = int(np.argmax(scores))
    scale = float(np.sqrt(np.dot(a, a) * np.dot(b, b)))
    if best in (0, shifts.size - 1) or scale == 0.0 or scores[best] < 0.5 * scale:
        return 0.0
    left, top, right = scores[best - 1 : best + 2]
    return float((shifts[best] + 0.5 * (left - right) / (left - 2.0 * top + right)) / rate)


def _offset(
    read: Floats, speed: Floats, height: Floats | None, valid: Bools, rate: float
) -> tuple[float, bool]:
    """Accelerometer offset from work against energy [m/s^2], and whether height was known."""
    v = np.where(valid, speed, 0.0)
    distance = float(v.sum()) / rate
    if distance < 100.0:
        still = valid & (speed < 0.1)
        return (float(np.median(read[still])) if still.any() else 0.0), False
    # Gaps split the drive: across them neither energy is balanced.
    edges = np.flatnonzero(np.diff(valid.astype(np.int8))) + 1
    pieces = np.split(np.arange(valid.size), edges)
    gain = 0.0
    for piece in pieces:
        if piece.size and valid[piece[0]]:
            a, b = piece[0], piece[-1]
            gain += 0.5 * (speed[b] ** 2 - speed[a] ** 2)
            if height is not None:
                gain += GRAVITY * (height[b] - height[a])
    return (float(np.dot(read, v)) / rate - gain) / distance, height is not None
