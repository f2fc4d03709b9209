"""Terms of the longitudinal law that are estimated from a drive: the mass, and what looks like it.

Along the road the traction is a sum of columns times states. A `Term` is one of them: its column,
how large its state is before the drive has shown, how long it lasts, and how far it may jump where
the load changes. `weighbridge.estimators.joint.settings.JointSettings.terms` picks them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, Protocol

import numpy as np

from weighbridge.balance import law
from weighbridge.balance.law import DISTURBANCE_STD
from weighbridge.balance.table import ForceTable
from weighbridge.constants import GRAVITY
from weighbridge.registry import Registry
from weighbridge.signals import Floats
from weighbridge.vehicle import Vehicle, by_data_sheet, cold_torque_std
from weighbridge.vehicle.data_sheet import USUAL_SPEED, offset_std

RESISTANCE_STD: Final = 0.017
"""Of the slow resistance, over mass [m/s^2]: a fifth of the rolling resistance of a car."""

WIND_STD: Final = 2.0
"""Of each component of the wind at the vehicle [m/s]."""

GUSTS_LAST: Final = 30.0
"""Time constant of gusts, and of errors of grade and torque [s]."""

RESISTANCE_LASTS: Final = 900.0
"""The same of rolling resistance and offsets [s]."""

WIND_LASTS: Final = 600.0
"""The same of the mean wind [s]."""

COLD_LASTS: Final = 2e4
"""The same of how cold a drive began: it stays the same all along [s]."""

A_DRIVE: Final = 1e4
"""A state with a longer time constant lasts as long as the drive [s]."""


class Sizes(NamedTuple):
    """What the states of a drive are large or small against.

    Attributes
    ----------
    mass : rough [kg]
    torque : highest of the drive [N m]
    unmeasured_grade : what of the grade nothing has measured [rad]
    """

    mass: float
    torque: float
    unmeasured_grade: float = 0.0


class LoadChange(Protocol):
    """What settings say of a change of load, as standard deviations."""

    @property
    def change_std(self) -> float:
        """Of the load, over mass [-]."""
        ...

    @property
    def load_pitch_std(self) -> float:
        """Of what it adds to the slow resistance, over mass [m/s^2]."""
        ...


def _everywhere(_: Vehicle) -> bool:
    return True


def _never(_: LoadChange) -> float:
    return 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """One state of the joint estimator, and the traction that it takes.

    Attributes
    ----------
    name : of the state
    title : what it is, as a report says it
    unit : of the state, as `weighbridge.report` prints it
    column : of force table, vehicle and unmeasured grade [rad]; returns the traction (n,) that one
        unit of the state takes [N per unit]
    std : of vehicle and `Sizes`; returns the standard deviation of the state before the drive
        has shown
    time_constant : how long it lasts, as a first-order Gauss-Markov state [s]; infinite for a
        constant
    jump : of the settings; returns the standard deviation by which the state jumps where the load
        changes, over the mass
    applies : whether a vehicle has it
    levelled : the drive itself shows how large it is, by its likelihood
    """

    name: str
    title: str
    unit: str
    column: Callable[[ForceTable, Vehicle, float], Floats]
    std: Callable[[Vehicle, Sizes], float]
    time_constant: float = math.inf
    jump: Callable[[LoadChange], float] = _never
    applies: Callable[[Vehicle], bool] = _everywhere
    levelled: bool = False

    @property
    def lasting(self) -> bool:
        """Whether it stays the same all along a drive."""
        return self.time_constant > A_DRIVE


def _gusts(table: ForceTable, vehicle: Vehicle, unmeasured_grade: float) -> Floats:
    usual = vehicle.driveline.usual_gearing
    return law.gust_column(table, unmeasured_grade, usual_gearing=usual)


def _resistance_std(vehicle: Vehicle, sizes: Sizes) -> float:
    rolling = GRAVITY * vehicle.road.rolling_coefficient.std
    return sizes.mass * float(np.hypot(RESISTANCE_STD, rolling))


def _wind(name: str, part: int) -> Term:
    return Term(
        name=f"wind_{name}",
        title=f"wind at the vehicle from {name}",
        unit="m/s",
        column=lambda t, v, _: v.road.drag_area.value * law.wind_column(t, part),
        std=lambda *_: WIND_STD,
        time_constant=WIND_LASTS,
    )


def _geared_by_data_sheet(vehicle: Vehicle) -> bool:
    """Whether gears separate the inertias of a data sheet from the mass.

    With one gear they are like the scale and the lean of the accelerometer, which would be taken
    for them (`weighbridge.estimators.joint.slow_errors.inertia_relative_std`).
    """
    return by_data_sheet(vehicle) and not vehicle.driveline.single_speed


_OWN: Final = (
    Term(
        name="mass",
        title="mass",
        unit="kg",
        column=lambda t, v, _: law.mass_column(t, v),
        # That of the mass is its guess as well.
        std=lambda _, sizes: sizes.mass,
        jump=lambda settings: settings.change_std,
    ),
    Term(
        name="disturbance",
        title="gusts and fast errors of grade and torque, at their usual speed and gear",
        unit="N",
        column=_gusts,
        std=lambda _, s: s.mass * float(np.hypot(DISTURBANCE_STD, GRAVITY * s.unmeasured_grade)),
        time_constant=GUSTS_LAST,
        levelled=True,
    ),
    Term(
        name="resistance",
        title="resistance above the vehicle file's",
        unit="N",
        column=lambda t, *_: law.resistance_column(t),
        std=_resistance_std,
        time_constant=RESISTANCE_LASTS,
        # The body pitches with its load, and the accelerometer with it.
        jump=lambda settings: settings.load_pitch_std,
    ),
    _wind("north", 0),
    _wind("east", 1),
    Term(
        name="cold_torque",
        title="friction of the cold start in the torque",
        unit="N m",
        column=lambda t, *_: law.cold_torque_column(t),
        std=lambda v, sizes: cold_torque_std(v) * sizes.torque,
        time_constant=COLD_LASTS,
    ),
    Term(
        name="drag_area",
        title="drag area above the vehicle file's",
        unit="m²",
        column=lambda t, *_: law.drag_column(t),
        std=lambda v, _: v.road.drag_area.std,
    ),
    # What a calibration finds once is found from each drive where a data sheet is all there is. An
    # offset of the torque works through the gear, and low gears go with strong acceleration: taken
    # for none it makes mass. So does friction that grows with engine speed, which is high where
    # torque is.
    Term(
        name="torque_offset",
        title="torque the file's model has too much",
        unit="N m",
        column=lambda t, *_: law.torque_offset_column(t),
        std=lambda v, sizes: offset_std(v, sizes.torque)[0],
        applies=by_data_sheet,
    ),
    Term(
        name="torque_growth",
        title=f"the same, grown with engine speed, at {USUAL_SPEED:.0f} rad/s",
        unit="N m",
        column=lambda t, *_: law.torque_growth_column(t),
        std=lambda v, sizes: offset_std(v, sizes.torque)[1],
        applies=by_data_sheet,
    ),
    Term(
        name="engine_inertia",
        title="engine inertia above the file's",
        unit="kg m²",
        column=lambda t, *_: law.engine_inertia_column(np.nan_to_num(t.gearing), t.engine_accel),
        std=lambda v, _: v.road.engine_inertia.std,
        applies=_geared_by_data_sheet,
    ),
    Term(
        name="wheel_inertia",
        title="wheel inertia above the file's",
        unit="kg m²",
        column=lambda t, v, _: law.wheel_inertia_column(t.accel, v.driveline.wheel_radius),
        std=lambda v, _: v.road.wheel_inertia.std,
        applies=_geared_by_data_sheet,
    ),
    Term(
        name="ratio_lateness",
        title="lateness of the engine speed against the torque",
        unit="s",
        column=lambda t, *_: law.lateness_column(t, np.nan_to_num(t.traction_force)),
        std=lambda *_: law.LATENESS_STD,
        applies=lambda v: v.driveline.stepless,
    ),
)

TERMS: Final = Registry(Term, "weighbridge.terms", _OWN)
"""Every term by its name, in the order of the states: the mass is the first."""


def terms_of(vehicle: Vehicle, names: Sequence[str] = TERMS.own) -> tuple[Term, ...]:
    """Those of some terms that a vehicle has."""
    return tuple(term for term in map(TERMS.__getitem__, names) if term.applies(vehicle))


def design(
    table: ForceTable,
    vehicle: Vehicle,
    names: Sequence[str] = TERMS.own,
    *,
    squat_accel: Floats | None = None,
    unmeasured_grade: float = 0.0,
) -> tuple[Floats, Floats]:
    """Rows of the model ``y = rows @ states``.

    Parameters
    ----------
    table, vehicle
    names : of the terms; the mass is the first
    squat_accel : (n,) what squat of the body adds to the specific force [m/s^2]
    unmeasured_grade : what of the grade nothing has measured [rad]

    Returns
    -------
    rows : (n, k) for the terms that the vehicle has; the mass is that of the first row
    y : (n,) traction less drag and rotating inertia, and what the fuel that is burnt by then
        would have weighed [N]
    """
    columns = [term.column(table, vehicle, unmeasured_grade) for term in terms_of(vehicle, names)]
    if squat_accel is not None:
        columns[0] = columns[0] - squat_accel
    y = law.force_on_mass(table, vehicle) + columns[0] * table.fuel_burnt
    return np.column_stack(columns), y
