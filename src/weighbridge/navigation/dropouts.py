"""Inertial samples that cannot be: zeros in place of a reading, spikes."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.navigation.axes import Axes
from weighbridge.signals import Bools, Floats, Ints, spread

_LEAST_FORCE, _MOST_FORCE = 2.0, 50.0
"""No body on wheels feels less or more than so for a sample [m/s^2]."""

_SPIKE: Final = 20.0
"""A sample off the mean of its neighbours by so many usual deviations is a spike [-],"""

_LEAST_SPIKE: Final = (4.0, 1.0)
"""if it is also off by so much: force [m/s^2], rate [rad/s]."""

_ZEROS: Final = 0.002
"""A larger part of zeros in motion is no chance [-],"""

_ENOUGH: Final = 200_000
"""Moving samples by which the values beside zero are found."""

_MORE: Final = 4.0
"""if there are so many times more of them than of the values beside them [-]."""


def false_rows(accel: Axes, gyro: Axes, moving: Bools) -> Bools:
    """Mark samples that say nothing of the motion.

    Parameters
    ----------
    accel, gyro : specific force [m/s^2] and rate [rad/s]
    moving : (n,) the vehicle moves

    Returns
    -------
    (n,)
    """
    size = np.square(accel.x)
    size += np.square(accel.y)
    size += np.square(accel.z)
    np.sqrt(size, out=size)
    false = np.zeros(size.size, dtype=bool)
    if 0.5 * GRAVITY < float(np.median(size)) < 2.0 * GRAVITY:
        # Otherwise the unit is wrong, which other checks find.
        false |= (size < _LEAST_FORCE) | (size > _MOST_FORCE)
    del size
    some = np.flatnonzero(moving)[:_ENOUGH]
    for kind, block in enumerate((accel, gyro)):
        for x in block.columns:
            false |= _spikes(x, _LEAST_SPIKE[kind]) | _zeros(x, moving, some)
    return np.asarray(false)


def _spikes(x: Floats, least: float) -> Bools:
    off = np.zeros(x.size)
    inner = off[1:-1]
    np.add(x[2:], x[:-2], out=inner)
    inner *= -0.5
    inner += x[1:-1]
    np.abs(off, out=off)
    if not off.max(initial=0.0) > least:
        return np.zeros(x.size, dtype=bool)
    limit = max(_SPIKE * spread(off), least)
    found = off > limit
    # The neighbours of a spike are off by half of it.
    found[1:] &= off[1:] > off[:-1]
    found[:-1] &= off[:-1] > off[1:]
    return np.asarray(found)


def _zeros(x: Floats, moving: Bools, rows: Ints) -> Bools:
    zero = x == 0.0
    if not zero.any():
        return np.asarray(zero)
    here = int(np.count_nonzero(zero & moving))
    if here <= _ZEROS * np.count_nonzero(moving):
        return np.zeros(x.size, dtype=bool)
    some = x[rows]
    levels = np.unique(some)
    place = int(np.searchsorted(levels, 0.0))
    low, high = levels[max(place - 5, 0)], levels[min(place + 5, levels.size - 1)]
    below, above = np.percentile(some, [16.0, 84.0])
    if high - low > above - below:
        # Rounding is so coarse that the middle may well be zero.
        return np.zeros(x.size, dtype=bool)
    near = int(np.count_nonzero((x >= low) & (x <= high) & moving)) - here
    return zero if here > _MORE * max(near, 1) / 10.0 else np.zeros(x.size, dtype=bool)
