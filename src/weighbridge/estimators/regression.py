"""The mass as a slope: regressor and right-hand side of the longitudinal law."""

from __future__ import annotations

import numpy as np

from weighbridge.balance.force_balance import MergedView
from weighbridge.constants import GRAVITY
from weighbridge.signals import Floats
from weighbridge.vehicle.model import Vehicle


def regression(view: MergedView, vehicle: Vehicle) -> tuple[Floats, Floats]:
    """Regressor and right-hand side of the mass (Jensen 2022, eqs. 5, 6).

    The two terms ``v' + g sin(grade)`` of eq. 5 are the specific force along
    the road.

    Returns
    -------
    phi : (n,) [m/s^2]
    y : (n,) [N]
    """
    rolling = (
        vehicle.road.rolling_coefficient.value
        + vehicle.road_load.rolling_speed_coefficient * view.speed
    )
    phi = view.specific_force + GRAVITY * rolling * np.cos(view.grade)
    y = view.traction_force - view.drag_force - view.rotating_mass * view.accel
    return phi, y
