"""Other signals of the same engine that bear second signal of the reading its torque is made from.

Air, fuel or current that an engine takes go with its torque. How they go with the reading is
learnt from drives of known mass, so that a later drive shows whether the reading is still what it
was. Both sides are compared as means over seconds: values asked for one after another, gear
changes and short delays then matter little.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.limits import CREEPS, LOCKED, PARTS, SOME
from weighbridge.signals import (
    Bools,
    Drive,
    Floats,
    Ints,
    Signal,
    median_of_three,
    robust_fit,
    robust_fits,
)
from weighbridge.signals.interpolation import interpolate
from weighbridge.signals.lag import best_lag
from weighbridge.vehicle import SecondSignalRelation, Vehicle, source_of
from weighbridge.vehicle.air import standard_pressure

WINDOW: Final = 3.0
"""Both sides are averaged over so long, at least three periods of the slowest signal [s]."""

DELAYS: Final = np.arange(-1.0, 1.51, 0.25)
"""Delays of the reading against its second signal that are tried [s]."""

SLOW_PERIOD: Final = 1.0
"""Signals sampled more slowly show no delay [s]."""

Ranges: TypeAlias = tuple[tuple[float, float], tuple[float, float]]
"""Lowest and highest value of a second signal [SI], and speed of the engine [rad/s]."""


@dataclass(frozen=True, slots=True)
class SecondSignal:
    """One signal that can bear second signal of a torque reading.

    Attributes
    ----------
    signal : its name
    needs : signals it is made from
    of : its value at stamps (n,), of drive, vehicle, stamps and engine speed there [SI]
    air : lowest and highest power of the pressure of the air, and of its temperature, to which
        it may go at one charge of the engine
    enriched : more of it than the torque needs is no fault: enrichment, regeneration of a filter
    per_turn : it is taken over the engine's speed
    battery : it goes with a motor's torque in both directions, and with what else takes current
    """

    signal: str
    needs: tuple[str, ...]
    of: Callable[[Drive, Floats, Floats], Floats]
    air: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0))
    enriched: bool = False
    per_turn: bool = False
    battery: bool = False


def _as_it_is(name: str) -> Callable[[Drive, Floats, Floats], Floats]:
    return lambda drive, time, _: drive.signals[name].at(time)


def _per_turn(name: str) -> Callable[[Drive, Floats, Floats], Floats]:
    """Per radian of the engine [SI unit of the signal times s/rad]."""

    def value(drive: Drive, time: Floats, turning: Floats) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(turning > 0.0, drive.signals[name].at(time) / turning, np.nan)

    return value


def _battery(drive: Drive, time: Floats, turning: Floats) -> Floats:
    """Power of the battery over the speed of the motor [N m], of the sign of the current."""
    power = drive.signals["battery_voltage"].at(time) * drive.signals["battery_current"].at(time)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(turning > 0.0, power / turning, np.nan)


# PID 04 is load over the highest at that speed, pressure and temperature (SAE J1979): the charge
# over p / sqrt(T). Many engines do not reckon with the air; both are accepted.
LOAD_AIR: Final = ((-1.0, 0.0), (0.0, 0.5))

# A charge takes the more pressure the warmer the air gets, heated on its way in.
_PRESSURE_AIR: Final = ((0.0, 0.0), (0.5, 1.0))

SECOND_SIGNALS: Final = (
    SecondSignal(
        "mass_air_flow",
        ("mass_air_flow",),
        _per_turn("mass_air_flow"),
        per_turn=True,
    ),
    SecondSignal("absolute_load", ("absolute_load",), _as_it_is("absolute_load")),
    SecondSignal(
        "intake_pressure", ("intake_pressure",), _as_it_is("intake_pressure"), air=_PRESSURE_AIR
    ),
    SecondSignal("fuel_rate", ("fuel_rate",), _per_turn("fuel_rate"), enriched=True, per_turn=True),
    SecondSignal("engine_load", ("engine_load",), _as_it_is("engine_load"), air=LOAD_AIR),
    SecondSignal("demanded_torque", ("demanded_torque",), _as_it_is("demanded_torque")),
    SecondSignal("battery_current", ("battery_voltage", "battery_current"), _battery, battery=True),
)
"""Every signal that can be a second signal."""

BY_SIGNAL: Final = {second_signal.signal: second_signal for second_signal in SECOND_SIGNALS}


@dataclass(frozen=True, slots=True)
class Rows:
    """Reading and second signal at the stamps of the reading.

    Attributes
    ----------
    time : (n,) [s]
    reading : (n,) as the torque source reads it
    value : (n,) of the second signal [SI]
    turning : (n,) speed of engine or motor [rad/s]
    driving : (n,) all are known, and the vehicle drives
    period : of the slowest of them [s]
    """

    time: Floats
    reading: Floats
    value: Floats
    turning: Floats
    driving: Bools
    period: float


@dataclass(frozen=True, slots=True)
class Means:
    """Means over windows that lie in the ranges of a relation.

    Attributes
    ----------
    time : (m,) [s]
    reading : (m,)
    terms : (m, k) of the relation
    """

    time: Floats
    reading: Floats
    terms: Floats


@dataclass(frozen=True, slots=True)
class Comparison:
    """Reading against what a second signal shows, ``reading = level + scale (shown - its mean)``.

    Attributes
    ----------
    scale, scale_std : with its standard deviation [-]
    level, level_std : reading where the second signal shows ``predicted``, in the reading's unit
    predicted : mean of what the second signal shows
    """

    scale: float
    level: float
    predicted: float
    scale_std: float
    level_std: float


def rows_of(
    drive: Drive, vehicle: Vehicle, second_signal: SecondSignal, later: float = 0.0
) -> Rows | None:
    """Reading and second signal; None where one is missing, or the vehicle is another kind.

    Parameters
    ----------
    drive, vehicle, second signal
    later : by how much the reading is later than the second signal, which is moved by it [s]
    """
    source = source_of(vehicle)
    made_of = source.found(drive)
    motor = vehicle.driveline.single_speed
    # A reading is no second signal of itself, and there is none for wheels.
    if set(made_of) & set(second_signal.needs) or source.gearing or motor != second_signal.battery:
        return None
    name = made_of[0]
    turning_of = drive.get("engine_speed") or (drive.get("vehicle_speed") if motor else None)
    speed = drive.speed
    if drive.missing((name, *second_signal.needs)) or turning_of is None or speed is None:
        return None
    used = [drive.signals[n] for n in (name, *second_signal.needs)] + [turning_of, speed]
    if min(map(len, used)) < SOME:
        return None
    time = drive.signals[name].time
    try:
        reading = source.reading(drive, time, vehicle.torque)
    except DriveError:
        return None  # Percent of an unknown torque: weighing says so.
    gearing = vehicle.driveline.gearings[0] if turning_of.name == "vehicle_speed" else 1.0
    # One false value would be in all that is divided by it, or filtered.
    steady = replace(turning_of, values=median_of_three(turning_of.values))
    moved = time - later
    turning = steady.at(moved) * gearing
    value = second_signal.of(drive, moved, turning)
    driving = np.isfinite(reading) & np.isfinite(value) & np.isfinite(turning)
    least = LOCKED if motor else CREEPS
    driving &= np.nan_to_num(speed.at(moved)) > least
    for signal in used[1:]:
        driving &= signal.age(moved) <= 2.0 * signal.period
    period = max(signal.period for signal in used[:-1])
    return Rows(time, reading, np.nan_to_num(value), np.nan_to_num(turning), driving, period)


def terms(second_signal: SecondSignal, value: Floats, turning: Floats, ranges: Ranges) -> Floats:
    """Columns of the relation (n, k); see `weighbridge.vehicle.model.WitnessRelation`."""
    (low, high), (_, fastest) = ranges
    w = value / max(abs(low), abs(high), 1e-300)
    speed = turning / fastest
    if second_signal.battery:
        return np.column_stack([np.ones_like(w), w, 1.0 / np.maximum(speed, 1e-3)])
    return np.column_stack([np.ones_like(w), w, w * speed, w**2])


def means(rows: Rows, second_signal: SecondSignal, ranges: Ranges) -> Means:
    """Average over windows that lie in the ranges with all their samples.

    The second signal chooses the windows, not the reading: what is wrong with the reading must not
    choose what it is judged by.
    """
    value_range, speed_range = ranges
    inside = rows.driving & (rows.value >= value_range[0]) & (rows.value <= value_range[1])
    inside &= (rows.turning >= speed_range[0]) & (rows.turning <= speed_range[1])
    window = max(WINDOW, 3.0 * rows.period)
    number: Ints = np.floor((rows.time - rows.time[0]) / window).astype(np.int64)
    _, place = np.unique(number, return_inverse=True)
    count = np.bincount(place)
    own = float(np.median(np.diff(rows.time)))
    whole = np.bincount(place, inside.astype(np.float64)) == count
    whole &= count >= max(2.0, 0.6 * window / own)

    def mean(x: Floats) -> Floats:
        return np.asarray(np.bincount(place, np.nan_to_num(x))[whole] / count[whole])

    columns = terms(second_signal, rows.value, rows.turning, ranges)
    averaged = np.column_stack([mean(column) for column in columns.T])
    return Means(mean(rows.time), mean(rows.reading), averaged)


def ranges_of(relation: SecondSignalRelation) -> Ranges:
    """Ranges that a relation has seen."""
    return relation.value_range, relation.speed_range


def predicted_by(relation: SecondSignalRelation, rows: Means) -> Floats:
    """Reading that a second signal shows (m,)."""
    return np.asarray(rows.terms @ np.array(relation.coefficients))


def compare(reading: Floats, predicted: Floats) -> Comparison:
    """Fit a scale and a level of the reading against what a second signal shows.

    Parameters
    ----------
    reading, predicted : (m,) in the order of time

    References
    ----------
    Huber, Robust Statistics, 1981, ch. 7. Standard deviations by leaving out one part of the
    drive after another (Efron, Stein, Ann. Statist. 9, 1981).
    """
    middle = float(np.mean(predicted))
    columns = np.column_stack([predicted - middle, np.ones_like(predicted)])
    scale, level = robust_fit(columns, reading)[0]
    # Each is fitted anew: which of two clusters of rows is the outlier may depend on one part.
    size = -(-reading.size // PARTS)
    begin = (np.arange(PARTS) * (reading.size - size)) // (PARTS - 1)
    rows = np.arange(reading.size - size)
    others = rows + size * (rows >= begin[:, None])
    left_out = robust_fits(columns[others], reading[others])[0]
    spread = (PARTS - 1) / PARTS * np.sum((left_out - np.mean(left_out, 0)) ** 2, 0)
    scale_std, level_std = np.sqrt(spread)
    return Comparison(float(scale), float(level), middle, float(scale_std), float(level_std))


def lateness(
    rows: Rows, second_signal: SecondSignal, relation: SecondSignalRelation
) -> float | None:
    """Find how late the reading is against what the second signal shows [s].

    Parameters
    ----------
    rows, second signal
    relation : of which the ranges are taken

    Returns
    -------
    NaN where it is beyond `DELAYS`; None where the signals are sampled too slowly, or the drive
    is too short.
    """
    if rows.period > SLOW_PERIOD or np.count_nonzero(rows.driving) < 10 * SOME:
        return None
    value = np.clip(rows.value, *relation.value_range)
    turning = np.clip(rows.turning, *relation.speed_range)
    predicted = terms(second_signal, value, turning, ranges_of(relation)) @ np.array(
        relation.coefficients
    )
    driven = rows.time[rows.driving]
    moved = (interpolate(driven - delay, rows.time, predicted) for delay in DELAYS)
    return best_lag(rows.reading[rows.driving], moved, DELAYS).at


def air_of(drive: Drive, start: float, end: float) -> tuple[float, float]:
    """Pressure [Pa] and temperature [K] of the air within a time; NaN where they are unknown."""
    pressure = _median(drive.get("barometric_pressure"), start, end)
    if np.isnan(pressure):
        height = _median(drive.get("altitude"), start, end)
        known = drive.info.barometric_pressure
        pressure = known if known is not None else float(standard_pressure(np.asarray(height)))
    temperature = _median(drive.get("ambient_temperature"), start, end)
    if np.isnan(temperature) and drive.info.ambient_temperature is not None:
        temperature = drive.info.ambient_temperature
    return pressure, temperature


def _median(signal: Signal | None, start: float, end: float) -> float:
    """Median within a time, else of all; NaN without samples."""
    if signal is None or not len(signal):
        return float("nan")
    first, last = signal.time.searchsorted([start, end])
    return float(np.median(signal.values[first:last] if last > first else signal.values))
