"""Does a vehicle roll on tyres of another circumference than in its calibration?"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from weighbridge.balance.gear_fit import held_ratios
from weighbridge.balance.table import ForceBalance
from weighbridge.limits import MANY
from weighbridge.messages import Problem
from weighbridge.vehicle import Vehicle

LEAST: Final = 0.01
"""Smaller changes are wear and pressure [-]: in undamaged drives of seven vehicles of two
simulators it was 0.002 at most."""

MOST: Final = 0.08
"""No tyre that fits a rim is larger or smaller by more [-]."""

AGREES: Final = 0.01
"""Circumference by GNSS less that by the gears at most [-]: both were within 0.003 of a change of
4 % in those vehicles."""

NEAR: Final = 0.02
"""A ratio this near to a gearing lies on it [-]."""

FITS: Final = 0.8
"""Part of the ratios that lie on the gearings of the tyres found [-]."""


def on_its_tyres(balance: ForceBalance, vehicle: Vehicle) -> tuple[Vehicle, Problem | None]:
    """Give a vehicle the gearings of the tyres that it rolls on.

    Larger tyres make the indicated speed fall against that of GNSS, and engine over true speed
    by as much. Where both say so, the force at the wheels is less by as much, too.

    Parameters
    ----------
    balance, vehicle

    Returns
    -------
    vehicle : itself where its tyres are those of the calibration, or nothing shows
    note : what was found; None if nothing
    """
    motion, line = balance.motion, vehicle.driveline
    shown = motion.speed_scale or 0.0
    # Positions of two drives put together can make a scale that is no scale.
    if shown <= 0.0 or not line.gearings or not vehicle.provenance.torque_fitted:
        return vehicle, None
    _, ratio = held_ratios(balance)
    change = float(np.log(shown / line.speed_scale))
    std = motion.speed_scale_std or 0.0
    if ratio.size < MANY or not max(LEAST, 3.0 * std) < abs(change) < MOST:
        return vehicle, None
    off = ratio[:, None] - change - np.log(np.array(line.gearings))
    off = off[np.arange(ratio.size), np.abs(off).argmin(axis=1)]
    on = np.abs(off) < NEAR
    if np.mean(on) < FITS or abs(float(np.median(off))) > AGREES:
        return vehicle, None
    change += float(np.median(off[on]))
    scale = float(np.exp(change))
    found = replace(
        line,
        gearings=tuple(g * scale for g in line.gearings),
        wheel_radius=line.wheel_radius / scale,
    )
    size = "larger" if scale < 1.0 else "smaller"
    return replace(vehicle, driveline=found), Problem.of(
        "tyres.changed", share=100.0 * abs(1.0 / scale - 1.0), size=size
    )
