"""Motion from vehicle speed, with grade or height where they are."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.messages import Problem, phrase, refused
from weighbridge.navigation.height_lag import find_height_lag
from weighbridge.navigation.longitudinal import LONGEST_GAP, resample
from weighbridge.navigation.motion import Motion, MotionSource
from weighbridge.navigation.smoothing import GRADE_STD, smooth_grade, smooth_height, smooth_speed
from weighbridge.signals import Drive, Floats, Signal

SHORTEST: Final = 20.0
"""A shorter drive is not worth a look [s]."""

SHORTEST_WAY: Final = 120.0
"""A shorter way shows no grade by its heights [m]."""


def speed_motion(drive: Drive, *, rate: float = 10.0) -> Motion:
    """Find the motion from speed: acceleration as its smoothed rate of change.

    Grade comes from a grade signal, else from height over distance, else the
    road is taken as level and the notes say so. It is moved where the torque surely shows the
    hills at another time. Acceleration and grade are conditional means, see
    `weighbridge.navigation.smoothing`.

    Parameters
    ----------
    drive : with vehicle_speed or gnss_speed
    rate : of the result [Hz]

    Raises
    ------
    DriveError
        No speed, or too little of it.
    """
    speed = drive.speed
    if speed is None or len(speed) < 20:
        raise refused("speed.few", drive=drive.name)
    start, end = float(speed.time[0]), float(speed.time[-1])
    rate = min(rate, 4.0 / speed.period)
    time = start + np.arange(int((end - start) * rate)) / rate
    if end - start < SHORTEST or time.size < 32:
        raise refused("speed.short", drive=drive.name, length=end - start, least=SHORTEST)
    valid = speed.age(time) < max(LONGEST_GAP, 2.5 * speed.period)
    v, accel, speed_std, accel_std = smooth_speed(speed, time)
    distance = np.cumsum(np.where(valid, v, 0.0)) / rate
    grade, grade_std, height, source, notes = _grade(drive, time, distance)
    hills = "grade" if drive.has("grade") else "altitude"
    late = find_height_lag(drive, time, v, accel, grade, valid) if drive.has(hills) else None
    if late is not None and late.shown:
        shown = drive.signals[hills]
        moved = drive.with_signals(Signal(hills, shown.time - late.lag, shown.values))
        grade, grade_std, height, source, notes = _grade(moved, time, distance)
        when = phrase("later" if late.lag > 0.0 else "earlier", by=abs(late.lag))
        notes += (Problem.of("altitude.late", hills, when=when),)
    nowhere = np.full(time.size, np.nan)
    return Motion(
        source=source,
        time=time,
        speed=np.maximum(v, 0.0),
        accel=accel,
        specific_force=accel + GRAVITY * np.sin(grade),
        grade=grade,
        pitch=grade,
        roll=np.zeros(time.size),
        heading=nowhere,
        distance=distance,
        altitude=height if height is not None else nowhere,
        valid=valid,
        specific_force_std=float(np.median(accel_std)),
        grade_std=grade_std,
        speed_std=float(np.median(speed_std)),
        measured_speed=speed,
        notes=notes,
    )  # fmt: skip


def _grade(
    drive: Drive, time: Floats, distance: Floats
) -> tuple[Floats, Floats, Floats | None, MotionSource, tuple[Problem, ...]]:
    """Find grade, its standard deviation, and height where there is one."""
    measured, altitude = drive.get("grade"), drive.get("altitude")
    known = (
        altitude is not None
        and np.count_nonzero(altitude.age(time[::10]) < 5.0) > 1
        and np.count_nonzero((altitude.time >= time[0]) & (altitude.time <= time[-1])) > 1
    )
    height = resample(altitude, time) if altitude is not None and known else None
    if measured is not None and len(measured) > 1:
        grade, std = smooth_grade(measured, time, distance)
        return grade, std, height, "speed_grade", ()
    if altitude is None or height is None or distance[-1] < SHORTEST_WAY:
        note = Problem.of("motion.level")
        return np.zeros(time.size), np.full(time.size, GRADE_STD), height, "speed", (note,)
    height, slope, std = smooth_height(altitude, time, distance)
    grade = np.arcsin(np.clip(slope, -0.3, 0.3))
    return grade, std, height, "speed_grade", (Problem.of("motion.grade_by_height"),)
