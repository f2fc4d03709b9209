"""Vans, trucks, buses and automatics that can be simulated, and random vehicles."""

from __future__ import annotations

import math
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
    random_car,
    rpm,
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

DIESEL_AUTOMATIC: Final = SimulatedCar(
    name="diesel car, 8-speed automatic",
    mass=1750.0,
    engine="diesel",
    transmission="automatic",
    gear_ratios=(4.714, 3.143, 2.106, 1.667, 1.285, 1.000, 0.839, 0.667),
    final_drive=2.813,
    wheel_radius=0.313,
    engine_inertia=0.27,
    wheel_inertia=5.8,
    drag_area=0.27 * 2.25,
    rolling_coefficient=0.0085,
    curve_speed=rpm(700, 1000, 1250, 1750, 3000, 4000, 4600),
    curve_torque=(130.0, 210.0, 290.0, 380.0, 380.0, 325.0, 250.0),
    idle_speed=780 * RPM,
    max_speed=4600 * RPM,
    drag_torque=(24.0, 0.012, 1.1e-4),
    loss_constant=6.0,
    loss_slope=0.035,
    torque_lag=0.20,
    shift_time=0.35,
    shift_floor=0.65,
    upshift=1650 * RPM,
    downshift=1080 * RPM,
    gear_skip=2,
    converter_capacity=380.0 / (2100 * RPM) ** 2,
    stall_ratio=2.0,
    lock_gear=3,
    lock_speed=1150 * RPM,
    load_full=1.0,
    load_curvature=0.04,
    load_speed_slope=-0.05,
    squat=math.radians(0.20),
    load_pitch=2.2e-5,
)
"""A midsize car with a 2.0 l diesel of 136 kW and a torque-converter automatic of the
gear ratios of the ZF 8HP. The converter stalls at 2100 rpm at full torque and
doubles it, usual figures (Gillespie, Fundamentals of Vehicle Dynamics, 1992, ch. 2;
Heisler, Advanced Vehicle Technology, ch. 4)."""

STEPLESS: Final = SimulatedCar(
    name="petrol car, stepless gearbox",
    mass=1330.0,
    transmission="stepless",
    gear_ratios=(2.63, 0.38),
    final_drive=5.25,
    wheel_radius=0.305,
    engine_inertia=0.15,
    wheel_inertia=4.4,
    drag_area=0.29 * 2.25,
    rolling_coefficient=0.0088,
    curve_speed=rpm(700, 1000, 2000, 3000, 4000, 5200, 6000, 6400),
    curve_torque=(80.0, 118.0, 145.0, 156.0, 163.0, 157.0, 143.0, 126.0),
    idle_speed=700 * RPM,
    max_speed=6400 * RPM,
    drag_torque=(16.0, 0.009, 7.0e-5),
    loss_constant=3.5,
    loss_slope=0.06,
    torque_lag=0.10,
    converter_capacity=163.0 / (2300 * RPM) ** 2,
    stall_ratio=1.9,
    lock_gear=1,
    lock_speed=1700 * RPM,
    economy_speed=1250 * RPM,
    power_share=0.75,
    ratio_lag=0.5,
    ratio_bend=0.35,
    pump=0.009,
    accessory_power=600.0,
    load_full=0.92,
    load_curvature=-0.04,
    load_speed_slope=-0.05,
    load_smoothing=0.10,
    squat=math.radians(0.24),
    load_pitch=2.8e-5,
    roll_gain=math.radians(0.45),
    pitch_frequency=1.4,
    tyre_slip=0.038,
)
"""A car of the middle with a naturally aspirated engine of 1.8 l and a push-belt variator behind a
converter, of ratios 2.6 to 0.4 as such boxes have. The belt and its pump lose 8 to 20 % of the
power, least near a ratio of one (Srivastava and Haque, A review on belt and chain continuously
variable transmissions, Mechanism and Machine Theory 44, 2009)."""

POWER_SPLIT: Final = replace(
    STEPLESS, name="petrol hybrid, power split", mass=1420.0, split=PowerSplit()
)
"""A hybrid that moves as the car with a stepless gearbox does: who gives the power is another."""

VAN: Final = SimulatedCar(
    name="diesel van, 6-speed manual",
    kind="van",
    mass=2100.0,
    engine="diesel",
    transmission="manual",
    gear_ratios=(5.076, 2.610, 1.518, 1.000, 0.791, 0.680),
    final_drive=3.923,
    wheel_radius=0.342,
    engine_inertia=0.30,
    wheel_inertia=10.0,
    drag_area=0.35 * 4.8,
    rolling_coefficient=0.0095,
    curve_speed=rpm(700, 1000, 1250, 1500, 2400, 3000, 3800, 4500),
    curve_torque=(110.0, 190.0, 270.0, 330.0, 330.0, 305.0, 263.0, 170.0),
    idle_speed=780 * RPM,
    max_speed=4500 * RPM,
    drag_torque=(26.0, 0.013, 1.2e-4),
    loss_constant=5.0,
    loss_slope=0.035,
    torque_lag=0.20,
    shift_time=1.0,
    shift_floor=0.0,
    upshift=2150 * RPM,
    downshift=1250 * RPM,
    accessory_power=900.0,
    load_full=1.0,
    load_curvature=-0.04,
    load_speed_slope=0.05,
    brake_drag=25.0,
    top_speed=130 / 3.6,
    liveliness=0.85,
    wind_height=1.35,
    yaw_drag=4.0,
    tyre_cooling=0.010,
    warm_up_time=900.0,
    squat=math.radians(0.22),
    squat_load=0.7,
    load_pitch=1.2e-5,
    roll_gain=math.radians(0.55),
    pitch_frequency=1.4,
    roll_frequency=1.3,
    heave_frequency=1.5,
    wheelbase=3.66,
    track=1.72,
    tyre_slip=0.038,
)
"""A van of 3.5 t permitted mass with a 2.1 l diesel of 105 kW; ratios, size and drag typical
of its class. Loaded, it sits nose up by 1 degree."""

TRUCK18: Final = SimulatedCar(
    name="rigid truck of 18 t, diesel, 12-speed automated",
    kind="truck",
    mass=9000.0,
    engine="diesel",
    transmission="automated",
    gear_ratios=(
        12.33, 9.59, 7.44, 5.78, 4.57, 3.55, 2.70, 2.10, 1.63, 1.27, 1.00, 0.78,
    ),
    final_drive=4.11,
    wheel_radius=0.485,
    engine_inertia=1.4,
    wheel_inertia=82.0,
    drag_area=0.60 * 9.2,
    rolling_coefficient=0.0065,
    curve_speed=rpm(600, 800, 1000, 1200, 1750, 2000, 2300, 2500),
    curve_torque=(450.0, 650.0, 900.0, 1100.0, 1100.0, 995.0, 885.0, 450.0),
    idle_speed=600 * RPM,
    max_speed=2500 * RPM,
    drag_torque=(65.0, 0.12, 8.0e-4),
    loss_constant=14.0,
    loss_slope=0.03,
    torque_lag=0.25,
    shift_time=0.9,
    shift_floor=0.0,
    upshift=1480 * RPM,
    downshift=1020 * RPM,
    launch_gear=3,
    gear_skip=2,
    accessory_power=4000.0,
    compressor_power=4000.0,
    load_full=1.0,
    load_curvature=0.03,
    load_speed_slope=0.03,
    torque_curvature=0.03,
    load_smoothing=0.05,
    brake_rise=0.40,
    brake_fall=0.30,
    brake_drag=100.0,
    retarder_force=12_000.0,
    top_speed=89 / 3.6,
    liveliness=0.5,
    wind_height=1.9,
    yaw_drag=6.0,
    tyre_cooling=0.006,
    warm_up_time=2400.0,
    squat=math.radians(0.08),
    squat_load=1.0,
    load_pitch=1.0e-6,
    roll_gain=math.radians(0.55),
    pitch_frequency=1.8,
    roll_frequency=0.9,
    heave_frequency=1.7,
    wheelbase=5.1,
    track=2.0,
    tyre_slip=0.030,
    side_slip=0.004,
    cylinders=6,
)  # fmt: skip
"""A two-axle box truck with a 6.9 l diesel of 213 kW, a gearbox of the ratios of a ZF
12AS1210 and the speed limiter of Directive 92/6/EEC. C_d, tyres and inertias as Wong,
Theory of Ground Vehicles, ch. 3, and Gillespie, ch. 4, give them for trucks; air brakes rise
within the 0.6 s of UN Regulation 13."""

BUS: Final = SimulatedCar(
    name="bus, diesel, 6-speed automated",
    kind="bus",
    mass=7000.0,
    engine="diesel",
    transmission="automated",
    gear_ratios=(6.75, 3.60, 2.13, 1.39, 1.00, 0.78),
    final_drive=3.545,
    wheel_radius=0.49,
    engine_inertia=1.1,
    wheel_inertia=62.0,
    drag_area=0.69 * 7.9,
    rolling_coefficient=0.0075,
    curve_speed=rpm(600, 800, 1000, 1200, 1600, 1900, 2300, 2600),
    curve_torque=(420.0, 560.0, 750.0, 850.0, 850.0, 800.0, 685.0, 420.0),
    idle_speed=700 * RPM,
    max_speed=2600 * RPM,
    drag_torque=(50.0, 0.10, 7.0e-4),
    loss_constant=8.0,
    loss_slope=0.035,
    torque_lag=0.25,
    shift_time=0.8,
    shift_floor=0.0,
    upshift=1450 * RPM,
    downshift=950 * RPM,
    accessory_power=4500.0,
    compressor_power=3500.0,
    load_full=1.0,
    load_curvature=0.03,
    load_speed_slope=0.03,
    torque_curvature=0.03,
    load_smoothing=0.05,
    brake_rise=0.35,
    brake_fall=0.30,
    brake_drag=60.0,
    retarder_force=9000.0,
    top_speed=100 / 3.6,
    liveliness=0.6,
    wind_height=1.6,
    yaw_drag=5.0,
    tyre_cooling=0.006,
    warm_up_time=1800.0,
    squat=math.radians(0.10),
    squat_load=1.0,
    load_pitch=1.5e-7,
    roll_gain=math.radians(0.55),
    pitch_frequency=1.1,
    roll_frequency=0.8,
    heave_frequency=1.15,
    wheelbase=5.2,
    track=2.05,
    tyre_slip=0.030,
    side_slip=0.004,
    cylinders=6,
)
"""The bus of Du 2025, Table 1: empty mass, C_d, frontal area, tyre radius, axle ratio and,
nearly, driveline efficiency (0.95). Its rolling coefficient of 0.0005 is a tenth of any tyre's;
0.0075 is usual for buses (Wong, Theory of Ground Vehicles, ch. 3, gives 0.006 to 0.01 for truck
tyres). The table gives no powertrain: a six-cylinder diesel of 6.7 l and 165 kW and a six-speed
box of a medium bus, its clutch opened by the control unit for every shift."""


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
