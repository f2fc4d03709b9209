"""Motion, engine speed and gear at the instants of the force samples."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from weighbridge.balance.averaging import WINDOW
from weighbridge.constants import GRAVITY
from weighbridge.kernels.first_order import even_lag
from weighbridge.kernels.interpolation import mixed, shares
from weighbridge.kernels.lowpass import lowpass_even
from weighbridge.limits import LOCKED
from weighbridge.navigation import BY_SPEED, Motion
from weighbridge.navigation.motion import nearest_row, row_before
from weighbridge.signals import Bools, Drive, Floats, Ints, Signal
from weighbridge.signals.runs import marked_runs
from weighbridge.vehicle import (
    Vehicle,
    effective_gearing,
    find_engine_delay,
    number_reported_gears,
    predict_gear,
    reported_gear_numbers,
    shifting,
    source_of,
)
from weighbridge.vehicle.gear import spin_rate

SLOWEST_GEARED: Final = 1.5
"""Below this speed gears, slip and torque are not separated [m/s]."""

BEYOND_RANGE: Final = 1.03
"""A gearing beyond those of a stepless gearbox by this factor is a slip, or an engine that is not
coupled [-]."""

TYRE_SLIP: Final = 0.08
"""Slip of the driven wheels over the specific force, in g [-]: traction over load is 15 to 30 times
the slip, and half of the load is on driven wheels (Gillespie, Fundamentals of Vehicle Dynamics,
1992, ch. 10)."""

SHIFT_MARGIN: Final = 0.4
"""Samples nearer than this to a change of gear are left out [s]."""

WIND_AT_VEHICLE: Final = 0.5
"""Wind at a vehicle over the wind reported at 10 m [-]: logarithmic profile down to 1 m
over a roughness length of 0.1 m, ln(1 / 0.1) / ln(10 / 0.1) (Stull, An Introduction to
Boundary Layer Meteorology, 1988, ch. 9)."""

BREAK: Final = 1.5
"""Rows of a motion further apart, over their period, have a silence between them [-]."""

BAND: Final = 0.8
"""Edge of what the mean of a window of a heavy vehicle keeps [Hz]: in four drives of two trucks a
sixth of the specific force is above it, and nine tenths of the error of one sample (RMS). With 0.6
to 1.2 Hz the masses of six trucks scatter alike. Of the corpus it changes 60 undamaged pairs of
trucks and buses, from 4.20 to 3.84 % RMS. For cars at 1 Hz it is no gain: 1.2 to 1.7 % RMS
in eight drives of another simulator."""

ENOUGH_ROWS: Final = 16
"""So many rows of a window average a vibration themselves, see
`weighbridge.estimators.joint.slow_errors.MOTION_SHARE`."""

REACH: Final = 0.45
"""Seconds of the motion on either side of a row by which it is known; what goes forward with a
drive waits as long. With 1.0 or 1.25 s seven trucks in seven equipments scatter as much."""

_FORGOTTEN: Final = 2.0
"""Time constants after which a first-order lag has forgotten a gap that a line bridges [-]."""

_LONG_GAP: Final = 0.5
"""Across less a line is near to what was not seen [s]."""


def lagged_motion(motion: Motion, lag: float, before: Motion | None = None) -> Motion:
    """Pass what the force side is compared with through a first-order lag.

    Parameters
    ----------
    motion
    lag : [s]
    before : what this made of earlier rows, some of which ``motion`` still has, to go on from;
        None to begin anew
    """
    if lag <= 0.0:
        return motion
    return replace(
        motion,
        valid=_valid_lagged(motion.valid, motion.rate, lag),
        specific_force=_lagged(motion, "specific_force", lag, before),
        accel=_lagged(motion, "accel", lag, before),
        grade=_lagged(motion, "grade", lag, before),
    )


def in_band(motion: Motion, vehicle: Vehicle, period: float) -> Motion:
    """Take off the vibration of a heavy vehicle that the mean of a window does not keep.

    A window has few samples of a torque that comes slowly, and a vibration at their instants is
    noise of the motion, which makes every mass too low. The mean of all samples around an instant
    has less of it, and keeps the starts and hills that weigh. The slope of a smoothed speed is such
    a mean already. A car changes its force within half a second, which a mean would lose.

    Parameters
    ----------
    motion, vehicle
    period : between samples of the torque [s]

    References
    ----------
    Noise of a regressor: Fuller, Measurement Error Models, 1987, ch. 1; windowed ideal low-pass:
    Oppenheim and Schafer, Discrete-Time Signal Processing, 2010, ch. 7.5.
    """
    heavy = vehicle.of_class.underpowered
    if motion.source in BY_SPEED or not heavy or period < WINDOW / ENOUGH_ROWS:
        return motion
    columns = (motion.specific_force, motion.accel, motion.grade)
    values = np.column_stack([np.nan_to_num(column) for column in columns])
    anew = np.concatenate(([False], _silent(motion)))
    # A row lies between two of the motion.
    share, reach = BAND / motion.rate, max(round(REACH * motion.rate) - 1, 0)
    slow = lowpass_even(values, motion.valid, anew, share, reach)
    force, accel, grade = (
        np.where(motion.valid, x, y) for x, y in zip(slow.T, columns, strict=True)
    )
    return replace(motion, specific_force=force, accel=accel, grade=grade)


def _silent(motion: Motion) -> Bools:
    """Between which rows nothing came (n - 1,)."""
    return np.asarray(np.diff(motion.time) * motion.rate > BREAK)


def _lagged(motion: Motion, name: str, lag: float, before: Motion | None) -> Floats:
    """One column (n,) of `lagged_motion`; it begins anew where the motion does."""
    values, known = getattr(motion, name), 0
    found = np.empty(values.size)
    if before is not None and before.time[-1] >= motion.time[0]:
        known = int(np.searchsorted(motion.time, before.time[-1], side="right"))
        found[:known] = getattr(before, name)[before.time.size - known :]
    silent = _silent(motion)
    anew = np.flatnonzero(silent) + 1
    for first, last in itertools.pairwise((known, *anew[anew > known], values.size)):
        # Where no row is new, there is none to begin with.
        goes_on = 0 < first < values.size and not silent[first - 1]
        start = found[first - 1] if goes_on else None
        found[first:last] = behind(values[first:last], motion.rate, lag, start)
    return found


def _valid_lagged(valid: Bools, rate: float, lag: float) -> Bools:
    """Take out what follows long gaps, too, as long as a lag passes on what was not seen there."""
    starts, ends = marked_runs(~valid)
    long = ends - starts > _LONG_GAP * rate
    change = np.zeros(valid.size + 1, dtype=np.int64)
    np.add.at(change, ends[long], 1)
    np.add.at(change, np.minimum(ends[long] + round(_FORGOTTEN * lag * rate), valid.size), -1)
    return np.asarray(valid & (np.cumsum(change)[:-1] == 0))


def behind(values: Floats, rate: float, lag: float, start: float | None = None) -> Floats:
    """Pass even samples (n,) at ``rate`` [Hz] through a first-order lag [s].

    ``start`` is what came out before the first; that sample itself when None.
    """
    if not values.size:
        return values
    keep = float(np.exp(-1.0 / (rate * lag)))
    start = values[0] if start is None else start
    return np.asarray(even_lag(np.ascontiguousarray(values), keep, float(start)))


def interpolate_motion(motion: Motion, time: Floats) -> dict[str, Floats]:
    """Interpolate the motion to the instants ``time``; NaN outside."""
    row = row_before(motion, time)
    share = shares(time, motion.time, row, BREAK / motion.rate)
    rows: dict[str, Floats] = {
        name: mixed(np.asarray(getattr(motion, name), dtype=np.float64), row, share)
        for name in ("speed", "accel", "specific_force", "grade", "pitch", "altitude", "valid")
    }
    outside = np.isnan(share)
    rows["valid"][outside] = 0.0
    rows["heading"] = np.where(outside, np.nan, motion.heading[nearest_row(motion, time)])
    return rows


def identify_engine_delay(drive: Drive, vehicle: Vehicle, motion: Motion) -> float:
    """Find how late the engine speed of a drive is, as late as vehicle speed if unseen [s]."""
    signal = drive.get("engine_speed")
    gearings = np.array(vehicle.driveline.gearings)
    unseen = signal is None or not len(signal) or gearings.size < 2
    if signal is None or unseen or source_of(vehicle).gearing is not None:
        return motion.speed_delay
    seen = (motion.time, motion.speed)
    return find_engine_delay(signal.time, signal.values, seen, gearings, motion.speed_delay)


def engine_speed_at(drive: Drive, vehicle: Vehicle, recorded: Floats, speed: Floats) -> Floats:
    """Engine speed at the stamps it was recorded with."""
    if source_of(vehicle).gearing is not None:
        return speed * vehicle.driveline.gearings[0]
    signal = drive.get("engine_speed")
    if signal is not None and len(signal):
        near = signal.age(recorded) <= 3.0 * signal.period
        return np.where(near, signal.at(recorded), np.nan)
    if vehicle.driveline.single_speed:
        return speed * vehicle.driveline.gearings[0]
    return np.full(speed.size, np.nan)


def ratio_rate(
    drive: Drive, stamps: Floats, engine_speed: Floats, speed: Floats, accel: Floats
) -> Floats:
    """How fast the logarithm of engine over vehicle speed rises (n,) [1/s].

    Parameters
    ----------
    drive : with engine_speed
    stamps : (n,) those of its engine speed [s]
    engine_speed, speed, accel : (n,) there [rad/s], [m/s], [m/s^2]
    """
    turning, moving = engine_speed > 0.0, speed > SLOWEST_GEARED
    known = turning & moving
    spun = spin_rate(drive.signals["engine_speed"], stamps)
    faster = spun / np.where(known, engine_speed, 1.0)
    return np.where(known, faster - accel / np.where(known, speed, 1.0), np.nan)


def identify_reported_gears(
    drive: Drive, vehicle: Vehicle, recorded: Floats, engine_speed: Floats, speed: Floats
) -> Mapping[int, int]:
    """Find which gears of the vehicle file are those that the gearbox reports."""
    measured = drive.get("gear")
    if measured is None or not len(measured) or len(vehicle.driveline.gearings) < 2:
        return {}
    reported = np.nan_to_num(measured.held(recorded)).astype(np.int64)
    ratio = effective_gearing(engine_speed, speed)
    return reported_gear_numbers(reported, ratio, np.array(vehicle.driveline.gearings))


def gears_at(
    drive: Drive,
    vehicle: Vehicle,
    recorded: Floats,
    engine_speed: Floats,
    speed: Floats,
    numbers: Mapping[int, int],
) -> tuple[Ints, Floats, Bools]:
    """Gear, gearing and whether the clutch slips, from the best source there is.

    ``numbers`` are those of `identify_reported_gears`.
    """
    gearings = np.array(vehicle.driveline.gearings)
    if gearings.size == 1:
        gear = np.ones(recorded.size, dtype=np.int64)
        return gear, np.full(recorded.size, gearings[0]), np.zeros(recorded.size, dtype=bool)
    if gearings.size == 0:
        # Without known ratios the ratio of the moment is the best there is.
        moving = (speed > SLOWEST_GEARED) & (engine_speed != 0.0)
        ratio = np.where(moving, engine_speed / np.where(moving, speed, 1.0), np.nan)
        slipping = np.zeros(recorded.size, dtype=bool)
        if vehicle.driveline.gearing_range is not None:
            low, high = vehicle.driveline.gearing_range
            inside = (ratio > low / BEYOND_RANGE) & (ratio < high * BEYOND_RANGE)
            slipping = (speed < LOCKED) | ~inside
        return np.zeros(recorded.size, dtype=np.int64), ratio, slipping
    gear, mismatch = predict_gear(engine_speed, speed, gearings)
    measured: Signal | None = drive.get("gear")
    if measured is not None and len(measured):
        reported = np.nan_to_num(measured.held(recorded)).astype(np.int64)
        gear = number_reported_gears(reported, numbers)
        mismatch = np.where(
            gear > 0,
            engine_speed / np.maximum(speed, SLOWEST_GEARED) / gearings[np.maximum(gear, 1) - 1]
            - 1.0,
            mismatch,
        )
    clutch = drive.get("clutch_switch")
    pressed = clutch.held(recorded) > 0.5 if clutch is not None else np.zeros(gear.size, bool)
    slipping = (gear == 0) | pressed | (np.abs(np.nan_to_num(mismatch)) > 0.06)
    gearing = np.where(gear > 0, gearings[np.maximum(gear, 1) - 1], np.nan)
    return gear, gearing, slipping


@dataclass(frozen=True, slots=True, kw_only=True)
class Instants:
    """Motion, engine speed and gear at the instants of the force samples.

    Attributes
    ----------
    columns : of `weighbridge.balance.table.ForceTable` that depend on neither torque nor air (n,)
    altitude : (n,) [m]; NaN where unknown
    known : (n,) the motion is known
    slipping : (n,) the clutch slips
    changing : (n,) the gear changes soon or has just changed
    numbers : of `identify_reported_gears`
    engine_delay : of `identify_engine_delay` [s]
    """

    columns: dict[str, Any]
    altitude: Floats
    known: Bools
    slipping: Bools
    changing: Bools
    numbers: Mapping[int, int]
    engine_delay: float


def read_instants(
    drive: Drive,
    vehicle: Vehicle,
    motion: Motion,
    recorded: Floats,
    delay: float,
    numbers: Mapping[int, int] | None = None,
    engine_delay: float | None = None,
    *,
    ahead: float = math.inf,
) -> Instants:
    """Read a motion, smoothed as the torque is, where a delay puts the force samples.

    Parameters
    ----------
    drive, vehicle, motion
    recorded : (n,) stamps of the torque [s]
    delay : by which they are late [s]
    numbers : of `identify_reported_gears`; found from this drive when None
    engine_delay : of `identify_engine_delay`; found from this drive when None [s]
    ahead : how far past a row others may show it [s]
    """
    time = recorded - delay
    rows = interpolate_motion(motion, time)
    speed = rows["speed"]
    if engine_delay is None:
        engine_delay = identify_engine_delay(drive, vehicle, motion)
    # A ratio that moves is that of the instant at which the torque was read: both make power.
    stepless = vehicle.driveline.stepless
    read_at = recorded if stepless else time + engine_delay
    engine_speed = engine_speed_at(drive, vehicle, read_at, speed)
    if numbers is None:
        numbers = identify_reported_gears(drive, vehicle, recorded, engine_speed, speed)
    gear, gearing, slipping = gears_at(drive, vehicle, recorded, engine_speed, speed, numbers)
    if stepless:
        # Wheels that pull turn faster than they roll, which is no gearing.
        gearing = gearing / (1.0 + TYRE_SLIP * np.maximum(rows["specific_force"], 0.0) / GRAVITY)
    over = source_of(vehicle).over_speed
    if over is not None:
        # What is left of a power over a late and rounded speed is the force at the true one.
        gearing = gearing * over(drive, recorded) / np.where(speed > SLOWEST_GEARED, speed, np.nan)
    changing = shifting(time, gear, margin=SHIFT_MARGIN, ahead=ahead)
    if vehicle.driveline.single_speed:
        changing[:] = False
    rate = None
    if stepless:
        rate = ratio_rate(drive, read_at, engine_speed, speed, rows["accel"])
    moved = ("speed", "accel", "specific_force", "grade", "pitch", "heading")
    return Instants(
        columns={
            "time": time,
            "engine_speed": engine_speed,
            "gear": gear,
            "gearing": gearing,
            "ratio_rate": rate,
            "air_speed": speed + headwind(drive, rows["heading"]),
            **{name: rows[name] for name in moved},
        },
        altitude=rows["altitude"],
        known=np.asarray(rows["valid"] > 0.99),
        slipping=slipping,
        changing=changing,
        numbers=numbers,
        engine_delay=engine_delay,
    )


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
