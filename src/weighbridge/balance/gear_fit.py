"""Do a vehicle's gearings explain the engine and vehicle speed of a drive?"""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.balance.table import ForceBalance
from weighbridge.constants import CRUISE
from weighbridge.limits import DRIVES, MANY
from weighbridge.signals import Floats, scalar_from_si
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.gear import steady

NEAR: Final = 0.04
"""A ratio this near to a gearing belongs to it [-]: half the distance of close gears."""

ENOUGH: Final = 0.4
"""Part of the steady ratios that lies at a gearing. Gearings of another vehicle, a third
apart, catch a quarter by chance; a file that lacks one of its gears keeps more than half [-]."""


def share_on_gears(balance: ForceBalance, vehicle: Vehicle) -> float | None:
    """Part of the steady ratios of engine to vehicle speed that lie at a gearing.

    Only rows with rising speed count: coasting, the engine may idle. Those of a stepless gearbox
    lie within its range.

    Parameters
    ----------
    balance, vehicle

    Returns
    -------
    In [0, 1] [-]; None without gearings, or where too few ratios hold still
    """
    if not _known(vehicle):
        return None
    time, ratio = held_ratios(balance)
    if time.size < MANY:
        return None
    return _share(ratio, vehicle)


def ratio_apart(balance: ForceBalance, vehicle: Vehicle) -> tuple[float, float]:
    """Return the ratio that most of the rows have which lie at no gearing, and the nearest gearing.

    Parameters
    ----------
    balance, vehicle : with gearings, and steady ratios that lie elsewhere

    Returns
    -------
    Both as the engine speed at 100 km/h [rpm]
    """
    gearings = np.log(np.array(_known(vehicle)))
    _, ratio = held_ratios(balance)
    off = np.sort(ratio[distance(ratio, vehicle) >= NEAR])
    # The densest stretch of the width of a gear.
    counts = np.searchsorted(off, off + NEAR, side="right") - np.arange(off.size)
    most = int(np.argmax(counts))
    seen = float(np.median(off[most : most + int(counts[most])]))
    expected = float(gearings[np.argmin(np.abs(gearings - seen))])
    return _rpm(seen), _rpm(expected)


def _rpm(ratio: float) -> float:
    """Engine speed at 100 km/h of the logarithm of a ratio [rpm]."""
    return scalar_from_si(float(np.exp(ratio)) * CRUISE, "rpm")


def _share(ratio: Floats, vehicle: Vehicle) -> float:
    """Part of logarithms of ratios (n,) that lie at a gearing [-]."""
    # A short drive may not show the scale of its speed, which stays the indicated one then.
    true, indicated = (
        float(np.mean(distance(ratio + shift, vehicle) < NEAR))
        for shift in (0.0, np.log(vehicle.driveline.speed_scale))
    )
    return max(true, indicated)


def _known(vehicle: Vehicle) -> tuple[float, ...]:
    """Gearings, or both ends of a range of them [1/m]; empty where they are not known."""
    return vehicle.driveline.gearing_range or vehicle.driveline.gearings


def distance(ratio: Floats, vehicle: Vehicle) -> Floats:
    """How far logarithms of ratios (n,) are from the gearings, or outside of their range [-]."""
    gearings = np.log(np.array(_known(vehicle)))
    if vehicle.driveline.stepless:
        return np.asarray(np.maximum(np.maximum(gearings[0] - ratio, ratio - gearings[-1]), 0.0))
    return np.asarray(np.abs(ratio[:, None] - gearings).min(axis=1))


def held_ratios(balance: ForceBalance) -> tuple[Floats, Floats]:
    """Logarithms of the steady ratios of engine to vehicle speed while it rises.

    Returns
    -------
    time : (n,) [s]
    ratio : (n,) of ratios in 1/m
    """
    table, engine_speed = balance.table, balance.table.engine_speed
    pulling = (table.speed > DRIVES) & (table.accel > 0.0) & (engine_speed > 0.0)
    ratio = np.where(pulling, engine_speed / np.where(pulling, table.speed, 1.0), 0.0)
    held = pulling & steady(table.time, ratio, np.full(ratio.size, 0.02))
    return table.time[held], np.log(ratio[held])
