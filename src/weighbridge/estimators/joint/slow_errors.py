"""The slow errors that look like mass, and how large each may be."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, TypeVar

import numpy as np

from weighbridge.balance import WINDOW, Windows, law
from weighbridge.balance.law import DISTURBANCE_STD
from weighbridge.balance.table import ForceTable
from weighbridge.constants import GRAVITY
from weighbridge.estimators.regression import regression
from weighbridge.estimators.squat import share_of_accel
from weighbridge.kernels.disturbance import DisturbanceParams
from weighbridge.navigation import BY_SPEED, Motion
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle import Vehicle, by_data_sheet, cold_torque_std
from weighbridge.vehicle.data_sheet import offset_std

Variance = TypeVar("Variance", float, Floats)

TIME_CONSTANTS: Final = (30.0, 900.0, 600.0, 600.0, 2e4)
"""How long disturbance, resistance, wind north and east and cold torque last [s]: gusts,
grade and torque errors half a minute, rolling resistance and offsets a quarter of an
hour, mean wind ten minutes; how cold a drive began stays the same all along."""

RESISTANCE_STD: Final = 0.017
"""Of the slow resistance, over mass [m/s^2]: a fifth of the rolling resistance of a car."""

WIND_STD: Final = 2.0
"""Of each component of the wind at the vehicle [m/s]."""

UNMEASURED_NOISE: Final = 0.03
"""Noise of one sample of a specific force that no accelerometer measured [m/s^2]."""

MOTION_SHARE: Final = 0.25
"""What of that noise the mean of a window keeps [-]: in 58 drives of three simulators, vibration,
rough roads and vehicles of all classes, noise of one sample from 0.010 to 0.113 m/s^2,
`motion_variance` meets the true error of the mean of a window within a quarter (RMS); how much a
window keeps depends on how fast the noise is, and on rough roads of one simulator it was twice as
much."""

MOTION_WINDOW_STD: Final = 0.007
"""Fast error of the mean of a window without such noise [m/s^2]."""

NAMES: Final = ("mass", "disturbance", "resistance", "wind_north", "wind_east", "cold_torque",
                "drag_area")  # fmt: skip
"""The states, in order."""

LASTING: Final = NAMES.index("cold_torque")
"""From this state on they last as long as the drive."""

DATA_SHEET_NAMES: Final = ("torque_offset", "torque_growth", "engine_inertia", "wheel_inertia")
"""Further states, constant, of a vehicle file from a data sheet alone, in order: what a
calibration finds once is found from each drive. An offset of the torque works through the
gear, and low gears go with strong acceleration: taken for none it makes mass. So does
friction that grows with engine speed, which is high where torque is. The inertias are states
where there are several gears: with one they are like the scale and the lean of the
accelerometer, which would be taken for them (`inertia_relative_std`)."""


RATIO_LATENESS: Final = "ratio_lateness"
"""Further state, constant, of a stepless gearbox: how late its ratio is against the torque."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowErrors:
    """What stood beside the mass, smoothed over the whole drive, one row per window.

    Attributes
    ----------
    time : (m,) [s]
    mass_bound : (m,) standard deviation of the mass as known at each window, by the noise
        of this drive alone [kg]
    disturbance, disturbance_std : (m,) force of half a minute [N]
    resistance, resistance_std : (m,) force of a quarter of an hour [N]
    wind_north, wind_east : (m,) what the wind blows towards the south and west at the
        vehicle, which is a head wind for one who drives north or east [m/s]
    wind_std : (m, 2) their standard deviations [m/s]
    constants : the states that last as long as the drive, by name, each with its standard
        deviation: ``cold_torque``, friction of the start in the reading [N m]; ``drag_area``, C_d A
        above that of the vehicle file [m^2]; and those of `DATA_SHEET_NAMES`: by how much the
        file's model of the torque gives too much [N m], the part of it that grows with engine
        speed, at `USUAL_SPEED` [N m], and inertias above those of the file [kg m^2]; and
        `RATIO_LATENESS` [s]
    """

    time: Floats
    mass_bound: Floats
    disturbance: Floats
    disturbance_std: Floats
    resistance: Floats
    resistance_std: Floats
    wind_north: Floats
    wind_east: Floats
    wind_std: Floats
    constants: dict[str, tuple[float, float]]

    @classmethod
    def from_states(
        cls,
        time: Floats,
        x: Floats,
        var: Floats,
        mass_var: Floats,
        gusts: Floats,
        *,
        stepless: bool = False,
    ) -> SlowErrors:
        """Name the states of the filter.

        Parameters
        ----------
        time : (m,) of the windows [s]
        x, var : (m, k) smoothed states in the order of `NAMES`, and their variances
        mass_var : (m,) variance of the mass as known at each window [kg^2]
        gusts : (m,) `weighbridge.balance.law.gust_column` of each window, by which the disturbance
            is a force
        stepless : whether the last state is `RATIO_LATENESS`
        """
        names = (*NAMES, *DATA_SHEET_NAMES)[: x.shape[1] - stepless]
        return cls(
            time=time,
            mass_bound=np.sqrt(mass_var),
            disturbance=gusts * x[:, 1],
            disturbance_std=gusts * np.sqrt(var[:, 1]),
            resistance=x[:, 2],
            resistance_std=np.sqrt(var[:, 2]),
            wind_north=x[:, 3],
            wind_east=x[:, 4],
            wind_std=np.sqrt(var[:, 3:5]),
            constants={
                name: (float(x[-1, k]), float(np.sqrt(var[-1, k])))
                for k, name in enumerate((*names, *([RATIO_LATENESS] if stepless else ())))
                if k >= LASTING
            },
        )


def design(
    table: ForceTable,
    vehicle: Vehicle,
    *,
    squat_accel: Floats | None = None,
    unmeasured_grade: float = 0.0,
) -> tuple[Floats, Floats]:
    """Rows of the model ``y = phi m + d + c + wind + cold torque + drag``.

    Each column is that of `weighbridge.balance.law`.

    Parameters
    ----------
    table, vehicle
    squat_accel : (n,) what squat of the body adds to the specific force [m/s^2]
    unmeasured_grade : what of the grade nothing has measured [rad]

    Returns
    -------
    rows : (n, 7) for `NAMES`, or (n, 9) or (n, 11) with `DATA_SHEET_NAMES`, and one more for
        `RATIO_LATENESS`; the mass is that of the first row
    y : (n,) traction less drag and rotating inertia, and what the fuel that is burnt by then
        would have weighed [N]
    """
    phi, y = regression(table, vehicle)
    if squat_accel is not None:
        phi = phi - squat_accel
    area = vehicle.road.drag_area.value
    north, east = law.wind_columns(table)
    columns = [
        phi,
        law.gust_column(table, unmeasured_grade, usual_gearing=vehicle.driveline.usual_gearing),
        law.resistance_column(table),
        area * north,
        area * east,
        law.cold_torque_column(table),
        law.drag_column(table),
    ]
    if by_data_sheet(vehicle):
        line = vehicle.driveline
        columns += [law.torque_offset_column(table), law.torque_growth_column(table)]
        if not line.single_speed:
            columns += [
                law.engine_inertia_column(np.nan_to_num(table.gearing), table.engine_accel),
                law.wheel_inertia_column(table.accel, line.wheel_radius),
            ]
    if vehicle.driveline.stepless:
        columns.append(law.lateness_column(table, np.nan_to_num(table.traction_force)))
    return np.column_stack(columns), y + phi * table.fuel_burnt


def usable_rows(table: ForceTable, rows: Floats, y: Floats) -> Bools:
    """Rows without a reason against them and with finite numbers."""
    return np.asarray(table.usable & np.isfinite(y) & np.isfinite(rows).all(axis=1))


def noise_variance(
    table: ForceTable, cut: Windows, mass: float, motion: Motion, length: float = WINDOW
) -> Floats:
    """Variance of the fast noise of each window's mean force (m,) [N^2], both sides.

    Parameters
    ----------
    table, cut
    mass : [kg]
    motion
    length : of a window [s]
    """
    torque_var = cut.mean(table.force_std**2) / cut.count
    return window_noise(torque_var, mass, window_motion_variance(motion, length))


def window_noise(torque_var: Variance, mass: float, motion_var: float) -> Variance:
    """Variance of the fast noise of a window's mean force, both sides [N^2].

    Parameters
    ----------
    torque_var : part of it that is the torque's [N^2]
    mass : that the noise of the motion moves [kg]
    motion_var : `window_motion_variance` [m^2/s^4]
    """
    return torque_var + mass**2 * motion_var


def window_motion_variance(motion: Motion, length: float = WINDOW) -> float:
    """Variance of a window's mean specific force by its samples and by its ends [m^2/s^4]."""
    return motion_variance(motion, length) + motion.mean_accel_std(length) ** 2


def motion_variance(motion: Motion, length: float = WINDOW) -> float:
    """Variance of the noise in the mean specific force over ``length`` [s] [m^2/s^4].

    The drive shows it by the noise of the samples of its accelerometer. The slope of a
    smoothed speed is a conditional mean, and what is unknown of it no such noise.
    """
    level = motion.specific_force_std
    if motion.source in BY_SPEED or not np.isfinite(level):
        level = UNMEASURED_NOISE
    # Over any length it is not above that of one sample.
    share = min(MOTION_SHARE**2 * WINDOW / length, 1.0)
    return MOTION_WINDOW_STD**2 + share * level**2


def with_variance(motion: Motion, variance: float) -> Motion:
    """Return a motion whose `motion_variance` over a window is this [m^2/s^4]."""
    level = np.sqrt(max(variance - MOTION_WINDOW_STD**2, 0.0)) / MOTION_SHARE
    return replace(motion, specific_force_std=float(level))


def prior_std(
    vehicle: Vehicle, mass: float, torque: float, *, unmeasured_grade: float = 0.0
) -> Floats:
    """Standard deviations (k,) of the states of `design` before the drive has shown.

    Parameters
    ----------
    vehicle : its drag area, rolling resistance and inertias are as uncertain as its ``road`` says
    mass : rough [kg]; its own standard deviation is as large
    torque : highest of the drive [N m]
    unmeasured_grade : what of the grade nothing has measured; the disturbance takes it [rad]
    """
    road = vehicle.road
    grade = GRAVITY * unmeasured_grade
    resistance = float(np.hypot(RESISTANCE_STD, GRAVITY * road.rolling_coefficient.std))
    states = [
        mass,
        mass * float(np.hypot(DISTURBANCE_STD, grade)),
        mass * resistance,
        WIND_STD,
        WIND_STD,
        cold_torque_std(vehicle) * torque,
        road.drag_area.std,
    ]
    if by_data_sheet(vehicle):
        states += offset_std(vehicle, torque)
        if not vehicle.driveline.single_speed:
            states += [road.engine_inertia.std, road.wheel_inertia.std]
    if vehicle.driveline.stepless:
        states.append(law.LATENESS_STD)
    return np.array(states)


def filter_params(std: Floats, gate: float, settle_rows: int, jump_rows: int) -> DisturbanceParams:
    """Make the kernel's parameters from the standard deviations of the states."""
    lasting = np.full(std.size, np.inf)
    lasting[1 : 1 + len(TIME_CONSTANTS)] = TIME_CONSTANTS
    return DisturbanceParams(
        time_constant=lasting,
        std=np.where(np.isfinite(lasting), std, 0.0),
        gate=gate,
        settle_rows=settle_rows,
        jump_rows=jump_rows,
    )


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
    turns = float(law.engine_inertia_column(line.gearings[0], 1.0))
    rolls = float(law.wheel_inertia_column(1.0, line.wheel_radius))
    rotating = math.hypot(engine.std * turns, wheels.std * rolls)
    return rotating / mass * share_of_accel(accel, phi, used)
