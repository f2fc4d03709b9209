"""Vehicles with other gearboxes, drawn from those of ``vehicle``, and hybrids beside them."""

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from .motion import COLUMNS, DUAL_CLUTCH, RATE, Engine
from .vehicle import Hybrid, Vehicle, random_vehicle

AT = {name: k for k, name in enumerate(COLUMNS)}
CONTROL = 10  # rows from one decision of a hybrid to the next
VARIANTS = {
    "slipping_clutch": "petrol",
    "two_speed_electric": "electric_car",
    "hub_motors": "electric_car",
    "power_split": "petrol_cvt",
    "parallel_hybrid": "petrol_dct",
    "mild_hybrid": "petrol_dct",
}


def random_variant(variant: str, seed: int) -> Vehicle:
    """Draw a vehicle of a variant; the same seed gives the same vehicle.

    Parameters
    ----------
    variant : one of ``VARIANTS``
    seed : of the draw
    """
    vehicle = random_vehicle(VARIANTS[variant], seed)
    rng = np.random.default_rng([seed, list(VARIANTS).index(variant), 78])
    u, engine, box = rng.uniform, vehicle.engine, vehicle.box
    peak = float(engine.full.max())
    hybrid = None
    if variant == "slipping_clutch":
        # Worn: it slips at the higher torques, by a little or until the foot gives way.
        box = box._replace(capacity=u(0.55, 0.95) * peak)
    elif variant == "two_speed_electric":
        first = float(box.ratios[0]) * u(1.1, 1.4)
        box = box._replace(
            kind=DUAL_CLUTCH,
            robot=1,
            ratios=np.array([first, first / u(1.6, 2.2)]),
            efficiency=float(box.efficiency[0]) * u(0.985, 1.0, 2),
            launch_span=1.0,
            start_gear=1,
        )
    elif variant == "hub_motors":
        engine, box = _at_the_wheels(engine, float(box.ratios[0])), box._replace(
            ratios=np.ones(1), efficiency=np.array([u(0.995, 1.0)]), spin_0=0.0, spin_1=0.0
        )  # fmt: skip
    else:
        mild = variant == "mild_hybrid"
        power = u(8e3, 15e3) if mild else u(30e3, 75e3)
        hybrid = Hybrid(
            layout=variant,
            engine_power=u(0.75, 1.0) * float(np.max(engine.full * _grid(engine))),
            motor_power=power,
            motor_torque=power / u(120.0, 220.0),
            start_power=u(6e3, 18e3),
            fastest_alone=u(10.0, 22.0),
            capacity=(u(0.8, 2.0) if mild else u(2.5, 6.0)) * 1e6,
            voltage=48.0 if mild else u(180.0, 340.0),
            efficiency=u(0.84, 0.93),
            mechanical=u(0.93, 0.97),
            charging=u(0.3, 1.2),
            best_torque=u(0.35, 0.65),
            slow=u(1.3, 1.7) * engine.idle,
            fast=u(0.7, 0.9) * engine.limit,
            bend=u(0.5, 0.9),
            lag=u(0.3, 1.0),
        )
    return replace(vehicle, name=f"{variant}-{seed}", engine=engine, box=box, hybrid=hybrid)


def _grid(engine: Engine) -> np.ndarray:
    return np.linspace(0.0, engine.top, engine.full.size)


def _at_the_wheels(motor: Engine, ratio: float) -> Engine:
    """Return motors in the hubs that do what one motor does through a gear."""
    return motor._replace(
        full=ratio * motor.full,
        top=motor.top / ratio,
        limit=motor.limit / ratio,
        friction_0=ratio * motor.friction_0,
        friction_1=ratio**2 * motor.friction_1,
        friction_2=ratio**3 * motor.friction_2,
        inertia=ratio**2 * motor.inertia,
        regen=ratio * motor.regen,
        blend=ratio * motor.blend,
    )


def hybridised(
    out: np.ndarray, vehicle: Vehicle, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Share what moved a vehicle between its engine and a motor.

    The motion stays what it is: wheels get the same force. Only who gave it is another.

    Parameters
    ----------
    out : (n, columns) motion of a vehicle with the engine alone
    vehicle : with ``hybrid``
    rng : what the battery holds at first

    Returns
    -------
    out : with speed and torque of the engine as they are beside the motor, and the brakes less
        what the motor brakes
    battery : (n,) power that it gives [W]
    """
    h, engine = vehicle.hybrid, vehicle.engine
    out = out.copy()
    column = {name: out[:, AT[name]] for name in COLUMNS}
    speed, turning, torque = column["speed"], column["engine_speed"], column["engine_torque"]
    split = h.layout == "power_split"
    power = column["traction_force"] * speed / h.mechanical if split else torque * turning
    braking = np.minimum(column["brake_force"] * speed, h.motor_power) * (speed > 3.0)
    coarse = slice(0, None, CONTROL)
    shared = _decide(
        h, float(engine.full.max()), power[coarse], torque[coarse], turning[coarse],
        speed[coarse], braking[coarse], rng,
    )  # fmt: skip
    rows, at = np.arange(speed.size), np.arange(speed.size)[coarse]
    running, by_engine, by_motor = (np.interp(rows, at, part) for part in shared)
    on = running > 0.5
    if split:
        share = np.clip(by_engine / h.engine_power, 0.0, 1.0)
        wanted = np.where(on, h.slow + (h.fast - h.slow) * share**h.bend, 0.0)
        q = np.exp(-1.0 / (RATE * h.lag))
        turns = lfilter([1.0 - q], [1.0, -q], wanted, zi=[wanted[0] * q])[0]
        spun = engine.inertia * np.gradient(turns) * RATE
        alone = np.where(on, by_engine / np.maximum(turns, h.slow) + spun, 0.0)
        electric = power - by_engine * on
    else:
        turns = np.where(on, turning, 0.0)
        alone = np.where(on, torque - by_motor, 0.0)
        electric = by_motor * turning
    limit = np.interp(turns, _grid(engine), engine.full)
    rubs = engine.friction_0 + (engine.friction_1 + engine.friction_2 * turns) * turns
    rubs *= np.minimum(1.0, turns / 20.0)
    out[:, AT["engine_speed"]] = turns
    out[:, AT["engine_torque"]] = alone
    out[:, AT["indicated_torque"]] = np.where(on, np.maximum(alone + rubs, 0.0), 0.0)
    out[:, AT["indicated_limit"]] = limit + rubs
    out[:, AT["warm_friction"]] = rubs
    out[:, AT["brake_force"]] -= braking / np.maximum(speed, 3.0)
    given = np.where(electric > 0.0, electric / h.efficiency, electric * h.efficiency)
    return out, given - h.efficiency * braking + column["accessory_power"]


def _decide(
    h: Hybrid,
    peak: float,
    power: np.ndarray,
    torque: np.ndarray,
    turning: np.ndarray,
    speed: np.ndarray,
    braking: np.ndarray,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Whether the engine runs, its power [W], and the motor's torque at its shaft [N m]."""
    step = CONTROL / RATE
    charge, on, since, smooth = rng.uniform(0.4, 0.75), True, 0.0, 0.0
    running, by_engine, by_motor = (np.zeros(power.size) for _ in range(3))
    for k in range(power.size):
        since += step
        wanted = power[k] + h.charging * (0.6 - charge) * h.motor_power
        alone = wanted < h.start_power and speed[k] < h.fastest_alone and charge > 0.35
        alone = alone and power[k] < h.motor_power and h.layout != "mild_hybrid"
        if alone == on and since > (2.0 if alone else 0.3):
            on, since = not alone, 0.0
        if h.layout == "power_split":
            goal = min(max(wanted, 0.4 * h.start_power), h.engine_power) if on else 0.0
            # The motor cannot give or take more than it can.
            goal = min(max(goal, power[k] - h.motor_power), power[k] + h.motor_power) if on else 0.0
            smooth += step / (step + h.lag) * (goal - smooth)
            by_engine[k] = smooth
            motor = power[k] - smooth * on
        else:
            most = min(h.motor_torque, h.motor_power / max(turning[k], 50.0))
            # Above the best torque of the engine the motor helps, below it charges.
            lift = h.charging * (0.6 - charge) * peak
            helped = torque[k] - h.best_torque * peak - lift
            if torque[k] < 0.05 * peak:
                helped = 0.0
            elif helped < 0.0:
                helped = max(helped, -0.5 * most) if charge < 0.6 else 0.0
            by_motor[k] = min(max(helped, -most), most) if charge > 0.2 or helped < 0.0 else 0.0
            if not on:
                by_motor[k] = torque[k]
            motor = by_motor[k] * turning[k]
        charge -= step * (motor - h.efficiency * braking[k]) / h.capacity
        charge = min(max(charge, 0.05), 0.95)
        running[k] = on
    return running, by_engine, by_motor
