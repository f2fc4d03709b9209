"""Is an accelerometer one? A derivative of the speed feels neither gravity nor its own noise."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.limits import DRIVES, FEW
from weighbridge.signals import Drive, Floats, Problem, Signal

NAME: Final = "longitudinal_accel"

SPAN: Final = 30.0
"""Acceleration and speed are compared over so long: rounding and smoothing of a speed lie below
0.01 m/s^2 then [s]."""

ALIKE: Final = 0.008
"""Root mean square of the difference of both, at most: 0.0013 of a derivative of the same speed,
0.0055 of one of another speed in whole km/h; 0.029 to 0.57 of the accelerometer of a BMW i3 in 24
trips. A road of 0.1 % or a sensor that leans by 0.06 degrees make more [m/s^2]."""


def without_derived(drive: Drive) -> Drive:
    """Leave out an acceleration that was calculated from a speed of the drive.

    One that a person vouches for (``drive.info.trusted``) stays as it is.

    Parameters
    ----------
    drive : on clocks that rise
    """
    accel = drive.get(NAME)
    if accel is None or NAME in drive.info.trusted or len(accel) < 2:
        return drive
    for name in ("gnss_speed", "vehicle_speed"):
        speed = drive.get(name)
        if speed is None or len(speed) < 2:
            continue
        difference = _difference(accel, speed)
        rms = float(np.sqrt(np.mean(difference**2))) if difference.size >= FEW else np.inf
        if rms < ALIKE:
            found = Problem.of("imu.derived", NAME, speed=name, rms=rms, span=SPAN)
            return drive.without(NAME).with_problems(found)
    return drive


def _difference(accel: Signal, speed: Signal) -> Floats:
    """Mean of an acceleration less the change of a speed, of each span in motion [m/s^2]."""
    start = max(float(accel.time[0]), float(speed.time[0]))
    end = min(float(accel.time[-1]), float(speed.time[-1]))
    edges = np.arange(start, end, SPAN)
    if edges.size < 2:
        return np.zeros(0)
    gained = np.diff(np.interp(edges, accel.time, _integral(accel)))
    changed = np.diff(np.interp(edges, speed.time, speed.values))
    way = np.diff(np.interp(edges, speed.time, _integral(speed)))
    return np.asarray((gained - changed)[way > DRIVES * SPAN] / SPAN)


def _integral(signal: Signal) -> Floats:
    mean = 0.5 * (signal.values[1:] + signal.values[:-1])
    return np.concatenate([[0.0], np.cumsum(mean * np.diff(signal.time))])
