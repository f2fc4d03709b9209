"""The longitudinal law of a road vehicle: each physical term once, as the column of its parameter.

Along the road, with the traction force F at the wheels::

    F = m (f + g C_r(v) cos(grade))                 mass, hills, rolling resistance
      + C_d A q                                     air drag
      + I_e G^2 a_e + I_w a / r^2                   engine and wheels that turn faster
      + rho C_d A v (w_n cos(psi) + w_e sin(psi))   wind that nobody reported
      + s d + c                                     gusts and fast errors, lasting offset
      + G q_c exp(-t / tau)                         cold engine: friction in the reading
      + G (o + p G v / N_0)                         torque reported too high, all data sheets
      + P eta G / N                                 power that the engine gives beside the wheels

    F = eta G T(reading, engine speed)

with the specific force f = dv/dt + g sin(grade), acceleration a, dynamic pressure q, gearing G
(engine angle per distance), engine speed N, heading psi and speed v. The engine's speed rises by
``G a_e``; in a gear a_e is a, in a stepless gearbox ``a + v G' / G``. A column is the traction
force that one unit of its parameter takes, so that the sum of columns times parameters is the
traction. Weighing, calibration, delay search and sensitivity pick the columns they need.

References
----------
Gillespie, Fundamentals of Vehicle Dynamics, 1992, ch. 2, 4 (mass, drag, rolling, inertias);
Jensen et al. 2022, eqs. 3, 5, 6, 48, 49 (specific force, torque).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.balance.instants import SLOWEST_GEARED
from weighbridge.balance.table import ForceTable
from weighbridge.constants import (
    GAS_CONSTANT_DRY_AIR,
    GRAVITY,
    STANDARD_PRESSURE,
    STANDARD_TEMPERATURE,
)
from weighbridge.signals import Floats
from weighbridge.vehicle import Vehicle, reading_of, rows_of, torque_rows
from weighbridge.vehicle.data_sheet import USUAL_SPEED, wheel_share

STANDARD_DENSITY: Final = STANDARD_PRESSURE / (GAS_CONSTANT_DRY_AIR * STANDARD_TEMPERATURE)
"""Of air at sea level [kg/m^3] (ISO 2533)."""

DISTURBANCE_STD: Final = 0.04
"""Standard deviation of the disturbance before the drive has shown, over mass [m/s^2]."""

GUST_SPEED: Final = 15.0
"""Speed at which gusts are half of the disturbance [m/s]: so the likelihood of 82 drives of two
other simulators is highest."""

WARM_UP: Final = 500.0
"""Time constant of engine and oil getting warm [s]."""

SLOWEST_ENGINE: Final = 50.0
"""Of an engine that drives accessories [rad/s]."""

LATENESS_STD: Final = 0.08
"""Of the engine speed against the torque, from drive to drive [s]: two values of one bus, polled in
turn, each late by 0.02 to 0.3 s."""

ROAD_PARAMETERS: Final = ("drag_area", "rolling_coefficient", "engine_inertia", "wheel_inertia")
"""Parameters of `road_columns`, in order."""


def traction_gain(vehicle: Vehicle, torque: Floats, gearing: Floats) -> Floats:
    """Traction force over torque, ``eta G`` (n,) [1/m]; losses add to what drags an engine."""
    return np.asarray(wheel_share(vehicle, torque) * gearing)


def mass_column(table: ForceTable, vehicle: Vehicle) -> Floats:
    """Of the mass, ``f + g (C_r + C_rv v) cos(grade)`` (n,) [m/s^2].

    The two terms ``v' + g sin(grade)`` of Jensen 2022, eq. 5, are the specific force.
    """
    at_rest = vehicle.road.rolling_coefficient.value
    rolling = at_rest + vehicle.road_load.rolling_speed_coefficient * table.speed
    return np.asarray(table.specific_force + GRAVITY * rolling * np.cos(table.grade))


def rolling_column(table: ForceTable, mass: Floats | float) -> Floats:
    """Of the rolling coefficient, ``m g cos(grade)`` (n,) [N]."""
    return np.asarray(mass * GRAVITY * np.cos(table.grade))


def drag_column(table: ForceTable) -> Floats:
    """Of the drag area C_d A, ``q = rho v_air |v_air| / 2`` (n,) [Pa], with the reported wind."""
    return table.dynamic_pressure


def engine_inertia_column(gearing: Floats | float, accel: Floats | float) -> Floats:
    """Of the inertia at engine or motor, ``G^2 a_e`` (n,) [1/(m s^2)]."""
    return np.asarray(gearing**2 * accel)


def wheel_inertia_column(accel: Floats | float, wheel_radius: float) -> Floats:
    """Of the inertia of all wheels, ``a / r^2`` (n,) [1/(m s^2)]."""
    return np.asarray(accel / wheel_radius**2)


def road_columns(table: ForceTable, mass: Floats | float, wheel_radius: float) -> Floats:
    """Columns of `ROAD_PARAMETERS` (n, 4) [N per unit].

    Parameters
    ----------
    table
    mass : that rolls, one or (n,) [kg]
    wheel_radius : [m]
    """
    return np.column_stack(
        [
            drag_column(table),
            rolling_column(table, mass),
            engine_inertia_column(table.gearing, table.engine_accel),
            wheel_inertia_column(table.accel, wheel_radius),
        ]
    )


def wind_column(table: ForceTable, part: int) -> Floats:
    """Of ``C_d A`` times the head wind of one who drives north, or east (part 1) [N per m^3/s].

    The drag of a wind small against the speed is linear in it: ``rho v`` times its part along
    the road. Zero where the heading is unknown.
    """
    return table.air_density * table.speed * table.direction(part)


def resistance_column(table: ForceTable) -> Floats:
    """Of a force that is always there: rolling resistance, offsets of torque and sensors (n,)."""
    return np.ones_like(table.time)


def gust_column(
    table: ForceTable, unmeasured_grade: float = 0.0, *, usual_gearing: float = 0.0
) -> Floats:
    """How large the fast disturbance is at each row over its usual size (n,) [-].

    Half of it are errors of the grade, the other half gusts, whose force grows with the speed.
    Errors of the torque come beside them: at an engine they act through the gear. So does a grade
    that nothing has measured.

    Parameters
    ----------
    table
    unmeasured_grade : what of the grade nothing has measured [rad]
    usual_gearing : at which errors of the torque are as large as the usual size [1/m]; 0 for a
        single gear, where they are a part of it
    """
    gusts = 0.5 * (1.0 + (np.nan_to_num(table.speed) / GUST_SPEED) ** 2)
    through = np.nan_to_num(table.gearing) / usual_gearing if usual_gearing > 0.0 else 0.0
    grade = (GRAVITY * unmeasured_grade / DISTURBANCE_STD) ** 2
    return np.asarray(np.sqrt((gusts + through**2 + grade) / (1.0 + grade)))


def coldness(table: ForceTable) -> Floats:
    """How much of the cold of the start is left at each row, ``exp(-t / tau)`` (n,) [-]."""
    return np.asarray(np.exp(-np.maximum(table.time - table.first_moved, 0.0) / WARM_UP))


def cold_torque_column(table: ForceTable) -> Floats:
    """Of the friction of a cold start in the reading, ``G exp(-t / tau)`` (n,) [1/m]."""
    return np.asarray(coldness(table) * np.nan_to_num(table.gearing))


def torque_offset_column(table: ForceTable) -> Floats:
    """Of what the torque is reported too high by, ``G`` (n,) [1/m]."""
    return np.nan_to_num(table.gearing)


def torque_growth_column(table: ForceTable) -> Floats:
    """Of the part of it that grows with engine speed, ``G (G v / N_0)`` (n,) [1/m].

    Its unit is the torque at N_0, `weighbridge.vehicle.data_sheet.USUAL_SPEED`.
    """
    gearing = np.nan_to_num(table.gearing)
    return np.asarray(gearing * (gearing * table.speed / USUAL_SPEED))


def lateness_column(table: ForceTable, traction: Floats) -> Floats:
    """Of the lateness of engine speed against torque, ``-F N' / N`` (n,) [N/s].

    Parameters
    ----------
    table : of a stepless gearbox, whose gearing is engine over vehicle speed
    traction : (n,) [N]
    """
    moving = np.maximum(np.nan_to_num(table.speed), SLOWEST_GEARED)
    return np.asarray(-traction * np.nan_to_num(table.engine_accel) / moving)


def accessory_column(table: ForceTable, vehicle: Vehicle) -> Floats:
    """Of a power that an engine gives to accessories, ``eta G / N`` (n,) [N/W]; 0 for a motor.

    A torque that is reported at the crank counts it as traction.
    """
    if vehicle.driveline.single_speed:
        return np.zeros(table.time.size)
    gain = traction_gain(vehicle, np.nan_to_num(table.torque), np.nan_to_num(table.gearing))
    turning = np.maximum(np.nan_to_num(table.engine_speed), SLOWEST_ENGINE)
    return np.asarray(np.nan_to_num(gain) / turning)


def reading_columns(
    gain: Floats,
    reading: Floats,
    engine_speed: Floats,
    *,
    order: int,
    curved: bool = False,
    knots: tuple[float, ...] = (),
) -> Floats:
    """Traction that one unit of each coefficient of the torque gives (n, p) (Jensen 2022, eq. 49).

    On the other side of the law than the columns above: the coefficients make traction.

    Parameters
    ----------
    gain : (n,) traction over torque [1/m]
    reading, engine_speed, order, curved, knots : as of `weighbridge.vehicle.torque.torque_rows`
    """
    rows = torque_rows(reading, engine_speed, order, curved=curved, knots=knots)
    return np.asarray(gain[:, None] * rows)


def torque_columns(table: ForceTable, vehicle: Vehicle) -> Floats:
    """`reading_columns` of a vehicle's model, at the readings that gave its torque (n, p)."""
    torque, speed = np.nan_to_num(table.torque), np.nan_to_num(table.engine_speed)
    gain = traction_gain(vehicle, torque, np.nan_to_num(table.gearing))
    model = vehicle.torque
    return np.asarray(rows_of(model, reading_of(torque, speed, model), speed) * gain[:, None])


def squat_column(force: Floats) -> Floats:
    """Specific force that a squat of one radian per m/s^2 adds to one ``f``, ``g f`` (n,) [m/s^2].

    The body pitches by the moment of the traction, which a hill takes as an acceleration does.
    """
    return np.asarray(GRAVITY * force)


def rotating_mass(vehicle: Vehicle, gearing: Floats | float) -> Floats:
    """Mass that the rotating parts act like, ``I_w / r^2 + I_e G^2`` (n,) [kg]."""
    road = vehicle.road
    wheels = road.wheel_inertia.value / vehicle.driveline.wheel_radius**2
    return np.asarray(wheels + road.engine_inertia.value * gearing**2)


def rotating_force(table: ForceTable, vehicle: Vehicle) -> Floats:
    """Force that makes wheels and engine turn faster (n,) [N]."""
    return np.asarray(
        rotating_mass(vehicle, table.gearing) * table.accel + ratio_force(table, vehicle)
    )


def ratio_force(table: ForceTable, vehicle: Vehicle) -> Floats | float:
    """Part of it that a moving gearing takes, ``I_e G v G'`` (n,) [N]; none where gears hold it."""
    if table.ratio_rate is None:
        return 0.0
    inertia = vehicle.road.engine_inertia.value
    return np.asarray(inertia * table.gearing**2 * (table.engine_accel - table.accel))


def drag_force(table: ForceTable, vehicle: Vehicle) -> Floats:
    """Air drag ``C_d A q`` (n,) [N], in still air or in the wind that ``drive.toml`` reports."""
    return np.asarray(vehicle.road.drag_area.value * drag_column(table))


def drag_factor(table: ForceTable, vehicle: Vehicle) -> Floats:
    """Air drag over the square of the air speed, ``rho C_d A / 2`` (n,) [kg/m]."""
    return np.asarray(0.5 * table.air_density * vehicle.road.drag_area.value)


def force_on_mass(table: ForceTable, vehicle: Vehicle) -> Floats:
    """Traction less air drag and what turns: it moves, lifts and rolls the mass (n,) [N].

    The right-hand side of Jensen 2022, eq. 6.
    """
    turning = rotating_force(table, vehicle)
    return np.asarray(table.traction_force - drag_force(table, vehicle) - turning)


def needed_force(
    vehicle: Vehicle, specific_force: Floats, pressure: Floats, rotating: Floats | float = 0.0
) -> tuple[Floats, float]:
    """Force at the wheels (n,) that a motion takes, and the weight it is given for [N].

    Its sign depends on the mass through the drag alone. The largest mass known is the
    cautious one: drag explains least of how a heavy vehicle slows down.

    Parameters
    ----------
    vehicle
    specific_force : (n,) [m/s^2]
    pressure : (n,) dynamic pressure of the air [Pa]
    rotating : `rotating_mass` [kg]
    """
    mass = max(vehicle.provenance.masses, default=vehicle.tare or vehicle.of_class.typical_mass)
    road = vehicle.road
    rolling = mass * GRAVITY * road.rolling_coefficient.value
    drag = road.drag_area.value * pressure
    needed = (mass + np.nan_to_num(rotating)) * specific_force + rolling + drag
    return np.asarray(needed), mass * GRAVITY
