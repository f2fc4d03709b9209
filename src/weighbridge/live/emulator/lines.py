"""JSON lines that an inertial sensor sends of a drive: the line protocol of ``lines``."""

from __future__ import annotations

import json
from typing import Final

import numpy as np

from weighbridge.signals import Drive, Floats
from weighbridge.signals.catalogue import IMU_SIGNALS

# Digits after the point: 1e-5 m/s^2 and rad/s are far below the noise of a sensor.
_DIGITS: Final = 5


class InertialLines:
    """A line for each sample of the accelerometer, with the gyro's reading at that instant.

    Parameters
    ----------
    drive : with an accelerometer and a gyro
    """

    def __init__(self, drive: Drive) -> None:
        self._stamps = drive.signals[IMU_SIGNALS[0]].time
        columns = [drive.signals[name] for name in IMU_SIGNALS]
        self._rows = np.round(
            np.stack([np.interp(self._stamps, s.time, s.values) for s in columns], axis=1), _DIGITS
        )

    def between(self, start: float, end: float) -> list[bytes]:
        """Lines of the samples later than ``start`` and not later than ``end`` [s]."""
        first, last = np.searchsorted(self._stamps, [start, end], side="right")
        return [_line(self._stamps[k], self._rows[k]) for k in range(first, last)]


def _line(stamp: float, row: Floats) -> bytes:
    said = {"t": round(float(stamp), 6), "accel": row[:3].tolist(), "gyro": row[3:].tolist()}
    return json.dumps(said).encode("ascii") + b"\n"
