"""Vans, trucks, buses and automatics that can be simulated, and random vehicles."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Final, Literal, get_args

import numpy as np
from scipy.ndimage import gaussian_filter1d

from weighbridge.arguments import check_choice
from weighbridge.simulation.car import (
    ELECTRIC,
    RPM,
    PowerSplit,
    SimulatedCar,
    listed_car,
    random_car,
)
from weighbridge.simulation.scenario import Habits

VehicleKind = Literal[
    "petrol_manual",
    "petrol_dct",
    "petrol_cvt",
    "petrol_hybrid",
    "diesel_automatic",
    "electric",
    "van",
    "truck",
    "bus",
]
"""Kinds of random vehicles."""

DIESEL_AUTOMATIC: Final = listed_car("diesel_automatic")
"""A midsize car with a diesel and a torque-converter automatic."""

STEPLESS: Final = listed_car("stepless")
"""A car with a push-belt variator behind a converter."""

POWER_SPLIT: Final = replace(
    STEPLESS, name="petrol hybrid, power split", mass=1420.0, split=PowerSplit()
)
"""A hybrid that moves as the car with a stepless gearbox does: who gives the power is another."""

VAN: Final = listed_car("van")
"""A van of 3.5 t permitted mass."""

TRUCK18: Final = listed_car("truck")
"""A two-axle box truck."""

BUS: Final = listed_car("bus")
"""The bus of Du 2025, Table 1."""


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def random_vehicle(rng: np.random.Generator, kind: VehicleKind) -> SimulatedCar:
    """Draw a plausible vehicle of a kind.

    Parameters
    ----------
    rng : numpy.random.Generator
    kind : str
        One of `VehicleKind`.

    Returns
    -------
    SimulatedCar

    Raises
    ------
    ConfigError
        There is no such kind.
    """
    check_choice("kind of vehicle", kind, get_args(VehicleKind))
    # A generator of their own: what else is drawn stays the same.
    (details,) = rng.spawn(1)
    if kind in ("petrol_manual", "petrol_dct"):
        wanted = "manual" if kind == "petrol_manual" else "dual_clutch"
        while True:
            car = random_car(rng)
            if car.transmission == wanted:
                return with_random_details(details, car)
    if kind in ("petrol_cvt", "petrol_hybrid"):
        base = STEPLESS if kind == "petrol_cvt" else POWER_SPLIT
        car = with_random_ratios(details, with_random_details(details, _vary(rng, base)))
        return car if car.split is None else replace(car, split=_random_split(details))
    model = {
        "diesel_automatic": DIESEL_AUTOMATIC, "electric": ELECTRIC, "van": VAN, "truck": TRUCK18,
        "bus": BUS,
    }[kind]  # fmt: skip
    return with_random_details(details, _vary(rng, model))


_YAW_DRAG: Final = {"car": (2.0, 5.0), "van": (3.0, 7.0), "truck": (5.0, 14.0), "bus": (3.0, 8.0)}


def with_random_details(rng: np.random.Generator, car: SimulatedCar) -> SimulatedCar:
    """Give a vehicle losses, fuelling and full-load curve that the named ones do not have.

    Parameters
    ----------
    rng : numpy.random.Generator
    car : SimulatedCar

    Returns
    -------
    SimulatedCar

    Notes
    -----
    - Spin loss of gearbox and axle, 0.2 to 0.6 W/kg at 100 km/h when warm: 0.3 to 0.9 kW of a
      car of 1500 kg beside the 0.5 to 1 kW of ``loss_constant``. Together they are the 1 to 2 kW
      of load-independent loss of gearboxes with their axle at that speed (Naunheimer et al.,
      Automotive Transmissions, 2nd ed., 2011).
    - Drag area in side wind, at a flow angle of 10 degrees 6 to 15 % more for cars, 9 to 21 %
      for vans and 15 to 42 % for boxes of trucks (Hucho, Aerodynamics of Road Vehicles, 4th
      ed., 1998).
    - Overrun: a closed throttle passes about the air of idling, burnt until the fuel is cut after
      1 to 6 s, and always below 1.2 to 1.6 times the idle speed; control units wait, so that the
      torque does not jump and the catalyst stays warm. A cycle needs 10 to 18 % of the full
      charge to burn at all: the spark is late instead, and the load reading shows the air. A
      diesel has no throttle and is cut within half a second, but for what heats its exhaust.
      See Reif (ed.), Gasoline Engine Management, 2015, on overrun fuel cut-off. Times and charge
      are such that the load stands above its floor about as often as in the recorded car of
      `random_habits`.
    - Full-load curve without corners, highest at one speed; the farther end of the range gives
      10 to 30 % less than by corners, as the filling of the cylinders falls (Heywood, Internal
      Combustion Engine Fundamentals, 1988, ch. 6). The calculated load is of it
      at every speed (SAE J1979, PID 04).
    """
    between = partial(_between, rng)
    # Power at 100 km/h is force times speed, force is torque per radius.
    speed = 100.0 / 3.6
    spin_loss = between(0.2, 0.6) * car.mass * (car.wheel_radius / speed) ** 2
    car = replace(car, spin_loss=spin_loss, yaw_drag=between(*_YAW_DRAG[car.kind]))
    if car.electric:
        return car
    diesel = car.engine == "diesel"
    speeds, torques = _smooth_curve(rng, car)
    return replace(
        car,
        curve_speed=speeds,
        curve_torque=torques,
        load_curve=1.0,
        overrun_charge=between(0.0, 0.5) if diesel else between(0.5, 1.1),
        least_charge=0.0 if diesel else between(0.10, 0.18),
        cut_delay=between(0.1, 0.5) if diesel else between(1.0, 6.0),
        cut_speed=between(1.2, 1.5 if diesel else 1.6) * car.idle_speed,
    )


def with_random_ratios(rng: np.random.Generator, car: SimulatedCar) -> SimulatedCar:
    """Give a stepless box another law: how its ratio follows the power asked for, what it loses.

    Parameters
    ----------
    rng : numpy.random.Generator
    car : SimulatedCar
    """
    between = partial(_between, rng)
    return replace(
        car,
        lock_speed=between(1100.0, 2300.0) * RPM,
        economy_speed=between(1050.0, 1500.0) * RPM,
        power_share=between(0.55, 0.9),
        ratio_lag=between(0.2, 1.2),
        ratio_bend=between(0.0, 0.8),
        pump=between(0.002, 0.02),
        loss_constant=between(1.0, 6.0),
        loss_slope=between(0.03, 0.1),
    )


def _random_split(rng: np.random.Generator) -> PowerSplit:
    """Draw how a hybrid shares its power, and what its motor loses."""
    between = partial(_between, rng)
    return PowerSplit(
        start_power=between(4e3, 14e3),
        motor_power=between(35e3, 70e3),
        efficiency=between(0.84, 0.94),
        mechanical=between(0.93, 0.97),
        slowest=between(95.0, 130.0),
        fastest=between(350.0, 500.0),
        engine_power=between(60e3, 90e3),
        engine_inertia=between(0.12, 0.24),
        auxiliary=between(250.0, 900.0),
        voltage=between(180.0, 340.0),
    )


def _smooth_curve(
    rng: np.random.Generator, car: SimulatedCar
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Round off a full-load curve and let it peak at one speed [rad/s], [N m]."""
    speed = np.linspace(car.curve_speed[0], car.curve_speed[-1], 16)
    fine = np.linspace(speed[0], speed[-1], 301)
    torque = np.interp(fine, car.curve_speed, car.curve_torque)
    top = float(torque.max())
    summit = float(rng.choice(fine[torque > 0.98 * top]))
    droop = float(rng.uniform(0.1, 0.3))
    reach = max(fine[-1] - summit, summit - fine[0])
    torque = gaussian_filter1d(torque, 15.0, mode="nearest")
    torque *= 1.0 - droop * ((fine - summit) / reach) ** 2
    torque *= top / torque.max()
    return tuple(map(float, speed)), tuple(map(float, np.interp(speed, fine, torque)))


def random_habits(rng: np.random.Generator) -> Habits:
    """Draw a driver.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    Habits

    Notes
    -----
    How often and how lightly drivers brake is fitted to a recorded car with a brake switch,
    20 115 s at 1 Hz, ten drivers: 0.02 to 0.12 touches a second, of 0.05 to 0.15 m/s^2, for 0.5 to
    1.5 s. Its light braking is at 1 to 2 bar, some percent of the weight. The foot needs 0.2 s
    between the pedals when it has to and 0.6 s when it need not hurry (Green, Transportation
    Human Factors 2(3), 2000, on movement times). Air drag behind another vehicle is 5 to 25 %
    less at the usual distance of one to two seconds, most behind trucks (Zabat et al., The
    Aerodynamic Performance of Platoons, PATH report UCB-ITS-PRR-95-35, 1995).
    """
    between = partial(_between, rng)
    quick = between(0.2, 0.35)
    return Habits(
        least_braking=(between(0.2, 0.4), between(0.7, 1.1)),
        touch_rate=between(0.02, 0.12),
        touch_strength=between(0.05, 0.15),
        touch_time=between(0.5, 1.5),
        foot_time=(quick, quick + between(0.1, 0.25)),
        both_pedals=between(0.05, 0.25),
        following=between(0.0, 0.4),
        shelter=(0.05, 0.25),
    )


def _vary(rng: np.random.Generator, model: SimulatedCar) -> SimulatedCar:
    """Draw a vehicle of the model's kind: everything estimators care about differs."""

    def by(part: float) -> float:
        return float(rng.uniform(1.0 - part, 1.0 + part))

    size = by(0.15)
    power = size * by(0.12)
    ratios = by(0.08)
    # The steps between the gears differ, the first gear stays what it is.
    spread = by(0.05)
    first = model.gear_ratios[0]
    friction = power * by(0.12)
    bend = abs(model.load_curvature) + 0.04
    return replace(
        model,
        name=f"random {model.name}",
        mass=model.mass * size,
        gear_ratios=tuple(first * (g / first) ** spread for g in model.gear_ratios),
        final_drive=model.final_drive * ratios,
        wheel_radius=model.wheel_radius * by(0.04),
        engine_inertia=model.engine_inertia * power * by(0.15),
        wheel_inertia=model.wheel_inertia * size * by(0.12),
        drag_area=model.drag_area * by(0.15),
        rolling_coefficient=model.rolling_coefficient * by(0.15),
        curve_torque=tuple(power * t for t in model.curve_torque),
        idle_speed=model.idle_speed * by(0.06),
        drag_torque=(
            friction * model.drag_torque[0],
            friction * model.drag_torque[1],
            friction * model.drag_torque[2],
        ),
        loss_constant=model.loss_constant * by(0.4),
        loss_slope=model.loss_slope * by(0.3),
        torque_lag=model.torque_lag * by(0.3),
        shift_time=model.shift_time * by(0.2),
        upshift=model.upshift * by(0.06),
        converter_capacity=model.converter_capacity * power * by(0.1),
        accessory_power=model.accessory_power * by(0.3),
        regeneration=model.regeneration * by(0.3),
        load_curvature=float(rng.uniform(-bend, bend)),
        load_speed_slope=float(rng.uniform(-0.1, 0.1)),
        torque_curvature=float(rng.uniform(-1.0, 1.0)) * model.torque_curvature,
        load_smoothing=model.load_smoothing * by(0.5),
        brake_drag=model.brake_drag * by(0.5),
        squat=model.squat * by(0.3),
        load_pitch=model.load_pitch * by(0.5),
        roll_gain=model.roll_gain * by(0.2),
        pitch_frequency=model.pitch_frequency * by(0.12),
        tyre_slip=model.tyre_slip * by(0.25),
    )
