"""Scale of an electric motor's torque, from the power of its battery.

Torque times speed is what the motor gives, voltage times current what the battery gives.
Driving, the battery gives more than the motor by the losses of inverter and motor;
recuperating, it gets less by them. So both together show the losses and how much too high
the torque is read, with no calibration: a torque read too high makes driving look too
efficient and recuperation too lossy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from weighbridge.constants import INDEPENDENT
from weighbridge.limits import MOVES, POSSIBLE
from weighbridge.messages import Problem
from weighbridge.signals import Bools, Drive, Floats, Signal, robust_fit
from weighbridge.signals.lag import best_lag
from weighbridge.vehicle.data_sheet import by_data_sheet, torque_std
from weighbridge.vehicle.model import Vehicle
from weighbridge.vehicle.torque import engine_torque, source_of

LEAST_LOSS: Final = 0.01
"""Of inverter and motor in proportion to power, at least [-]: their best efficiency is below
97 %, and part of what they lose depends on speed alone (Burress, Benchmarking EV and HEV
Technologies, Oak Ridge National Laboratory, 2016)."""

HIGHEST_LOSS: Final = 0.15
"""The same at most [-]; more is no motor's, but another current, torque or gearing."""

METER_STD: Final = 0.015
"""Scale of voltage times current, relative standard deviation [-]: chosen. A recorded car's
heater, with meters of its own, took 0.96 to 1.00 of what the battery's said."""

LEAST_POWER: Final = 3000.0
"""Power at the shaft from which a second shows the efficiency [W]."""

LEAST_TIME: Final = 15.0
"""Time above that power that is needed, driving and recuperating [s]."""

SLOW: Final = 60.0
"""What changes more slowly is taken off: heating, air conditioning, pumps [s]."""

STEP: Final = 0.1
"""Between the instants at which both powers are compared [s]."""

WINDOW: Final = 1.0
"""They are averaged over this time, at least two periods of the slowest signal [s]."""

LATEST: Final = 1.0
"""Battery power may be later or earlier than torque by this much [s]."""

TOGETHER: Final = 0.5
"""Correlation of the changes of both powers from which on a lateness is one [-]: 0.87 to 0.96 in 24
recorded trips, 0.75 and more in simulated drives; 0.14 at most where the clocks are 2 s apart or
more. Without it two of twelve such drives had a possible scale, 2.2 and 10 in place of 1.1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerBalance:
    """What the power of the battery shows of the torque.

    Attributes
    ----------
    scale : torque read over torque of the motor [-]
    std : its standard deviation
    noise_std : the part of it that differs from drive to drive
    driving : shaft power, as read, over electric power, of what changes within a minute [-]:
        the lowest scale, with which nothing is lost driving
    recuperating : electric power over shaft power, as read [-]: its inverse is the highest
        scale, with which nothing is lost recuperating
    charging_positive : whether the current recorded is positive while charging
    """

    scale: float
    std: float
    noise_std: float
    driving: float
    recuperating: float
    charging_positive: bool

    @property
    def possible(self) -> bool:
        """Whether a motor's losses explain both directions."""
        loss = 1.0 - math.sqrt(max(self.driving * self.recuperating, 0.0))
        return -LEAST_LOSS - 2.0 * self.noise_std <= loss <= HIGHEST_LOSS

    @property
    def problem(self) -> Problem:
        """What was found."""
        return Problem.of(
            "battery.scale" if self.possible else "battery.impossible",
            "battery_current",
            **self._found,
        )

    def weighed(self, scale: float, std: float, *, unusual: bool) -> Problem:
        """Say what was found, and the scale with the data sheet by which the torque is divided."""
        return Problem.of(
            "battery.unusual" if unusual else "battery.divided",
            "battery_current",
            **self._found,
            with_sheet=scale,
            with_sheet_std=std,
        )

    @property
    def _found(self) -> dict[str, Any]:
        return {
            "driving": 100.0 * self.driving,
            "recuperating": 100.0 * self.recuperating,
            "scale": self.scale,
            "std": self.std,
        }


def find_power_balance(drive: Drive, vehicle: Vehicle) -> PowerBalance | None:
    """Find the scale of the torque from what the battery gives and gets.

    With T the torque read and s its scale, electric power is ``T w / s`` and losses. Losses
    have the same sign both ways, so the electric power per shaft power is ``(1 + l) / s``
    driving and ``(1 - l) / s`` recuperating: their mean shows s, their difference the losses
    l. No losses driving and twice of them recuperating, or the other way round, are the
    bounds; between them equal losses are the likeliest (a triangular distribution). Heating,
    cooling and electronics change slowly and are taken off with all that does (`SLOW`).

    Parameters
    ----------
    drive : with torque, vehicle or engine speed, battery_voltage and battery_current
    vehicle : with one gear

    Returns
    -------
    PowerBalance
        None where a signal is missing, or too little was driven or recuperated.

    References
    ----------
    Robust regression: Huber, Robust Statistics, 1981, ch. 7.
    """
    source = source_of(vehicle)
    if source.gearing is not None or source.lacking(drive):
        return None
    if drive.missing(("battery_voltage", "battery_current")):
        return None
    rows = _rows(drive, vehicle)
    if rows is None:
        return None
    time, shaft, electric, moving = rows
    many = min(np.count_nonzero(s * shaft > LEAST_POWER) for s in (1.0, -1.0))
    if many * float(np.median(np.diff(time))) < LEAST_TIME:
        return None
    battery, power, loss = (_without_slow(time, x) for x in (electric, shaft, np.abs(shaft)))
    sign = math.copysign(1.0, float(power[moving] @ battery[moving]))
    design = np.column_stack([power, loss, np.ones_like(power)])[moving]
    (slope, lost, _), noise = _robust_fit(
        design, sign * battery[moving], time[moving] // INDEPENDENT
    )
    if not slope > abs(lost):
        return None
    scale = float(1.0 / slope)
    open_part = max(float(lost) * scale, LEAST_LOSS) / math.sqrt(6.0)
    own = noise * scale
    return PowerBalance(
        scale=scale,
        std=scale * float(np.linalg.norm([own, open_part, METER_STD])),
        noise_std=scale * own,
        driving=float(1.0 / (slope + lost)),
        recuperating=float(slope - lost),
        charging_positive=sign < 0.0,
    )


def by_power(drive: Drive, vehicle: Vehicle) -> tuple[Vehicle, tuple[Problem, ...]]:
    """Narrow the scale of a data sheet's torque by the power of the battery.

    The torque is divided by the mean of its scale by battery and by data sheet, each
    weighted by its variance. Where they contradict each other, what lies between them
    stays in the standard deviation.

    Returns
    -------
    vehicle : as it was where nothing was found, the torque was calibrated, or the vehicle file
        says how sure its masses or its torque are
    notes : what was found
    """
    stated = vehicle.provenance.mass_scale_std, vehicle.torque.scale_std
    electric = by_data_sheet(vehicle) and vehicle.driveline.single_speed
    if not electric or any(s is not None for s in stated):
        return vehicle, ()
    found = find_power_balance(drive, vehicle)
    if found is None or not found.possible:
        return vehicle, (found.problem,) if found else ()
    usual = torque_std(vehicle)
    weight = usual**2 / (usual**2 + found.std**2)
    scale = 1.0 + weight * (found.scale - 1.0)
    std = math.sqrt(weight) * found.std
    unusual = abs(found.scale - 1.0) > POSSIBLE * math.hypot(usual, found.std)
    if unusual:
        std = math.hypot(std, found.scale - scale)
    offset, slope, *powers = vehicle.torque.coefficients or (0.0, 1.0)
    model = replace(
        vehicle.torque,
        coefficients=tuple(w / scale for w in (offset, slope, *powers)),
        coefficient_stds=(),
        scale_std=std,
    )
    return replace(vehicle, torque=model), (found.weighed(scale, std, unusual=unusual),)


def _rows(drive: Drive, vehicle: Vehicle) -> tuple[Floats, Floats, Floats, Bools] | None:
    """Return means over windows: time, shaft and electric power, and whether it moves."""
    torque = source_of(vehicle).carrier(drive)
    turning = drive.get("engine_speed") or drive.get("vehicle_speed")
    volts, amps = drive.signals["battery_voltage"], drive.signals["battery_current"]
    gearings = vehicle.driveline.gearings
    if turning is None or not gearings or min(map(len, (torque, turning, volts, amps))) < 3:
        return None
    used = (torque, turning, volts, amps)
    begin = max(float(s.time[0]) for s in used) + LATEST
    end = min(float(s.time[-1]) for s in used) - LATEST
    if end - begin < 2.0 * SLOW:
        return None
    time: Floats = np.asarray(begin + STEP * np.arange(int((end - begin) / STEP)), dtype=np.float64)
    speed = turning.at(time) * (1.0 if turning.name == "engine_speed" else gearings[0])
    shaft = engine_torque(drive, vehicle, speed, time).torque * speed
    power = Signal("battery_power", volts.time, volts.values * amps.at(volts.time))
    late = _lateness(shaft, power, time)
    if math.isnan(late):
        return None
    electric = power.at(time + late)
    known = np.isfinite(shaft) & np.isfinite(electric)
    for signal in used:
        known &= signal.age(time) <= max(3.0 * signal.period, STEP)
    window = max(WINDOW, 2.0 * max(s.period for s in used))
    number = ((time - begin) // window).astype(np.int64)
    count = np.bincount(number)
    whole = np.bincount(number, weights=known) == count
    if np.count_nonzero(whole) * window < 2.0 * SLOW:
        return None
    at, at_shaft, at_battery, at_speed = (
        np.bincount(number, weights=np.nan_to_num(x))[whole] / count[whole]
        for x in (time, shaft, electric, speed)
    )
    return at, at_shaft, at_battery, at_speed > MOVES * gearings[0]


def _lateness(shaft: Floats, power: Signal, time: Floats) -> float:
    """How late battery power is against torque, by their changes [s]; NaN where none shows."""

    def change(values: Floats) -> Floats:
        return np.nan_to_num(np.diff(values, prepend=values[:1]))

    shifts = np.asarray(STEP * np.arange(-int(LATEST / STEP), int(LATEST / STEP) + 1))
    own = change(shaft)
    lag = best_lag(own, (change(power.at(time + shift)) for shift in shifts), shifts)
    return lag.at if abs(lag.correlation) > TOGETHER else math.nan


def _without_slow(time: Floats, values: Floats) -> Floats:
    """Take the mean over `SLOW` around each row away."""
    first = np.searchsorted(time, time - 0.5 * SLOW)
    last = np.searchsorted(time, time + 0.5 * SLOW, side="right")
    total = np.concatenate(([0.0], np.cumsum(values)))
    return np.asarray(values - (total[last] - total[first]) / (last - first))


def _robust_fit(rows: Floats, y: Floats, block: Floats) -> tuple[Floats, float]:
    """Fit by Huber's weights; standard deviation of the first parameter by leaving blocks out.

    Parameters
    ----------
    rows : (n, k)
    y : (n,) [W]
    block : (n,) rows of one number are left out together
    """
    found, weight = robust_fit(rows, y)
    size = np.sqrt(np.mean(rows**2, axis=0)) + 1e-12
    scaled = rows / size
    _, number = np.unique(block, return_inverse=True)
    many = int(number.max()) + 1
    gram = np.zeros((many, size.size, size.size))
    right = np.zeros((many, size.size))
    for k in range(many):
        part: Bools = number == k
        gram[k] = (scaled[part].T * weight[part]) @ scaled[part]
        right[k] = scaled[part].T @ (weight[part] * y[part])
    ridge = 1e-9 * np.eye(size.size)
    left_out = np.array(
        [
            np.linalg.solve(gram.sum(0) - gram[k] + ridge, right.sum(0) - right[k])[0]
            for k in range(many)
        ]
    )
    variance = (many - 1) / many * float(np.sum((left_out - left_out.mean()) ** 2))
    return found, math.sqrt(variance) / float(size[0])
