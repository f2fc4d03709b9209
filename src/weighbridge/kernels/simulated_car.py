"""One vehicle driven along a road: longitudinal dynamics.

The step is 5 ms. Distance is integrated with the mean of old and new speed, so
that force times distance is kinetic energy exactly.
"""

from typing import NamedTuple

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.kernels._jit import inlined_kernel, kernel, spliced_kernel
from weighbridge.kernels.simulated_driveline import (
    DRIVING,
    OPEN,
    Shaft,
    choose_gear,
    converter_torques,
    crank_drag,
    cut_fuel,
    foot_off,
    fuel_flow,
    gearbox_loss,
    transmit,
)
from weighbridge.kernels.simulated_driver import (
    ACCELERATOR,
    ON_BRAKE,
    Foot,
    Intent,
    loaded,
    look_up,
    move_foot,
    steer,
)

DISTANCE, SPEED, ACCEL, ENGINE_SPEED, GEAR, TORQUE, GROSS_TORQUE, TRACTION, BRAKE, DRAG = range(10)
ROLLING, WIND_ALONG, MASS, FUEL_FLOW, PEDAL, PHASE, ACCESSORY, LOADED = range(10, 18)
BRAKE_PEDAL, UNCUT = 18, 19
FIELDS = 20

NOISE_STRIDE = 20  # steps per row of random numbers: 10 Hz
NOISE_CHANNELS = 6


class Resistance(NamedTuple):
    """What holds the car back, and its mass."""

    mass: float  # at the start [kg]
    drag_area: float  # [m^2]
    yaw_drag: float  # growth of the drag area with sin^2 of the flow angle [-]
    rolling: float  # warm coefficient at walking pace [-]
    rolling_speed: float  # its growth with (v / 30 m/s)^2 [-]
    rolling_cold: float  # extra at the start [-]
    warm_up_time: float  # of tyres and oil [s]
    cornering: float  # drag per mass and squared lateral acceleration [s^2/m]
    tyre_slip: float  # slip per traction force [1/N]
    density: float  # of air at altitude zero of the road [kg/m^3]
    density_height: float  # scale height of the density [m]
    wind_north: float  # the wind blows to, at vehicle height [m/s]
    wind_east: float
    gust_std: float  # [m/s]
    gust_length: float  # [m]
    slow_wind_std: float  # part of the mean wind [-]
    fuel_burn: float  # 1 to lose the fuel's mass, 0 not to
    brake_rise: float  # lag of the brakes when they are applied [s]
    brake_fall: float  # and released [s]
    brake_drag: float  # left of the brakes when released [N]
    brake_drag_time: float  # in which it fades [s]


class Weather(NamedTuple):
    """Wandering of foot, wind and electric load, unit standard deviation."""

    ripple: float
    speed_ripple: float
    gust: float
    cross_gust: float
    slow: float
    electric_load: float


class Car(NamedTuple):
    """Vehicle and driver at one instant."""

    s: float  # distance [m]
    v: float  # [m/s]
    a: float  # [m/s^2]
    shaft: Shaft
    intent: Intent
    foot: Foot
    brake: float  # force [N]
    residual: float  # left of the brakes when released [N]
    off_pedal: float  # time since the foot left the accelerator [s]
    uncut: float  # part of the charge of overrun that still burns [-]
    fuel: float  # burnt [kg]
    load: float  # taken on [kg]
    mass: float  # [kg]


@inlined_kernel
def _wander(weather, row, v, fast, gust_length):
    """Let the random quantities wander for ``fast`` seconds."""
    c = np.exp(-fast / 2.5)
    ripple = c * weather.ripple + np.sqrt(1.0 - c * c) * row[0]
    c = np.exp(-fast / 20.0)
    speed_ripple = c * weather.speed_ripple + np.sqrt(1.0 - c * c) * row[1]
    c = np.exp(-fast * (v + 3.0) / gust_length)
    gust = c * weather.gust + np.sqrt(1.0 - c * c) * row[2]
    cross_gust = c * weather.cross_gust + np.sqrt(1.0 - c * c) * row[3]
    c = np.exp(-fast / 600.0)
    slow = c * weather.slow + np.sqrt(1.0 - c * c) * row[4]
    c = np.exp(-fast / 30.0)
    electric_load = c * weather.electric_load + np.sqrt(1.0 - c * c) * row[5]
    return Weather(ripple, speed_ripple, gust, cross_gust, slow, electric_load)


@inlined_kernel
def _resist(road, resistance, weather, where, v, mass, cold):
    """Drag, rolling resistance and slope [N], and the wind from behind [m/s]."""
    grade = look_up(road.grade, where)
    sine, cosine = np.sin(grade), np.cos(grade)
    curvature = look_up(road.curvature, where)
    heading = look_up(road.heading, where)
    exposure = look_up(road.exposure, where)
    scale = exposure * (1.0 + resistance.slow_wind_std * weather.slow)
    north, east = resistance.wind_north * scale, resistance.wind_east * scale
    tail = north * np.cos(heading) + east * np.sin(heading)
    side = -north * np.sin(heading) + east * np.cos(heading)
    tail += resistance.gust_std * exposure * weather.gust
    side += resistance.gust_std * exposure * weather.cross_gust
    flow = v - tail
    flow_total = np.sqrt(flow * flow + side * side) + 1e-9
    density = resistance.density * np.exp(
        -look_up(road.altitude, where) / resistance.density_height
    )
    area = resistance.drag_area * (1.0 + resistance.yaw_drag * (side / flow_total) ** 2)
    drag = 0.5 * density * area * flow_total * flow * look_up(road.shelter, where)
    lateral = v * v * curvature
    rolling = (
        mass
        * GRAVITY
        * cosine
        * resistance.rolling
        * look_up(road.surface, where)
        * (1.0 + resistance.rolling_cold * cold)
        * (1.0 + resistance.rolling_speed * (v / 30.0) ** 2)
    ) + mass * resistance.cornering * lateral * lateral
    slope = mass * GRAVITY * sine
    if v < 0.05:
        drag *= v / 0.05
        rolling *= v / 0.05
    return drag, rolling, slope, tail


@inlined_kernel
def _brake(brake, foot, wanted, coasting, at_stop, inertia, push, resistance, dt):
    """Brake force [N], from the acceleration wanted and the one the vehicle has with the
    foot off the pedal, or of a touch; at a stop, against what pushes.
    """
    asked = 0.0
    if foot.place == ON_BRAKE:
        asked = max(0.0, inertia * (coasting - wanted))
        if foot.touch_left > 0.0:
            asked = max(asked, inertia * foot.touch)
        if at_stop:
            asked = inertia + push
    elif foot.both > 0.0:
        asked = inertia * foot.touch
    lag = resistance.brake_fall if asked < brake else resistance.brake_rise
    brake += (asked - brake) * dt / lag
    if brake < 5.0 and asked == 0.0 and foot.place != ON_BRAKE:
        brake = 0.0
    return brake


@inlined_kernel
def _press(power, shaft, drag, torque_wanted, coast, lifted, v, dt):
    """Torque the pedal asks for [N m], and the pedal [-]."""
    if power.electric:
        # The motor brakes as asked; a lifted foot asks for a little.
        if coast and v > 3.0:
            torque_wanted = min(torque_wanted, -0.2 * power.regeneration)
    elif lifted or (coast and v > 3.0):
        torque_wanted = drag.lowest
    torque_wanted = min(drag.full, max(drag.lowest, torque_wanted))
    pedal_torque = shaft.pedal_torque + (torque_wanted - shaft.pedal_torque) * dt / 0.25
    return pedal_torque, min(2.0, max(0.0, pedal_torque / max(drag.full, 1.0)))


@inlined_kernel
def _shift(power, shaft, road, where, sync, braking, pedal_torque, pedal, dt):
    """Let the gearbox see the pedal, and start a shift where it wants one."""
    calm_pedal, since_shift = shaft.calm_pedal, shaft.since_shift
    if shaft.shifting <= 0.0:
        calm_pedal += (pedal - calm_pedal) * dt / 0.5
        since_shift += dt
    shaft = Shaft(
        shaft.engine, shaft.torque, shaft.gear, shaft.gear_from, since_shift, shaft.shifting,
        shaft.locked, shaft.fuel_cut, shaft.phase, pedal_torque, calm_pedal, shaft.gearing,
    )  # fmt: skip
    ready = shaft.shifting <= 0.0 and (shaft.locked or power.converter > 0.0)
    if power.gearings.size == 1 or power.stepless or not ready:
        return shaft
    new = choose_gear(power, shaft, sync, look_up(road.revs, where), braking)
    if new == shaft.gear:
        return shaft
    return Shaft(
        shaft.engine, shaft.torque, new, shaft.gear, 0.0, power.shift_time,
        shaft.locked, shaft.fuel_cut, shaft.phase, pedal_torque, calm_pedal, shaft.gearing,
    )  # fmt: skip


@inlined_kernel
def _wanted_torque(power, shaft, crank_side, wanted, inertia, against, gearing, sync):
    """Torque at the crank [N m] for an acceleration wanted, against the forces [N] of road and
    gearbox.
    """
    turning = power.engine_inertia * gearing * gearing
    if power.automated and shaft.phase != DRIVING:
        # Behind a slipping clutch the engine need not gain speed with the vehicle.
        turning = 0.0
    resist, spin = against
    torque = (
        ((inertia + turning) * wanted + resist + spin) / gearing + crank_side.loss_constant
    ) * (1.0 + power.loss_slope)
    if power.converter > 0.0 and not shaft.locked and torque > 0.0:
        torque /= converter_torques(power, shaft.engine, sync, 1.0)[1]
    return torque


@spliced_kernel
def _step(road, power, resistance, driver, car, weather, uneven, every, dt, out, k):
    """Drive step ``k`` and note it down in ``out``.

    ``uneven`` are the random numbers of the foot, which decide over ``every`` seconds.
    """
    t = k * dt
    s, v, shaft, mass = car.s, car.v, car.shaft, car.mass
    where = s / road.step
    cold = np.exp(-t / resistance.warm_up_time)
    drag, rolling, slope, tail = _resist(road, resistance, weather, where, v, mass, cold)
    resist = drag + rolling + slope

    gearing = shaft.gearing if power.stepless else power.gearings[shaft.gear - 1]
    weight = resistance.mass / (resistance.mass + car.load)
    pull = mass * car.a + drag + rolling + slope
    slip = min(0.05, max(-0.05, resistance.tyre_slip * weight * pull))
    sync = gearing * v * (1.0 + slip)
    crank_side = crank_drag(power, shaft.engine, v, t, cold, weather.electric_load, car.uncut)
    spin = power.spin_loss * (1.0 + power.spin_cold * cold) * v

    intent = steer(road, driver, car.intent, t, s, v, weather.ripple, weather.speed_ripple, dt)
    load = loaded(road, intent) if car.intent.at_stop else car.load
    inertia = mass + power.wheel_mass
    idle_force = gearing * foot_off(power, shaft, crank_side, sync)
    coasting = (idle_force - spin - resist) / inertia
    foot = move_foot(
        driver, car.foot, uneven, every, power.electric, intent.wanted, coasting, intent.coast,
        intent.at_stop, v, dt,
    )  # fmt: skip
    lifted = foot.place != ACCELERATOR
    brake = _brake(
        car.brake, foot, intent.wanted, coasting, intent.at_stop, inertia,
        abs(slope) + max(0.0, idle_force), resistance, dt,
    )  # fmt: skip
    torque = _wanted_torque(
        power, shaft, crank_side, intent.wanted, inertia, (resist, spin), gearing, sync
    )
    pedal_torque, pedal = _press(power, shaft, crank_side, torque, intent.coast, lifted, v, dt)

    shaft = _shift(power, shaft, road, where, sync, lifted, pedal_torque, pedal, dt)
    shaft, gearing, net, crank = transmit(
        power, shaft, crank_side, gearing, v, slip, pedal, lifted, dt
    )
    off_pedal, uncut = cut_fuel(power, shaft, crank_side, car.off_pedal, car.uncut, dt)
    gross, burnt = crank, 0.0
    if not power.electric:
        gross = max(0.0, crank + crank_side.friction + crank_side.accessory)
        burnt = fuel_flow(power, shaft, crank_side, gross)

    loss = gearbox_loss(power, crank_side, gearing, shaft.engine, net, v)
    rotating = power.engine_inertia * gearing * gearing if shaft.phase == DRIVING else 0.0
    force = gearing * (net - loss) - spin
    residual = car.residual * (1.0 - dt / resistance.brake_drag_time)
    if brake > resistance.brake_drag:
        residual = resistance.brake_drag
    held = max(brake, residual) if v > 0.0 else 0.0
    a = (force - held - resist) / (inertia + rotating)
    if v <= 0.0 and (intent.at_stop or a < 0.0):
        a = 0.0
    v_new = v + a * dt
    if v_new < 0.0:
        v_new = 0.0
        a = -v / dt
    fuel = car.fuel + burnt * dt
    mass = resistance.mass - resistance.fuel_burn * fuel + load
    out[DISTANCE, k], out[SPEED, k], out[ACCEL, k] = s, v, a
    out[ENGINE_SPEED, k], out[GEAR, k], out[PHASE, k] = shaft.engine, shaft.gear, shaft.phase
    out[TORQUE, k], out[GROSS_TORQUE, k], out[ACCESSORY, k] = crank, gross, crank_side.accessory
    out[TRACTION, k], out[BRAKE, k], out[DRAG, k] = force - rotating * a, held, drag
    out[ROLLING, k], out[WIND_ALONG, k], out[MASS, k], out[LOADED, k] = rolling, tail, mass, load
    out[FUEL_FLOW, k], out[PEDAL, k], out[UNCUT, k] = burnt, 0.0 if lifted else pedal, uncut
    out[BRAKE_PEDAL, k] = 1.0 if foot.place == ON_BRAKE or foot.both > 0.0 else 0.0
    return Car(
        s + 0.5 * (v + v_new) * dt, v_new, a, shaft, intent, foot, brake, residual, off_pedal,
        uncut, fuel, load, mass,
    )  # fmt: skip


@kernel
def drive(road, power, resistance, driver, noise, chance, dt, steps):
    """Drive the road from end to end.

    Parameters
    ----------
    road, power, resistance, driver
        See the types.
    noise : (m, 6) float64
        Standard normal numbers at ``NOISE_STRIDE`` steps.
    chance : (m, 6) float64
        Evenly distributed numbers in [0, 1) at ``NOISE_STRIDE`` steps, for the foot.
    dt : float
        Step [s].
    steps : int
        Steps at most.

    Returns
    -------
    out : (20, steps) float64
        One row per field, see the constants of this module; SI.
    count : int
        Steps driven.

    Notes
    -----
    Equation (1) of Jensen 2022 with the torque split: the driveline applies
    ``G (T_e - I_e dw/dt - T_loss)`` at the wheels, which accelerates the mass
    and the wheels against drag, rolling, slope and brakes.
    """
    out = np.zeros((FIELDS, steps))
    length = (road.grade.size - 1) * road.step
    fast = dt * NOISE_STRIDE
    shaft = Shaft(
        power.idle_speed, 0.0, power.launch_gear, power.launch_gear, 10.0, 0.0,
        power.electric, False, OPEN, 0.0, 0.0, power.gearings[power.launch_gear - 1],
    )  # fmt: skip
    intent = Intent(0.0, 0.0, 0, False, 0, True, driver.rest)
    foot = Foot(ON_BRAKE, 0.0, driver.least_high, 0.0, 0.0, 0.0)
    car = Car(0.0, 0.0, 0.0, shaft, intent, foot, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, resistance.mass)
    weather = Weather(0.0, 0.0, 0.0, 0.0, noise[0, 4], 0.0)
    for k in range(steps):
        every = 0.0
        if k % NOISE_STRIDE == 0:
            row = noise[(k // NOISE_STRIDE) % noise.shape[0]]
            weather = _wander(weather, row, car.v, fast, resistance.gust_length)
            uneven = chance[(k // NOISE_STRIDE) % chance.shape[0]]
            every = fast
        car = _step(road, power, resistance, driver, car, weather, uneven, every, dt, out, k)
        intent = car.intent
        last = intent.stop >= road.stop_distance.size and intent.at_stop
        if car.s >= length - 2.0 or (last and intent.waiting < dt):
            return out, k + 1
    return out, steps
