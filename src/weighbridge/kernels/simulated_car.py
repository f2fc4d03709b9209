"""One car driven along a road: driver, powertrain and longitudinal dynamics.

The step is 5 ms. Distance is integrated with the mean of old and new speed, so
that force times distance is kinetic energy exactly.
"""

from typing import NamedTuple

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.kernels._jit import kernel

DISTANCE, SPEED, ACCEL, ENGINE_SPEED, GEAR, TORQUE, GROSS_TORQUE, TRACTION, BRAKE, DRAG = range(10)
ROLLING, WIND_ALONG, MASS, FUEL_FLOW, PEDAL, PHASE, ACCESSORY, LOADED = range(10, 18)
FIELDS = 18

DRIVING, SHIFTING, SLIPPING, OPEN = range(4)
"""Phases of the clutch: locked, changing gear, slipping at a launch, open."""

LOADING_STARTS, LOADING_ENDS = 0.15, 0.85
"""Part of a stop's time at which a load change starts and ends, evenly between."""

NOISE_STRIDE = 20  # steps per row of random numbers: 10 Hz
NOISE_CHANNELS = 6


class Road(NamedTuple):
    """The road over distance, on an even grid."""

    step: float  # [m]
    grade: np.ndarray  # (n,) [rad]
    altitude: np.ndarray  # (n,) [m]
    heading: np.ndarray  # (n,) unwrapped [rad]
    curvature: np.ndarray  # (n,) positive to the right [1/m]
    surface: np.ndarray  # (n,) rolling resistance factor [-]
    exposure: np.ndarray  # (n,) wind over wind in the open [-]
    target_speed: np.ndarray  # (n,) what the driver wants to drive [m/s]
    accel_limit: np.ndarray  # (n,) pull-away acceleration the driver uses [m/s^2]
    revs: np.ndarray  # (n,) eagerness to rev, 0 calm to 1 to the limiter [-]
    stop_distance: np.ndarray  # (k,) where to stop [m]
    stop_time: np.ndarray  # (k,) how long [s]
    stop_decel: np.ndarray  # (k,) how hard [m/s^2]
    stop_load: np.ndarray  # (k,) what is loaded there, unloaded negative [kg]


class Powertrain(NamedTuple):
    """Engine or motor, clutch and gears."""

    electric: bool
    gearings: np.ndarray  # (n,) engine angle over distance [1/m]
    curve_speed: np.ndarray  # (k,) [rad/s]
    curve_torque: np.ndarray  # (k,) full load torque [N m]
    engine_inertia: float  # [kg m^2]
    wheel_mass: float  # wheel inertia over radius squared [kg]
    idle_speed: float  # [rad/s]
    max_speed: float  # [rad/s]
    drag_torque: np.ndarray  # (3,) of rising powers of engine speed [N m]
    loss_constant: float  # at the gearbox input [N m]
    loss_slope: float  # part of the torque [-]
    torque_lag: float  # [s]
    shift_time: float  # [s]
    shift_floor: float  # torque kept during a shift [-]
    upshift: float  # calm upshift speed [rad/s]
    downshift: float  # calm downshift speed [rad/s]
    accessory_power: float  # [W]
    compressor_power: float  # [W]
    cold_friction: float  # extra friction at the start [-]
    heating_value: float  # [J/kg]
    regeneration: float  # largest braking torque of a motor [N m]


class Resistance(NamedTuple):
    """What holds the car back, and its mass."""

    mass: float  # at the start [kg]
    drag_area: float  # [m^2]
    yaw_drag: float  # growth of the drag area with sin^2 of the flow angle [-]
    rolling: float  # warm coefficient at walking pace [-]
    rolling_speed: float  # its growth with (v / 30 m/s)^2 [-]
    rolling_cold: float  # extra at the start [-]
    warm_up_time: float  # [s]
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


class Driver(NamedTuple):
    """How the driver drives."""

    ripple: float  # of the acceleration wanted [m/s^2]
    speed_ripple: float  # of the speed wanted, relative [-]
    gain: float  # acceleration per speed error [1/s]
    rest: float  # standing before the start [s]


@kernel
def limit_target(speed, step, decel):
    """Lower a speed profile so that it can be followed with a deceleration.

    Parameters
    ----------
    speed : (n,) float64
        Speed wanted over distance [m/s].
    step : float
        Grid step [m].
    decel : (n,) float64
        Deceleration the driver uses [m/s^2].

    Returns
    -------
    speed : (n,) float64
    """
    out = speed.copy()
    for k in range(out.size - 2, -1, -1):
        out[k] = min(out[k], np.sqrt(out[k + 1] ** 2 + 2.0 * decel[k] * step))
    return out


@kernel
def _look_up(values, where):
    """Interpolate on a grid of unit step, held at the ends."""
    if where <= 0.0:
        return values[0]
    last = values.size - 1
    if where >= last:
        return values[last]
    i = int(where)
    part = where - i
    return values[i] + part * (values[i + 1] - values[i])


@kernel
def _full_torque(power, speed):
    """Full load torque at an engine speed; none above the limiter."""
    x, y = power.curve_speed, power.curve_torque
    if speed >= power.max_speed:
        return max(0.0, y[-1] * (1.0 - (speed - power.max_speed) / 15.0))
    if speed <= x[0]:
        return y[0]
    i = 0
    while i < x.size - 2 and speed > x[i + 1]:
        i += 1
    part = min(1.0, (speed - x[i]) / (x[i + 1] - x[i]))
    return y[i] + part * (y[i + 1] - y[i])


@kernel
def _upshift_speed(power, eager):
    """Engine speed at which the next gear is taken."""
    return power.upshift + (0.965 * power.max_speed - power.upshift) * min(1.0, eager) ** 1.6


@kernel
def _downshift_speed(power, eager):
    """Engine speed below which the gear before is taken."""
    return power.downshift + (0.55 * power.max_speed - power.downshift) * min(1.0, eager) ** 2


@kernel
def _loaded(road, stop, waiting):
    """Load taken on since the start, while standing for ``waiting`` s more at ``stop``."""
    if stop < 0:
        return 0.0
    done = 1.0 - waiting / road.stop_time[stop]
    part = min(1.0, max(0.0, (done - LOADING_STARTS) / (LOADING_ENDS - LOADING_STARTS)))
    return road.stop_load[:stop].sum() + part * road.stop_load[stop]


@kernel
def drive(road, power, resistance, driver, noise, dt, steps):
    """Drive the road from end to end.

    Parameters
    ----------
    road, power, resistance, driver
        See the types.
    noise : (m, 6) float64
        Standard normal numbers at ``NOISE_STRIDE`` steps.
    dt : float
        Step [s].
    steps : int
        Steps at most.

    Returns
    -------
    out : (18, steps) float64
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
    gears = power.gearings.size
    length = (road.grade.size - 1) * road.step
    fast = dt * NOISE_STRIDE

    s, v, a = 0.0, 0.0, 0.0
    gear = 1
    gear_from = 1
    since_shift = 10.0
    shifting = 0.0  # time left of a shift
    engine = power.idle_speed
    torque = 0.0
    pedal_torque = 0.0
    wanted = 0.0
    integral = 0.0
    brake = 0.0
    braking = False
    fuel_cut = False
    locked = power.electric
    fuel = 0.0
    loaded = 0.0
    stop = 0
    approach = 0  # 1 foot lifted, 2 braking
    waiting = driver.rest
    at_stop = True
    ripple, speed_ripple, gust, cross_gust, slow, electric_load = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    pedal = 0.0
    mass = resistance.mass
    slow = noise[0, 4]
    phase = OPEN
    calm_pedal = 0.0

    for k in range(steps):
        t = k * dt
        where = s / road.step
        if k % NOISE_STRIDE == 0:
            row = noise[(k // NOISE_STRIDE) % noise.shape[0]]
            c = np.exp(-fast / 2.5)
            ripple = c * ripple + np.sqrt(1.0 - c * c) * row[0]
            c = np.exp(-fast / 20.0)
            speed_ripple = c * speed_ripple + np.sqrt(1.0 - c * c) * row[1]
            c = np.exp(-fast * (v + 3.0) / resistance.gust_length)
            gust = c * gust + np.sqrt(1.0 - c * c) * row[2]
            cross_gust = c * cross_gust + np.sqrt(1.0 - c * c) * row[3]
            c = np.exp(-fast / 600.0)
            slow = c * slow + np.sqrt(1.0 - c * c) * row[4]
            c = np.exp(-fast / 30.0)
            electric_load = c * electric_load + np.sqrt(1.0 - c * c) * row[5]

        grade = _look_up(road.grade, where)
        sine, cosine = np.sin(grade), np.cos(grade)
        curvature = _look_up(road.curvature, where)

        # What holds the car back.
        heading = _look_up(road.heading, where)
        exposure = _look_up(road.exposure, where)
        scale = exposure * (1.0 + resistance.slow_wind_std * slow)
        north, east = resistance.wind_north * scale, resistance.wind_east * scale
        tail = north * np.cos(heading) + east * np.sin(heading)
        side = -north * np.sin(heading) + east * np.cos(heading)
        tail += resistance.gust_std * exposure * gust
        side += resistance.gust_std * exposure * cross_gust
        flow = v - tail
        flow_total = np.sqrt(flow * flow + side * side) + 1e-9
        density = resistance.density * np.exp(
            -_look_up(road.altitude, where) / resistance.density_height
        )
        area = resistance.drag_area * (1.0 + resistance.yaw_drag * (side / flow_total) ** 2)
        drag = 0.5 * density * area * flow_total * flow
        cold = np.exp(-t / resistance.warm_up_time)
        lateral = v * v * curvature
        rolling = (
            mass
            * GRAVITY
            * cosine
            * resistance.rolling
            * _look_up(road.surface, where)
            * (1.0 + resistance.rolling_cold * cold)
            * (1.0 + resistance.rolling_speed * (v / 30.0) ** 2)
        ) + mass * resistance.cornering * lateral * lateral
        slope = mass * GRAVITY * sine
        if v < 0.05:
            drag *= v / 0.05
            rolling *= v / 0.05

        # Engine side.
        gearing = power.gearings[gear - 1]
        weight = resistance.mass / (resistance.mass + loaded)
        pull = mass * a + drag + rolling + slope
        slip = min(0.05, max(-0.05, resistance.tyre_slip * weight * pull))
        sync = gearing * v * (1.0 + slip)
        full = _full_torque(power, engine)
        warm = 1.0 + power.cold_friction * cold
        friction = warm * (
            power.drag_torque[0]
            + power.drag_torque[1] * engine
            + power.drag_torque[2] * engine * engine
        )
        accessory = 0.0
        if not power.electric:
            on = 1.0 if (t % 70.0) < 40.0 else 0.0
            accessory = (
                power.accessory_power * (1.0 + 0.25 * electric_load + 0.8 * np.exp(-t / 300.0))
                + power.compressor_power * on
            ) / max(engine, 0.8 * power.idle_speed)
        loss_constant = power.loss_constant * (1.0 + 0.6 * power.cold_friction * cold)
        if power.electric:
            lowest = -power.regeneration * min(1.0, v / 3.0)
        else:
            lowest = -friction - accessory

        # Driver: where to stop, how fast to go.
        gap = 1e9
        stop_decel = 1.5
        if stop < road.stop_distance.size:
            gap = road.stop_distance[stop] - s
            stop_decel = road.stop_decel[stop]
        if not at_stop and v < 0.5 and gap < 2.5:
            at_stop = True
            waiting = road.stop_time[stop]
            stop += 1
            approach = 0
        target = _look_up(road.target_speed, where) * (1.0 + driver.speed_ripple * speed_ripple)
        ahead = _look_up(road.target_speed, where + 2.5 * v / road.step)
        # The front tyres grip no more than that.
        limit = min(4.0, _look_up(road.accel_limit, where) / (1.0 + v / 13.0))
        error = target - v
        if abs(error) < 2.0:
            integral = min(0.4, max(-0.4, integral + 0.05 * error * dt))
        else:
            integral *= 1.0 - 0.3 * dt
        demand = min(limit, driver.gain * error + integral) + driver.ripple * ripple * min(
            1.0, v / 5.0
        )
        coast = False
        slope_ahead = (
            _look_up(road.target_speed, where + 3.0) - _look_up(road.target_speed, where)
        ) / (3.0 * road.step)
        if slope_ahead < -0.002 and v > 0.95 * target:
            demand += v * slope_ahead
        elif ahead < 0.93 * v:
            coast = True
        # Towards a stop the driver lifts the foot, then follows a braking parabola.
        needed = v * v / (2.0 * max(gap - 1.0, 0.3))
        brake_at = max(0.75 * stop_decel, 0.95)
        lift_at = max(0.5 * stop_decel, 0.7)
        if approach == 0 and needed > lift_at:
            approach = 1
        if approach == 1 and needed > brake_at:
            approach = 2
        if approach > 0 and needed < 0.3 * brake_at:
            approach = 0
        if approach == 2:
            demand = min(demand, -min(1.1 * needed, 3.5, 0.7 + 0.9 * v))
        elif approach == 1:
            coast = True
            demand = min(demand, 0.0)
        elif gap < 30.0:
            # Short of the stop: creep up to it.
            demand = min(demand, 0.8 * (np.sqrt(1.2 * max(gap - 1.0, 0.0)) + 0.2 - v))
        wanted += (demand - wanted) * dt / 0.35
        if at_stop:
            waiting -= dt
            wanted = -1.0
            loaded = _loaded(road, stop - 1, waiting)
            if waiting <= 0.0:
                at_stop = False
                wanted = 0.0
                integral = 0.0

        resist = drag + rolling + slope
        inertia = mass + power.wheel_mass
        coasting = (
            gearing * (lowest - loss_constant) * (1.0 if locked else 0.0) - resist
        ) / inertia
        if power.electric:
            braking = wanted < coasting - 0.02 or at_stop
        elif braking:
            braking = wanted < coasting + 0.05 or at_stop
        else:
            braking = (wanted < coasting - 0.3) or at_stop
        brake_wanted = 0.0
        if braking:
            brake_wanted = max(0.0, inertia * (coasting - wanted))
            if at_stop:
                brake_wanted = inertia + abs(slope)
        brake += (brake_wanted - brake) * dt / (0.12 if brake_wanted < brake else 0.2)
        if brake < 5.0 and not braking:
            brake = 0.0

        torque_wanted = (
            ((inertia + power.engine_inertia * gearing * gearing) * wanted + resist) / gearing
            + loss_constant
        ) * (1.0 + power.loss_slope)
        if power.electric:
            # The motor brakes as asked; a lifted foot asks for a little.
            if coast and v > 3.0:
                torque_wanted = min(torque_wanted, -0.2 * power.regeneration)
        elif braking or (coast and v > 3.0):
            torque_wanted = lowest
        torque_wanted = min(full, max(lowest, torque_wanted))
        pedal_torque += (torque_wanted - pedal_torque) * dt / 0.25
        pedal = max(0.0, pedal_torque / max(full, 1.0))
        if shifting <= 0.0:
            calm_pedal += (pedal - calm_pedal) * dt / 0.5

        # Gears. A shift must not call for its own undoing: the pedal in the new
        # gear is what decides there.
        if shifting <= 0.0:
            since_shift += dt
        if gears > 1 and shifting <= 0.0 and locked:
            revs = _look_up(road.revs, where)
            new = gear
            if gear < gears and since_shift > 1.2 and not braking:
                up = _upshift_speed(power, max(calm_pedal, revs))
                if sync > up:
                    ratio = power.gearings[gear] / gearing
                    asked = calm_pedal / ratio
                    after = sync * ratio
                    enough = after > 1.1 * _downshift_speed(power, max(asked, revs))
                    if (enough and asked < 0.95) or sync > 0.96 * power.max_speed:
                        new = gear + 1
            if gear > 1 and since_shift > 1.0:
                if sync < _downshift_speed(power, max(calm_pedal, revs)):
                    ratio = power.gearings[gear - 2] / gearing
                    asked = calm_pedal / ratio
                    if sync * ratio < 0.93 * _upshift_speed(power, max(asked, revs)):
                        new = gear - 1
                if sync < 1.15 * power.idle_speed:
                    new = gear - 1
            if new != gear:
                gear_from = gear
                gear = new
                shifting = power.shift_time
                since_shift = 0.0

        before = engine
        if shifting > 0.0 and v > 0.5:
            phase = SHIFTING
            shifting -= dt
            part = min(1.0, max(0.0, 1.0 - shifting / power.shift_time))
            blend = part * part * (3.0 - 2.0 * part)
            old = power.gearings[gear_from - 1]
            gearing = old + blend * (power.gearings[gear - 1] - old)
            engine = gearing * v * (1.0 + slip)
            dip = 4.0 * part * (1.0 - part)
            dip = min(1.0, 1.6 * dip)
            keep = 1.0 - (1.0 - power.shift_floor) * dip
            torque += (min(full, max(lowest, pedal_torque)) - torque) * dt / power.torque_lag
            clutch = torque * keep
            locked = True
            net = clutch
            crank = clutch + power.engine_inertia * (engine - before) / dt
            crank = min(full, max(lowest, crank))
            if shifting <= 0.0:
                shifting = 0.0
        elif power.electric or (sync > power.idle_speed * 0.98 and locked):
            phase = DRIVING
            torque += (min(full, max(lowest, pedal_torque)) - torque) * dt / power.torque_lag
            if not power.electric:
                # Combustion below some charge is cut, and comes back softly.
                gross = torque + friction + accessory
                if fuel_cut:
                    fuel_cut = pedal_torque < lowest + 0.25 * friction
                else:
                    fuel_cut = pedal_torque < lowest + 0.05 * friction
                if gross < 0.0:
                    torque = lowest
            engine = sync
            net = torque
            crank = torque
        else:
            # Clutch slips at a launch or is open.
            gear = 1
            shifting = 0.0
            gearing = power.gearings[0]
            sync = gearing * v * (1.0 + slip)
            lift = 0.0
            if pedal_torque > 2.0 and not braking:
                phase = SLIPPING
                lift = min(1.0, pedal)
                torque += (min(full, pedal_torque) - torque) * dt / max(power.torque_lag, 0.15)
            else:
                phase = OPEN
                torque += (0.0 - torque) * dt / 0.1
            hold = power.idle_speed + lift * 1.2 * power.idle_speed
            aim = max(hold, sync)
            engine += (aim - engine) * dt / 0.2
            locked = phase == SLIPPING and sync >= engine - 3.0
            if locked:
                engine = sync
            net = torque
            crank = net + power.engine_inertia * (engine - before) / dt
            crank = min(full, max(lowest, crank))
            fuel_cut = False
        if phase == DRIVING and not power.electric and sync <= power.idle_speed * 0.98:
            locked = False
        if (
            not power.electric
            and gear == 1
            and sync < 0.98 * power.idle_speed
            and phase != SLIPPING
        ):
            locked = False

        # Motion.
        loss = loss_constant * min(1.0, v / 0.5) + power.loss_slope * abs(net)
        rotating = power.engine_inertia * gearing * gearing if phase == DRIVING else 0.0
        force = gearing * (net - loss)
        held = brake if v > 0.0 else 0.0
        new_a = (force - held - resist) / (inertia + rotating)
        if v <= 0.0 and (at_stop or new_a < 0.0):
            new_a = 0.0
        v_new = v + new_a * dt
        if v_new < 0.0:
            v_new = 0.0
            new_a = -v / dt
        a = new_a
        traction = force - rotating * a

        gross = max(0.0, crank + friction + accessory)
        if power.electric:
            gross = crank
            flow_fuel = 0.0
        else:
            cut = fuel_cut and phase == DRIVING and engine > 1.25 * power.idle_speed
            # Indicated efficiency: richer at full load, poorer at very low load.
            share = gross / (power.curve_torque.max() + friction + accessory)
            efficiency = 0.385 - 0.05 * np.exp(-share / 0.12) - 0.04 * max(0.0, share - 0.75) / 0.25
            flow_fuel = 0.0 if cut else gross * engine / (efficiency * power.heating_value)
        fuel += flow_fuel * dt
        mass = resistance.mass - resistance.fuel_burn * fuel + loaded

        out[DISTANCE, k] = s
        out[SPEED, k] = v
        out[ACCEL, k] = a
        out[ENGINE_SPEED, k] = engine
        out[GEAR, k] = gear
        out[TORQUE, k] = crank
        out[GROSS_TORQUE, k] = gross
        out[TRACTION, k] = traction
        out[BRAKE, k] = held
        out[DRAG, k] = drag
        out[ROLLING, k] = rolling
        out[WIND_ALONG, k] = tail
        out[MASS, k] = mass
        out[FUEL_FLOW, k] = flow_fuel
        out[PEDAL, k] = 0.0 if braking else pedal
        out[PHASE, k] = phase
        out[ACCESSORY, k] = accessory
        out[LOADED, k] = loaded

        s += 0.5 * (v + v_new) * dt
        v = v_new
        if s >= length - 2.0 or (stop >= road.stop_distance.size and at_stop and waiting < dt):
            return out, k + 1
    return out, steps
