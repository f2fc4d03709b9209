"""A motor and an engine that share what moves a simulated car: a power split."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.ndimage import uniform_filter1d

from weighbridge.signals import Floats
from weighbridge.simulation.car import PowerSplit
from weighbridge.simulation.longitudinal import DT, Trajectory

SMOOTHED: Final = 3.0
"""The engine gives the mean of the power asked for over so long, the motor the rest [s]."""

SLOW: Final = 3.0
"""Slower, the motor brakes no more [m/s]."""


def shared(trajectory: Trajectory, split: PowerSplit) -> Trajectory:
    """Share what moved a car between engine and motor.

    The motion stays what it is: the wheels get the same force, and only who gives it is another.

    Parameters
    ----------
    trajectory : of the car
    split : of its power

    Returns
    -------
    Trajectory
        With speed, torque and fuel of the engine, the battery's power, and brakes less what the
        motor brakes.
    """
    speed = trajectory.speed
    power = trajectory.traction_force * speed / split.mechanical
    size = max(1, round(SMOOTHED / DT))
    # Of the past alone: an engine does not know what will be asked for.
    asked = uniform_filter1d(np.maximum(power, 0.0), size, origin=(size - 1) // 2)
    runs = uniform_filter1d((asked > split.start_power).astype(float), size) > 0.5
    given = np.where(runs, np.clip(asked, 0.5 * split.start_power, split.engine_power), 0.0)
    given = np.where(runs, np.maximum(given, power - split.motor_power), 0.0)
    part = np.sqrt(np.clip(given / split.engine_power, 0.0, 1.0))
    wanted = np.where(runs, split.slowest + (split.fastest - split.slowest) * part, 0.0)
    turns = uniform_filter1d(wanted, max(1, round(0.6 / DT)))
    spun = split.engine_inertia * np.gradient(turns, DT)
    torque = np.where(runs, given / np.maximum(turns, split.slowest) + spun, 0.0)
    motor = power - torque * turns + spun * turns
    braked = np.minimum(trajectory.brake_force * speed, split.motor_power) * (speed > SLOW)
    motor = motor - braked
    battery = np.where(motor > 0.0, motor / split.efficiency, motor * split.efficiency)
    # The fuel of the engine alone would be in proportion to its power.
    before = np.maximum(trajectory.engine_torque * trajectory.engine_speed, 1.0)
    burnt = trajectory.fuel_flow * np.clip(given / before, 0.0, 3.0)
    return trajectory._replace(
        engine_speed=turns,
        engine_torque=torque,
        gross_torque=np.maximum(torque, 0.0),
        accessory_torque=np.zeros_like(torque),
        fuel_flow=np.where(runs, burnt, 0.0),
        brake_force=trajectory.brake_force - braked / np.maximum(speed, SLOW),
        battery_power=battery + split.auxiliary,
    )


def volts_and_amps(battery: Floats, split: PowerSplit) -> tuple[Floats, Floats]:
    """Voltage [V] and current [A] of the battery (n,), positive while it gives, of its power [W].

    Its resistance takes 6 % of the voltage at the motor's largest power.
    """
    drop = 0.06 / split.motor_power
    volts = split.voltage * 0.5 * (1.0 + np.sqrt(np.maximum(1.0 - 4.0 * drop * battery, 0.1)))
    return volts, battery / np.maximum(volts, math.ulp(1.0))
