"""Averages over short windows, in which signals of different clocks can be compared."""

from __future__ import annotations

import numpy as np

from weighbridge.constants import EARTH_RADIUS
from weighbridge.kernels.interpolation import seen_windows, trapezoid_means
from weighbridge.signals import Bools, Drive, Floats, Signal


def edges(start: float, end: float, length: float) -> Floats:
    """Edges of even windows [s]."""
    return np.arange(start, end, length)


def means(signal: Signal, at: Floats) -> tuple[Floats, Bools]:
    """Average a signal over windows.

    Parameters
    ----------
    signal : the signal
    at : (n + 1,) edges of the windows [s]

    Returns
    -------
    mean : (n,) by the trapezoidal rule
    full : (n,) no gap of more than a quarter of the window in or at it
    """
    t, v = signal.time, signal.values
    limit = 0.25 * float(at[1] - at[0])
    return trapezoid_means(at, t, v), seen_windows(at, t, limit)


def track(
    drive: Drive, spacing: float, *, swapped: bool = False
) -> tuple[Floats, Floats, Floats] | None:
    """Displacements between fixes about ``spacing`` [s] apart.

    Parameters
    ----------
    drive : the drive
    spacing : [s]
    swapped : take latitude for longitude and the other way round

    Returns
    -------
    time : (n + 1,) of the fixes [s]
    north, east : (n,) displacements [m]
    or None without positions
    """
    lat, lon = drive.get("latitude"), drive.get("longitude")
    if lat is None or lon is None or len(lat) < 5:
        return None
    time = lat.time
    if lon.time is not lat.time:
        time = time[(time >= lon.time[0]) & (time <= lon.time[-1])] if len(lon) else time[:0]
    if time.size < 5:
        return None
    stride = max(1, round(spacing / max(float(np.median(np.diff(time))), 1e-6)))
    time = time[::stride]
    phi, lam = lat.at(time), lon.at(time)
    if swapped:
        phi, lam = lam, phi
    north = EARTH_RADIUS * np.diff(phi)
    turn = (np.diff(lam) + np.pi) % (2.0 * np.pi) - np.pi
    return time, north, EARTH_RADIUS * np.cos(phi[:-1]) * turn
