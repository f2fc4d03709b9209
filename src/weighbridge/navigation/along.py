"""The vehicle's own direction in three accelerometer axes that no gyroscope stands beside."""

from __future__ import annotations

from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from weighbridge.navigation.longitudinal import LONGEST_GAP, lowpass, resample
from weighbridge.signals import Bools, Drive, Floats, Problem, Signal
from weighbridge.signals.catalogue import IMU_SIGNALS

RATE: Final = 10.0
"""Of the grid on which accelerometer and speed are compared [Hz]."""

BAND: Final = (0.03, 0.5)
"""Grade and offsets lie below, vibration and rounding of the speed above [Hz]."""

LATEST: Final = 1.0
"""Longest time by which the speed may be late, or early [s]."""

SHORTEST: Final = 120.0
"""Over less time nothing is compared [s]."""

PARTS: Final = 4
"""Parts of a drive in which the direction has to hold."""

ALIKE: Final = 0.9
"""Correlation with the change of speed over the whole drive, at least [-]."""

ALIKE_IN_PART: Final = 0.8
"""The same in each part in which the vehicle speeds up and slows down."""

MOVING: Final = 0.2
"""Standard deviation of the change of speed from which a part can be judged [m/s^2]."""

TURNED: Final = 0.94
"""Cosine of the angle between the directions of a part and of the whole drive, at least [-]: bends
turned it to 0.97 in 76 drives with a device that was fixed."""

AXES: Final = IMU_SIGNALS[:3]


class _Compared(NamedTuple):
    """Accelerometer read (n, 3), the same and the change of speed (n,) in `BAND` [m/s^2], and which
    rows are known.
    """

    read: Floats
    felt: Floats
    shown: Floats
    valid: Bools


def with_forward_accel(drive: Drive) -> Drive:
    """Add what a three-axis accelerometer without gyroscope reads along the vehicle.

    Where it changes as the speed does is ahead; of that direction only what is level counts.
    Nothing is added where an accelerometer along the vehicle or a gyroscope is there already, or
    where the direction does not hold for the whole drive.

    Parameters
    ----------
    drive

    Returns
    -------
    Drive
        With ``longitudinal_accel``, with a note on why not, or as it was.
    """
    if drive.has(*IMU_SIGNALS) or drive.has("longitudinal_accel"):
        return drive
    if not drive.has(*AXES, "vehicle_speed"):
        return drive
    compared = _compared(drive)
    if compared is None or not _telling(compared.shown):
        return drive
    ahead, shift = _direction(compared)
    if not _holds(compared, ahead, shift):
        unused = Problem.of("imu.no_direction", "accel_x")
        return drive.with_problems(unused)
    time = drive.signals[AXES[0]].time
    read = sum(w * resample(drive.signals[n], time) for n, w in zip(AXES, ahead, strict=True))
    return drive.with_signals(Signal("longitudinal_accel", time, np.asarray(read)))


def _compared(drive: Drive) -> _Compared | None:
    """Lay accelerometer and speed on one grid; None where they are too short."""
    axes = [drive.signals[name] for name in AXES]
    speed = drive.signals["vehicle_speed"]
    if min(len(s) for s in (*axes, speed)) < 2:
        return None
    start = max(float(s.time[0]) for s in (*axes, speed))
    end = min(float(s.time[-1]) for s in (*axes, speed))
    if end - start < SHORTEST:
        return None
    time = start + np.arange(int((end - start) * RATE)) / RATE
    valid = speed.age(time) < LONGEST_GAP
    for s in axes:
        valid &= s.age(time) < LONGEST_GAP
    if np.count_nonzero(valid) < SHORTEST * RATE:
        return None
    read = np.column_stack([resample(s, time) for s in axes])
    change = np.gradient(lowpass(resample(speed, time), RATE, BAND[1]), 1.0 / RATE)
    felt = np.column_stack([_in_band(column, valid) for column in read.T])
    return _Compared(read, felt, _in_band(change, valid), valid)


def _in_band(values: Floats, valid: Bools) -> Floats:
    fast = np.where(valid, values - lowpass(values, RATE, BAND[0]), 0.0)
    return lowpass(fast, RATE, BAND[1])


def _direction(compared: _Compared) -> tuple[Floats, int]:
    """Find the level direction that follows the speed (3,), and the rows by which that is late.

    Noise of the change of speed makes all components smaller alike, and not their direction.
    """
    most = int(LATEST * RATE)
    inner = slice(most, compared.shown.size - most)
    shifts = [
        (_common(compared, np.roll(compared.shown, -k), inner), k) for k in range(-most, most + 1)
    ]
    common, shift = max(shifts, key=lambda one: float(np.linalg.norm(one[0])))
    down = _unit(np.mean(compared.read[compared.valid], axis=0))
    return _unit(common - down * (down @ common)), shift


def _common(compared: _Compared, shown: Floats, part: slice) -> Floats:
    """Sum of products of each axis and the change of speed over a part (3,)."""
    return np.asarray(compared.felt[part].T @ shown[part])


def _unit(direction: Floats) -> Floats:
    return np.asarray(direction / max(float(np.linalg.norm(direction)), 1e-9))


def _holds(compared: _Compared, ahead: Floats, shift: int) -> bool:
    """Whether the direction is that of the whole drive: nobody moved the device."""
    felt, shown = compared.felt @ ahead, np.roll(compared.shown, -shift)

    def alike(part: slice) -> float:
        size = float(np.linalg.norm(felt[part]) * np.linalg.norm(shown[part]))
        return float(felt[part] @ shown[part]) / size if size > 0.0 else 0.0

    telling = _telling(shown)
    whole = slice(0, shown.size)
    if alike(whole) < ALIKE or any(alike(part) < ALIKE_IN_PART for part in telling):
        return False
    return all(
        _unit(_common(compared, shown, part)) @ _unit(_common(compared, shown, whole)) > TURNED
        for part in telling
    )


def _telling(shown: Floats) -> list[slice]:
    """Parts of the drive in which the vehicle speeds up and slows down."""
    edges = np.linspace(0, shown.size, PARTS + 1).astype(int)
    parts = [slice(a, b) for a, b in pairwise(edges)]
    return [part for part in parts if float(np.std(shown[part])) > MOVING]
