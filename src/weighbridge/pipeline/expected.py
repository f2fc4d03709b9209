"""What to expect of a mass by each way to weigh, as `inspect` and docs/accuracy.md show it."""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple

import numpy as np

from weighbridge.estimators.gate import GATE
from weighbridge.estimators.joint.batch import JOINT_MOTION_STD
from weighbridge.limits import CREEPS
from weighbridge.navigation import MotionSource
from weighbridge.signals import Drive
from weighbridge.vehicle import Vehicle

MOTIONS: Final[dict[MotionSource, str]] = {
    "inertial": "IMU with speed",
    "longitudinal_accel": "longitudinal accelerometer with speed",
    "speed_grade": "speed with grade or height",
    "speed": "speed alone",
}
"""Each source of motion in words, the best first."""

FAST: Final = 2.9
"""Readings of torque or load per second from which they are in time for the motion [1/s]."""

EXPECTED: Final[dict[tuple[MotionSource, bool], tuple[float, float, str]]] = {
    ("inertial", True): (0.4, 3.0, "what the torque's reading is worth, squat and wind"),
    ("inertial", False): (1.0, 3.0, "how late slow readings are"),
    ("longitudinal_accel", True): (1.5, 3.5, "the lean of the accelerometer, the torque's scale"),
    ("longitudinal_accel", False): (2.0, 4.0, "how late slow readings are, the sensor's lean"),
    ("speed_grade", True): (2.0, 6.0, "acceleration and grade come from smoothed speed and height"),
    ("speed_grade", False): (3.0, 6.0, "acceleration comes from slowly polled speed"),
    ("speed", True): (4.0, 7.0, "no grade is measured"),
    ("speed", False): (4.0, 8.0, "no grade is measured, and speed is slowly polled"),
}
"""Standard deviation of a mass, best to worst [%], and what sets it, by motion and whether the
torque is read at `FAST` or more: it holds what docs/accuracy.md has as measured. Of fast speed
alone, of speed alone below 2 Hz and of a slow longitudinal accelerometer nothing was measured;
theirs are graded from the others."""


class _Kept(NamedTuple):
    """Standard deviation of a mass by one motion source, from drives of two simulators.

    Attributes
    ----------
    drive : of a drive, times the root of its excitation [% sqrt(m^2/s^3)]
    file : factor on what the vehicle file and the motion leave in every mass [-]
    low, high : range that holds nine drives of ten, over the value by these [-]
    """

    drive: float
    file: float
    low: float
    high: float


_KEPT: Final[dict[MotionSource, _Kept]] = {
    "inertial": _Kept(20.0, 1.3, 0.45, 2.4),
    "longitudinal_accel": _Kept(22.0, 1.3, 0.5, 2.2),
    "speed_grade": _Kept(33.0, 1.45, 0.58, 1.65),
    "speed": _Kept(37.0, 1.5, 0.5, 1.65),
}
"""Fitted by studies/corpus/promise.py to 440 weighings of vehicles of seed 7300."""

_UNSURE: Final = 2.5
"""Standard deviation by the drive alone from which a mass may not come [%]."""

_HOPELESS: Final = 100.0 * GATE.widest
"""The same from which none comes [%]: the gate of every method."""

_SHORT: Final = 150.0
"""Time of driving below which a mass may not come [s]. With an inertial sensor, 24 of 121 cuts of
70 to 160 s carry none, and 7 of 261 longer ones."""

_SPARSE: Final = 60.0
"""Longest mean period of a speed that shows an acceleration [s]."""

_SPACING: Final = 1.0
_BASE: Final = 2
"""Samples of speed for an acceleration: their spacing [s], and how many steps it spans."""


class Excitation(NamedTuple):
    """How much a drive moves.

    Attributes
    ----------
    energy : integral of the squared acceleration, while driving [m^2/s^3]
    driven : time of driving [s]
    """

    energy: float
    driven: float


ENOUGH: Final = Excitation(math.inf, math.inf)
"""Of a drive that is not known: it is taken as long enough."""


def excitation(drive: Drive) -> Excitation:
    """Return how much a drive moves, from its speed by differences over two seconds.

    Without a speed it is `ENOUGH`: what other signals show is not judged. A speed with fewer than
    one sample in `_SPARSE` shows none.
    """
    speed = drive.speed
    if speed is None or len(speed) < 2:
        return ENOUGH
    if speed.duration > _SPARSE * len(speed):
        return Excitation(0.0, 0.0)
    time = np.arange(speed.time[0], speed.time[-1], _SPACING)
    v = np.abs(np.interp(time, speed.time, speed.values))
    accel = (v[_BASE:] - v[:-_BASE]) / (_BASE * _SPACING)
    driving = 0.5 * (v[_BASE:] + v[:-_BASE]) > CREEPS
    energy = float(np.sum(accel[driving] ** 2)) * _SPACING
    return Excitation(energy, float(np.count_nonzero(driving)) * _SPACING)


def expected(
    motion: MotionSource,
    *,
    fast: bool,
    vehicle: Vehicle | None = None,
    drive: Excitation = ENOUGH,
) -> tuple[float, float]:
    """Return the standard deviation of a mass, best to worst [%].

    Parameters
    ----------
    motion : source of the motion
    fast : the torque is read at `FAST` or more
    vehicle : a file that was calibrated; what it leaves in every mass counts
    drive : how much the drive moves
    """
    kept = _KEPT[motion]
    alone = _by_drive(motion, drive)
    scale = vehicle.provenance.mass_scale_std if vehicle is not None else None
    if scale is None:
        best, worst, _ = EXPECTED[motion, fast]
        return round(math.hypot(best, kept.low * alone), 1), round(
            math.hypot(worst, kept.high * alone), 1
        )
    left = 100.0 * math.hypot(scale, JOINT_MOTION_STD[motion])
    middle = math.hypot(kept.file * left, alone)
    return round(max(kept.low * middle, 0.1), 1), round(max(kept.high * middle, 0.2), 1)


def _by_drive(motion: MotionSource, drive: Excitation) -> float:
    """Return the standard deviation that the drive alone leaves [%]."""
    return _KEPT[motion].drive / math.sqrt(drive.energy) if drive.energy > 0.0 else math.inf


def chance(motion: MotionSource, drive: Excitation) -> Literal["sure", "unsure", "none"]:
    """Return whether a drive that contradicts nothing moves enough for a mass."""
    alone = _by_drive(motion, drive)
    if alone > _HOPELESS:
        return "none"
    return "unsure" if alone > _UNSURE or drive.driven < _SHORT else "sure"
