"""A vehicle as its source of torque sees it: no gearbox lies behind what is read at wheels."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from weighbridge.vehicle.model import Vehicle
from weighbridge.vehicle.torque import source_of
from weighbridge.vehicle.torque_source import TorqueSource

USUAL_MOTOR_GEARING: Final = 30.0
"""Of electric cars with one gear [1/m]: reductions of 8 to 11 over a radius of 0.31 m."""


def as_read(vehicle: Vehicle, source: TorqueSource | None = None) -> Vehicle:
    """Return the vehicle with the shaft of its reading in place of its gears.

    Parameters
    ----------
    vehicle : itself where its source reads at the shaft of engine or motor
    source : that of the vehicle's torque when None
    """
    source = source or source_of(vehicle)
    if source.gearing is None:
        return vehicle
    line = vehicle.driveline
    gearing = source.gearing(line.wheel_radius)
    inertia, std = 0.0, 0.0
    if source.before_motor:
        turns = USUAL_MOTOR_GEARING
        usual, spread = vehicle.of_class.road_prior(single_speed=True)
        inertia, std = float(usual[2]), float(spread[2])
        if line.single_speed:
            motor = vehicle.road.engine_inertia
            turns, inertia, std = line.gearings[0], motor.value, motor.std
        share = (turns / gearing) ** 2
        inertia, std = share * inertia, share * std
    return replace(
        vehicle,
        driveline=replace(
            line,
            gearings=(gearing,),
            gearing_stds=(),
            engine_inertia=inertia,
            engine_inertia_std=std,
            idle_speed=0.0,
        ),
    )
