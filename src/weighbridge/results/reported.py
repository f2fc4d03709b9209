"""What a vehicle says of its own load, beside the mass that was weighed. No mass is made of it."""

from __future__ import annotations

import math

import numpy as np

from weighbridge.estimators import MassTrack
from weighbridge.signals import Drive, Floats


def maker_mass(drive: Drive, result: MassTrack | None) -> float:
    """Median of the mass that the vehicle reports over the rows used [kg]; NaN without one."""
    reported = _reported("maker_mass", drive, result)
    return float(np.median(reported)) if reported.size else math.nan


def trailer_connected(drive: Drive, result: MassTrack | None) -> bool | None:
    """Whether the vehicle reports a trailer in most of the rows used; None if it does not say."""
    reported = _reported("trailer_connected", drive, result)
    return bool(np.mean(reported) > 0.5) if reported.size else None


def _reported(name: str, drive: Drive, result: MassTrack | None) -> Floats:
    """What was reported last at each row used; all samples where no row tells."""
    signal = drive.get(name)
    if signal is None:
        return np.empty(0)
    held = signal.held(result.time[result.used]) if result is not None else np.empty(0)
    held = held[np.isfinite(held)]
    return held if held.size else signal.values
