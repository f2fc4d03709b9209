"""What a data sheet leaves uncertain: losses of the driveline, friction of the engine, torque.

All of it is from print, for vehicles that were never calibrated. Losses of a driveline
have a part in proportion to torque, which is the efficiency here and scales every mass,
and a drag that is always there, which is an offset of the torque and can be found from the
drive. So the efficiency of this module is the slope of wheel over engine torque; the
efficiency over a cycle, with the drag in it, is one to three percent lower.
"""

from __future__ import annotations

from typing import Final, Literal

import numpy as np

from weighbridge.signals import Floats
from weighbridge.vehicle.model import Layout, Vehicle
from weighbridge.vehicle.torque import source_of

Fuel = Literal["petrol", "diesel"]

SINGLE_SPEED_EFFICIENCY: Final = (0.97, 0.010)
"""Two stages of spur gears and a differential between motor and wheels: mean and standard
deviation [-]. 1 % of each mesh and its bearings: spur gears alone have 99.0 to 99.8 %
(Joachim, Börner and Kurz, Gear Technology, September 2012, fig. 2)."""

LAYOUT_EFFICIENCY: Final[dict[Layout, tuple[float, float]]] = {
    "transverse": (0.96, 0.015),
    "longitudinal": (0.93, 0.020),
}
"""Of cars and vans by how the engine lies [-]. Across: gear pair and final drive, both spur
gears; gearboxes of cars have 92 to 97 % and automatic and dual clutch ones 90 to 95 %
with drag and pumps (Joachim et al. 2012), a gear without drag 96 % (standard loss of
Regulation (EU) 2017/2400, Annex VI, App. 8, which is meant to be on the safe side). Lengthwise:
0.97 in the gearbox, in which some gears are direct, times 0.96 in the hypoid axle: 95.5 %
(40 CFR 1036.545); a van's lost at least 6 % (Transport Research Laboratory, report RR 10)."""

RADIUS_STD: Final = 0.015
"""Rolling radius from the size of the tyre, relative standard deviation [-]: tolerance of the
size, wear of the tread (8 mm of 310 are 2.5 %), pressure and load."""

OFFSET_STD: Final = 0.02
"""Offset of an engine's torque over the highest torque of the drive, standard deviation [-]:
alternator and pumps take 1 to 2 kW, which is 5 to 10 N m, gearboxes drag with 1.5 % of
their torque at 2000 rpm (Annex VI, as above), readings are granted 5 N m."""

GROWTH_STD: Final = 0.01
"""How much of it comes with engine speed, up to `USUAL_SPEED` [-]: half of a gearbox's drag
does (Annex VI, as above), and friction as far as a control unit does not know it."""

MOTOR_OFFSET_STD: Final = 0.008
"""Offset of a motor's torque, likewise [-]: two stages of gears drag, nothing else does."""

FRICTION_STD: Final = 0.3
"""Friction that a vehicle file states, relative standard deviation [-]: read at idle it holds
alternator and pumps, and in gear the converter of an automatic."""

FRICTION_PRESSURE: Final[dict[Fuel, tuple[float, float, float]]] = {
    "petrol": (0.97, 0.15, 0.05),
    "diesel": (0.75, 0.48, 0.036),
}
"""Mean effective pressure of friction and pumping, coefficients of rising powers of the engine
speed in 1000 rpm [bar]: Heywood, Internal Combustion Engine Fundamentals, 1988, ch. 13; of
diesels with direct injection, 0.4 kPa times the squared piston speed with a stroke of 90 mm.
Only the shape is used."""

ACCESSORY_POWER: Final = 1000.0
"""Taken from the crank while driving [W]: 750 W of electricity by an alternator of 67 %
(Implementing Decision 2013/341/EU), less where little is switched on."""

USUAL_SPEED: Final = 200.0
"""Engine speed at which accessories are reckoned while driving [rad/s]."""

MOST_ACCESSORIES: Final = 0.5
"""Part of the torque at idle that is not friction, at most [-]."""


def by_data_sheet(vehicle: Vehicle) -> bool:
    """Whether torque is shown by the vehicle, and nothing has calibrated it."""
    return source_of(vehicle).signed and not vehicle.provenance.torque_fitted


def needs_calibration(vehicle: Vehicle) -> bool:
    """Whether torque is made from a load or a flow, and no calibration shows what that is worth."""
    model = vehicle.torque
    fitted = vehicle.provenance.torque_fitted or vehicle.provenance.fit is not None
    return not model.of_source.signed and not model.coefficients and not fitted


def usual_efficiency(vehicle: Vehicle) -> tuple[float, float]:
    """Return the slope of wheel over engine torque of such a vehicle and its standard deviation."""
    line, of_source = vehicle.driveline, source_of(vehicle).efficiency
    if of_source is not None:
        return of_source
    if line.single_speed:
        return SINGLE_SPEED_EFFICIENCY
    if vehicle.of_class.layouts and line.layout is not None:
        return LAYOUT_EFFICIENCY[line.layout]
    return vehicle.of_class.efficiency


def wheel_efficiency(vehicle: Vehicle) -> float:
    """Efficiency of the driveline: as the vehicle file says, else that of its kind.

    It is 1 where the torque was fitted at the wheels.
    """
    if vehicle.driveline.efficiency is not None:
        return vehicle.driveline.efficiency
    return usual_efficiency(vehicle)[0] if by_data_sheet(vehicle) else 1.0


def wheel_share(vehicle: Vehicle, torque: Floats) -> Floats:
    """Torque at the wheels, geared down, over that of the engine (n,) [-].

    Losses take of it when driving, and add to it when the wheels turn the engine.
    """
    driving = wheel_efficiency(vehicle)
    return np.where(torque >= 0.0, driving, 1.0 / driving)


def torque_std(vehicle: Vehicle) -> float:
    """Relative standard deviation of the torque's scale: as the file says, else as usual."""
    if vehicle.torque.scale_std is not None:
        return vehicle.torque.scale_std
    source = source_of(vehicle)
    if vehicle.driveline.single_speed and source.motor_scale_std is not None:
        return source.motor_scale_std
    return source.scale_std


def scale_std(vehicle: Vehicle) -> float:
    """Relative standard deviation of a mass by torque, efficiency and rolling radius."""
    radius = RADIUS_STD if source_of(vehicle).by_radius else 0.0
    return float(np.linalg.norm([torque_std(vehicle), usual_efficiency(vehicle)[1], radius]))


def offset_std(vehicle: Vehicle, torque: float) -> tuple[float, float]:
    """Return the standard deviations of the torque's offset and of its growth with speed [N m].

    Parameters
    ----------
    vehicle : what its file states of friction is as uncertain as `FRICTION_STD` says
    torque : highest of the drive [N m]

    Returns
    -------
    offset
    growth : from standing to `USUAL_SPEED`; none for motors
    """
    if vehicle.driveline.single_speed:
        return MOTOR_OFFSET_STD * torque, 0.0
    offset, _, *powers = vehicle.torque.coefficients or (0.0, 1.0)
    growth = sum(w * USUAL_SPEED**k for k, w in enumerate(powers, start=1))
    return (
        float(np.hypot(OFFSET_STD * torque, FRICTION_STD * offset)),
        float(np.hypot(GROWTH_STD * torque, FRICTION_STD * growth)),
    )


def friction_coefficients(
    idle_torque: float, idle_speed: float, fuel: Fuel
) -> tuple[float, float, float]:
    """Friction and accessories from what a torque reads at idle.

    The reading holds friction, which grows with engine speed, and accessories, which take
    a power, so that their torque falls with it.

    Parameters
    ----------
    idle_torque : reading of a warm engine, standing, not working against a converter [N m]
    idle_speed : [rad/s]
    fuel : "petrol" or "diesel"

    Returns
    -------
    of engine speed to the power 0, 1, 2, to be taken off the reading; SI
    """
    accessories = min(ACCESSORY_POWER / idle_speed, MOST_ACCESSORIES * idle_torque)
    shape = np.asarray(FRICTION_PRESSURE[fuel]) * (0.03 / np.pi) ** np.arange(3)
    unit = float(np.polynomial.polynomial.polyval(idle_speed, shape))
    friction = (idle_torque - accessories) / unit * shape
    friction[0] += accessories * idle_speed / USUAL_SPEED
    return float(friction[0]), float(friction[1]), float(friction[2])
