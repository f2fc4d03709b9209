"""The waist: torque and motion of a drive, brought together at the instants of the torque."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weighbridge.balance.braking import Brakes, find_brakes, retarder_unreported
from weighbridge.balance.coarse import coarse_std
from weighbridge.balance.cornering import cornering
from weighbridge.balance.filled import Fill, filled, identify_fill
from weighbridge.balance.foot_setup import learn_dragged
from weighbridge.balance.instants import (
    SLOWEST_GEARED,
    Instants,
    in_band,
    interpolate_motion,
    lagged_motion,
    read_instants,
)
from weighbridge.balance.law import needed_force, traction_gain
from weighbridge.balance.table import ForceBalance, ForceSetup, ForceTable, Reason
from weighbridge.navigation import BY_SPEED, Motion
from weighbridge.signals import Bools, Drive, Floats, Signal
from weighbridge.signals.recent import looking
from weighbridge.vehicle import (
    Air,
    Burnt,
    DraggedReading,
    Vehicle,
    air_density,
    engine_torque,
    fuel_burnt,
    fuel_flow,
    full_load_torque,
    identify_air,
    in_air,
    source_of,
)
from weighbridge.vehicle.air import dynamic_pressure
from weighbridge.vehicle.torque import EXPONENT_STEP, Torque, source_signal

ROUGH_NOISE: Final = 0.03
"""Noise of a torque of which the vehicle file says none, over the highest of the drive [-]."""


class ForceState(NamedTuple):
    """What the rows so far leave to those that come.

    Attributes
    ----------
    burnt : fuel until the last row; None before the first
    lagged : motion, smoothed as the torque is; None before the first row
    """

    burnt: Burnt | None
    lagged: Motion | None

    @property
    def time(self) -> float:
        """Instant of the last row; minus infinity before the first [s]."""
        return -math.inf if self.burnt is None else self.burnt.time

    @property
    def fuel(self) -> float:
        """Burnt since the first row [kg]."""
        return 0.0 if self.burnt is None else self.burnt.mass


def force_balance(
    drive: Drive,
    vehicle: Vehicle,
    motion: Motion,
    *,
    delay: float | None = None,
    lag: float | None = None,
    signed: bool = True,
    engine_delay: float | None = None,
    setup: ForceSetup | None = None,
    since: ForceState | None = None,
) -> ForceBalance:
    """Bring the force and the motion of a drive together.

    A control unit smooths what it reports. The motion is smoothed alike, so
    that both sides have lost the same.

    With a setup that looks no further than ``setup.ahead`` each row depends on the setup, on what
    came before and on what comes so soon after, and on nothing else: a drive whose rows are found
    together has the same ones, to the last bit, as one that is read second by second.

    Parameters
    ----------
    drive, vehicle, motion
    delay : lateness of the torque; the vehicle's when None, 0 if that is unknown [s]
    lag : time constant of its first-order smoothing; the vehicle's when None [s]
    signed : whether the torque shows what a dragged engine takes; not a load in its place
        does not
    engine_delay : lateness of the engine speed; that of the setup, or found from this drive, when
        None [s]
    setup : what a whole drive shows of its force side; found from this drive when None
    since : what earlier rows left, where ``drive`` and ``motion`` hold the last seconds alone

    Raises
    ------
    DriveError
        The drive lacks what the vehicle's torque source needs.
    """
    forward = setup is not None and setup.foot.forward
    if setup is not None and forward:
        drive = looking(drive, setup.readings_ahead, setup.periods)
    source = source_signal(drive, vehicle)
    if delay is None:
        delay = vehicle.timing.torque_delay or 0.0
    lag = vehicle.timing.torque_lag if lag is None else lag
    lagged = lagged_motion(motion, lag, since.lagged if since is not None else None)
    if setup is not None:
        engine_delay = setup.engine_delay
    shown = in_band(lagged, vehicle, source.period)
    read = _read(drive, vehicle, shown, source, delay, engine_delay, setup, since)
    fill = setup.fill if setup is not None else identify_fill(source)
    brakes, table = _judged(drive, vehicle, motion, source, read, lag, signed, fill, setup)
    if setup is None:
        setup = ForceSetup(
            foot=brakes.foot,
            switch_dead=brakes.switch_dead,
            gears=read.instants.numbers,
            engine_delay=read.instants.engine_delay,
            air=read.air,
            full_torque=read.full_torque,
            air_std=read.air_std,
            torque_noise=_torque_noise(vehicle, table),
            fill=fill,
            periods=drive.periods,
        )
    return ForceBalance(
        table=replace(table, force_std=setup.torque_noise * np.nan_to_num(table.gearing)),
        motion=motion,
        brake_hidden=brakes.hidden,
        switch_dead=brakes.switch_dead,
        retarder_unreported=retarder_unreported(drive, vehicle),
        coarse_std=coarse_std(source, table.usable),
        air_std=setup.air_std,
        wheel_speed=None if forward else _wheel_speed(drive, motion, table),
        setup=setup,
        delay=delay,
        lagged=lagged if forward else None,
        fuel_flow=read.fuel_flow if forward else None,
    )


def _wheel_speed(drive: Drive, motion: Motion, table: ForceTable) -> Floats | None:
    """Speed of the wheels as recorded, when it was true (n,) [m/s]; None without."""
    speed = drive.get("vehicle_speed")
    if speed is None or len(speed) < 2:
        return None
    late = table.time + motion.speed_delay
    return np.where(speed.age(late) <= 2.0 * speed.period, np.abs(speed.at(late)), np.nan)


def force_rows(
    drive: Drive, vehicle: Vehicle, lagged: Motion, delay: float, setup: ForceSetup
) -> ForceTable:
    """Return the rows of `force_balance` without reasons and noise: enough to compare forces.

    Parameters
    ----------
    drive, vehicle, delay, setup : as of `force_balance`
    lagged : the motion, smoothed as the torque is, and `in_band`
    """
    source = source_signal(drive, vehicle)
    return _read(drive, vehicle, lagged, source, delay, setup.engine_delay, setup).table


def usable_rows(
    drive: Drive, vehicle: Vehicle, motion: Motion, lagged: Motion, delay: float, setup: ForceSetup
) -> ForceTable:
    """Return the rows as of `force_rows` with reasons; parameters likewise."""
    source = source_signal(drive, vehicle)
    read = _read(drive, vehicle, lagged, source, delay, setup.engine_delay, setup)
    lag = vehicle.timing.torque_lag
    return _judged(drive, vehicle, motion, source, read, lag, True, setup.fill, setup)[1]


def _judged(
    drive: Drive,
    vehicle: Vehicle,
    motion: Motion,
    source: Signal,
    read: _Read,
    lag: float,
    signed: bool,
    fill: Fill | None,
    setup: ForceSetup | None,
) -> tuple[Brakes, ForceTable]:
    """Where brakes may work, and the rows with the reasons why they are not used."""
    table = read.table
    brakes = find_brakes(
        drive, vehicle, motion, source, table,
        known=read.instants.known, lag=lag,
        signed=signed and source_of(vehicle).signed, setup=setup,
    )  # fmt: skip
    without = filled(source, fill, forward=setup is not None and setup.foot.forward)
    turning = cornering(motion, table.time, setup.ahead if setup is not None else math.inf)
    return brakes, replace(table, reason=_reasons(read, brakes, without, turning))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Read:
    """What is read of motion and torque at each row.

    Attributes
    ----------
    table : (n,) rows, without reasons and noise
    torque : of the rows
    instants : motion, engine speed and gear
    air, full_torque, air_std : of `ForceSetup`
    fuel_flow : of the rows (n,) [kg/s]
    """

    table: ForceTable
    torque: Torque
    instants: Instants
    air: Air
    full_torque: float
    fuel_flow: Floats
    air_std: float


def _read(
    drive: Drive,
    vehicle: Vehicle,
    lagged: Motion,
    source: Signal,
    delay: float,
    engine_delay: float | None,
    setup: ForceSetup | None,
    since: ForceState | None = None,
) -> _Read:
    """Read motion, lagged as the torque is, and torque at the source's stamps less its delay."""
    recorded = source.time
    gears = setup.gears if setup is not None else None
    ahead = setup.ahead if setup is not None else math.inf
    at = read_instants(drive, vehicle, lagged, recorded, delay, gears, engine_delay, ahead=ahead)
    engine_speed, gearing, altitude = at.columns["engine_speed"], at.columns["gearing"], at.altitude
    period = setup.foot.period if setup is not None else None
    air = setup.air if setup is not None else identify_air(drive, altitude)

    def torque_of(more: float) -> Torque:
        exponent = vehicle.torque.in_thin_air[0] + more
        share = in_air(vehicle.torque.charge, exponent, air, altitude)
        return engine_torque(
            drive, vehicle, engine_speed, recorded, share=share, period=period, ahead=ahead
        )

    torque = torque_of(0.0)
    full = setup.full_torque if setup is not None else full_load_torque(torque.torque)
    flow = fuel_flow(drive, vehicle, recorded, torque.torque, engine_speed, full)
    burnt = since.burnt if since is not None else None
    table = ForceTable(
        **at.columns,
        traction_force=traction_gain(vehicle, torque.torque, gearing) * torque.torque,
        force_std=np.full(recorded.size, np.nan),
        torque=torque.torque,
        air_density=air.density(altitude),
        fuel_burnt=fuel_burnt(at.columns["time"], flow, burnt),
        reason=np.zeros(recorded.size, dtype=np.uint8),
    )
    return _Read(
        table=table,
        torque=torque,
        instants=at,
        air=air,
        full_torque=full,
        fuel_flow=flow,
        air_std=_air_std(vehicle, torque_of) if setup is None and air.known else 0.0,
    )


def _air_std(vehicle: Vehicle, torque_of: Callable[[float], Torque]) -> float:
    """What the air leaves uncertain of the torque: it is not that of the calibration [-]."""
    _, std = vehicle.torque.in_thin_air
    if vehicle.torque.charge is None or std == 0.0:
        return 0.0
    now, then = (torque_of(more).torque for more in (0.0, EXPONENT_STEP))
    known = np.isfinite(now) & np.isfinite(then) & (now > 0.0)
    size = float(now[known] @ now[known])
    if size == 0.0:
        return 0.0
    return std * abs(float(now[known] @ (then - now)[known])) / size / EXPONENT_STEP


def _reasons(read: _Read, brakes: Brakes, without: Bools, turning: Bools) -> NDArray[np.uint8]:
    """Why a row is not usable (n,); the first reason that applies is given, so the order matters.

    Parameters
    ----------
    read, brakes : of the rows
    without : (n,) readings that a logger filled in
    turning : (n,) it corners hard
    """
    table = read.table
    reason = np.zeros(table.time.size, dtype=np.uint8)
    has_torque = np.isfinite(table.traction_force) & ~without
    for flag, why in (
        (~read.instants.known | ~np.isfinite(table.speed), Reason.NO_MOTION),
        (table.speed < SLOWEST_GEARED, Reason.STANDING),
        (brakes.braked, Reason.BRAKING),
        (read.instants.changing, Reason.SHIFTING),
        (read.instants.slipping, Reason.CLUTCH_SLIPPING),
        (~has_torque, Reason.NO_TORQUE),
        (read.torque.overrun | brakes.overrun, Reason.OVERRUN),
        (read.torque.extrapolated, Reason.EXTRAPOLATED),
        (turning, Reason.CORNERING),
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
        lagged = in_band(lagged_motion(motion, vehicle.timing.torque_lag), vehicle, source.period)
        rows = interpolate_motion(lagged, time)
        pressure = dynamic_pressure(air_density(drive, rows["altitude"]), rows["speed"])
        needed, weight = needed_force(vehicle, rows["specific_force"], pressure)
        sources.append(source)
        needs.append(np.full_like(needed, np.nan) if motion.source in BY_SPEED else needed / weight)
    return learn_dragged(drives, sources, needs)
