"""How long a vehicle has been on the move."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.balance.table import MOVING
from weighbridge.signals import Drive

GAP: Final = 1.0
"""Of the time between two readings of the speed no more counts [s]."""


def time_on_the_move(drive: Drive, since: float) -> float:
    """Time on the move since an instant, gaps left out [s]."""
    speed = drive.speed
    if speed is None:
        return 0.0
    moved = (speed.values[1:] > MOVING) & (speed.time[1:] > since)
    return float(np.minimum(np.diff(speed.time), GAP)[moved].sum())


def moves(drive: Drive, at: float) -> bool:
    """Whether the vehicle moves at an instant [s], by the last speed before it."""
    speed = drive.speed
    return speed is not None and float(speed.held(np.array([at]))[0]) > MOVING
