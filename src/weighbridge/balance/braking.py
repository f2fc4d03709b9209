"""Where a vehicle is braked: by switch, by retarder, by what the motion takes, by a foot that is
off the accelerator.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.balance.foot import find_foot
from weighbridge.balance.foot_setup import FootSetup, identify_foot, near
from weighbridge.balance.instants import SLOWEST_GEARED, behind
from weighbridge.balance.law import STANDARD_DENSITY, needed_force, rotating_mass
from weighbridge.balance.table import ForceSetup, ForceTable
from weighbridge.kernels.interpolation import rows_before
from weighbridge.navigation import BY_SPEED, Motion
from weighbridge.navigation.motion import row_before
from weighbridge.signals import Bools, Drive, Floats, Signal
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.air import dynamic_pressure

BRAKING_FORCE: Final = 0.06
"""Braking force over weight that marks unseen braking [-]."""

SWITCH_MARGIN: Final = 0.3
"""Samples nearer than this to a pressed brake switch may be braked [s]."""

HARD_BRAKING: Final = 0.15
"""Braking force over weight that no retarder makes: a brake switch is on there [-]."""

SWITCH_ROWS: Final = 20
"""Rows of hard braking that show whether a brake switch can be believed."""

SWITCH_MISSES: Final = 0.2
"""Part of them with the switch off from which it is not believed [-]; true ones miss none."""

TRAIL: Final = 0.0015
"""Braking force over weight that smoothing may still hold of a brake let go [-]."""

SLOWED: Final = 0.005
"""Force over weight that slows a vehicle as a dragged engine does, or a light brake [-]."""

SLOWS: Final = 0.02
"""Part of the moving rows in which a vehicle slows that is braked now and then [-]."""

RETARDING: Final = -0.005
"""Retarder torque over its reference below which it brakes [-]; SPN 520 has steps of 1 %."""


@dataclass(frozen=True, slots=True)
class Brakes:
    """What is known of the brakes at each row.

    Attributes
    ----------
    braked : (n,) brake or retarder work, or the vehicle slows more than its torque explains
    overrun : (n,) the foot may be on the brake, or smoothing still holds what it did
    hidden : nothing shows where the brake is on
    switch_dead : the brake switch contradicts the motion
    foot : what holds all along the drive
    """

    braked: Bools
    overrun: Bools
    hidden: bool
    switch_dead: bool
    foot: FootSetup


@dataclass(frozen=True, slots=True)
class _Slowing:
    """What the motion takes of the wheels, to judge brakes by.

    Attributes
    ----------
    needed : (n,) force at the wheels [N]
    weight : it is given for [N]
    beyond : (n,) the same, less what a dragged engine explains [N]
    moving : (n,)
    """

    needed: Floats
    weight: float
    beyond: Floats
    moving: Bools


def find_brakes(
    drive: Drive,
    vehicle: Vehicle,
    motion: Motion,
    source: Signal,
    table: ForceTable,
    *,
    known: Bools,
    lag: float,
    signed: bool,
    setup: ForceSetup | None = None,
) -> Brakes:
    """Find where brakes may work.

    Parameters
    ----------
    drive, vehicle, motion
    source : what the torque is made from
    table : (n,) rows, at the stamps of the source
    known : (n,) the motion is known there
    lag : time constant of the smoothing [s]
    signed : the torque shows what a dragged engine takes
    setup : what holds all along the drive; found from this drive when None
    """
    recorded, traction = source.time, table.traction_force
    rotating = rotating_mass(vehicle, table.gearing)
    needed, weight = needed_force(vehicle, table.specific_force, table.dynamic_pressure, rotating)
    slowing = _Slowing(
        needed=needed,
        weight=weight,
        beyond=needed - np.minimum(np.where(np.isfinite(traction), traction, 0.0), 0.0),
        moving=np.asarray(table.speed > SLOWEST_GEARED),
    )
    pressed = brake_pressed(drive, recorded)
    if setup is not None:
        dead = setup.switch_dead
    else:
        dead = pressed is not None and _misses(pressed, slowing, known)
    pressed = None if dead else pressed
    measured = np.nan if motion.source in BY_SPEED else 1.0
    need, torque = measured * needed / weight, measured * needed / table.gearing
    by = setup.foot if setup is not None else identify_foot(drive, vehicle, source, need, torque)
    foot = find_foot(drive, vehicle, source, need, torque, by)
    # What a dragged engine takes is shown by a torque alone, and by none where a foot may brake,
    # or a retarder.
    released = signed and pressed is not None and not retarder_unreported(drive, vehicle)
    overrun = np.zeros_like(foot.off) if released else foot.off
    slowed = foot.off if pressed is None else pressed
    reported = traction if signed else None
    held = _trailing(vehicle, motion, table.time, slowed, reported, lag, forward=by.forward)
    slows = (needed < -SLOWED * weight)[slowing.moving]
    hidden = pressed is None and not foot.observable and slows.size and slows.mean() > SLOWS
    return Brakes(
        braked=_braked(drive, recorded, slowing, pressed),
        overrun=overrun | held,
        hidden=bool(hidden),
        switch_dead=dead,
        foot=by,
    )


def retarder_unreported(drive: Drive, vehicle: Vehicle) -> bool:
    """Whether a retarder may slow the vehicle that neither switch nor signal shows."""
    retarder = drive.get("retarder_torque")
    recorded = retarder is not None and len(retarder) > 0
    return vehicle.of_class.retarded and not vehicle.driveline.single_speed and not recorded


def brake_pressed(drive: Drive, recorded: Floats) -> Bools | None:
    """Where the brake switch is on, or nearly (n,); None without a switch."""
    switch = drive.get("brake_switch")
    if switch is None or not len(switch):
        return None
    on = switch.values > 0.5
    return (switch.held(recorded) > 0.5) | near(switch.time, on, recorded, SWITCH_MARGIN)


def _misses(pressed: Bools, slowing: _Slowing, known: Bools) -> bool:
    """Whether a brake switch is off in much of the hard braking."""
    hard = known & slowing.moving
    hard &= np.nan_to_num(slowing.beyond) < -HARD_BRAKING * slowing.weight
    count = np.count_nonzero(hard)
    return bool(count >= SWITCH_ROWS and np.mean(~pressed[hard]) > SWITCH_MISSES)


def _braked(drive: Drive, recorded: Floats, slowing: _Slowing, pressed: Bools | None) -> Bools:
    """Where brake or retarder work, or the vehicle slows more than its torque explains."""
    retarder = drive.get("retarder_torque")
    retarding = np.zeros(recorded.size, dtype=bool)
    if retarder is not None and len(retarder):
        retarding = np.nan_to_num(retarder.held(recorded)) < RETARDING
    if pressed is not None:
        return np.asarray(retarding | pressed)
    # Unseen braking: what slows the vehicle is far more than engine, drag and
    # rolling can, whatever the mass within reason.
    return np.asarray(retarding | (slowing.beyond < -BRAKING_FORCE * slowing.weight))


def _trailing(
    vehicle: Vehicle,
    motion: Motion,
    time: Floats,
    slowed: Bools,
    traction: Floats | None,
    lag: float,
    *,
    forward: bool,
) -> Bools:
    """Where the smoothed motion still holds the force of a brake that was let go (n,).

    Parameters
    ----------
    vehicle, motion
    time : (n,) instants of the torque [s]
    slowed : (n,) where the brake may work
    traction : (n,) of a torque that shows what a dragged engine takes [N]; None for none
    lag : time constant of the smoothing [s]
    forward : take the last motion before a row, for which no later row counts, not between two
    """
    if lag <= 0.0 or not slowed.any():
        return np.zeros(time.size, dtype=bool)
    before = rows_before(motion.time, time)
    nearest = np.minimum(before + (time[before] < motion.time), time.size - 1)
    pressure = dynamic_pressure(STANDARD_DENSITY, motion.speed)
    needed, weight = needed_force(vehicle, motion.specific_force, pressure)
    dragged = np.minimum(np.nan_to_num(traction), 0.0)[nearest] if traction is not None else 0.0
    brake = np.where(slowed[nearest], np.maximum(dragged - np.nan_to_num(needed), 0.0), 0.0)
    smoothed = behind(brake, motion.rate, lag)
    last = row_before(motion, time)
    held = smoothed[last] if forward else np.interp(time, motion.time, smoothed)
    return np.asarray(held > TRAIL * weight)
