"""What a drive must be weighed in spite of."""

from __future__ import annotations

import numpy as np

from fault_kinds.shaping import (
    ACCEL,
    GYRO,
    IMU,
    USUAL,
    Fault,
    changed,
    inside,
    kept,
    middle,
    of_table,
    retimed,
    scaled,
    stretches,
)
from weighbridge.signals import Drive, Floats

GROUP = "harmless"
ALL = (*USUAL, "truck", "long")

Rng = np.random.Generator


def undamaged(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Nothing."""
    return drive


def cut_short(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The drive ends after this time [s]."""
    return drive.between(drive.start, drive.start + severity)


def tail_alone(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Of the drive, this time is left at its end; it begins while the vehicle moves [s]."""
    return drive.between(drive.end - severity, drive.end + 1.0)


def imu_stamps_jitter(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Stamps of the inertial sensor jitter [s]."""
    return retimed(drive, IMU, lambda t: np.sort(t + severity * rng.standard_normal(t.size)))


def bus_stamps_jitter(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Stamps of the bus jitter [s]."""
    names = of_table(drive, "obd")
    return retimed(drive, names, lambda t: np.sort(t + severity * rng.standard_normal(t.size)))


def imu_rows_empty(drive: Drive, severity: float, rng: Rng) -> Drive:
    """A share of the rows of the inertial sensor is empty [-]."""
    return kept(drive, IMU, lambda t: rng.random(t.size) >= severity)


def bus_rows_empty(drive: Drive, severity: float, rng: Rng) -> Drive:
    """A share of the values of the bus is empty [-]."""
    return kept(drive, of_table(drive, "obd"), lambda t: rng.random(t.size) >= severity)


def imu_gaps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The inertial sensor pauses five times for this time [s]."""
    starts, ends = stretches(drive, 5.0 * severity / drive.duration, severity, rng)
    return kept(drive, IMU, lambda t: ~inside(t, starts, ends))


def bus_gaps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The bus pauses five times for this time [s]."""
    starts, ends = stretches(drive, 5.0 * severity / drive.duration, severity, rng)
    return kept(drive, of_table(drive, "obd"), lambda t: ~inside(t, starts, ends))


def all_gaps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The whole recording pauses five times for this time [s]."""
    starts, ends = stretches(drive, 5.0 * severity / drive.duration, severity, rng)
    return kept(drive, list(drive.signals), lambda t: ~inside(t, starts, ends))


def clock_jumps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """All clocks are set on together in the middle [s]."""
    at = middle(drive)
    return retimed(drive, list(drive.signals), lambda t: t + severity * (t >= at))


def far_from_zero(drive: Drive, severity: float, rng: Rng) -> Drive:
    """All clocks count from long before the drive [s]."""
    return retimed(drive, list(drive.signals), lambda t: t + severity)


def accel_bias(drive: Drive, severity: float, rng: Rng) -> Drive:
    """All axes of the accelerometer are off, by this along the vehicle [m/s^2]."""
    parts = dict(zip(ACCEL, (1.0, -0.6, 0.4), strict=True))
    for name, part in parts.items():
        drive = changed(drive, [name], lambda t, x, off=part * severity: x + off)
    return drive


def gyro_bias(drive: Drive, severity: float, rng: Rng) -> Drive:
    """All axes of the gyro are off by this [rad/s]."""
    return changed(drive, GYRO, lambda t, x: x + severity)


def no_fixes(drive: Drive, severity: float, rng: Rng) -> Drive:
    """There are no fixes from a part of the drive on [-]."""
    at = middle(drive, severity)
    return kept(drive, of_table(drive, "gnss"), lambda t: t < at)


def fixes_jump(drive: Drive, severity: float, rng: Rng) -> Drive:
    """One fix in a hundred is off by up to this to the north [deg]."""

    def spoil(t: Floats, x: Floats) -> Floats:
        off = np.radians(severity) * rng.uniform(-1.0, 1.0, x.size)
        return x + np.where(rng.random(x.size) < 0.01, off, 0.0)

    return changed(drive, ["latitude"], spoil)


def fixes_late(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Fixes are stamped late [s]."""
    return retimed(drive, of_table(drive, "gnss"), lambda t: t + severity)


def gnss_speed_noisy(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Speed of the fixes is noisy [m/s]."""
    return changed(
        drive,
        ["gnss_speed"],
        lambda t, x: np.abs(x + severity * rng.standard_normal(x.size)),
    )


def altitude_wanders(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Altitude wanders by this over ten minutes [m]."""
    return changed(drive, ["altitude"], lambda t, x: x + severity * np.sin(t / 95.0))


def course_missing(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Course of the fixes is always zero."""
    return scaled(drive, ["gnss_course"], 0.0)


FAULTS = tuple(
    Fault(GROUP, apply, severities, vehicles=vehicles, harmless=True)
    for apply, severities, vehicles in (
        (undamaged, (0,), ALL),
        (cut_short, (600, 900), (*USUAL, "truck")),
        (tail_alone, (900,), USUAL),
        (imu_stamps_jitter, (0.001, 0.005), USUAL),
        (bus_stamps_jitter, (0.01, 0.03), USUAL),
        (imu_rows_empty, (0.1, 0.5), USUAL),
        (bus_rows_empty, (0.1, 0.5), USUAL),
        (imu_gaps, (2, 10), USUAL),
        (bus_gaps, (2, 10), USUAL),
        (all_gaps, (2, 10), USUAL),
        (clock_jumps, (60, 3600), USUAL),
        (far_from_zero, (1e6,), USUAL),
        (accel_bias, (0.1, 0.3, 0.5), USUAL),
        (gyro_bias, (0.02,), USUAL),
        (no_fixes, (0.0, 0.5), USUAL),
        (fixes_jump, (0.001, 0.1), USUAL),
        (fixes_late, (0.5,), USUAL),
        (gnss_speed_noisy, (1.0,), USUAL),
        (altitude_wanders, (30,), USUAL),
        (course_missing, (0,), USUAL),
    )
)
