"""What a drive cannot separate from the mass, and what the mass is uncertain by for it."""

from __future__ import annotations

import math

from weighbridge.balance.law import engine_inertia_column, wheel_inertia_column
from weighbridge.estimators.squat import share_of_accel
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle import Vehicle, by_data_sheet


def inertia_relative_std(
    vehicle: Vehicle, mass: float, accel: Floats, phi: Floats, used: Bools
) -> float:
    """Relative standard deviation of a mass by the inertias of a data sheet with one gear [-].

    With one gear the rotating mass is the same all the time. Only hills, which accelerate
    nothing, separate it from the mass, and they do so no better than the accelerometer's
    scale and lean are known. So it is considered (Schmidt, 1966), not estimated. With
    several gears it is a state.

    Parameters
    ----------
    vehicle
    mass : [kg]
    accel, phi : (n,) acceleration and regressor of the mass [m/s^2]
    used : (n,)
    """
    line = vehicle.driveline
    if not (by_data_sheet(vehicle) and line.single_speed) or not mass > 0.0:
        return 0.0
    engine, wheels = vehicle.road.engine_inertia, vehicle.road.wheel_inertia
    turns = float(engine_inertia_column(line.gearings[0], 1.0))
    rolls = float(wheel_inertia_column(1.0, line.wheel_radius))
    rotating = math.hypot(engine.std * turns, wheels.std * rolls)
    return rotating / mass * share_of_accel(accel, phi, used)
