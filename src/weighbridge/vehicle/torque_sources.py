"""Sources of torque, one record each: what a drive must hold, and what its reading is worth.

A new source is a record in `TORQUE_SOURCES`, or in the entry points
``weighbridge.torque_sources`` of another package.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.constants import PETROL_HEATING_VALUE, PETROL_STOICHIOMETRIC_RATIO
from weighbridge.registry import Registry
from weighbridge.signals import Drive, Floats
from weighbridge.vehicle.force_sources import (
    BATTERY,
    HYBRID,
    POWER,
    POWER_BY_SPEED,
    TRACTION_FORCE,
    WHEEL_TORQUE,
)
from weighbridge.vehicle.reported_torque import torque_in_nm, torque_in_percent
from weighbridge.vehicle.torque_source import (
    MOTOR_BETWEEN_STD,
    REPORTED,
    REPORTED_TERMS,
    ROUGH,
    ROUGH_TERMS,
    TorqueConstants,
    TorqueSource,
    TorqueTerms,
)

__all__ = [
    "REPORTED",
    "REPORTED_TERMS",
    "ROUGH",
    "ROUGH_TERMS",
    "TORQUE_SOURCES",
    "TorqueSource",
    "TorqueTerms",
    "air_flow_torque",
    "lowest_load",
]


def air_flow_torque(
    mass_air_flow: Floats, engine_speed: Floats, lambda_1: Floats, efficiency: float
) -> Floats:
    """Torque from intake air flow (Jensen 2022, eq. 51, with the division by engine speed).

    Parameters
    ----------
    mass_air_flow : (n,) [kg/s]
    engine_speed : (n,) [rad/s]
    lambda_1 : (n,) air-fuel equivalence ratio [-]
    efficiency : shaft over fuel power [-]

    Returns
    -------
    (n,) [N m]
    """
    fuel_flow = mass_air_flow / (PETROL_STOICHIOMETRIC_RATIO * lambda_1)
    power = efficiency * PETROL_HEATING_VALUE * fuel_flow
    return np.asarray(power / np.maximum(engine_speed, 30.0))


def _load(drive: Drive, time: Floats, _: TorqueConstants) -> Floats:
    return drive.signals["engine_load"].at(time)


def _air_flow(drive: Drive, time: Floats, model: TorqueConstants) -> Floats:
    lambda_1 = drive.get("lambda_1")
    ratio = lambda_1.at(time) if lambda_1 is not None else np.ones_like(time)
    speed = drive.signals["engine_speed"].at(time)
    usable = np.where(np.isfinite(ratio), ratio, 1.0)
    flow = drive.signals["mass_air_flow"].at(time)
    return air_flow_torque(flow, speed, usable, model.engine_efficiency)


def lowest_load(load: Floats) -> float:
    """Load below which the engine may be dragged and the load says nothing [-]."""
    finite = load[np.isfinite(load)]
    if finite.size == 0:
        return 0.0
    return float(np.percentile(finite, 1.0) + 0.01)


MEASURED: Final = "measured"
"""Name of the source that is read where a vehicle file states none."""

_MEASURED: Final = REPORTED(
    name=MEASURED,
    signals=("engine_torque",),
    reading=torque_in_nm,
    title="torque in N m",
    words="torque in N m, as the control unit reports it",
    axis="Recorded torque [N m]",
    # Reported from the currents of a motor; its limit is 5 %.
    motor_scale_std=0.03,
    motor_between_std=MOTOR_BETWEEN_STD,
)

_PERCENT: Final = REPORTED(
    name="percent",
    signals=("engine_torque_fraction",),
    reading=torque_in_percent,
    needs_reference=True,
    motor_between_std=MOTOR_BETWEEN_STD,
    title="torque in percent",
    words="torque in percent of the reference torque",
    axis="Recorded torque [N m]",
)

_LOAD: Final = ROUGH(
    name="load",
    signals=("engine_load", "engine_speed"),
    reading=_load,
    needs_map=True,
    floor=lowest_load,
    title="engine load",
    words="engine load (PID 04)",
    axis="Engine load [%]",
    axis_suffix="pct",
    transfer_std=0.010,
    # 1 as SAE J1979 defines it, 0 where boost makes up for thin air, or nothing reckons with it:
    # evenly between the two.
    charge_exponent=(0.5, 0.29),
)

_AIR_FLOW: Final = ROUGH(
    name="air_flow",
    signals=("mass_air_flow", "engine_speed"),
    reading=_air_flow,
    floor=lambda _: 0.0,
    title="air flow",
    words="air flow and fuel",
    axis="Torque from air flow [N m]",
    transfer_std=0.015,
    # Graded, not measured.
    expected=1.0,
    limit="air flow says little of efficiency and ignition",
)

TORQUE_SOURCES: Final = Registry(
    TorqueSource,
    "weighbridge.torque_sources",
    (
        _MEASURED,
        _PERCENT,
        WHEEL_TORQUE,
        TRACTION_FORCE,
        POWER,
        POWER_BY_SPEED,
        _LOAD,
        _AIR_FLOW,
        BATTERY,
        HYBRID,
    ),
)
"""Every torque source, the most direct first.

``scale_std``: a maker's bus specification grants 10 % or 5 N m, Regulation (EU) 582/2011 7 % of
the full load torque, and limits are two standard deviations; load and air flow are only roughly
torque. ``transfer_std``: the torque model is used at other loads and engine speeds than it was
made at; simulated, five calibrations of one car each weighed by load on other drives: the five
means scattered by 0.9 %; the others set in proportion to how direct the torque is. ``cold_std``:
load and air flow count the friction of a cold engine as traction: simulated cold drives of 13
minutes came out 5 to 8 % heavy, and right when warm; measured torque leaves the tyres, a fifth
more rolling resistance. ``cold_torque_std``: friction is a tenth of the full load torque of a warm
engine and half as much again at 20 degC (Heywood, Internal Combustion Engine Fundamentals, 1988,
ch. 13); load and air flow count it as torque; of measured torque only the gearbox and axle oil
takes."""
