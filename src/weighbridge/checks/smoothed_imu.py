"""Was the accelerometer smoothed? A road shakes a vehicle, and a raw sensor shows it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from weighbridge.kernels.shaking import shaking
from weighbridge.navigation.frozen import without_frozen
from weighbridge.signals import Drive, Floats, Problem, Signal
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.signals.instants import span
from weighbridge.vehicle import Vehicle

SECOND: Final = 1.0
"""What an axis reads beside its mean over so long is the shaking [s]."""

BLOCK: Final = 30.0
"""Shaking is judged over so long [s]."""

QUIET: Final = 0.025
"""Root mean square of the shaking, of the axis that shakes most, below which it was smoothed
[m/s^2]: 0.26 to 0.68 in raw sensors of cars, vans and trucks of two simulators, 0.08 to 0.23 in
means over 0.3 s and 0.026 to 0.06 over 1 s, which do no harm; 0.017 to 0.024 over 2 s and 0.010 to
0.020 over 3 s, of which masses came out up to 15 % heavy."""

MADE: Final = 0.001
"""Less is no sensor's, but a simulation's without noise, and shows nothing [m/s^2]."""

FAST: Final = 5.0
"""A slower vehicle need not shake [m/s]."""

PART: Final = 0.2
"""Part of the driving that has to be quiet [-]."""

SLOWEST: Final = 0.2
"""Samples further apart do not show the shaking [s]."""


def without_smoothed(drive: Drive, vehicle: Vehicle | None = None) -> Drive:
    """Leave out an accelerometer that was smoothed, where speed and heights weigh without it.

    Signals that a person vouches for (``drive.info.trusted``) stay as they are.

    Parameters
    ----------
    drive, vehicle : as of `weighbridge.checks.correct_drive`
    """
    if not _dispensable(drive):
        return drive
    for found in check_smoothed(drive, vehicle):
        left_out = Problem.of(
            "imu.smoothed_out", found.signal, start=found.start, end=found.end, **found.values
        )
        return drive.without(*IMU_SIGNALS).with_problems(left_out)
    return drive


def _dispensable(drive: Drive) -> bool:
    """Whether speed and heights weigh without the accelerometer, for which no person vouches."""
    heights = drive.has("altitude") or drive.has("grade")
    trusted = set(IMU_SIGNALS) & set(drive.info.trusted)
    return drive.has("vehicle_speed") and heights and not trusted


def check_needed(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Check as `check_smoothed` an accelerometer that `without_smoothed` does not look at."""
    if not _dispensable(drive):
        yield from check_smoothed(drive, vehicle)


def check_smoothed(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find an accelerometer whose shaking was filtered away, and quick changes with it."""
    speed = drive.speed
    drive = without_frozen(drive, IMU_SIGNALS[:3])
    axes = [s for name in IMU_SIGNALS[:3] if (s := drive.get(name)) is not None and len(s) > 1]
    if speed is None or len(speed) < 2 or len(axes) < len(IMU_SIGNALS[:3]):
        return
    if max(s.period for s in axes) > SLOWEST:
        return
    start, count = drive.start, int((drive.end - drive.start) / BLOCK) + 1
    size = np.zeros(count)
    for axis in axes:
        size = np.fmax(size, _shaking(axis, speed, start, count))
    driven = size > MADE
    quiet = driven & (size < QUIET)
    if not quiet.any() or np.count_nonzero(quiet) < max(2.0, PART * np.count_nonzero(driven)):
        return
    first, last = np.flatnonzero(quiet)[[0, -1]]
    end = min(start + BLOCK * (last + 1), drive.end)
    yield Problem.of(
        "imu.smoothed",
        axes[0].name,
        serious=True,
        start=start + BLOCK * first,
        end=end,
        shaking=float(np.median(size[quiet])),
        within=SECOND,
        span=span(round(start + BLOCK * first), round(end)),
    )


def _shaking(axis: Signal, speed: Signal, start: float, count: int) -> Floats:
    """Root mean square of an axis beside its mean, by blocks (count,); 0 where nothing drives."""
    long = max(2, round(SECOND / axis.period))
    if len(axis) <= 2 * long:
        return np.zeros(count)
    square, samples = shaking(
        axis.time, axis.values, speed.time, np.abs(speed.values), FAST, long, start, BLOCK, count
    )
    enough = samples * axis.period > 0.3 * BLOCK
    return np.asarray(np.sqrt(np.where(enough, square / np.maximum(samples, 1), 0.0)))
