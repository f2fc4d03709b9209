"""From a scenario to how the car moved: the driver's plan and the compiled drive."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from weighbridge.constants import GAS_CONSTANT_DRY_AIR, GRAVITY, PETROL_HEATING_VALUE
from weighbridge.kernels import simulated_car as kernel
from weighbridge.kernels.simulated_driveline import Powertrain
from weighbridge.kernels.simulated_driver import CHANCES, Driver, Road, limit_target
from weighbridge.signals import Floats
from weighbridge.simulation.route import STEP

if TYPE_CHECKING:
    from weighbridge.simulation.scenario import Scenario

DT = 1.0 / 200.0
"""Step of the simulation [s]."""

DIESEL_HEATING_VALUE = 42.8e6
"""Lower heating value of diesel fuel [J/kg] (Heywood 1988, app. D)."""

ROUGHNESS_LENGTH = 0.1
"""Of open country with hedges, for the profile of the wind over height [m]."""

SPIN_COLD = 1.5
"""How much more gearbox and axle drag at the start [-]. Their oils are ten times as viscous at
20 degC as at 80 degC; churning and bearings follow with a power of about 0.4 (Naunheimer et al.,
Automotive Transmissions, 2nd ed., 2011, on load-independent losses)."""

_REFERENCE_TEMPERATURE = 298.15  # of rolling resistance, ISO 28580 [K]


class Trajectory(NamedTuple):
    """How the car moved, every 5 ms; SI."""

    time: Floats
    distance: Floats
    speed: Floats
    accel: Floats  # to the next sample
    engine_speed: Floats
    gear: Floats
    engine_torque: Floats
    gross_torque: Floats
    traction_force: Floats
    brake_force: Floats
    drag_force: Floats
    rolling_force: Floats
    wind_along: Floats
    mass: Floats
    fuel_flow: Floats
    pedal: Floats
    phase: Floats
    accessory_torque: Floats
    loaded: Floats  # since the start [kg]
    brake_pedal: Floats  # 1 while it is pressed [-]
    uncut: Floats  # part of the charge of overrun that still burns [-]
    battery_power: Floats | None = None  # that it gives, of a hybrid [W]


def _shelter(scenario: Scenario, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Draw the stretches driven behind another vehicle.

    Returns
    -------
    drag, speed : (n,) float64
        Air drag over that of a vehicle alone [-], and of whom is followed [m/s].
    """
    route, habits = scenario.route, scenario.habits
    drag, speed = np.ones(route.grade.size), np.full(route.grade.size, math.inf)
    # Nobody to follow where there is no traffic.
    size = scenario.effects.drafting * min(1.0, scenario.effects.traffic)
    if habits.following <= 0.0 or size <= 0.0:
        return drag, speed
    s = np.arange(route.grade.size) * STEP
    open_road = route.limit > 55 / 3.6
    x = 0.0
    while x < s[-1]:
        length = rng.uniform(500.0, 4000.0)
        saved = rng.uniform(*habits.shelter)
        slower = rng.uniform(0.8, 1.0)
        x += rng.exponential(2250.0 * (1.0 / habits.following - 1.0))
        part = (s >= x) & (s < x + length) & open_road
        # It takes some seconds to close up, and to be left alone.
        drag[part] = 1.0 - size * saved
        speed[part] = slower * route.limit[part]
        x += length
    return np.maximum(0.0, uniform_filter1d(drag, round(100.0 / STEP), mode="nearest")), speed


def _plan(scenario: Scenario, rng: np.random.Generator, habit_rng: np.random.Generator) -> Road:
    """Decide what the driver will do: speeds, stops, how hard to pull away."""
    route, effects = scenario.route, scenario.effects
    n = route.grade.size
    s = np.arange(n) * STEP
    curvature = route.curvature
    lively = scenario.aggressiveness * scenario.car.liveliness
    target = route.limit * (1.0 + 0.02 * float(rng.standard_normal()) * effects.driver_ripple)
    # Traffic, villages, overtaking: stretches driven slower or faster.
    x = 200.0
    city = route.limit < 55 / 3.6
    fast = route.limit > 100 / 3.6
    while x < s[-1] and effects.traffic > 0.0:
        k = int(x / STEP)
        if city[k]:
            length, factor = rng.uniform(80, 300), rng.uniform(0.65, 1.04)
        elif fast[k]:
            length, factor = rng.uniform(500, 2500), rng.choice([0.82, 0.9, 0.96, 1.0, 1.05, 1.09])
        else:
            length, factor = rng.uniform(300, 1200), rng.choice([0.75, 0.85, 0.95, 1.0, 1.05])
        if scenario.calibration:
            length = min(length, rng.uniform(180, 700))
            factor = rng.uniform(0.65 if fast[k] else 0.45, 1.15)
        part = (s >= x) & (s < x + length)
        target[part] *= 1.0 + effects.traffic * (factor - 1.0)
        x += length + rng.uniform(50, 400) * (3.0 if fast[k] and not scenario.calibration else 1.0)
    bend = math.sqrt(2.1 * lively)
    target = np.minimum(target, bend / np.sqrt(np.abs(curvature) + 1e-6))
    # Pull-away habits and revs per stretch.
    accel_limit = np.full(n, 2.0 * lively)
    revs = np.full(n, 0.05 * lively)
    x = 0.0
    while x < s[-1]:
        length = rng.uniform(300, 900)
        part = (s >= x) & (s < x + length)
        accel_limit[part] *= rng.uniform(0.75, 1.2)
        if scenario.calibration:
            accel_limit[part] *= rng.choice([0.6, 1.5, 3.0, 6.0])
            revs[part] = max(0.0, rng.uniform(-0.5, 0.95))
        else:
            revs[part] += rng.uniform(0.0, 0.15)
        x += length
    # Which lights are red.
    red = rng.random(route.stops.size) < route.stop_chance
    pause = rng.uniform(3.0, 25.0, route.stops.size)
    decel = rng.uniform(1.0, 2.1, route.stops.size) * lively**0.5
    pass_speed = rng.uniform(25, 45, route.stops.size) / 3.6
    for at, is_red, slow in zip(route.stops, red, pass_speed, strict=True):
        if not is_red and rng.random() < 0.3:
            k = int(at / STEP)
            target[k : k + 10] = np.minimum(target[k : k + 10], slow)
    shelter, ahead = _shelter(scenario, habit_rng)
    target = np.minimum(np.minimum(target, ahead), scenario.car.top_speed)
    target = np.maximum(target, 2.5)
    # Braking on purpose in town, mostly lifting the foot on the highway.
    slow_down = np.where(city, 0.95, np.where(fast, 0.5, 0.75)) * lively**0.5
    slow_down *= rng.uniform(0.85, 1.2)
    target = limit_target(target, STEP, slow_down)
    rolling = 1.0 + effects.surface * (route.surface - 1.0)
    stops = _stops(scenario, np.stack((route.stops, pause, decel))[:, red], s[-1])
    return Road(
        step=STEP,
        grade=np.ascontiguousarray(route.grade, dtype=np.float64),
        altitude=route.height,
        heading=np.ascontiguousarray(route.heading, dtype=np.float64),
        curvature=curvature,
        surface=rolling,
        exposure=np.ascontiguousarray(route.exposure, dtype=np.float64),
        shelter=shelter,
        target_speed=target,
        accel_limit=accel_limit,
        revs=np.minimum(revs, 1.0),
        stop_distance=stops[0],
        stop_time=stops[1],
        stop_decel=stops[2],
        stop_load=stops[3],
        brake_start=np.array([b.time for b in scenario.brakings], dtype=np.float64),
        brake_end=np.array([b.time + b.duration for b in scenario.brakings], dtype=np.float64),
        brake_decel=np.array([b.decel for b in scenario.brakings], dtype=np.float64),
    )


def _stops(scenario: Scenario, red: Floats, end: float) -> Floats:
    """Join red lights, stops for loading and the end of the road.

    Parameters
    ----------
    scenario : Scenario
    red : (3, n) float64
        Where [m], how long [s] and how hard the driver brakes [m/s^2].
    end : float
        Length of the road [m].

    Returns
    -------
    (4, k) float64
        As ``red``, and what is loaded [kg]; rising in distance.
    """
    loading = np.array([(x.distance, x.duration, 1.2, x.load) for x in scenario.loading])
    loading = loading.reshape(-1, 4).T
    # A light beside a place of loading is not waited at twice.
    apart = np.abs(red[0][:, None] - loading[0]).min(axis=1, initial=np.inf) > 60.0
    red = np.vstack((red[:, apart], np.zeros(np.count_nonzero(apart))))
    last = np.array([[end - 3.0], [10.0], [1.3], [0.0]])
    stops = np.hstack((red, loading, last))
    return np.ascontiguousarray(stops[:, np.argsort(stops[0], kind="stable")])


def _powertrain(scenario: Scenario) -> Powertrain:
    car, effects = scenario.car, scenario.effects
    warm = min(1.0, max(0.0, (scenario.ambient_temperature - 283.15) / 20.0))
    return Powertrain(
        electric=car.electric,
        gearings=np.array(car.gearings),
        launch_gear=car.launch_gear,
        skip=car.gear_skip,
        curve_speed=np.array(car.curve_speed),
        curve_torque=np.array(car.curve_torque),
        engine_inertia=car.engine_inertia,
        wheel_mass=car.wheel_inertia / car.wheel_radius**2
        + (scenario.trailer.wheel_mass if scenario.trailer else 0.0),
        idle_speed=car.idle_speed,
        max_speed=car.max_speed,
        drag_torque=np.array(car.drag_torque),
        loss_constant=car.loss_constant * effects.driveline_loss,
        loss_slope=car.loss_slope * effects.driveline_loss,
        torque_lag=max(0.02, car.torque_lag * effects.torque_lag),
        shift_time=car.shift_time,
        shift_floor=max(0.0, 1.0 - (1.0 - car.shift_floor) * effects.shift_gap),
        upshift=car.upshift,
        downshift=car.downshift,
        accessory_power=car.accessory_power * effects.accessories,
        compressor_power=car.compressor_power * warm * effects.accessories,
        cold_friction=0.35 * effects.warm_up,
        heating_value=DIESEL_HEATING_VALUE if car.engine == "diesel" else PETROL_HEATING_VALUE,
        # Best indicated efficiencies of the two kinds of engine, Heywood 1988, ch. 5.
        fuel_efficiency=0.45 if car.engine == "diesel" else 0.385,
        regeneration=car.regeneration,
        automated=car.transmission == "automated",
        converter=car.converter_capacity,
        stall_ratio=car.stall_ratio,
        lock_gear=car.lock_gear,
        lock_speed=car.lock_speed,
        spin_loss=car.spin_loss / car.wheel_radius**2 * effects.spin_loss,
        spin_cold=SPIN_COLD * effects.warm_up,
        overrun_charge=car.overrun_charge * effects.overrun_fuel,
        cut_delay=car.cut_delay * effects.overrun_fuel,
        cut_speed=car.cut_speed * effects.overrun_fuel,
        stepless=car.transmission == "stepless",
        economy=car.economy_speed,
        power_share=car.power_share,
        ratio_lag=car.ratio_lag,
        ratio_bend=car.ratio_bend * effects.driveline_loss,
        pump=car.pump * effects.driveline_loss,
    )


def _resistance(scenario: Scenario) -> kernel.Resistance:
    car, effects, trailer = scenario.car, scenario.effects, scenario.trailer
    density = scenario.pressure / (GAS_CONSTANT_DRY_AIR * scenario.ambient_temperature)
    colder = _REFERENCE_TEMPERATURE - scenario.ambient_temperature
    rolling, drag_area = car.rolling_coefficient, car.drag_area
    if trailer is not None:
        behind = 1.0 - scenario.carried / scenario.mass
        rolling += behind * (trailer.rolling_coefficient - rolling)
        drag_area += trailer.drag_area
    rolling *= scenario.tyre_factor
    rolling *= 1.0 + effects.tyre_temperature * car.tyre_cooling * colder
    height = math.log(car.wind_height / ROUGHNESS_LENGTH) / math.log(10.0 / ROUGHNESS_LENGTH)
    wind = scenario.wind_speed * height
    return kernel.Resistance(
        mass=scenario.mass,
        drag_area=drag_area + scenario.drag_area_addition,
        yaw_drag=car.yaw_drag * effects.yaw_drag,
        rolling=rolling,
        rolling_speed=0.20 * effects.tyre_speed,
        rolling_cold=0.22 * effects.warm_up,
        warm_up_time=car.warm_up_time,
        cornering=0.005 * effects.cornering_drag,
        tyre_slip=car.tyre_slip
        * (scenario.slip_factor / (scenario.carried * GRAVITY))
        * effects.tyre_slip,
        density=density,
        density_height=GAS_CONSTANT_DRY_AIR * scenario.ambient_temperature / GRAVITY,
        wind_north=-wind * math.cos(scenario.wind_from),
        wind_east=-wind * math.sin(scenario.wind_from),
        gust_std=scenario.gust_std * wind * effects.gusts,
        gust_length=60.0,
        slow_wind_std=0.12 * effects.gusts,
        fuel_burn=effects.fuel_burn,
        brake_rise=car.brake_rise,
        brake_fall=car.brake_fall,
        brake_drag=car.brake_drag * effects.brake_drag,
        brake_drag_time=15.0,
    )


def _driver(scenario: Scenario) -> Driver:
    habits, effects = scenario.habits, scenario.effects
    light, foot = effects.light_braking, effects.foot_switch
    low, high = (max(0.0, 0.3 + light * (x - 0.3)) for x in habits.least_braking)
    return Driver(
        ripple=0.09 * effects.driver_ripple,
        speed_ripple=0.018 * effects.driver_ripple,
        gain=0.4,
        rest=scenario.start_rest,
        # What the driven axle of a heavy vehicle grips, or its standing passengers bear.
        grip=4.0 * min(1.0, scenario.car.liveliness),
        least_low=low,
        least_high=high,
        touch_rate=habits.touch_rate * light,
        touch_strength=habits.touch_strength,
        touch_time=habits.touch_time,
        foot_low=habits.foot_time[0] * foot,
        foot_high=habits.foot_time[1] * foot,
        both_chance=min(1.0, habits.both_pedals * light),
    )


def simulate_trajectory(
    scenario: Scenario,
    plan_rng: np.random.Generator,
    noise_rng: np.random.Generator,
    habit_rng: np.random.Generator,
) -> Trajectory:
    """Drive the scenario's car along its route.

    Parameters
    ----------
    scenario : Scenario
    plan_rng, noise_rng : numpy.random.Generator
        Of the driver's plan, and of foot, wind and electric load.
    habit_rng : numpy.random.Generator
        Of the foot between the pedals and of vehicles ahead.

    Returns
    -------
    Trajectory
    """
    road = _plan(scenario, plan_rng, habit_rng)
    longest = 1.7 * float(np.sum(STEP / road.target_speed)) + 1.3 * float(road.stop_time.sum())
    longest += scenario.start_rest + 30.0 * road.stop_time.size + 120.0
    if scenario.duration is not None:
        longest = min(longest, scenario.duration)
    steps = int(longest / DT)
    noise = noise_rng.standard_normal((steps // kernel.NOISE_STRIDE + 1, kernel.NOISE_CHANNELS))
    chance = habit_rng.random((noise.shape[0], CHANCES))
    out, count = kernel.drive(
        road,
        _powertrain(scenario),
        _resistance(scenario),
        _driver(scenario),
        noise,
        chance,
        DT,
        steps,
    )
    columns = [row[:count] for row in out]
    return Trajectory(np.arange(count) * DT, *columns)
