"""The way between positions, against the way that a speed says: by it units are known."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.constants import EARTH_RADIUS
from weighbridge.signals import Floats

_WINDOW: Final = 5.0
"""One position in such a time is compared with the next: the way hardly bends in it [s]."""

_LONGEST: Final = 30.0
"""Positions further apart are not compared [s]."""

_LEAST: Final = 30.0
"""Way between two positions, at least: far more than their noise [m]."""

_FEWEST: Final = 5
"""Pairs of positions that a comparison needs."""


def way_ratio(
    time: Floats, speed: Floats, fix_time: Floats, latitude: Floats, longitude: Floats
) -> float:
    """How many times the way of a speed the positions cover, in the median of many pairs.

    Parameters
    ----------
    time, speed : (n,) of the speed [s], [m/s]
    fix_time, latitude, longitude : (m,) of the positions [s], [rad]

    Returns
    -------
    NaN where there are too few positions or the vehicle hardly moves.
    """
    known = np.isfinite(time) & np.isfinite(speed)
    fixed = np.isfinite(fix_time) & np.isfinite(latitude) & np.isfinite(longitude)
    if known.sum() < 2 or fixed.sum() < 2:
        return float("nan")
    t, v = time[known], np.abs(speed[known])
    way = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    inside = fixed & (fix_time >= t[0]) & (fix_time <= t[-1])
    _, at = np.unique(fix_time[inside] // _WINDOW, return_index=True)
    if at.size < 2:
        return float("nan")
    stamps, north, east = (x[inside][at] for x in (fix_time, latitude, longitude))
    chord = EARTH_RADIUS * np.hypot(np.diff(north), np.cos(north[1:]) * np.diff(east))
    driven = np.diff(np.interp(stamps, t, way))
    used = (np.diff(stamps) <= _LONGEST) & (np.maximum(chord, driven) > _LEAST) & (driven > 0.0)
    if np.count_nonzero(used) < _FEWEST:
        return float("nan")
    return float(np.median(chord[used] / driven[used]))
