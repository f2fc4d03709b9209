"""When the load changed during a ride, as its filter came to believe."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.inertia.filter import InertiaTrack
from weighbridge.limits import SURE
from weighbridge.signals import Bools

MERGED: Final = 0.5
"""Jumps of several parameters within this time are one [s]."""

HELD: Final = 0.5
"""A jump counts once the likeliest hypothesis has held it for so long [s]."""


def jumps(track: InertiaTrack) -> tuple[float, ...]:
    """Find when the load changed, as the filter came to believe.

    Returns
    -------
    Times [s], rising.
    """
    if track.time.size < 2:
        return ()
    step = np.diff(track.time, append=track.time[-1])
    believed: list[float] = []
    for j in range(3):
        born, place = np.unique(track.jumped[:, j], return_inverse=True)
        held = np.bincount(place, weights=step)
        last = track.jumped[-1, j]
        recent = (born == last) & (held > 0.2 * HELD)
        believed += born[np.isfinite(born) & ((held >= HELD) | recent)].tolist()
    found: list[float] = []
    for time in sorted(believed):
        if not found or time - found[-1] > MERGED:
            found.append(float(time))
    return tuple(found)


def load_changes(track: InertiaTrack, believed: tuple[float, ...]) -> tuple[float, ...]:
    """Keep of the jumps those that moved the mass: a change of load.

    Braking and turning push roll and pitch, never the heave. Where one begins so hard that a
    jump of an inertia is likelier, the mass stays.

    Parameters
    ----------
    track
    believed : times of the jumps [s], rising

    Returns
    -------
    Times [s], rising.
    """
    if not believed:
        return ()
    ends = np.searchsorted(track.time, (*believed, np.inf)) - 1
    alpha, std = track.alpha[ends, 0], track.alpha_std[ends, 0]
    moved = np.abs(np.diff(alpha)) > SURE * np.hypot(std[1:], std[:-1])
    return tuple(time for time, real in zip(believed, moved, strict=True) if real)


def believed_otherwise(track: InertiaTrack, begin: int, end: int) -> Bools:
    """Samples from ``begin`` on and before ``end`` at which the filter contradicts its end.

    Returns
    -------
    (end - begin,) True where a parameter as known then was not what it proved to be.
    """
    alpha, std = track.alpha[begin:end], track.alpha_std[begin:end]
    away = np.abs(alpha - alpha[-1])
    # An inertia within some percent leaves little beside the springs' own errors.
    return np.asarray(np.any(away > np.maximum(SURE * std, 0.05 * alpha[-1]), axis=1))
