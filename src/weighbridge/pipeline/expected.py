"""What to expect of a mass by each way to weigh, as `inspect` and docs/accuracy.md show it."""

from __future__ import annotations

import math
from typing import Final

from weighbridge.estimators.joint.batch import JOINT_MOTION_STD
from weighbridge.navigation.motion import MotionSource
from weighbridge.vehicle.model import Vehicle

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
    ("inertial", False): (1.0, 2.0, "how late slow readings are"),
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


def expected(
    motion: MotionSource, *, fast: bool, vehicle: Vehicle | None = None
) -> tuple[float, float]:
    """Return the standard deviation of a mass, best to worst [%].

    Parameters
    ----------
    motion : source of the motion
    fast : the torque is read at `FAST` or more
    vehicle : a file that was calibrated; what it leaves in every mass is the least
    """
    best, worst, _ = EXPECTED[motion, fast]
    scale = vehicle.provenance.mass_scale_std if vehicle is not None else None
    if scale is None:
        return best, worst
    left = 100.0 * math.hypot(scale, JOINT_MOTION_STD[motion])
    best = max(best, round(left, 1))
    return best, max(worst, round(math.hypot(best, left), 1))
