"""Sources of torque beside the engine's own: at wheels and axles, by power, by the battery."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from weighbridge.limits import MOVES, SOME
from weighbridge.messages import Problem, phrase
from weighbridge.signals import Drive, Floats, Signal, moving_mean
from weighbridge.vehicle.gear import spin_rate
from weighbridge.vehicle.reported_torque import torque_in_nm, torque_in_percent
from weighbridge.vehicle.torque_source import (
    MOTOR_BETWEEN_STD,
    REPORTED,
    BatteryUse,
    TorqueConstants,
)

SLOWEST_SHAFT: Final = 15.0
"""Slower than this a power says nothing of a torque [rad/s]."""

STANDING: Final = 0.1
"""Slower than this the vehicle stands [m/s]."""

NEAR: Final = 60.0
"""Standstill so near driving shows what the battery gives beside it [s]."""

OLDEST: Final = 3.0
"""Periods of a signal within which a value of it holds [-]."""

ACCESSORIES: Final = 750.0
"""What it gives where they are fewer [W] (Implementing Decision 2013/341/EU)."""

BATTERY_EFFICIENCY: Final = (0.92, 0.04)
"""Slope of power at the wheels over power of the battery, driving, and its standard deviation [-]:
0.95 is assumed of inverter and motor, near their best, for what is always lost is no part of the
slope, and 0.97 of gears (`weighbridge.vehicle.data_sheet`). Braking by the motor, its inverse."""

ENGINE_INERTIA: Final = 0.2
"""Of the engine of a hybrid with its damper and the motor that starts it [kg m^2]: petrol engines
of the class have 0.1 to 0.25."""

_AXLES: Final = {
    "front": ("wheel_torque_front", "wheel_torque_fl", "wheel_torque_fr"),
    "rear": ("wheel_torque_rear", "wheel_torque_rl", "wheel_torque_rr"),
}
"""Torque of each axle, and of its wheels."""


def _measured_of(drive: Drive, axle: str) -> tuple[str, ...]:
    """Signals that hold the torque of one axle; empty where it is not, or only partly, measured."""
    whole, *wheels = _AXLES[axle]
    if drive.has(whole):
        return (whole,)
    return tuple(wheels) if drive.has(*wheels) else ()


def _wheel_torque(drive: Drive) -> Signal:
    """Torque of all wheels that were measured, on the clock of the first [N m]."""
    names: tuple[str, ...] = ("wheel_torque",)
    if not drive.has("wheel_torque"):
        names = tuple(n for axle in _AXLES for n in _measured_of(drive, axle))
        names = names or tuple(n for parts in _AXLES.values() for n in parts if drive.has(n))
    first, *others = (drive.signals[name] for name in names)
    total = first.values + sum(_fresh(other, first.time) for other in others)
    known = np.isfinite(total)
    return Signal("wheel_torque", first.time[known], total[known])


def _fresh(signal: Signal, time: Floats) -> Floats:
    """Values at stamps (n,); NaN in the gaps of the signal."""
    return np.where(signal.age(time) <= OLDEST * signal.period, signal.at(time), np.nan)


def _unmeasured(drive: Drive, driven: str | None) -> Problem | None:
    """Say which driven wheels were not measured, None where all were."""
    if drive.has("wheel_torque"):
        return None
    measured = [axle for axle in _AXLES if _measured_of(drive, axle)]
    if len(measured) == len(_AXLES) or measured == [driven]:
        return None
    if not measured:
        single = [n for parts in _AXLES.values() for n in parts if drive.has(n)]
        return Problem.of("torque.one_wheel", names=" and ".join(single))
    axle = measured[0]
    other = "rear" if axle == "front" else "front"
    if driven is None:
        return Problem.of("torque.driven_unknown", axle=axle, other=other)
    return Problem.of(
        "torque.other_axle",
        axle=axle,
        driven=phrase("both_axles") if driven == "all" else phrase("one_axle", axle=other),
        other=other,
    )


def _wheels(drive: Drive, time: Floats, _: TorqueConstants) -> Floats:
    return _wheel_torque(drive).at(time)


def _force(drive: Drive, time: Floats, _: TorqueConstants) -> Floats:
    return drive.signals["traction_force"].at(time)


def _per(power: Floats, speed: Floats, slowest: float) -> Floats:
    """Power over speed (n,); NaN below the slowest."""
    fast = np.abs(speed) >= slowest
    return np.where(fast, power / np.where(fast, speed, 1.0), np.nan)


def _power(drive: Drive, time: Floats, _: TorqueConstants) -> Floats:
    speed = _fresh(drive.signals["engine_speed"], time)
    return _per(drive.signals["engine_power"].at(time), speed, SLOWEST_SHAFT)


def _speed_of(drive: Drive) -> Signal:
    speed = drive.speed
    assert speed is not None, "the source names it among its signals"
    return speed


def _shown_speed(drive: Drive, time: Floats) -> Floats:
    speed = np.abs(_fresh(_speed_of(drive), time))
    return np.where(speed >= MOVES, speed, np.nan)


def _power_by_speed(drive: Drive, time: Floats, _: TorqueConstants) -> Floats:
    return _per(drive.signals["engine_power"].at(time), _fresh(_speed_of(drive), time), MOVES)


def battery_use(drive: Drive) -> BatteryUse:
    """Find from a whole drive how its battery is read.

    What it gives at standstill goes to heating, pumps and electronics. Its sign is that with which
    power accelerates.

    Parameters
    ----------
    drive : with battery_voltage, battery_current and a speed
    """
    amps = drive.signals["battery_current"]
    power = _fresh(drive.signals["battery_voltage"], amps.time) * amps.values
    known = np.isfinite(power)
    time, power = amps.time[known], power[known]
    v = _speed_of(drive).at(time)
    around = max(round(1.0 / amps.period), 1) if amps.period > 0.0 else 1
    averaged = moving_mean(np.nan_to_num(v), around, "symmetric")
    gained = np.gradient(averaged**2, time) if time.size > 1 else np.zeros(time.size)
    sign = math.copysign(1.0, float((power - np.mean(power)) @ gained)) if time.size else 1.0
    moves = time[np.abs(v) >= MOVES]
    near = np.searchsorted(moves, time + NEAR) > np.searchsorted(moves, time - NEAR)
    # Long after or before driving it may charge or heat.
    standing = (np.abs(v) < STANDING) & near & (sign * power >= 0.0)
    rest = ACCESSORIES
    if np.count_nonzero(standing) >= SOME:
        rest = float(np.median(sign * power[standing]))
    return BatteryUse(sign, rest)


def _driving_power(drive: Drive, use: BatteryUse | None = None) -> Signal:
    """Power that a battery gives for driving, positive while it gives [W]."""
    use = use or battery_use(drive)
    amps = drive.signals["battery_current"]
    power = _fresh(drive.signals["battery_voltage"], amps.time) * amps.values
    known = np.isfinite(power)
    return Signal("battery_power", amps.time[known], use.sign * power[known] - use.rest)


def _battery(drive: Drive, time: Floats, model: TorqueConstants) -> Floats:
    power = _fresh(_driving_power(drive, model.battery), time)
    force = _per(power, _fresh(_speed_of(drive), time), MOVES)
    efficiency = BATTERY_EFFICIENCY[0]
    return np.asarray(np.where(force >= 0.0, efficiency * force, force / efficiency))


def _engine_and_battery(drive: Drive, time: Floats, model: TorqueConstants) -> Floats:
    """Force of engine and motor of a hybrid (n,) [N].

    The engine spins up apart from the wheels. What that takes is no part of the force.
    """
    turning = drive.signals["engine_speed"]
    torque = torque_in_nm if drive.has("engine_torque") else torque_in_percent
    spun = ENGINE_INERTIA * spin_rate(turning, time)
    power = (torque(drive, time, model) - spun) * _fresh(turning, time)
    by_engine = _per(power, _fresh(_speed_of(drive), time), MOVES)
    return np.asarray(by_engine + _battery(drive, time, model))


def _per_wheel_angle(radius: float) -> float:
    return 1.0 / radius


def _per_distance(radius: float) -> float:
    return 1.0


WHEEL_TORQUE: Final = REPORTED(
    name="wheel_torque",
    signals=("wheel_torque",),
    others=(
        ("wheel_torque_front", "wheel_torque_rear"),
        ("wheel_torque_fl", "wheel_torque_fr", "wheel_torque_rl", "wheel_torque_rr"),
        ("wheel_torque_front",),
        ("wheel_torque_rear",),
        ("wheel_torque_fl", "wheel_torque_fr"),
        ("wheel_torque_rl", "wheel_torque_rr"),
        *((name,) for parts in _AXLES.values() for name in parts[1:]),
    ),
    combined=_wheel_torque,
    gearing=_per_wheel_angle,
    efficiency=(1.0, 0.0),
    refusal=_unmeasured,
    reading=_wheels,
    title="torque at the wheels",
    words="torque at wheels or axles",
    axis="Torque at the wheels [N m]",
    cold_torque_std=0.005,
)

TRACTION_FORCE: Final = REPORTED(
    name="traction_force",
    signals=("traction_force",),
    gearing=_per_distance,
    efficiency=(1.0, 0.0),
    by_radius=False,
    reading=_force,
    title="traction force",
    words="traction force at the wheels",
    axis="Traction force [N]",
    cold_torque_std=0.005,
)

POWER: Final = REPORTED(
    name="power",
    signals=("engine_power", "engine_speed"),
    reading=_power,
    title="power and engine speed",
    words="power of engine or motor over its speed",
    axis="Torque from power [N m]",
    motor_scale_std=0.03,
    motor_between_std=MOTOR_BETWEEN_STD,
)

POWER_BY_SPEED: Final = REPORTED(
    name="power_by_speed",
    signals=("engine_power", "vehicle_speed"),
    others=(("engine_power", "gnss_speed"),),
    gearing=_per_distance,
    before_motor=True,
    by_radius=False,
    reading=_power_by_speed,
    over_speed=_shown_speed,
    title="power and vehicle speed",
    words="power of the motor over vehicle speed",
    axis="Force from power [N]",
    motor_scale_std=0.03,
    # Of simulated cars: studies/electric_power.md.
    transfer_std=0.009,
    between_std=0.005,
)

BATTERY: Final = REPORTED(
    name="battery",
    signals=("battery_current", "battery_voltage", "vehicle_speed"),
    others=(("battery_current", "battery_voltage", "gnss_speed"),),
    steady=("battery_voltage",),
    combined=_driving_power,
    gearing=_per_distance,
    before_motor=True,
    efficiency=(1.0, BATTERY_EFFICIENCY[1]),
    by_radius=False,
    reading=_battery,
    over_speed=_shown_speed,
    title="power of the battery",
    words="power of the traction battery over vehicle speed",
    axis="Force from battery power [N]",
    # Of the meters; the losses behind them are the efficiency's.
    scale_std=0.02,
    # Of simulated cars, whose heating and cooling differ: studies/electric_power.md.
    transfer_std=0.020,
    between_std=0.012,
    cold_std=0.03,
    cold_torque_std=0.02,
    # Graded, not measured.
    expected=1.0,
    limit="what heating, cooling and motor take of the battery's power is not measured",
)

_OF_HYBRID: Final = tuple(
    (torque, "engine_speed", "battery_current", "battery_voltage", speed)
    for torque in ("engine_torque", "engine_torque_fraction")
    for speed in ("vehicle_speed", "gnss_speed")
)

HYBRID: Final = replace(
    BATTERY,
    name="hybrid",
    signals=_OF_HYBRID[0],
    others=_OF_HYBRID[1:],
    steady=("battery_voltage", "engine_speed", "engine_torque", "engine_torque_fraction"),
    combined=None,
    of_all_motors=True,
    efficiency=(0.95, BATTERY_EFFICIENCY[1]),
    reading=_engine_and_battery,
    title="power of engine and battery",
    words="power of engine and traction battery over vehicle speed",
    axis="Force from engine and battery [N]",
    scale_std=0.04,
    # Twelve drives of four simulated power splits (second model, seeds 4601 to 4604) scattered by
    # 5.6 %, where 3.5 % was reported with that of a battery.
    between_std=0.045,
    expected=4.0,
    limit="what motor and inverter take of the battery's power is not measured",
)
