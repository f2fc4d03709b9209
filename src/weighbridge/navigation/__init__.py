"""Speed, specific force and grade from the sensors: of a whole drive, or second by second."""

from weighbridge.navigation.motion import BY_SPEED, Motion, MotionSource, with_squat
from weighbridge.navigation.printed import PrintedFilterSettings, mounting_of, printed_motion
from weighbridge.navigation.select import (
    by_accelerometer,
    find_motion,
    identify_motion,
    without_accelerometer,
)

__all__ = [
    "BY_SPEED",
    "Motion",
    "MotionSource",
    "PrintedFilterSettings",
    "by_accelerometer",
    "find_motion",
    "identify_motion",
    "mounting_of",
    "printed_motion",
    "with_squat",
    "without_accelerometer",
]
