"""Both sides of the balance from speed alone: traction by a model of the speed itself."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from weighbridge.balance.table import ForceBalance, ForceTable, Reason
from weighbridge.constants import GRAVITY
from weighbridge.errors import ConfigError
from weighbridge.kernels import speed_ekf as kernel
from weighbridge.messages import Problem, refused
from weighbridge.navigation import Motion, find_motion
from weighbridge.signals import Bools, Drive, Floats
from weighbridge.vehicle import SpeedModel, Vehicle
from weighbridge.vehicle.speed_model import SpeedSampling

SPEEDS: Final = ("vehicle_speed", "gnss_speed")
"""Signals of which one is enough, the better first."""

FULL: Final = 0.8
"""Part of a window in which the speed must be known [-]."""


def model_of(vehicle: Vehicle) -> SpeedModel:
    """Return the vehicle's speed model.

    Raises
    ------
    ConfigError
        It has none.
    """
    if vehicle.speed_model is None:
        raise ConfigError(
            f"the vehicle file of {vehicle.name} has no [speed_model], which weighing by speed "
            "alone needs: run weighbridge calibrate --method speed-ekf"
        )
    return vehicle.speed_model


def speed_motion_of(drive: Drive, vehicle: Vehicle, length: float) -> Motion:
    """Find the motion by speed alone, whatever else the drive holds; its grade is unknown.

    Parameters
    ----------
    drive, vehicle
    length : of the windows over which it will be averaged [s]

    Raises
    ------
    DriveError
        There is too little of it.
    """
    chosen = next((name for name in SPEEDS if drive.has(name)), SPEEDS[0])
    speed = drive.get(chosen)
    if speed is not None and speed.period > 0.5 * length:
        raise refused(
            "speed.slow", drive=drive.name, speed=chosen, period=speed.period, length=length
        )
    alone = drive.without(*(name for name in drive.signals if name != chosen))
    motion = find_motion(alone, vehicle)
    nowhere = np.full(motion.time.size, np.nan)
    return replace(
        motion,
        specific_force=nowhere,
        grade=nowhere,
        pitch=nowhere,
        notes=(Problem.of("speed.alone"),),
    )


def window_means(motion: Motion, values: Floats, sampling: SpeedSampling) -> Floats:
    """Average over windows, or over their last part; NaN where less than `FULL` of that is there.

    Parameters
    ----------
    motion : its clock and gaps
    values : (n,) at its instants
    sampling : length of the windows, and the part

    Returns
    -------
    (m,)
    """
    length = sampling.sample_time
    place = (motion.time - motion.time[0]) / length + 1e-9
    window = place.astype(np.int64)
    # At least the last row of a window.
    part = max(sampling.averaged, 1.0 / (motion.rate * length))
    count = int((motion.time[-1] - motion.time[0] + 1.0 / motion.rate) / length + 1e-9)
    inside = (window < count) & (place - window >= 1.0 - part - 1e-6)
    good = inside & motion.valid & np.isfinite(values)
    total = np.bincount(window[good], values[good], count)
    known = np.bincount(window[good], minlength=count).astype(np.float64)
    there = np.bincount(window[inside], minlength=count)
    enough = known >= FULL * np.maximum(there, 1)
    return np.where(enough, total / np.maximum(known, 1.0), np.nan)


def running(speed: Floats, sampling: SpeedSampling) -> tuple[Bools, Bools, Bools]:
    """Judge samples by their speeds alone.

    Parameters
    ----------
    speed : (m,) of each window; NaN where unknown [m/s]
    sampling : with the limits

    Returns
    -------
    known : (m,) there is a speed
    slow : (m,) slower than ``slowest``
    braked : (m,) slowed by more than ``hardest`` since the window before
    """
    known = np.isfinite(speed)
    filled = np.where(known, speed, 0.0)
    change = np.concatenate(([0.0], np.diff(filled)))
    both = known & np.concatenate(([False], known[:-1]))
    hardest = sampling.hardest * sampling.sample_time
    return known, filled < sampling.slowest, both & (change < -hardest)


def speed_balance(drive: Drive, vehicle: Vehicle) -> ForceBalance:
    """Balance the forces of windows by the model of the vehicle's ``speed_model``.

    A row is one window, stamped with its end. Grade and specific force are
    unknown; the estimator has a state for the slope.

    Raises
    ------
    ConfigError
        The vehicle was not calibrated for it.
    DriveError
        There is too little speed.
    """
    model = model_of(vehicle)
    length = model.sample_time
    motion = speed_motion_of(drive, vehicle, length)
    speed = window_means(motion, motion.speed, model)
    known, slow, braked = running(speed, model)
    time = motion.time[0] + length * np.arange(1, speed.size + 1)
    params = kernel_parameters(model, (0.0, 0.0, 0.0), 0.0)
    traction = kernel.traction_force(speed, params)
    reason = np.zeros(speed.size, dtype=np.uint8)
    for flag, why in (
        (~known, Reason.NO_MOTION),
        (slow, Reason.STANDING),
        (braked, Reason.BRAKING),
    ):
        reason[(reason == 0) & flag] = why
    nowhere = np.full(speed.size, np.nan)
    accel = np.concatenate(([np.nan], np.diff(speed))) / length
    return ForceBalance(
        motion=motion,
        table=ForceTable(
            time=time,
            traction_force=traction,
            force_std=nowhere,
            torque=model.corrections[6] * speed,
            engine_speed=nowhere,
            speed=speed,
            accel=accel,
            specific_force=nowhere,
            grade=nowhere,
            pitch=nowhere,
            heading=nowhere,
            gear=np.zeros(speed.size, dtype=np.int64),
            gearing=nowhere,
            air_speed=speed,
            air_density=nowhere,
            fuel_burnt=np.zeros(speed.size),
            reason=reason,
        ),
    )


def kernel_parameters(
    model: SpeedModel, process_var: tuple[float, float, float], speed_var: float
) -> kernel.SpeedEkfParams:
    """Make the kernel's parameters of a vehicle's speed model."""
    return kernel.SpeedEkfParams(
        sample_time=model.sample_time,
        force_gain=model.force_gain,
        drag=model.drag,
        gravity=GRAVITY / math.cos(math.atan(model.rolling_coefficient)),
        rotating_mass=model.rotating_mass,
        corrections=np.array(model.corrections),
        process_var=np.array(process_var),
        speed_var=speed_var,
    )
