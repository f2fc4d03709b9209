"""Motion from vehicle speed, with grade or height where they are."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.signal import savgol_filter

from weighbridge.constants import GRAVITY
from weighbridge.errors import DriveError
from weighbridge.navigation.longitudinal import LONGEST_GAP, lowpass, resample
from weighbridge.navigation.motion import Motion, MotionSource
from weighbridge.signals import Drive, Floats

SHORTEST: Final = 20.0
"""A shorter drive is not worth a look [s]."""

GRADE_DISTANCE: Final = 60.0
"""Distance over which height is smoothed into grade [m]."""


def speed_motion(drive: Drive, *, rate: float = 10.0) -> Motion:
    """Find the motion from speed: acceleration by differentiation.

    Grade comes from a grade signal, else from height over distance, else the
    road is taken as level and the notes say so.

    Parameters
    ----------
    drive : with vehicle_speed or gnss_speed
    rate : of the result [Hz]

    Raises
    ------
    DriveError
        No speed, or too little of it.
    """
    speed = drive.get("vehicle_speed") or drive.get("gnss_speed")
    if speed is None or len(speed) < 20:
        raise DriveError(
            f"{drive.name}: no vehicle_speed and no gnss_speed of at least 20 samples; "
            "without a speed no vehicle can be weighed"
        )
    start, end = float(speed.time[0]), float(speed.time[-1])
    rate = min(rate, 4.0 / speed.period)
    time = start + np.arange(int((end - start) * rate)) / rate
    if end - start < SHORTEST or time.size < 32:
        raise DriveError(
            f"{drive.name}: only {end - start:.0f} s of speed; at least {SHORTEST:.0f} s are needed"
        )
    valid = speed.age(time) < max(LONGEST_GAP, 2.5 * speed.period)
    # A quadratic over two seconds, or three samples where they are rarer,
    # rides over the steps of a speed in whole km/h.
    window = 2 * int(max(1.0, 1.5 * speed.period) * rate) + 1
    raw = resample(speed, time)
    v = np.asarray(savgol_filter(raw, window, 2))
    accel = np.asarray(savgol_filter(raw, window, 2, deriv=1, delta=1.0 / rate))
    distance = np.cumsum(np.where(valid, v, 0.0)) / rate
    grade, height, source, notes = _grade(drive, time, v, distance, rate)
    nowhere = np.full(time.size, np.nan)
    step = np.diff(np.unique(speed.values))
    quantum = float(step.min()) if step.size else 0.0
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
        latitude=nowhere,
        longitude=nowhere,
        valid=valid,
        specific_force_std=max(0.29 * quantum, 0.02) * rate / window,
        grade_std=np.full(time.size, 0.02),
        notes=notes,
    )  # fmt: skip


def _grade(
    drive: Drive, time: Floats, speed: Floats, distance: Floats, rate: float
) -> tuple[Floats, Floats | None, MotionSource, tuple[str, ...]]:
    measured, altitude = drive.get("grade"), drive.get("altitude")
    height = resample(altitude, time) if altitude is not None and len(altitude) > 1 else None
    if measured is not None and len(measured) > 1:
        return resample(measured, time), height, "speed_grade", ()
    if height is None or distance[-1] < 2.0 * GRADE_DISTANCE:
        note = "no grade and no altitude: the road is taken as level"
        return np.zeros(time.size), height, "speed", (note,)
    even = np.arange(0.0, distance[-1], 5.0)
    profile = lowpass(np.interp(even, distance, height), 1.0 / 5.0, 0.5 / GRADE_DISTANCE)
    slope = np.gradient(profile, 5.0)
    grade = np.arctan(np.clip(np.interp(distance, even, slope), -0.3, 0.3))
    return grade, height, "speed_grade", ("grade from altitude over distance",)
