"""Rows of one force balance, at which an equation is computed as printed and by the code."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from weighbridge.balance.table import ForceTable
from weighbridge.constants import GRAVITY
from weighbridge.signals import Floats

SPEED: Final = 14.0
"""[m/s]"""

ACCEL: Final = 0.4
"""[m/s^2]"""

GRADE: Final = 0.02
"""Slope of the road [rad]."""

DENSITY: Final = 1.206
"""Of the air [kg/m^3]."""


def point_table(torque: float, gearing: float, efficiency: float, rows: int = 2) -> ForceTable:
    """Return rows of a vehicle that pulls uphill, all alike.

    Parameters
    ----------
    torque : of the engine [N m]
    gearing : [1/m]
    efficiency : of the driveline [-]
    rows : how many, a tenth of a second apart
    """

    def same(value: float) -> Floats:
        return np.full(rows, value)

    return ForceTable(
        time=0.1 * np.arange(rows, dtype=np.float64),
        traction_force=same(efficiency * torque * gearing),
        force_std=same(0.0),
        torque=same(torque),
        engine_speed=same(gearing * SPEED),
        speed=same(SPEED),
        accel=same(ACCEL),
        specific_force=same(ACCEL + GRAVITY * math.sin(GRADE)),
        grade=same(GRADE),
        pitch=same(GRADE),
        heading=same(0.0),
        gear=np.ones(rows, dtype=np.int64),
        gearing=same(gearing),
        air_speed=same(SPEED),
        air_density=same(DENSITY),
        fuel_burnt=same(0.0),
        reason=np.zeros(rows, dtype=np.uint8),
    )
