"""Does the accelerometer part from the speed at some engine speeds, as one whose holder rings?"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from weighbridge.messages import Problem
from weighbridge.navigation import Motion
from weighbridge.navigation.identify.gain import changes_of_speed
from weighbridge.signals import UNITS, Drive, Floats

SPAN: Final = 3.0
"""Changes of the speed are compared with those by the accelerometer over so long [s]."""

SHIFTS: Final = (-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 9.0)
"""An accelerometer that is ahead by so much explains a speed that is late or smoothed [s]."""

BANDS: Final = 24
"""Bands of engine speed, each with as many samples as any other [-]."""

FEWEST: Final = 6
"""Spans that lie apart, in each band: fewer show nothing [-]."""

LEAST: Final = 0.010
"""Root mean square over the bands of what the two differ by, above which a mass is wrong [m/s^2]:
0.0005 to 0.003 in undamaged drives of simulated vehicles. A band that shifts the accelerometer by
0.2 m/s^2 made 0.016 to 0.022 and masses up to 14 % light, by 0.1 m/s^2 0.008 to 0.015 and 5 %."""

EXPLAINED: Final = 0.10
"""Part of the variance that the bands explain at least [-]: 0.12 and more with such shifts; 0.08 at
most where the speed is late, in coarse steps, or of wheels that spin; 0.04 in recorded drives."""

SURE: Final = 3.6
"""Standard deviations by which a band is off at least [-]: 3.9 and more against 3.0 at most."""


def shaken(drive: Drive, motion: Motion) -> Problem | None:
    """Say that vibration shifts the accelerometer in a band of engine speed; None if not so.

    Vibration that a holder's resonance makes one-sided reads as acceleration or as grade. The
    speed does not know of it, so that the two part where the engine speed is in the band.

    Parameters
    ----------
    drive : checked
    motion : of its accelerometer
    """
    speed, engine = drive.get("vehicle_speed"), drive.get("engine_speed")
    if motion.mounting is None or speed is None or engine is None:
        return None
    if min(len(speed), len(engine)) < 2:
        return None
    pairs = changes_of_speed(motion, speed, SPAN)
    if pairs is None:
        return None
    time, force, shown = pairs
    revs = engine.at(time)
    known = np.isfinite(revs) & (engine.age(time) < 0.5 * SPAN)
    apart = SPAN / float(np.median(np.diff(time))) if time.size > 1 else math.inf
    time, force, shown, revs = time[known], force[known], shown[known], revs[known]
    if revs.size < FEWEST * BANDS * apart or np.ptp(revs) <= 0.0:
        return None
    rows = np.column_stack([np.interp(time - shift, time, force) for shift in SHIFTS])
    off = rows @ np.linalg.lstsq(rows, shown, rcond=None)[0] - shown
    return _reported((off - float(np.mean(off))) / SPAN, revs, apart)


def _reported(off: Floats, revs: Floats, apart: float) -> Problem | None:
    """Judge the differences (n,) [m/s^2] by engine speed (n,) [rad/s]."""
    edges = np.percentile(revs, np.linspace(0.0, 100.0, BANDS + 1))
    band = np.clip(np.searchsorted(edges, revs) - 1, 0, BANDS - 1)
    count = np.maximum(np.bincount(band, minlength=BANDS), 1)
    mean = np.bincount(band, off, minlength=BANDS) / count
    left = np.bincount(band, (off - mean[band]) ** 2, minlength=BANDS) / count
    std = np.sqrt(left / np.maximum(count / apart, 1.0))
    sureness = np.abs(mean) / np.maximum(std, 1e-9)
    explained = float(np.mean(mean[band] ** 2) / np.mean(off**2))
    size = float(np.sqrt(np.mean(mean**2)))
    if size < LEAST or explained < EXPLAINED or float(np.max(sureness)) < SURE:
        return None
    worst = int(np.argmax(np.abs(mean)))
    rpm = float(np.median(revs[band == worst])) / UNITS["rpm"].factor
    return Problem.of("imu.shaken", off=abs(mean[worst]), rpm=rpm)
