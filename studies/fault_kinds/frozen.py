"""Values that freeze."""

from __future__ import annotations

import numpy as np

from fault_kinds.shaping import (
    GYRO,
    IMU,
    Fault,
    changed,
    inside,
    middle,
    of_table,
    stretches,
    torque_of,
)
from weighbridge.signals import Drive, Floats

GROUP = "frozen"
WORDS = (
    r"froze|frozen|\bstuck\b|same value|does not change|all the time"
    r"|(repeats?|keeps?) (its|one|their)"
)

Rng = np.random.Generator


def _from(drive: Drive, names: list[str], part: float) -> Drive:
    at = middle(drive, part)

    def hold(t: Floats, x: Floats) -> Floats:
        return np.where(t >= at, x[min(np.searchsorted(t, at), x.size - 1)], x)

    return changed(drive, names, hold)


def _in_stretches(drive: Drive, names: tuple[str, ...], share: float, rng: Rng) -> Drive:
    starts, ends = stretches(drive, share, 20.0, rng)

    def hold(t: Floats, x: Floats) -> Floats:
        last = np.where(inside(t, starts, ends), 0, np.arange(t.size))
        return x[np.maximum.accumulate(last)]

    return changed(drive, names, hold)


def torque_freezes(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Load or torque keeps its value from a part of the drive on [-]."""
    return _from(drive, [torque_of(drive)], severity)


def engine_speed_freezes(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Engine speed keeps its value from a part of the drive on [-]."""
    return _from(drive, ["engine_speed"], severity)


def speed_freezes(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Speed of the wheels keeps its value from a part of the drive on [-]."""
    return _from(drive, ["vehicle_speed"], severity)


def fixes_freeze(drive: Drive, severity: float, rng: Rng) -> Drive:
    """All of the fixes keep their values from a part of the drive on [-]."""
    return _from(drive, of_table(drive, "gnss"), severity)


def bus_freezes(drive: Drive, severity: float, rng: Rng) -> Drive:
    """All that comes from the bus keeps its value from a part of the drive on [-]."""
    return _from(drive, of_table(drive, "obd"), severity)


def accel_freezes(drive: Drive, severity: float, rng: Rng) -> Drive:
    """One axis of the accelerometer keeps its value from a part of the drive on [-]."""
    return _from(drive, ["accel_x"], severity)


def imu_stretches_frozen(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The inertial sensor hangs for 20 s at a time, for a share of the drive [-]."""
    return _in_stretches(drive, IMU, severity, rng)


def gyro_stretches_frozen(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The gyro hangs for 20 s at a time, for a share of the drive [-]."""
    return _in_stretches(drive, GYRO, severity, rng)


def torque_stretches_frozen(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Load or torque hangs for 20 s at a time, for a share of the drive [-]."""
    return _in_stretches(drive, (torque_of(drive),), severity, rng)


FAULTS = (
    Fault(GROUP, torque_freezes, (0.3, 0.5, 0.8), WORDS),
    Fault(GROUP, torque_freezes, (0.5,), WORDS, ("truck",)),
    Fault(GROUP, engine_speed_freezes, (0.3, 0.5, 0.8), WORDS),
    Fault(GROUP, speed_freezes, (0.5, 0.8), WORDS),
    Fault(GROUP, fixes_freeze, (0.5,), WORDS),
    Fault(GROUP, bus_freezes, (0.5, 0.9), WORDS),
    Fault(GROUP, accel_freezes, (0.5, 0.8), WORDS),
    Fault(GROUP, imu_stretches_frozen, (0.05, 0.2, 0.5), WORDS),
    Fault(GROUP, gyro_stretches_frozen, (0.05, 0.2, 0.5), WORDS),
    Fault(GROUP, torque_stretches_frozen, (0.1, 0.3), WORDS),
)
