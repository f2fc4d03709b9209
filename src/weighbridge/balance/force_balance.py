"""The waist: forces on one side, motion on the other, and what may be used of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from weighbridge.balance.coarse import coarse_note, coarse_std
from weighbridge.balance.cornering import cornering
from weighbridge.balance.foot import find_foot, learn_dragged, near
from weighbridge.constants import (
    GAS_CONSTANT_DRY_AIR,
    GRAVITY,
    STANDARD_PRESSURE,
    STANDARD_TEMPERATURE,
)
from weighbridge.navigation.motion import BY_SPEED, Motion
from weighbridge.signals import Bools, Drive, Floats, Ints, Signal
from weighbridge.signals.runs import marked_runs
from weighbridge.vehicle.air import air_density
from weighbridge.vehicle.data_sheet import wheel_share
from weighbridge.vehicle.fuel import fuel_burnt
from weighbridge.vehicle.gear import (
    effective_gearing,
    number_told_gears,
    predict_gear,
    shifting,
)
from weighbridge.vehicle.model import DraggedReading, Vehicle
from weighbridge.vehicle.torque import engine_torque, source_of, source_signal


class Reason(IntEnum):
    """Why a sample is not usable; 0 where it is."""

    USED = 0
    STANDING = 1
    NO_MOTION = 2
    NO_TORQUE = 3
    BRAKING = 4
    SHIFTING = 5
    CLUTCH_SLIPPING = 6
    OVERRUN = 7
    EXTRAPOLATED = 8
    NOT_ACCELERATING = 9
    BAD_FIT = 10
    TOO_SHORT = 11
    CORNERING = 12

    @property
    def text(self) -> str:
        """The reason in words."""
        return REASON_TEXT[self]


REASON_TEXT: Final[dict[Reason, str]] = {
    Reason.USED: "",
    Reason.STANDING: "standing",
    Reason.NO_MOTION: "no motion data",
    Reason.NO_TORQUE: "no torque data",
    Reason.BRAKING: "braking",
    Reason.SHIFTING: "shifting",
    Reason.CLUTCH_SLIPPING: "clutch slipping",
    Reason.OVERRUN: "overrun",
    Reason.EXTRAPOLATED: "outside torque model",
    Reason.NOT_ACCELERATING: "not accelerating",
    Reason.BAD_FIT: "bad fit",
    Reason.TOO_SHORT: "too short a stretch",
    Reason.CORNERING: "cornering hard",
}
"""Every reason as tables and reports print it."""

SLOWEST: Final = 1.5
"""Below this speed gears, slip and torque are not told apart [m/s]."""

SHIFT_MARGIN: Final = 0.4
"""Samples nearer than this to a change of gear are left out [s]."""

WIND_AT_VEHICLE: Final = 0.5
"""Wind at a vehicle over the wind reported at 10 m [-]: logarithmic profile down to 1 m
over a roughness length of 0.1 m, ln(1 / 0.1) / ln(10 / 0.1) (Stull, An Introduction to
Boundary Layer Meteorology, 1988, ch. 9)."""

BRAKING_FORCE: Final = 0.06
"""Braking force over weight that marks unseen braking [-]."""

SWITCH_MARGIN: Final = 0.3
"""Samples nearer than this to a pressed brake switch may be braked [s]."""

HARD_BRAKING: Final = 0.15
"""Braking force over weight that no retarder makes: a brake switch is on there [-]."""

SWITCH_ROWS: Final = 20
"""Rows of hard braking that tell whether a brake switch can be believed."""

SWITCH_MISSES: Final = 0.2
"""Part of them with the switch off from which it is not believed [-]; true ones miss none."""

SWITCH_DEAD: Final = (
    "the brake switch is off in much of the hard braking: it is not connected, late or of another "
    "drive, and is not used; check brake_switch, or leave its column out"
)

TRAIL: Final = 0.0015
"""Braking force over weight that smoothing may still hold of a brake let go [-]."""

SLOWED: Final = 0.005
"""Force over weight that slows a vehicle as a dragged engine does, or a light brake [-]."""

SLOWS: Final = 0.02
"""Part of the moving rows in which a vehicle slows that is braked now and then [-]."""

BRAKE_HIDDEN: Final = (
    "nothing tells when the brake is on: there is no brake switch and no accelerator position, "
    "and the torque source never rests on the lowest reading of a dragged engine; light "
    "braking then counts as load, and the mass may be some percent off; record brake switch or "
    "accelerator position"
)

FILLED_TIME: Final = 10.0
"""A fast reading that runs straight for so long was filled in, not measured [s]."""

FINE: Final = 1e-3
"""Steps of a reading over its range, above which it may well stay on one step for long [-]."""

FILLED_RATE: Final = 5.0
"""Slower readings may well be constant for long [Hz]."""

RETARDING: Final = -0.005
"""Retarder torque over its reference below which it brakes [-]; SPN 520 has steps of 1 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSide:
    """Traction at the instants it was computed in the vehicle.

    Attributes
    ----------
    time : (n,) instants, delay taken off, rising [s]
    traction_force : (n,) at the wheels, before the rotating parts are
        accelerated [N]; NaN without torque
    torque : (n,) of engine or motor [N m]
    engine_speed : (n,) [rad/s]
    gear : (n,) 1..n, 0 for none
    gearing : (n,) [1/m]; NaN without a gear
    reason : (n,) `Reason` why a sample is not usable
    delay : taken off the stamps [s]
    noise_std : of the traction force in the middle gear [N]; NaN if unknown
    """

    time: Floats
    traction_force: Floats
    torque: Floats
    engine_speed: Floats
    gear: Ints
    gearing: Floats
    reason: NDArray[np.uint8]
    delay: float
    noise_std: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MergedView:
    """One row per force sample, for the published methods.

    Attributes
    ----------
    time : (n,) [s]
    traction_force : (n,) [N]
    speed, accel, specific_force, grade, pitch, heading : (n,) of `Motion`
    gear : (n,)
    gearing : (n,) [1/m]
    rotating_mass : (n,) I_w / r^2 + I_e G^2 [kg]
    air_speed : (n,) against the air, with the reported wind [m/s]
    drag_force : (n,) in still air, or in the wind that ``drive.toml`` reports [N]
    air_density : (n,) [kg/m^3]
    fuel_burnt : (n,) since the first row, as far as the drive tells [kg]
    reason : (n,) `Reason`
    """

    time: Floats
    traction_force: Floats
    speed: Floats
    accel: Floats
    specific_force: Floats
    grade: Floats
    pitch: Floats
    heading: Floats
    gear: Ints
    gearing: Floats
    rotating_mass: Floats
    air_speed: Floats
    drag_force: Floats
    air_density: Floats
    fuel_burnt: Floats
    reason: NDArray[np.uint8]

    @property
    def usable(self) -> Bools:
        """Rows without a reason against them."""
        return np.asarray(self.reason == Reason.USED)

    @property
    def dynamic_pressure(self) -> Floats:
        """Of the air against the vehicle (n,), which times C_d A is the drag [Pa]."""
        return 0.5 * self.air_density * self.air_speed * np.abs(self.air_speed)

    @property
    def direction(self) -> tuple[Floats, Floats]:
        """North and east part of the direction driven (n,) [-]; zero where it is unknown."""
        known = np.isfinite(self.heading)
        heading = np.where(known, self.heading, 0.0)
        return np.where(known, np.cos(heading), 0.0), np.where(known, np.sin(heading), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceBalance:
    """Both sides of Newton's law along the road, and their merged view.

    Attributes
    ----------
    force, motion, merged
    brake_hidden : the vehicle slows, and no switch, accelerator or floor of the reading tells
        where it is braked
    switch_dead : the brake switch contradicts the motion and is not used
    coarse_std : what steps of the torque's reading leave open, relative to the mass [-]
    """

    force: ForceSide
    motion: Motion
    merged: MergedView
    brake_hidden: bool = False
    switch_dead: bool = False
    coarse_std: float = 0.0

    @property
    def notes(self) -> tuple[str, ...]:
        """What is doubted, one sentence each."""
        told = ((BRAKE_HIDDEN, self.brake_hidden), (SWITCH_DEAD, self.switch_dead))
        return tuple(text for text, so in told if so) + coarse_note(self.coarse_std)


def force_balance(
    drive: Drive,
    vehicle: Vehicle,
    motion: Motion,
    *,
    delay: float | None = None,
    lag: float | None = None,
    signed: bool = True,
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

    Raises
    ------
    DriveError
        The drive lacks what the vehicle's torque source needs.
    """
    source = source_signal(drive, vehicle)
    if delay is None:
        delay = vehicle.timing.torque_delay or 0.0
    recorded = source.time
    time = recorded - delay
    lag = vehicle.timing.torque_lag if lag is None else lag
    rows = _motion_at(smoothed(motion, lag), time)
    driveline, road = vehicle.driveline, vehicle.road

    engine_speed = _engine_speed(drive, vehicle, time + motion.speed_delay, rows["speed"])
    gear, gearing, slipping = _gears(drive, vehicle, recorded, engine_speed, rows["speed"])
    torque = engine_torque(drive, vehicle, engine_speed, recorded)
    traction = wheel_share(vehicle, torque.torque) * torque.torque * gearing
    density = air_density(drive, time, rows["altitude"])
    rotating = (
        road.wheel_inertia.value / driveline.wheel_radius**2
        + road.engine_inertia.value * gearing**2
    )
    air_speed = rows["speed"] + headwind(drive, rows["heading"])
    drag = 0.5 * density * vehicle.road.drag_area.value * air_speed * np.abs(air_speed)

    signed = signed and source_of(vehicle).signed
    needed, weight = _needed_force(vehicle, rows["specific_force"], drag, rotating)
    pressed = brake_pressed(drive, recorded)
    dead = pressed is not None and _misses(pressed, rows, traction, needed, weight)
    pressed = None if dead else pressed
    told = np.nan if motion.source in BY_SPEED else 1.0
    foot = find_foot(drive, vehicle, source, told * needed / weight, told * needed / gearing)
    # What a dragged engine takes is told by a torque alone, and by none where a foot may brake.
    overrun = np.zeros_like(foot.off) if signed and pressed is not None else foot.off
    slowed = foot.off if pressed is None else pressed
    trailing = _trailing(vehicle, motion, time, slowed, traction if signed else None, lag)

    # The first reason that applies is the one told, so the order matters.
    reason = np.zeros(time.size, dtype=np.uint8)
    fresh = source.age(recorded) <= 3.0 * source.period
    changing = shifting(time, gear, margin=SHIFT_MARGIN)
    if driveline.single_speed:
        changing[:] = False
    braking = _braking(drive, recorded, traction, needed, weight, pressed)
    for flag, why in (
        (~(rows["valid"] > 0.99) | ~np.isfinite(rows["speed"]), Reason.NO_MOTION),
        (rows["speed"] < SLOWEST, Reason.STANDING),
        (braking, Reason.BRAKING),
        (changing, Reason.SHIFTING),
        (slipping, Reason.CLUTCH_SLIPPING),
        (~np.isfinite(traction) | ~fresh | filled(source, recorded), Reason.NO_TORQUE),
        (torque.overrun | overrun | trailing, Reason.OVERRUN),
        (torque.extrapolated, Reason.EXTRAPOLATED),
        (cornering(motion, time), Reason.CORNERING),
    ):
        reason[(reason == 0) & flag] = why

    slows = (needed < -SLOWED * weight)[rows["speed"] > SLOWEST]
    hidden = pressed is None and not foot.told and slows.size and slows.mean() > SLOWS
    noise = vehicle.torque.noise
    middle = np.nanmedian(gearing) if np.isfinite(gearing).any() else np.nan
    return ForceBalance(
        force=ForceSide(
            time=time,
            traction_force=traction,
            torque=torque.torque,
            engine_speed=engine_speed,
            gear=gear,
            gearing=gearing,
            reason=reason,
            delay=delay,
            noise_std=float(noise * middle) if noise is not None else float("nan"),
        ),
        motion=motion,
        merged=MergedView(
            time=time,
            traction_force=traction,
            speed=rows["speed"],
            accel=rows["accel"],
            specific_force=rows["specific_force"],
            grade=rows["grade"],
            pitch=rows["pitch"],
            heading=rows["heading"],
            gear=gear,
            gearing=gearing,
            rotating_mass=rotating,
            air_speed=air_speed,
            drag_force=drag,
            air_density=density,
            fuel_burnt=fuel_burnt(drive, vehicle, recorded, torque.torque, engine_speed),
            reason=reason,
        ),
        brake_hidden=bool(hidden),
        switch_dead=dead,
        coarse_std=coarse_std(source, source.at(recorded), reason == Reason.USED),
    )


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
        rows = _motion_at(smoothed(motion, vehicle.timing.torque_lag), time)
        density = air_density(drive, time, rows["altitude"])
        drag = 0.5 * density * vehicle.road.drag_area.value * rows["speed"] ** 2
        needed, weight = _needed_force(vehicle, rows["specific_force"], drag)
        sources.append(source)
        needs.append(np.full_like(needed, np.nan) if motion.source in BY_SPEED else needed / weight)
    return learn_dragged(drives, sources, needs)


def filled(signal: Signal, time: Floats) -> Bools:
    """Where a signal holds one value or runs straight for longer than a real one does.

    Loggers and makers of data sets fill gaps so, and the fill looks like data.

    Parameters
    ----------
    signal : sampled faster than `FILLED_RATE` and in steps below `FINE`, else nothing is said
    time : (n,) instants asked about [s]

    Returns
    -------
    (n,)
    """
    values = signal.values
    least = int(FILLED_TIME / signal.period) if len(signal) > 2 else 0
    if len(signal) < 3 or signal.period > 1.0 / FILLED_RATE or values.size <= least:
        return np.zeros(time.size, dtype=bool)
    steps = np.abs(np.diff(values))
    step = float(steps[steps > 0.0].min(initial=np.inf))
    if not step < FINE * float(np.ptp(values)):
        return np.zeros(time.size, dtype=bool)
    # Rounding lets a straight line bend by one step of the reading.
    tolerance = 1.01 * step
    straight = np.concatenate(([False], np.abs(np.diff(values, 2)) <= tolerance, [False]))
    # Idling and coasting read a constant zero for long, recuperation its limit.
    straight &= ~np.isin(values, (0.0, np.nanmin(values)))
    runs = np.zeros(values.size, dtype=bool)
    for begin, end in zip(*marked_runs(straight), strict=True):
        if end - begin >= least:
            runs[begin:end] = True
    index = np.clip(np.searchsorted(signal.time, time), 0, values.size - 1)
    return np.asarray(runs[index])


def headwind(drive: Drive, heading: Floats) -> Floats:
    """Wind against the vehicle by the weather report of the drive.

    Parameters
    ----------
    drive : with ``wind_speed`` and ``wind_from`` in its info, else there is none
    heading : (n,) of the vehicle [rad]; NaN where unknown

    Returns
    -------
    (n,) positive from ahead [m/s]
    """
    speed, direction = drive.info.wind_speed, drive.info.wind_from
    if not speed or direction is None:
        return np.zeros_like(heading)
    along = WIND_AT_VEHICLE * speed * np.cos(direction - heading)
    return np.asarray(np.where(np.isfinite(along), along, 0.0))


_FORGOTTEN: Final = 2.0
"""Time constants after which a first-order lag has forgotten a gap that a line bridges [-]."""

_LONG_GAP: Final = 0.5
"""Across less a line is near to what was not seen [s]."""


def smoothed(motion: Motion, lag: float) -> Motion:
    """Pass what the force side is compared with through a first-order lag [s]."""
    if lag <= 0.0:
        return motion
    return replace(
        motion,
        valid=_settled(motion.valid, motion.rate, lag),
        specific_force=behind(motion.specific_force, motion.rate, lag),
        accel=behind(motion.accel, motion.rate, lag),
        grade=behind(motion.grade, motion.rate, lag),
    )


def _settled(valid: Bools, rate: float, lag: float) -> Bools:
    """Take out what follows long gaps, too, as long as a lag passes on what was not seen there."""
    starts, ends = marked_runs(~valid)
    long = ends - starts > _LONG_GAP * rate
    change = np.zeros(valid.size + 1, dtype=np.int64)
    np.add.at(change, ends[long], 1)
    np.add.at(change, np.minimum(ends[long] + round(_FORGOTTEN * lag * rate), valid.size), -1)
    return np.asarray(valid & (np.cumsum(change)[:-1] == 0))


def behind(values: Floats, rate: float, lag: float) -> Floats:
    """Pass even samples (n,) at ``rate`` [Hz] through a first-order lag [s]."""
    keep = float(np.exp(-1.0 / (rate * lag)))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])[0])


def _motion_at(motion: Motion, time: Floats) -> dict[str, Floats]:
    """Interpolate the motion to the instants ``time``; NaN outside."""
    rate = motion.rate
    position = (time - motion.time[0]) * rate
    inside = (position >= 0.0) & (position <= motion.time.size - 1)
    index = np.clip(position.astype(np.int64), 0, motion.time.size - 2)
    part = np.clip(position - index, 0.0, 1.0)
    rows: dict[str, Floats] = {}
    for name in ("speed", "accel", "specific_force", "grade", "pitch", "altitude", "valid"):
        values = np.asarray(getattr(motion, name), dtype=np.float64)
        mixed = values[index] + part * (values[index + 1] - values[index])
        rows[name] = np.where(inside, mixed, np.nan)
    rows["valid"] = np.where(inside, rows["valid"], 0.0)
    nearest = np.clip(np.rint(position).astype(np.int64), 0, motion.time.size - 1)
    rows["heading"] = np.where(inside, motion.heading[nearest], np.nan)
    return rows


def _engine_speed(drive: Drive, vehicle: Vehicle, recorded: Floats, speed: Floats) -> Floats:
    """Engine speed at the stamps it was recorded with: it is as late as vehicle speed."""
    if source_of(vehicle).gearing is not None:
        return speed * vehicle.driveline.gearings[0]
    signal = drive.get("engine_speed")
    if signal is not None and len(signal):
        near = signal.age(recorded) <= 3.0 * signal.period
        return np.where(near, signal.at(recorded), np.nan)
    if vehicle.driveline.single_speed:
        return speed * vehicle.driveline.gearings[0]
    return np.full(speed.size, np.nan)


def _gears(
    drive: Drive, vehicle: Vehicle, recorded: Floats, engine_speed: Floats, speed: Floats
) -> tuple[Ints, Floats, Bools]:
    """Gear, gearing and whether the clutch slips, from the best source there is."""
    gearings = np.array(vehicle.driveline.gearings)
    if gearings.size == 1:
        gear = np.ones(recorded.size, dtype=np.int64)
        return gear, np.full(recorded.size, gearings[0]), np.zeros(recorded.size, dtype=bool)
    if gearings.size == 0:
        # Without known ratios the ratio of the moment is the best there is.
        moving = speed > SLOWEST
        ratio = np.where(moving, engine_speed / np.where(moving, speed, 1.0), np.nan)
        return np.zeros(recorded.size, dtype=np.int64), ratio, np.zeros(recorded.size, dtype=bool)
    gear, mismatch = predict_gear(engine_speed, speed, gearings)
    measured: Signal | None = drive.get("gear")
    if measured is not None and len(measured):
        told = np.nan_to_num(measured.held(recorded)).astype(np.int64)
        gear = number_told_gears(told, effective_gearing(engine_speed, speed), gearings)
        mismatch = np.where(
            gear > 0,
            engine_speed / np.maximum(speed, SLOWEST) / gearings[np.maximum(gear, 1) - 1] - 1.0,
            mismatch,
        )
    clutch = drive.get("clutch_switch")
    pressed = clutch.held(recorded) > 0.5 if clutch is not None else np.zeros(gear.size, bool)
    slipping = (gear == 0) | pressed | (np.abs(np.nan_to_num(mismatch)) > 0.06)
    gearing = np.where(gear > 0, gearings[np.maximum(gear, 1) - 1], np.nan)
    return gear, gearing, slipping


def _needed_force(
    vehicle: Vehicle, specific_force: Floats, drag: Floats, rotating: Floats | float = 0.0
) -> tuple[Floats, float]:
    """Force at the wheels (n,) that the motion takes, and the weight it is told for [N].

    Its sign hangs on the mass through the drag alone. The largest mass known is the
    cautious one: drag explains least of how a heavy vehicle slows down.
    """
    mass = max(vehicle.provenance.masses, default=vehicle.tare or vehicle.of_class.typical_mass)
    rolling = vehicle.road.rolling_coefficient.value * GRAVITY
    needed = (mass + np.nan_to_num(rotating)) * specific_force + mass * rolling + drag
    return np.asarray(needed), mass * GRAVITY


def _trailing(
    vehicle: Vehicle,
    motion: Motion,
    time: Floats,
    slowed: Bools,
    traction: Floats | None,
    lag: float,
) -> Bools:
    """Where the smoothed motion still holds the force of a brake that was let go (n,).

    Parameters
    ----------
    vehicle, motion
    time : (n,) instants of the torque [s]
    slowed : (n,) where the brake may work
    traction : (n,) of a torque that tells what a dragged engine takes [N]; None for none
    lag : time constant of the smoothing [s]
    """
    if lag <= 0.0 or not slowed.any():
        return np.zeros(time.size, dtype=bool)
    nearest = np.clip(np.searchsorted(time, motion.time), 0, time.size - 1)
    density = STANDARD_PRESSURE / (GAS_CONSTANT_DRY_AIR * STANDARD_TEMPERATURE)
    drag = 0.5 * density * vehicle.road.drag_area.value * motion.speed**2
    needed, weight = _needed_force(vehicle, motion.specific_force, drag)
    dragged = np.minimum(np.nan_to_num(traction), 0.0)[nearest] if traction is not None else 0.0
    brake = np.where(slowed[nearest], np.maximum(dragged - np.nan_to_num(needed), 0.0), 0.0)
    held = np.interp(time, motion.time, behind(brake, motion.rate, lag))
    return np.asarray(held > TRAIL * weight)


def brake_pressed(drive: Drive, recorded: Floats) -> Bools | None:
    """Where the brake switch is on, or nearly (n,); None without a switch."""
    switch = drive.get("brake_switch")
    if switch is None or not len(switch):
        return None
    on = switch.values > 0.5
    return (switch.held(recorded) > 0.5) | near(switch.time, on, recorded, SWITCH_MARGIN)


def _misses(
    pressed: Bools, rows: dict[str, Floats], traction: Floats, needed: Floats, weight: float
) -> bool:
    """Whether a brake switch is off in much of the hard braking."""
    beyond = needed - np.minimum(np.nan_to_num(traction), 0.0)
    moving = (rows["valid"] > 0.99) & (rows["speed"] > SLOWEST)
    hard = moving & (np.nan_to_num(beyond) < -HARD_BRAKING * weight)
    count = np.count_nonzero(hard)
    return bool(count >= SWITCH_ROWS and np.mean(~pressed[hard]) > SWITCH_MISSES)


def _braking(
    drive: Drive,
    recorded: Floats,
    traction: Floats,
    needed: Floats,
    weight: float,
    pressed: Bools | None,
) -> Bools:
    """Where brake or retarder work, or the vehicle slows more than its torque explains."""
    retarder = drive.get("retarder_torque")
    retarding = np.zeros(recorded.size, dtype=bool)
    if retarder is not None and len(retarder):
        retarding = np.nan_to_num(retarder.held(recorded)) < RETARDING
    if pressed is not None:
        return np.asarray(retarding | pressed)
    # Unseen braking: what slows the vehicle is far more than engine, drag and
    # rolling can, whatever the mass within reason.
    force = np.where(np.isfinite(traction), traction, 0.0)
    unseen = needed - np.minimum(force, 0.0) < -BRAKING_FORCE * weight
    return np.asarray(retarding | unseen)
