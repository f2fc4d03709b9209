"""Inertial samples on an even clock."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.navigation.aiding import Imu, resample
from weighbridge.signals import Floats
from weighbridge.signals.interpolation import interpolate

_SPARSE: Final = 1.2
"""Samples further apart than so many periods of the clock are interpolated [-]."""

_LONGEST: Final = 2.5
"""Such samples further apart than so many of their usual distances leave a gap [-]."""


@dataclass(frozen=True, slots=True)
class Even:
    """Inertial samples, low-passed on an even clock.

    Attributes
    ----------
    time : (n,) [s]
    values : (n, 6) specific force and angular rate in sensor axes; NaN in gaps
    """

    time: Floats
    values: Floats


def evenly(imu: Imu, rate: float, first: int | None = None) -> Even:
    """Low-pass the inertial samples and take them to an even clock.

    It begins with the first sample, or with row ``first`` of a clock that began at 0 s.
    """
    start = float(imu.time[0]) if first is None else first / rate
    count = max(4, math.floor((imu.time[-1] - start) * rate) + 1)
    if imu.period * rate > _SPARSE:
        return _interpolated(imu, start + np.arange(count) / rate)
    columns = (*imu.accel.columns, *imu.gyro.columns)
    values = resample(imu.time, columns, start, 1.0 / rate, count)
    return Even(start + np.arange(count) / rate, values)


def _interpolated(imu: Imu, time: Floats) -> Even:
    """Interpolate samples slower than the clock; a low-pass would leave holes between them."""
    right = np.clip(np.searchsorted(imu.time, time), 1, imu.time.size - 1)
    near = imu.time[right] - imu.time[right - 1] < _LONGEST * imu.period
    columns = [
        np.where(near, interpolate(time, imu.time, y), np.nan)
        for y in (*imu.accel.columns, *imu.gyro.columns)
    ]
    return Even(time, np.column_stack(columns))


def coarsely(fine: Even, period: float) -> Even:
    """Low-pass even samples further, to a clock of ``period`` [s]."""
    start = float(fine.time[0])
    count = max(4, math.floor((fine.time[-1] - start) / period) + 1)
    whole = np.isfinite(fine.values).all(axis=1)
    values = resample(fine.time[whole], list(fine.values[whole].T), start, period, count)
    return Even(start + np.arange(count) * period, values)
