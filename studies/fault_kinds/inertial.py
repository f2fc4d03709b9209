"""Mounting, scale, noise and range of the inertial sensor."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from fault_kinds.shaping import (
    ACCEL,
    GYRO,
    IMU,
    Fault,
    changed,
    kept,
    middle,
    ramped,
    scaled,
)
from weighbridge.signals import Bools, Drive, Floats, Signal

MOUNTING = "mounting"
MOUNTING_WORDS = (
    r"sensor (was|is) (moved|turned)|\bmounting\b|\bmount\b|vibration shifts|wrong sign"
    r"|axes .*(swapped|reversed|mirrored|differ)|accelerometer('s)? offset"
)
SCALE = "scale of the inertial sensor"
SCALE_WORDS = (
    r"accelerometer (reads \d|offset|has steps)|\baccel_[xyz]\b|accelerometer\b.*\bin g\b"
    r"|inertial axes"
)
TURN_WORDS = r"inertial axes|sensor was left out|\bgyro(scope)?\b|\bgyro_[xyz]\b"
QUALITY = "noise, rate and range"
QUALITY_WORDS = (
    r"\baccel_[xyz]\b|accelerometer (is so noisy|is noisy|varies|has steps)"
    r"|inertial (samples|sensor) (are|come|is|shakes)|vibration|was smoothed"
)

Rng = np.random.Generator


def _turned(drive: Drive, axis: str, angle: Floats) -> Drive:
    """Turn the sensor about one of its axes by an angle for each row [deg]."""
    turn = Rotation.from_euler(axis, np.radians(angle)[:, None])
    made = []
    for names in (ACCEL, GYRO):
        parts = [drive.signals[n] for n in names]
        rows = turn.inv().apply(np.column_stack([s.values for s in parts]))
        made += [Signal(s.name, s.time, rows[:, k].copy()) for k, s in enumerate(parts)]
    return drive.with_signals(*made)


def _from_middle(drive: Drive, axis: str, angle: float) -> Drive:
    time = drive.signals["accel_x"].time
    return _turned(drive, axis, np.where(time >= middle(drive), angle, 0.0))


def pitches_in_mid_drive(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The sensor's nose goes up in the middle [deg]."""
    return _from_middle(drive, "y", severity)


def rolls_in_mid_drive(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The sensor rolls to a side in the middle [deg]."""
    return _from_middle(drive, "x", severity)


def yaws_in_mid_drive(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The sensor turns about its upright axis in the middle [deg]."""
    return _from_middle(drive, "z", severity)


def pitch_creeps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The sensor's holder gives way evenly over the drive [deg]."""
    time = drive.signals["accel_x"].time
    return _turned(drive, "y", severity * (time - drive.start) / drive.duration)


def mounted_otherwise(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The sensor is mounted turned against the calibration, all the drive [deg]."""
    return _turned(drive, "z", np.full(len(drive.signals["accel_x"]), severity))


def axis_swapped(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Two axes of accelerometer and gyro are swapped from a part of the drive on [-]."""
    time = drive.signals["accel_x"].time
    late = time >= middle(drive, severity)
    made = []
    for kind in ("accel", "gyro"):
        x, y = drive.signals[f"{kind}_x"], drive.signals[f"{kind}_y"]
        made += [
            Signal(x.name, time, np.where(late, y.values, x.values)),
            Signal(y.name, time, np.where(late, x.values, y.values)),
        ]
    return drive.with_signals(*made)


def accel_scale(drive: Drive, severity: float, rng: Rng) -> Drive:
    """All axes of the accelerometer read too much or too little [-]."""
    return scaled(drive, ACCEL, severity)


def accel_scale_x(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The axis along the vehicle reads too much or too little [-]."""
    return scaled(drive, ["accel_x"], severity)


def accel_gain_ramps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The gain of all axes goes from one to this over the drive [-]."""
    return ramped(drive, ACCEL, severity)


def accel_gain_ramps_x(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The gain of the axis along the vehicle goes from one to this [-]."""
    return ramped(drive, ["accel_x"], severity)


def gyro_scale(drive: Drive, severity: float, rng: Rng) -> Drive:
    """All axes of the gyro read too much or too little [-]."""
    return scaled(drive, GYRO, severity)


def accel_unit_changes(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The accelerometer goes over to another unit in the middle [-]."""
    return scaled(drive, ACCEL, severity, middle(drive))


def accel_bias_ramps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The offset along the vehicle grows to this over the drive [m/s^2]."""
    start, duration = drive.start, drive.duration
    return changed(drive, ["accel_x"], lambda t, x: x + severity * (t - start) / duration)


def accel_bias_steps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The offset along the vehicle steps in the middle [m/s^2]."""
    at = middle(drive)
    return changed(drive, ["accel_x"], lambda t, x: x + severity * (t >= at))


def accel_noise(drive: Drive, severity: float, rng: Rng) -> Drive:
    """White noise on the axis along the vehicle [m/s^2]."""
    return changed(drive, ["accel_x"], lambda t, x: x + severity * rng.standard_normal(x.size))


def accel_noise_z(drive: Drive, severity: float, rng: Rng) -> Drive:
    """White noise on the upright axis [m/s^2]."""
    return changed(drive, ["accel_z"], lambda t, x: x + severity * rng.standard_normal(x.size))


def gyro_noise(drive: Drive, severity: float, rng: Rng) -> Drive:
    """White noise on all axes of the gyro [rad/s]."""
    return changed(drive, GYRO, lambda t, x: x + severity * rng.standard_normal(x.size))


def accel_spikes(drive: Drive, severity: float, rng: Rng) -> Drive:
    """A share of the rows of the axis along the vehicle is off by up to 30 m/s^2 [-]."""

    def spike(t: Floats, x: Floats) -> Floats:
        hit = rng.random(x.size) < severity
        return np.where(hit, x + rng.uniform(-30.0, 30.0, x.size), x)

    return changed(drive, ["accel_x"], spike)


def imu_rate(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Rows are left out until the sensor has this rate, without a filter [Hz]."""
    time = drive.signals["accel_x"].time
    step = max(1, round((time.size - 1) / ((time[-1] - time[0]) * severity)))

    def thin(t: Floats) -> Bools:
        return np.arange(t.size) % step == 0

    return kept(drive, IMU, thin)


def accel_clipped(drive: Drive, severity: float, rng: Rng) -> Drive:
    """All axes end at this value [m/s^2]."""
    return changed(drive, ACCEL, lambda t, x: np.clip(x, -severity, severity))


def accel_clipped_x(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The axis along the vehicle ends at this value [m/s^2]."""
    return changed(drive, ["accel_x"], lambda t, x: np.clip(x, -severity, severity))


def accel_steps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """All axes come in steps of this [m/s^2]."""
    return changed(drive, ACCEL, lambda t, x: np.round(x / severity) * severity)


def shaken(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The holder rings at 7 Hz with this amplitude while the vehicle is fast [m/s^2]."""
    speed = drive.signals["vehicle_speed"]

    def ring(t: Floats, x: Floats) -> Floats:
        fast = np.interp(t, speed.time, speed.values) > 15.0
        return x + severity * fast * np.sin(2.0 * math.pi * 7.0 * t)

    return changed(drive, ACCEL, ring)


FAULTS = (
    Fault(MOUNTING, pitches_in_mid_drive, (0.5, 1, 2, 3, 5, 8, -3), MOUNTING_WORDS),
    Fault(MOUNTING, pitches_in_mid_drive, (3,), MOUNTING_WORDS, ("truck", "long")),
    Fault(MOUNTING, rolls_in_mid_drive, (2, 8), MOUNTING_WORDS),
    Fault(MOUNTING, yaws_in_mid_drive, (5, 15, 30, 90), MOUNTING_WORDS),
    Fault(MOUNTING, pitch_creeps, (1, 3, 8), MOUNTING_WORDS),
    Fault(MOUNTING, mounted_otherwise, (10, 45, 180), MOUNTING_WORDS),
    Fault(MOUNTING, axis_swapped, (0.01, 0.5), MOUNTING_WORDS),
    Fault(SCALE, accel_scale, (0.9, 0.95, 1.05, 1.1, 1.2), SCALE_WORDS),
    Fault(SCALE, accel_scale, (1.1,), SCALE_WORDS, ("truck",)),
    Fault(SCALE, accel_scale_x, (0.9, 1.05, 1.1), SCALE_WORDS),
    Fault(SCALE, accel_gain_ramps, (1.05, 1.1, 1.2), SCALE_WORDS),
    Fault(SCALE, accel_gain_ramps_x, (1.1, 1.2), SCALE_WORDS),
    Fault(SCALE, gyro_scale, (0.9, 1.1, 1.5), TURN_WORDS),
    Fault(SCALE, accel_unit_changes, (1.0 / 9.80665, 0.3048), SCALE_WORDS),
    Fault(SCALE, accel_bias_ramps, (0.3, 1.0), SCALE_WORDS + "|" + MOUNTING_WORDS),
    Fault(SCALE, accel_bias_steps, (0.2, 0.5), SCALE_WORDS + "|" + MOUNTING_WORDS),
    Fault(QUALITY, accel_noise, (0.5, 1, 2, 5), QUALITY_WORDS),
    Fault(QUALITY, accel_noise_z, (2,), QUALITY_WORDS),
    Fault(QUALITY, gyro_noise, (0.05, 0.3), TURN_WORDS),
    Fault(QUALITY, accel_spikes, (0.001, 0.01, 0.1), QUALITY_WORDS + "|spikes"),
    Fault(QUALITY, imu_rate, (25, 10, 5), QUALITY_WORDS),
    Fault(QUALITY, accel_clipped, (9.9, 10, 12), QUALITY_WORDS),
    Fault(QUALITY, accel_clipped_x, (0.8, 1.5), QUALITY_WORDS),
    Fault(QUALITY, accel_steps, (0.1, 0.5), QUALITY_WORDS),
    Fault(QUALITY, shaken, (1, 4), QUALITY_WORDS + "|rings"),
)
