"""Torque of engine or motor from what a drive recorded."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.messages import Problem, refused
from weighbridge.signals import Bools, Drive, Floats, Signal, moving_mean
from weighbridge.vehicle.air import Air
from weighbridge.vehicle.force_sources import battery_use
from weighbridge.vehicle.model import TorqueModel, Vehicle
from weighbridge.vehicle.torque_sources import TORQUE_SOURCES, TorqueSource

DRAGGED_TIME: Final = 0.5
"""Time over which a load shows whether the engine is dragged [s]."""

JITTER: Final = 0.1
"""By how much stamps may miss the ends of a window, over their period [-]."""


STEPLESS_COLD: Final = 0.08
"""What cold oil takes of the torque before a stepless gearbox, over the highest torque [-]: pump
and belt lose 3 to 5 % of it without load when warm, and up to thrice as much when cold."""

EXPONENT_STEP: Final = 0.1
"""Change of the charge's power by which its effect is measured [-]."""


@dataclass(frozen=True, slots=True)
class Torque:
    """Torque at the engine's or motor's shaft and where it holds.

    Attributes
    ----------
    time : (n,) stamps as recorded [s]
    torque : (n,) [N m]
    extrapolated : (n,) outside what the torque model has seen
    overrun : (n,) the source says nothing: load at its lowest, engine dragged
    """

    time: Floats
    torque: Floats
    extrapolated: Bools
    overrun: Bools


def source_of(vehicle: Vehicle) -> TorqueSource:
    """Return the source of the vehicle's torque."""
    return vehicle.torque.of_source


def cold_torque_std(vehicle: Vehicle) -> float:
    """Standard deviation of what the cold takes of the torque, over the highest torque [-]."""
    cold = STEPLESS_COLD if vehicle.driveline.stepless else 0.0
    return math.hypot(source_of(vehicle).cold_torque_std, cold)


def sources_of(vehicle: Vehicle | None) -> tuple[TorqueSource, ...]:
    """Sources that read all that drives a vehicle; None is one with one engine or motor."""
    hybrid = vehicle is not None and vehicle.of_class.motor_helps
    return tuple(
        source
        for source in TORQUE_SOURCES.values()
        if not (source.of_one_engine if hybrid else source.of_all_motors)
    )


def reading_battery(vehicle: Vehicle, drive: Drive) -> Vehicle:
    """Return the vehicle as a whole drive shows how its battery is read, for parts of the drive."""
    if "battery_current" not in source_of(vehicle).found(drive):
        return vehicle
    return replace(vehicle, torque=replace(vehicle.torque, battery=battery_use(drive)))


def part_of_a_hybrid(vehicle: Vehicle, source: TorqueSource) -> Problem | None:
    """Say that a source reads engine or motor of a hybrid alone; None where it reads all."""
    if not (vehicle.of_class.motor_helps and source.of_one_engine):
        return None
    return Problem.of("hybrid.part", vehicle=vehicle.name, title=source.title)


def source_signal(drive: Drive, vehicle: Vehicle) -> Signal:
    """Return the signal whose clock carries the torque.

    Raises
    ------
    DriveError
        The drive lacks what the vehicle's torque source needs.
    """
    source = source_of(vehicle)
    missing = source.lacking(drive)
    if missing:
        raise refused(
            "torque.missing",
            drive=drive.name,
            missing=" and no ".join(missing),
            source=source.name,
            vehicle=vehicle.name,
        )
    return source.carrier(drive)


def torque_rows(
    regressor: Floats,
    engine_speed: Floats,
    order: int,
    *,
    curved: bool = False,
    knots: tuple[float, ...] = (),
) -> Floats:
    """Rows of the torque regression (Jensen 2022, eq. 49).

    The paper's regression is linear in load and takes the same torque per
    load at every engine speed. Load is a part of the torque that is to be had
    at that speed, so the slope changes with it: two further columns let it, and
    one for each knot of a smooth curve.

    Parameters
    ----------
    regressor : (n,) load [-] or air-flow torque [N m]
    engine_speed : (n,) [rad/s]
    order : highest power of engine speed
    curved : append load times engine speed and load squared
    knots : rising engine speeds of the curve of torque per load [rad/s]

    Returns
    -------
    (n, 2 + order [+ 2] + knots): 1, load, N, N^2 ... [, load N, load^2], load times the part of
    each knot
    """
    powers = [engine_speed**k for k in range(1, order + 1)]
    columns = [np.ones_like(regressor), regressor, *powers]
    if curved:
        columns += [regressor * engine_speed, regressor**2]
    if knots:
        columns += list((regressor[:, None] * knot_parts(engine_speed, knots)).T)
    return np.column_stack(columns)


def knot_parts(engine_speed: Floats, knots: tuple[float, ...]) -> Floats:
    """Part of each knot in linear interpolation at engine speeds (n,): (n, knots)."""
    known = np.nan_to_num(engine_speed)
    return np.column_stack([np.interp(known, knots, unit) for unit in np.eye(len(knots))])


def rows_of(model: TorqueModel, reading: Floats, engine_speed: Floats) -> Floats:
    """Rows (n, p) whose product with a model's coefficients, curvature and knots is its torque."""
    return torque_rows(
        reading,
        engine_speed,
        max(len(model.coefficients) - 2, 0),
        curved=bool(model.curvature),
        knots=model.knots,
    )


def torque_of(model: TorqueModel, reading: Floats, engine_speed: Floats) -> Floats:
    """Torque that a reading means (n,) [N m].

    Parameters
    ----------
    model
    reading : (n,) in the unit of the source
    engine_speed : (n,) [rad/s]; may be NaN where the model does not ask for it
    """
    offset, scale, *powers = model.coefficients or (0.0, 1.0)
    speed_slope, bend = model.curvature or (0.0, 0.0)
    slope = scale + bend * reading
    if speed_slope:
        slope = slope + speed_slope * engine_speed
    if model.knots:
        slope = slope + np.interp(engine_speed, model.knots, model.knot_slopes)
    torque = offset + slope * reading
    for k, w in enumerate(powers, start=1):
        torque = torque + w * engine_speed**k
    return np.asarray(torque)


def reading_of(torque: Floats, engine_speed: Floats, model: TorqueModel) -> Floats:
    """Return the reading that gives a torque: `torque_rows` solved for it (n,).

    Parameters
    ----------
    torque : (n,) [N m]
    engine_speed : (n,) [rad/s]
    model
    """
    offset, scale, *powers = model.coefficients or (0.0, 1.0)
    speed_slope, bend = model.curvature or (0.0, 0.0)
    rest = offset - torque
    for k, w in enumerate(powers, start=1):
        rest = rest + w * engine_speed**k
    slope = scale + speed_slope * engine_speed
    if model.knots:
        slope = slope + np.interp(engine_speed, model.knots, model.knot_slopes)
    # The root that stays finite where the map is straight; where it bends so far that
    # there is none, its turning point.
    root = np.sqrt(np.maximum(slope**2 - 4.0 * bend * rest, 0.0))
    # A map that does not rise there has no reading for the torque.
    steep = slope + root
    return np.asarray(-2.0 * rest / np.where(steep > 0.0, steep, np.nan))


def averaged(
    values: Floats,
    period: float,
    span: float,
    *,
    time: Floats | None = None,
    ahead: float = math.inf,
) -> Floats:
    """Mean over ``span`` around each sample.

    Rows chosen by a noisy reading itself are chosen by its noise: of those near
    the limit the high readings stay, and the mass comes out low.

    Parameters
    ----------
    values : (n,) NaN where nothing is known
    period : between samples [s]
    span : [s]
    time, ahead : stamps (n,), and how far past each of them samples count, for stages that go
        forward [s]
    """
    if not period > 0.0:
        return values
    if time is not None and math.isfinite(ahead):
        return _averaged_until(values, time, period, span, ahead)
    size = 2 * round(0.5 * span / period) + 1
    known = np.isfinite(values)
    share = moving_mean(known.astype(np.float64), size, "symmetric")
    mean = moving_mean(np.where(known, values, 0.0), size, "symmetric")
    return np.where(share > 0.5 / size, mean / np.maximum(share, 0.5 / size), np.nan)


def _averaged_until(
    values: Floats, time: Floats, period: float, span: float, ahead: float
) -> Floats:
    """Mean of what is known over ``span``, centred where no more than ``ahead`` is needed (n,).

    Each window is summed for itself, so that it is the same wherever the samples begin.
    """
    known = np.isfinite(values)
    values = np.where(known, values, 0.0)
    end, jitter = min(ahead, 0.5 * span), JITTER * period
    first, last = end - span - jitter, min(end + jitter, ahead)
    total, count = np.zeros(values.size), np.zeros(values.size)
    for k in range(math.floor(first / period) - 1, math.ceil(last / period) + 2):
        if abs(k) >= values.size:
            continue
        # Samples that lie k after those they count for.
        there = slice(max(k, 0), values.size + min(k, 0))
        here = slice(max(-k, 0), values.size - max(k, 0))
        apart = time[there] - time[here]
        counts = known[there] & (first <= apart) & (apart <= last)
        total[here] += np.where(counts, values[there], 0.0)
        count[here] += counts
    return np.where(count > 0.0, total / np.maximum(count, 1.0), np.nan)


def engine_torque(
    drive: Drive,
    vehicle: Vehicle,
    engine_speed: Floats,
    time: Floats,
    *,
    share: Floats | float = 1.0,
    period: float | None = None,
    ahead: float = math.inf,
) -> Torque:
    """Return the torque at the recorded stamps ``time``.

    Parameters
    ----------
    engine_speed : (n,) at the same stamps [rad/s]; may be NaN for measured torque
    time : (n,) [s]
    share : what a reading means in this air, (n,) of `in_air` [-]
    period : between readings; that of the drive when None [s]
    ahead : how far past a reading others may show it [s]

    Raises
    ------
    DriveError
        The drive lacks what the torque source needs.
    """
    model = vehicle.torque
    period = source_signal(drive, vehicle).period if period is None else period
    source = source_of(vehicle)
    x = share * source.reading(drive, time, model)
    nowhere = np.zeros(time.size, dtype=bool)
    if source.signed:
        torque = torque_of(model, x, engine_speed)
        return Torque(time, torque, nowhere, nowhere)
    dragged = averaged(x, period, DRAGGED_TIME, time=time, ahead=ahead)
    if not model.coefficients:
        return Torque(time, x, nowhere, dragged <= 0.0)
    torque = torque_of(model, x, engine_speed)
    low, high = model.load_range or (-math.inf, math.inf)
    slow, fast = model.speed_range or (-math.inf, math.inf)
    extrapolated = (dragged > high) | (engine_speed < slow) | (engine_speed > fast)
    return Torque(time, torque, extrapolated, dragged < low)


def in_air(charge: float | None, exponent: float, air: Air, altitude: Floats) -> Floats | float:
    """What a reading means in this air, over what it does in that of the calibration [-].

    Parameters
    ----------
    charge, exponent : of `TorqueModel`
    air, altitude : of the drive, at its rows (n,) [m]

    Returns
    -------
    (n,), or 1 where the reading does not change with the air, or one of the two is not known
    """
    if charge is None or not air.known or exponent == 0.0:
        return 1.0
    return np.asarray((air.charge(altitude) / charge) ** exponent)
