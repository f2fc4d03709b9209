"""Averages over short windows, in which signals of different clocks can be compared."""

from __future__ import annotations

import numpy as np

from weighbridge.constants import EARTH_RADIUS
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
    # In place: several copies of a day's samples at 200 Hz would fill the memory.
    area = np.zeros(t.size)
    pieces = area[1:]
    np.add(v[1:], v[:-1], out=pieces)
    pieces *= 0.5
    pieces *= np.diff(t)
    np.cumsum(pieces, out=pieces)
    mean = np.diff(np.interp(at, t, area)) / np.diff(at)
    return mean, _full(signal, at)


def _full(signal: Signal, at: Floats) -> Bools:
    t = signal.time
    limit = 0.25 * float(at[1] - at[0])
    gaps = np.flatnonzero(np.diff(t) > limit)
    gap_starts, gap_ends = t[gaps], t[gaps + 1]
    inside = (at[:-1] >= t[0] - limit) & (at[1:] <= t[-1] + limit)
    # A gap touches a window that starts before it ends and ends after it starts.
    ended = np.searchsorted(gap_ends, at[:-1], side="right")
    begun = np.searchsorted(gap_starts, at[1:], side="left")
    return np.asarray(inside & (begun <= ended))


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
