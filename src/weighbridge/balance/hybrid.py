"""Does a motor drive the vehicle beside the engine whose torque is read?"""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.balance.force_balance import highest_torque
from weighbridge.balance.table import ForceBalance
from weighbridge.limits import CREEPS
from weighbridge.messages import Problem
from weighbridge.navigation import BY_SPEED
from weighbridge.signals import Bools, Drive
from weighbridge.signals.runs import marked_runs
from weighbridge.vehicle import Vehicle, source_of
from weighbridge.vehicle.gear import STANDS

IDLE_TORQUE: Final = 0.05
"""Torque that a standing engine may show, over the highest of the drive [-]."""

PULLS: Final = 0.3
"""Specific force from which something pulls [m/s^2]: rolling resistance and drag are more than
what a lean of the sensor leaves."""

GAINS: Final = 0.8
"""Acceleration from which something pulls where nothing measures hills [m/s^2]: a slope of 8 %
would do as much."""

FEWEST: Final = 3
"""Times that it pulls with a standing engine."""

SHORTEST: Final = 1.0
"""Each lasts so long at least [s]."""

TRACTION_VOLTAGE: Final = 30.0
"""Voltage above which a battery is that of a motor [V]: 48 V and more, not 12 or 24."""

MOTOR_POWER: Final = 3000.0
"""Power of a battery beyond that of its accessories [W]."""

OFTEN: Final = 0.05
"""Part of the driving in which it gives or takes as much [-]."""


def motor_helps(drive: Drive, balance: ForceBalance, vehicle: Vehicle) -> Problem | None:
    """Say what shows that a motor drives beside the engine; None where nothing does.

    Parameters
    ----------
    drive, balance, vehicle
    """
    if source_of(vehicle).gearing is not None or vehicle.driveline.single_speed:
        return None
    time = balance.table.time
    alone = _engine_stands(balance)
    starts, ends = marked_runs(alone)
    lasted = time[np.maximum(ends - 1, starts)] - time[starts]
    lasted = lasted[lasted >= SHORTEST]
    if lasted.size >= FEWEST:
        return Problem.of("hybrid.engine_stands", times=lasted.size, lasted=float(lasted.sum()))
    share = _battery_share(drive) if _engine_beside(balance, vehicle) else 0.0
    if share > OFTEN:
        return Problem.of("hybrid.battery", "battery_current", share=100.0 * share)
    return None


def _engine_stands(balance: ForceBalance) -> Bools:
    """Rows (n,) in which the vehicle is pulled and its engine stands."""
    table = balance.table
    idle = np.nan_to_num(table.torque) <= IDLE_TORQUE * highest_torque(table.torque)
    stands = (np.nan_to_num(table.engine_speed, nan=np.inf) < STANDS) & idle
    by_speed = balance.motion.source in BY_SPEED
    pulled = table.accel > GAINS if by_speed else table.specific_force > PULLS
    return np.asarray(stands & pulled & (table.speed > CREEPS))


def _engine_beside(balance: ForceBalance, vehicle: Vehicle) -> bool:
    """Whether the torque is that of an engine: it idles, or stands while the vehicle rolls.

    Else it is that of the motor, which turns with the wheels.
    """
    rolls = balance.table.speed > CREEPS
    stands = np.nan_to_num(balance.table.engine_speed, nan=np.inf)[rolls] < STANDS
    return vehicle.driveline.idle_speed > 0.0 or bool(np.sum(stands) > OFTEN * stands.size)


def _battery_share(drive: Drive) -> float:
    """Part of the driving in which a battery of traction gives or takes a motor's power [-]."""
    if not drive.has("battery_voltage", "battery_current"):
        return 0.0
    volts, amps, speed = (
        drive.signals["battery_voltage"],
        drive.signals["battery_current"],
        drive.speed,
    )
    if speed is None or not len(speed) or not np.median(volts.values) > TRACTION_VOLTAGE:
        return 0.0
    moving = np.nan_to_num(speed.at(amps.time)) > CREEPS
    power = np.nan_to_num(volts.at(amps.time) * amps.values)[moving]
    return float(np.mean(np.abs(power) > MOTOR_POWER)) if power.size else 0.0
