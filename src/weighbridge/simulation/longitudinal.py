"""From a scenario to how the car moved: the driver's plan and the compiled drive."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from weighbridge.constants import GAS_CONSTANT_DRY_AIR, GRAVITY, PETROL_HEATING_VALUE
from weighbridge.kernels import simulated_car as kernel
from weighbridge.signals import Floats
from weighbridge.simulation.route import STEP

if TYPE_CHECKING:
    from weighbridge.simulation.scenario import Scenario

DT = 1.0 / 200.0
"""Step of the simulation [s]."""

WIND_HEIGHT_FACTOR = math.log(1.0 / 0.1) / math.log(10.0 / 0.1)
"""Wind at 1 m over wind at 10 m, logarithmic profile, roughness length 0.1 m [-]."""

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


def _plan(scenario: Scenario, rng: np.random.Generator) -> kernel.Road:
    """Decide what the driver will do: speeds, stops, how hard to pull away."""
    route, effects = scenario.route, scenario.effects
    n = route.grade.size
    s = np.arange(n) * STEP
    curvature = route.curvature
    lively = scenario.aggressiveness
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
    target = np.maximum(target, 2.5)
    # Braking on purpose in town, mostly lifting the foot on the highway.
    slow_down = np.where(city, 0.95, np.where(fast, 0.5, 0.75)) * lively**0.5
    slow_down *= rng.uniform(0.85, 1.2)
    target = kernel.limit_target(target, STEP, slow_down)
    rolling = 1.0 + effects.surface * (route.surface - 1.0)
    stops = _stops(scenario, np.stack((route.stops, pause, decel))[:, red], s[-1])
    return kernel.Road(
        step=STEP,
        grade=np.ascontiguousarray(route.grade, dtype=np.float64),
        altitude=route.height,
        heading=np.ascontiguousarray(route.heading, dtype=np.float64),
        curvature=curvature,
        surface=rolling,
        exposure=np.ascontiguousarray(route.exposure, dtype=np.float64),
        target_speed=target,
        accel_limit=accel_limit,
        revs=np.minimum(revs, 1.0),
        stop_distance=stops[0],
        stop_time=stops[1],
        stop_decel=stops[2],
        stop_load=stops[3],
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


def _powertrain(scenario: Scenario) -> kernel.Powertrain:
    car, effects = scenario.car, scenario.effects
    warm = min(1.0, max(0.0, (scenario.ambient_temperature - 283.15) / 20.0))
    return kernel.Powertrain(
        electric=car.electric,
        gearings=np.array(car.gearings),
        curve_speed=np.array(car.curve_speed),
        curve_torque=np.array(car.curve_torque),
        engine_inertia=car.engine_inertia,
        wheel_mass=car.wheel_inertia / car.wheel_radius**2,
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
        heating_value=PETROL_HEATING_VALUE,
        regeneration=car.regeneration,
    )


def _resistance(scenario: Scenario) -> kernel.Resistance:
    car, effects = scenario.car, scenario.effects
    density = scenario.pressure / (GAS_CONSTANT_DRY_AIR * scenario.ambient_temperature)
    colder = _REFERENCE_TEMPERATURE - scenario.ambient_temperature
    # ISO 28580 corrects rolling resistance of car tyres by 0.8 % per kelvin.
    rolling = car.rolling_coefficient * scenario.tyre_factor
    rolling *= 1.0 + effects.tyre_temperature * 0.008 * colder
    wind = scenario.wind_speed * WIND_HEIGHT_FACTOR
    return kernel.Resistance(
        mass=scenario.mass,
        drag_area=car.drag_area + scenario.drag_area_addition,
        yaw_drag=2.5 * effects.yaw_drag,
        rolling=rolling,
        rolling_speed=0.20 * effects.tyre_speed,
        rolling_cold=0.22 * effects.warm_up,
        warm_up_time=600.0,
        cornering=0.005 * effects.cornering_drag,
        tyre_slip=car.tyre_slip / (scenario.mass * GRAVITY) * effects.tyre_slip,
        density=density,
        density_height=GAS_CONSTANT_DRY_AIR * scenario.ambient_temperature / GRAVITY,
        wind_north=-wind * math.cos(scenario.wind_from),
        wind_east=-wind * math.sin(scenario.wind_from),
        gust_std=scenario.gust_std * wind * effects.gusts,
        gust_length=60.0,
        slow_wind_std=0.12 * effects.gusts,
        fuel_burn=effects.fuel_burn,
    )


def simulate_trajectory(
    scenario: Scenario, plan_rng: np.random.Generator, noise_rng: np.random.Generator
) -> Trajectory:
    """Drive the scenario's car along its route.

    Parameters
    ----------
    scenario : Scenario
    plan_rng, noise_rng : numpy.random.Generator
        Of the driver's plan, and of foot, wind and electric load.

    Returns
    -------
    Trajectory
    """
    road = _plan(scenario, plan_rng)
    longest = 1.7 * float(np.sum(STEP / road.target_speed)) + 1.3 * float(road.stop_time.sum())
    longest += scenario.start_rest + 30.0 * road.stop_time.size + 120.0
    if scenario.duration is not None:
        longest = min(longest, scenario.duration)
    steps = int(longest / DT)
    noise = noise_rng.standard_normal((steps // kernel.NOISE_STRIDE + 1, kernel.NOISE_CHANNELS))
    ripple = scenario.effects.driver_ripple
    driver = kernel.Driver(
        ripple=0.09 * ripple, speed_ripple=0.018 * ripple, gain=0.4, rest=scenario.start_rest
    )
    out, count = kernel.drive(
        road, _powertrain(scenario), _resistance(scenario), driver, noise, DT, steps
    )
    columns = [row[:count] for row in out]
    return Trajectory(np.arange(count) * DT, *columns)
