"""The motion side of the force balance, evenly sampled."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.kernels.interpolation import rows_before
from weighbridge.messages import Problem, phrase
from weighbridge.signals import Bools, Floats, Ints, Signal, spread

if TYPE_CHECKING:
    from weighbridge.navigation.geodesy import LocalFrame

MotionSource = Literal["inertial", "longitudinal_accel", "speed_grade", "speed"]

BY_SPEED: Final = frozenset({"speed_grade", "speed"})
"""Motion without an accelerometer: its acceleration is the slope of speed, its grade that of
heights, or none; both are conditional means."""


SLOW: Final = 0.4
"""Values of a speed further apart are too slow to be the only source of acceleration [s]: starts
last few seconds, and masses by speed alone get worse from there on (docs/accuracy.md)."""


SLOPE: Final = 5.0
"""Time over which the slope of a slow speed is still that of the vehicle [s]."""

RATE_ROWS: Final = 100
"""First rows of a motion, which show its rate."""

RATE_DIGITS: Final = 6
"""Decimals of that rate [Hz]: the clock is even, and its stamps are rounded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedSpeed:
    """The speed that an acceleration without an accelerometer is the slope of.

    Attributes
    ----------
    period : time between its values [s]
    step : smallest step between values; 0 where it is fine [m/s]
    spread : standard deviation of its slope over `SLOPE`, which slow values still show [m/s^2]
    """

    period: float
    step: float
    spread: float

    @classmethod
    def of(cls, speed: Signal) -> RecordedSpeed:
        """Describe a speed: how often, how fine, and how much it changes over `SLOPE`."""
        levels = np.unique(np.round(speed.values, 6))
        coarse = levels.size > 2 and levels.size < 0.5 * len(speed)
        time = speed.time[speed.time <= speed.time[-1] - SLOPE]
        slope = (speed.at(time + SLOPE) - speed.at(time)) / SLOPE
        known = slope[np.isfinite(slope)]
        return cls(
            period=speed.period,
            step=float(np.median(np.diff(levels))) if coarse else 0.0,
            spread=float(np.std(known)) if known.size else 0.0,
        )

    @property
    def slow_text(self) -> str:
        """What is wrong with a slow speed and what to log, as a clause; empty for a fast one."""
        if self.period <= SLOW:
            return ""
        rate = 1.0 / self.period
        steps = phrase("in_steps", step=3.6 * self.step) if self.step > 0.0 else ""
        return phrase("slow_speed", rate=rate, steps=steps)


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """How the vehicle moved, band-limited and on an even clock.

    Attributes
    ----------
    source : how it was found: "inertial" (IMU with speed and GNSS as there are),
        "longitudinal_accel" (one accelerometer along the vehicle and speed),
        "speed_grade" (speed and grade or height) or "speed" (alone)
    time : (n,) even, rising [s]
    speed : (n,) along the road, true scale [m/s]
    accel : (n,) its rate of change [m/s^2]
    specific_force : (n,) along the road, ``accel + g sin(grade)``; the factor
        1 + g k of a leaning accelerometer is still in it where ``squat`` is
        None and taken out otherwise [m/s^2]
    grade : (n,) road slope, squat removed where known, positive uphill [rad]
    pitch : (n,) of the body, squat included, nose up positive [rad]
    roll : (n,) of the body, right side down positive [rad]
    heading : (n,) clockwise from north [rad]; NaN where unknown
    distance : (n,) travelled [m]
    altitude : (n,) [m]; NaN where unknown
    position : a local frame, and where in it the vehicle was (n, 3), north, east, down [m]; None
        where unknown, and of a pass forward
    valid : (n,) the sources were there; False in their gaps
    specific_force_std : noise level of ``specific_force``, of one sample [m/s^2]
    grade_std : (n,) standard deviation of ``grade`` as the filter sees it [rad]
    speed_scale : indicated over true vehicle speed [-]; None where not found
    speed_scale_std : its standard deviation
    speed_delay : lateness of the vehicle speed used [s]
    squat : pitch of the body per specific force k found and removed
        [rad per m/s^2]; None where the drive does not show it
    squat_std : its standard deviation
    own_squat : it is the drive's, and the one of the calibration does not hold
    mounting : (roll, pitch, yaw) of the sensor found or used [rad]
    mounting_std : their standard deviations [rad]
    speed_std : of ``speed`` where ``accel`` is its slope, as a smoother knows it; 0 where an
        accelerometer gave ``accel`` [m/s]
    specific_force_scale_std : relative, of the accelerometer's scale where it was corrected [-]
    uncertain_gain : specific force along the vehicle per change of its speed, where it is not 1 and
        was left as it is, for it may be the accelerometer's scale or an error of the squat [-]
    measured_speed : samples of the speed that all of this was made from, true scale; None where an
        accelerometer was there as well
    notes : what was found and what is uncertain
    """

    source: MotionSource
    time: Floats
    speed: Floats
    accel: Floats
    specific_force: Floats
    grade: Floats
    pitch: Floats
    roll: Floats
    heading: Floats
    distance: Floats
    altitude: Floats
    valid: Bools
    specific_force_std: float
    grade_std: Floats
    position: tuple[LocalFrame, Floats] | None = None
    speed_scale: float | None = None
    speed_scale_std: float | None = None
    speed_delay: float = 0.0
    squat: float | None = None
    squat_std: float | None = None
    own_squat: bool = False
    mounting: tuple[float, float, float] | None = None
    mounting_std: tuple[float, float, float] | None = None
    speed_std: float = 0.0
    specific_force_scale_std: float = 0.0
    uncertain_gain: float | None = None
    measured_speed: Signal | None = None
    notes: tuple[Problem, ...] = ()
    _rate: float | None = field(default=None, init=False, repr=False, compare=False)

    @property
    def recorded_speed(self) -> RecordedSpeed | None:
        """The speed whose slope ``accel`` is; None where an accelerometer gave it."""
        speed = self.measured_speed
        return None if speed is None else RecordedSpeed.of(speed)

    @property
    def rate(self) -> float:
        """Samples per second [Hz], the same of any part of a motion."""
        if self._rate is None:
            rate = round(1.0 / float(np.median(np.diff(self.time[:RATE_ROWS]))), RATE_DIGITS)
            object.__setattr__(self, "_rate", rate)
            return rate
        return self._rate

    @property
    def unmeasured_grade(self) -> float:
        """What of the grade nothing has measured, as a standard deviation [rad]."""
        if self.source not in BY_SPEED or not self.valid.any():
            return 0.0
        return float(np.sqrt(np.mean(self.grade_std[self.valid] ** 2)))

    def mean_accel_std(self, length: float) -> float:
        """Standard deviation of the mean acceleration over ``length`` [s] by its ends [m/s^2]."""
        return float(min(np.sqrt(2.0) * self.speed_std / length, self.specific_force_std or 0.0))


def row_before(motion: Motion, time: Floats) -> Ints:
    """Last row that is not after each instant (n,); the first where none is."""
    found: Ints = rows_before(np.ascontiguousarray(time), motion.time)
    return found


def nearest_row(motion: Motion, time: Floats) -> Ints:
    """Row nearest to each instant (n,)."""
    return np.minimum(row_before(motion, time + 0.5 / motion.rate), motion.time.size - 1)


def noise_level(y: Floats) -> float:
    """Noise of a smooth signal (n,) from its second differences, robustly; in its unit."""
    if y.size < 10:
        return 0.1
    second = y[2:] - 2.0 * y[1:-1] + y[:-2]
    return max(0.005, spread(second) / float(np.sqrt(6.0)))


def bridged(time: Floats, y: Floats) -> Floats:
    """Draw a line across what is NaN; values (n,) at ``time``, 0 where all of them are."""
    known = np.isfinite(y)
    if known.all():
        return y
    return np.interp(time, time[known], y[known]) if known.any() else np.zeros_like(y)


def with_squat(motion: Motion, squat: float, std: float) -> Motion:
    """Take another squat out of the grade than the one found in the drive.

    Parameters
    ----------
    motion : with a ``squat``, else it is returned as it is
    squat : pitch of the body per specific force along the road [rad per m/s^2]
    std : its standard deviation
    """
    if motion.squat is None:
        return motion
    more = (squat - motion.squat) / (1.0 + GRAVITY * squat) * motion.specific_force
    return replace(
        motion,
        grade=motion.grade - more,
        specific_force=motion.specific_force - GRAVITY * np.cos(motion.grade) * more,
        squat=squat,
        squat_std=std,
    )
