"""Where a vehicle corners so hard that its tyres slow it down."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from weighbridge.navigation import Motion
from weighbridge.navigation.motion import nearest_row
from weighbridge.signals import Bools, Floats

HARD_CORNERING: Final = 3.0
"""Lateral acceleration above which a row is left out [m/s^2]. A tyre runs at a slip angle and
its side force points backwards by that angle: the resistance over the mass is
a_y^2 / (g c), with a cornering stiffness c of 10 to 20 per rad over the load (Gillespie,
Fundamentals of Vehicle Dynamics, 1992, ch. 6), 0.05 to 0.09 m/s^2 at this limit. That is more
than the disturbance that the joint estimator expects (0.04 m/s^2), and it lasts through a
bend and has one sign. Ordinary drives spend a thousandth of their time beyond 2.5 m/s^2."""

TURN_TIME: Final = 1.0
"""Time over which the yaw rate is taken, as the difference of headings [s]."""


def yaw_rate(time: Floats, heading: Floats, rate: float, ahead: float = math.inf) -> Floats:
    """Return the yaw rate (n,) [rad/s]; NaN where the heading is unknown.

    Parameters
    ----------
    time : (n,) [s]
    heading : (n,) [rad]
    rate : of the rows [Hz]
    ahead : how far past a row others may show it [s]
    """
    half = max(1, round(0.5 * TURN_TIME * rate))
    seen = min(half, math.floor(min(ahead, TURN_TIME) * rate))
    index = np.arange(time.size)
    before, after = np.maximum(index - half, 0), np.minimum(index + seen, index.size - 1)
    turn = heading[after] - heading[before]
    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
    span = time[after] - time[before]
    return np.asarray(turn / np.where(span > 0.0, span, np.inf))


def lateral_acceleration(motion: Motion, ahead: float = math.inf) -> Floats:
    """Return yaw rate times speed (n,) [m/s^2]; NaN where the heading is unknown.

    ``ahead`` is how far past a row others may show it [s].
    """
    turning = yaw_rate(motion.time, motion.heading, motion.rate, ahead)
    return np.asarray(motion.speed * turning)


def cornering(motion: Motion, time: Floats, ahead: float = math.inf) -> Bools:
    """Where the lateral acceleration exceeds `HARD_CORNERING`; nowhere if headings are unknown.

    Parameters
    ----------
    motion
    time : (n,) instants asked about [s]
    ahead : how far past an instant the motion may show it [s]

    Returns
    -------
    (n,)
    """
    hard = (
        np.abs(np.nan_to_num(lateral_acceleration(motion, ahead - 0.5 / motion.rate)))
        > HARD_CORNERING
    )
    return np.asarray(hard[nearest_row(motion, time)])
