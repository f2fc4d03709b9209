"""The waist: torque and motion of a drive, brought together at the instants of the torque."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.balance.braking import Brakes, find_brakes, retarder_untold
from weighbridge.balance.coarse import coarse_std
from weighbridge.balance.cornering import cornering
from weighbridge.balance.filled import Fill, filled, identify_fill
from weighbridge.balance.foot_setup import learn_dragged
from weighbridge.balance.instants import (
    SLOWEST_GEARED,
    Instants,
    interpolate_motion,
    lagged_motion,
    read_instants,
)
from weighbridge.balance.law import needed_force, traction_gain
from weighbridge.balance.table import ForceBalance, ForceSetup, ForceTable, Reason
from weighbridge.navigation.motion import BY_SPEED, Motion
from weighbridge.signals import Drive, Floats, Signal
from weighbridge.vehicle.air import Air, air_density, dynamic_pressure, identify_air
from weighbridge.vehicle.fuel import fuel_burnt, full_load_torque
from weighbridge.vehicle.model import DraggedReading, Vehicle
from weighbridge.vehicle.torque import Torque, engine_torque, source_of, source_signal

ROUGH_NOISE: Final = 0.03
"""Noise of a torque of which the vehicle file says none, over the highest of the drive [-]."""


def force_balance(
    drive: Drive,
    vehicle: Vehicle,
    motion: Motion,
    *,
    delay: float | None = None,
    lag: float | None = None,
    signed: bool = True,
    setup: ForceSetup | None = None,
) -> ForceBalance:
    """Bring the force and the motion of a drive together.

    A control unit smooths what it reports. The motion is smoothed alike, so
    that both sides have lost the same.

    Parameters
    ----------
    drive, vehicle, motion
    delay : lateness of the torque; the vehicle's when None, 0 if that is unknown [s]
    lag : time constant of its first-order smoothing; the vehicle's when None [s]
    signed : whether the torque tells what a dragged engine takes; a load that stands for it
        does not
    setup : what a whole drive tells of its force side; found from this drive when None

    Raises
    ------
    DriveError
        The drive lacks what the vehicle's torque source needs.
    """
    source = source_signal(drive, vehicle)
    if delay is None:
        delay = vehicle.timing.torque_delay or 0.0
    lag = vehicle.timing.torque_lag if lag is None else lag
    read = _read(drive, vehicle, motion, source, delay, lag, setup)
    table = read.table
    brakes = find_brakes(
        drive, vehicle, motion, source, table,
        known=read.instants.known, lag=lag,
        signed=signed and source_of(vehicle).signed, setup=setup,
    )  # fmt: skip
    fill = setup.fill if setup is not None else identify_fill(source)
    reason = _reasons(vehicle, motion, source, read, brakes, fill)
    table = replace(table, reason=reason)
    if setup is None:
        setup = ForceSetup(
            foot=brakes.foot,
            switch_dead=brakes.switch_dead,
            gears=read.instants.numbers,
            engine_delay=read.instants.engine_delay,
            air=read.air,
            full_torque=read.full_torque,
            torque_noise=_torque_noise(vehicle, table),
            fill=fill,
        )
    return ForceBalance(
        table=replace(table, force_std=setup.torque_noise * np.nan_to_num(table.gearing)),
        motion=motion,
        brake_hidden=brakes.hidden,
        switch_dead=brakes.switch_dead,
        retarder_untold=retarder_untold(drive, vehicle),
        coarse_std=coarse_std(source, reason == Reason.USED),
        setup=setup,
        delay=delay,
    )


def force_rows(
    drive: Drive, vehicle: Vehicle, motion: Motion, delay: float, setup: ForceSetup | None
) -> ForceTable:
    """Return the rows of `force_balance` without reasons and noise: enough to compare forces.

    Parameters
    ----------
    drive, vehicle, motion, delay, setup : as of `force_balance`
    """
    source = source_signal(drive, vehicle)
    lag = vehicle.timing.torque_lag
    return _read(drive, vehicle, motion, source, delay, lag, setup).table


@dataclass(frozen=True, slots=True, kw_only=True)
class _Read:
    """What is read of motion and torque at each row.

    Attributes
    ----------
    table : (n,) rows, without reasons and noise
    torque : of the rows
    instants : motion, engine speed and gear
    air, full_torque : of `ForceSetup`
    """

    table: ForceTable
    torque: Torque
    instants: Instants
    air: Air
    full_torque: float


def _read(
    drive: Drive,
    vehicle: Vehicle,
    motion: Motion,
    source: Signal,
    delay: float,
    lag: float,
    setup: ForceSetup | None,
) -> _Read:
    """Read motion and torque at the stamps of the source, less its delay."""
    recorded = source.time
    known = (setup.gears, setup.engine_delay) if setup is not None else (None, None)
    at = read_instants(drive, vehicle, lagged_motion(motion, lag), recorded, delay, *known)
    engine_speed, gearing, altitude = at.columns["engine_speed"], at.columns["gearing"], at.altitude
    torque = engine_torque(drive, vehicle, engine_speed, recorded)
    full = setup.full_torque if setup is not None else full_load_torque(torque.torque)
    air = setup.air if setup is not None else identify_air(drive, altitude)
    table = ForceTable(
        **at.columns,
        traction_force=traction_gain(vehicle, torque.torque, gearing) * torque.torque,
        force_std=np.full(recorded.size, np.nan),
        torque=torque.torque,
        air_density=air.density(altitude),
        fuel_burnt=fuel_burnt(drive, vehicle, recorded, torque.torque, engine_speed, full),
        reason=np.zeros(recorded.size, dtype=np.uint8),
    )
    return _Read(
        table=table,
        torque=torque,
        instants=at,
        air=air,
        full_torque=full,
    )


def _reasons(
    vehicle: Vehicle,
    motion: Motion,
    source: Signal,
    read: _Read,
    brakes: Brakes,
    fill: Fill | None,
) -> NDArray[np.uint8]:
    """Why a row is not usable (n,); the first reason that applies is told, so the order matters.

    Parameters
    ----------
    vehicle, motion
    source : what the torque is made from
    read, brakes : of the rows
    fill : how readings that a logger filled in would look
    """
    table = read.table
    reason = np.zeros(table.time.size, dtype=np.uint8)
    has_torque = np.isfinite(table.traction_force) & ~filled(source, fill)
    for flag, why in (
        (~read.instants.known | ~np.isfinite(table.speed), Reason.NO_MOTION),
        (table.speed < SLOWEST_GEARED, Reason.STANDING),
        (brakes.braked, Reason.BRAKING),
        (read.instants.changing, Reason.SHIFTING),
        (read.instants.slipping, Reason.CLUTCH_SLIPPING),
        (~has_torque, Reason.NO_TORQUE),
        (read.torque.overrun | brakes.overrun, Reason.OVERRUN),
        (read.torque.extrapolated, Reason.EXTRAPOLATED),
        (cornering(motion, table.time), Reason.CORNERING),
    ):
        reason[(reason == 0) & flag] = why
    return reason


def highest_torque(torque: Floats) -> float:
    """Return the highest torque of some rows (n,), noise aside [N m]; 0 without any."""
    known = np.abs(torque[np.isfinite(torque)])
    return float(np.percentile(known, 98.0)) if known.size else 0.0


def _torque_noise(vehicle: Vehicle, table: ForceTable) -> float:
    """Noise of one torque [N m]: the vehicle's, else a part of the highest of the drive."""
    return vehicle.torque.noise or ROUGH_NOISE * highest_torque(table.torque[table.usable])


def dragged_reading(
    drives: Sequence[Drive], motions: Sequence[Motion], vehicle: Vehicle
) -> DraggedReading | None:
    """Learn what the torque source reads while the engine is dragged.

    Parameters
    ----------
    drives, motions : of the calibration
    vehicle : with the delay of its torque

    Returns
    -------
    DraggedReading
        None for a motor with one gear, and where the drives do not show it.
    """
    if vehicle.driveline.single_speed:
        return None
    sources, needs = [], []
    for drive, motion in zip(drives, motions, strict=True):
        source = source_signal(drive, vehicle)
        time = source.time - (vehicle.timing.torque_delay or 0.0)
        rows = interpolate_motion(lagged_motion(motion, vehicle.timing.torque_lag), time)
        pressure = dynamic_pressure(air_density(drive, rows["altitude"]), rows["speed"])
        needed, weight = needed_force(vehicle, rows["specific_force"], pressure)
        sources.append(source)
        needs.append(np.full_like(needed, np.nan) if motion.source in BY_SPEED else needed / weight)
    return learn_dragged(drives, sources, needs)
