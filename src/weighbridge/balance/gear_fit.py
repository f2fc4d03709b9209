"""Do a vehicle's gearings explain the engine and vehicle speed of a drive?"""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.balance.table import ForceBalance
from weighbridge.signals import Floats
from weighbridge.vehicle.gear import steady
from weighbridge.vehicle.model import Vehicle

NEAR: Final = 0.04
"""A ratio this near to a gearing belongs to it [-]: half the distance of close gears."""

ENOUGH: Final = 0.4
"""Part of the steady ratios that lies at a gearing. Gearings of another vehicle, a third
apart, catch a quarter by chance; a file that lacks one of its gears keeps more than half [-]."""

FEWEST: Final = 100
"""Steady ratios needed to judge."""

SLOWEST: Final = 3.0
"""Below, clutches slip [m/s]."""


def share_on_gears(balance: ForceBalance, vehicle: Vehicle) -> float | None:
    """Part of the steady ratios of engine to vehicle speed that lie at a gearing.

    Only rows with rising speed count: coasting, the engine may idle.

    Parameters
    ----------
    balance, vehicle

    Returns
    -------
    In [0, 1] [-]; None without gearings, or where too few ratios hold still
    """
    if not vehicle.driveline.gearings:
        return None
    time, ratio = held_ratios(balance)
    if time.size < FEWEST:
        return None
    gearings = np.log(np.array(vehicle.driveline.gearings))
    # A short drive may not show the scale of its speed, which stays the indicated one then.
    true, indicated = (
        float(np.mean(np.abs(ratio[:, None] - gearings + shift).min(axis=1) < NEAR))
        for shift in (0.0, np.log(vehicle.driveline.speed_scale))
    )
    return max(true, indicated)


def held_ratios(balance: ForceBalance) -> tuple[Floats, Floats]:
    """Logarithms of the steady ratios of engine to vehicle speed while it rises.

    Returns
    -------
    time : (n,) [s]
    ratio : (n,) of ratios in 1/m
    """
    view, engine_speed = balance.merged, balance.merged.engine_speed
    pulling = (view.speed > SLOWEST) & (view.accel > 0.0) & (engine_speed > 0.0)
    ratio = np.where(pulling, engine_speed / np.where(pulling, view.speed, 1.0), 0.0)
    held = pulling & steady(view.time, ratio, np.full(ratio.size, 0.02))
    return view.time[held], np.log(ratio[held])
