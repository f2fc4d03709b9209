"""Clocks that run apart, step, count rows or lose them."""

from __future__ import annotations

import numpy as np

from fault_kinds.shaping import IMU, Fault, middle, of_table, retimed, torque_of
from weighbridge.signals import Drive, Floats

GROUP = "clocks"
WORDS = (
    r"\bclocks?\b|time stamps?|run apart|whatever the delay|\bspread evenly"
    r"|the delay of|stamps were shifted|straight lines"
    r"|rows? (are|were) (lost|missing)|samples? every"
)
LATE_WORDS = WORDS + r"|torque delay|is late"

Rng = np.random.Generator


def _imu_stretched(drive: Drive, ppm: float) -> Drive:
    start = drive.start
    return retimed(drive, IMU, lambda t: start + (t - start) * (1.0 + 1e-6 * ppm))


def imu_clock_drift(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The inertial sensor's clock runs fast [ppm]."""
    return _imu_stretched(drive, severity)


def imu_clock_drift_long(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The same over 79 minutes [ppm]."""
    return _imu_stretched(drive, severity)


def bus_clock_drift(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The bus logger's clock runs fast [ppm]."""
    start = drive.start
    names = of_table(drive, "obd")
    return retimed(drive, names, lambda t: start + (t - start) * (1.0 + 1e-6 * severity))


def imu_clock_bends(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The inertial sensor's clock runs fast until the middle and slow from there [ppm]."""
    at = middle(drive)
    top = at - drive.start

    def bend(t: Floats) -> Floats:
        return t + 1e-6 * severity * (top - np.abs(t - at))

    return retimed(drive, IMU, bend)


def imu_clock_step(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The inertial sensor's clock is set on in the middle [s]."""
    at = middle(drive)
    return retimed(drive, IMU, lambda t: t + severity * (t >= at))


def bus_clock_step(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The bus logger's clock is set on in the middle [s]."""
    at = middle(drive)
    return retimed(drive, of_table(drive, "obd"), lambda t: t + severity * (t >= at))


def imu_clock_offset(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The inertial sensor's clock is off all the time [s]."""
    return retimed(drive, IMU, lambda t: t + severity)


def torque_late(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Torque alone is stamped late [s]."""
    return retimed(drive, [torque_of(drive)], lambda t: t + severity)


def torque_later_and_later(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Torque's delay grows from nothing to the severity [s], as a queue that fills."""
    start, duration = drive.start, drive.duration
    return retimed(drive, [torque_of(drive)], lambda t: t + severity * (t - start) / duration)


def _row_counted(drive: Drive, lost: float, run: int, rng: Rng) -> Drive:
    time = drive.signals["accel_x"].time
    gone = np.convolve(rng.random(time.size) < lost / run, np.ones(run), "same")[: time.size] > 0.5
    even = time[0] + np.median(np.diff(time)) * np.cumsum(~gone)
    # Rows that are gone repeat the stamp of the one before, and are left out so.
    return retimed(drive, IMU, lambda t: even)


def imu_rows_lost_uncounted(drive: Drive, severity: float, rng: Rng) -> Drive:
    """A logger that counts rows for its time loses a part of them [-]."""
    return _row_counted(drive, severity, 1, rng)


def imu_rows_lost_in_runs(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The same, half a second at a time [-]."""
    return _row_counted(drive, severity, 50, rng)


def _jittered(drive: Drive, names: list[str], std: float, gaps: float, rng: Rng) -> Drive:
    def jitter(t: Floats) -> Floats:
        moved = np.sort(t + std * rng.standard_normal(t.size))
        gone = rng.random(t.size) < gaps
        gone[0] = False
        return np.where(gone, moved[0], moved)

    return retimed(drive, names, jitter)


def imu_jitter_and_gaps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Stamps of the inertial sensor jitter [s], and a tenth of the rows is missing."""
    return _jittered(drive, list(IMU), severity, 0.1, rng)


def bus_jitter_and_gaps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Stamps of the bus jitter [s], and a tenth of the rows is missing."""
    return _jittered(drive, of_table(drive, "obd"), severity, 0.1, rng)


FAULTS = (
    Fault(GROUP, imu_clock_drift, (20, 100, 200, 500, -500, 1000, -1000, 2000), WORDS),
    Fault(GROUP, imu_clock_drift, (1000,), WORDS, ("truck",)),
    Fault(GROUP, imu_clock_drift_long, (20, 50, 100, 200, -200, 500, 1000), WORDS, ("long",)),
    Fault(GROUP, bus_clock_drift, (200, 1000, -2000), WORDS),
    Fault(GROUP, imu_clock_bends, (500, 2000), WORDS),
    Fault(GROUP, imu_clock_step, (0.3, 1.0, 2.0, -2.0), WORDS),
    Fault(GROUP, imu_clock_step, (2.0,), WORDS, ("truck", "long")),
    Fault(GROUP, bus_clock_step, (0.5, 2.0, -1.0), WORDS),
    Fault(GROUP, imu_clock_offset, (0.5, 2.0, 18.0, 3600.0), WORDS),
    Fault(GROUP, torque_late, (0.3, 0.5, 1.0, -0.5), LATE_WORDS),
    Fault(GROUP, torque_later_and_later, (0.5, 1.0, 3.0), LATE_WORDS),
    Fault(GROUP, imu_rows_lost_uncounted, (0.0002, 0.0005, 0.002, 0.01), WORDS),
    Fault(GROUP, imu_rows_lost_in_runs, (0.0005, 0.002), WORDS),
    Fault(GROUP, imu_jitter_and_gaps, (0.02, 0.05, 0.1), WORDS),
    Fault(GROUP, bus_jitter_and_gaps, (0.05, 0.1, 0.3), WORDS),
)
