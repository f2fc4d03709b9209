"""The driver of a simulated vehicle: where to stop, how fast to go, pedal or brake."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import inlined_kernel, kernel

LOADING_STARTS, LOADING_ENDS = 0.15, 0.85
"""Part of a stop's time at which a load change starts and ends, evenly between."""


class Road(NamedTuple):
    """The road over distance, on an even grid, and what the driver will do on it."""

    step: float  # [m]
    grade: np.ndarray  # (n,) [rad]
    altitude: np.ndarray  # (n,) [m]
    heading: np.ndarray  # (n,) unwrapped [rad]
    curvature: np.ndarray  # (n,) positive to the right [1/m]
    surface: np.ndarray  # (n,) rolling resistance factor [-]
    exposure: np.ndarray  # (n,) wind over wind in the open [-]
    shelter: np.ndarray  # (n,) air drag over that of a vehicle alone [-]
    target_speed: np.ndarray  # (n,) what the driver wants to drive [m/s]
    accel_limit: np.ndarray  # (n,) pull-away acceleration the driver uses [m/s^2]
    revs: np.ndarray  # (n,) eagerness to rev, 0 calm to 1 to the limiter [-]
    stop_distance: np.ndarray  # (k,) where to stop [m]
    stop_time: np.ndarray  # (k,) how long [s]
    stop_decel: np.ndarray  # (k,) how hard [m/s^2]
    stop_load: np.ndarray  # (k,) what is loaded there, unloaded negative [kg]
    brake_start: np.ndarray  # (b,) when to brake, whatever the road is like [s]
    brake_end: np.ndarray  # (b,) [s]
    brake_decel: np.ndarray  # (b,) how hard [m/s^2]


ACCELERATOR, TO_BRAKE, ON_BRAKE, TO_ACCELERATOR = range(4)
"""Where the right foot is."""

CHANCES = 6
"""Random numbers the foot needs at a time: whether it touches the brake, how hard, how long,
from which deceleration it brakes next, how fast it moves, whether both pedals are pressed."""

TOUCH_BELOW, TOUCH_UNTIL = 0.5, 0.7
"""Acceleration wanted beyond that with the foot off the pedals up to which the brake is touched,
and from which a touch ends [m/s^2]: nearly none, and plainly one."""


class Driver(NamedTuple):
    """How the driver drives."""

    ripple: float  # of the acceleration wanted [m/s^2]
    speed_ripple: float  # of the speed wanted, relative [-]
    gain: float  # acceleration per speed error [1/s]
    rest: float  # standing before the start [s]
    grip: float  # acceleration the driven tyres can hold [m/s^2]
    least_low: float  # deceleration beyond the dragged engine's from which the driver
    least_high: float  # brakes, drawn anew for each braking [m/s^2]
    touch_rate: float  # how often a foot off the accelerator touches the brake [1/s]
    touch_strength: float  # mean deceleration of a touch [m/s^2]
    touch_time: float  # mean length of a touch [s]
    foot_low: float  # time of the foot between the pedals, drawn anew each time [s]
    foot_high: float
    both_chance: float  # that the brake is still pressed when the driver accelerates [-]


class Foot(NamedTuple):
    """What the right foot does."""

    place: int  # ACCELERATOR ... TO_ACCELERATOR
    moving: float  # time left between the pedals [s]
    least: float  # deceleration beyond the dragged engine's from which it brakes next [m/s^2]
    touch: float  # deceleration of the last touch [m/s^2]
    touch_left: float  # its time left [s]
    both: float  # time left with both pedals pressed [s]


class Intent(NamedTuple):
    """What the driver has in mind."""

    wanted: float  # acceleration [m/s^2]
    integral: float  # of the speed error [m/s^2]
    approach: int  # towards a stop: 1 foot lifted, 2 braking
    coast: bool  # foot off the pedal
    stop: int  # the next one
    at_stop: bool
    waiting: float  # time left to stand [s]


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


@inlined_kernel
def look_up(values, where):
    """Interpolate on a grid of unit step, held at the ends."""
    if where <= 0.0:
        return values[0]
    last = values.size - 1
    if where >= last:
        return values[last]
    i = int(where)
    part = where - i
    return values[i] + part * (values[i + 1] - values[i])


@inlined_kernel
def loaded(road, intent):
    """Load taken on since the start [kg]."""
    stop = intent.stop - 1 if intent.at_stop else intent.stop
    before = road.stop_load[: max(stop, 0)].sum()
    if stop < 0 or not intent.at_stop:
        return before
    done = 1.0 - intent.waiting / road.stop_time[stop]
    part = min(1.0, max(0.0, (done - LOADING_STARTS) / (LOADING_ENDS - LOADING_STARTS)))
    return before + part * road.stop_load[stop]


@inlined_kernel
def steer(road, driver, intent, t, s, v, ripple, speed_ripple, dt):
    """Decide the acceleration wanted.

    Parameters
    ----------
    road, driver, intent
        See the types.
    t, s, v : float
        Time [s], distance [m] and speed [m/s].
    ripple, speed_ripple : float
        Wandering of foot and speed, unit standard deviation.
    dt : float
        Step [s].

    Returns
    -------
    Intent
    """
    wanted, integral, approach = intent.wanted, intent.integral, intent.approach
    stop, at_stop, waiting = intent.stop, intent.at_stop, intent.waiting
    where = s / road.step
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
    here = look_up(road.target_speed, where)
    target = here * (1.0 + driver.speed_ripple * speed_ripple)
    ahead = look_up(road.target_speed, where + 2.5 * v / road.step)
    limit = min(driver.grip, look_up(road.accel_limit, where) / (1.0 + v / 13.0))
    error = target - v
    if abs(error) < 2.0:
        integral = min(0.4, max(-0.4, integral + 0.05 * error * dt))
    else:
        integral *= 1.0 - 0.3 * dt
    demand = min(limit, driver.gain * error + integral) + driver.ripple * ripple * min(1.0, v / 5.0)
    coast = False
    slope_ahead = (look_up(road.target_speed, where + 3.0) - here) / (3.0 * road.step)
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
    for j in range(road.brake_start.size):
        if road.brake_start[j] <= t < road.brake_end[j]:
            demand = min(demand, -road.brake_decel[j])
    wanted += (demand - wanted) * dt / 0.35
    if at_stop:
        waiting -= dt
        wanted = -1.0
        if waiting <= 0.0:
            at_stop = False
            wanted = 0.0
            integral = 0.0
    return Intent(wanted, integral, approach, coast, stop, at_stop, waiting)


@inlined_kernel
def move_foot(driver, foot, row, every, electric, wanted, coasting, coast, at_stop, v, dt):
    """Move the foot between accelerator and brake.

    Parameters
    ----------
    driver, foot
        See the types.
    row : (6,) float64
        Evenly distributed random numbers in [0, 1), see ``CHANCES``.
    every : float
        Seconds for which the row decides over a touch, 0 where it was asked already [s].
    electric : bool
        The motor brakes before the brakes do; there is no drag to help out.
    wanted, coasting : float
        Acceleration wanted, and that with the foot off the pedals [m/s^2].
    coast, at_stop : bool
        Foot lifted; held at a stop.
    v, dt : float
        Speed [m/s], step [s].

    Returns
    -------
    Foot

    Notes
    -----
    A driver brakes who wants to slow down more than the vehicle does by itself. Beside
    that, a foot off the accelerator now and then touches the brake while the engine is
    dragged: to be ready, or because a braking begins before it is needed.
    """
    place, moving, least = foot.place, foot.moving, foot.least
    touch, touch_left = foot.touch, max(0.0, foot.touch_left - dt)
    both = max(0.0, foot.both - dt)
    idle = coast or wanted < coasting + TOUCH_BELOW
    idle = idle and place != ON_BRAKE and both <= 0.0 and v > 1.0
    if idle and touch_left <= 0.0 and row[0] < driver.touch_rate * every:
        touch = -np.log(1.0 - row[1]) * driver.touch_strength
        touch_left = -np.log(1.0 - row[2]) * driver.touch_time + driver.foot_high
    if wanted > coasting + TOUCH_UNTIL or at_stop or electric:
        touch_left = 0.0
    if electric:
        wants = wanted < coasting - 0.02 or at_stop
    elif place == ON_BRAKE:
        wants = wanted < coasting + 0.05 or at_stop
    else:
        wants = wanted < coasting - least or at_stop
    wants = wants or touch_left > 0.0
    time = driver.foot_low + (driver.foot_high - driver.foot_low) * row[4]
    if place == ACCELERATOR and wants:
        place, moving = TO_BRAKE, time
    elif place == ON_BRAKE and not wants:
        place, moving = TO_ACCELERATOR, time
        least = driver.least_low + (driver.least_high - driver.least_low) * row[3]
        if row[5] < driver.both_chance:
            # The other foot, or the edge of the shoe, stays on the brake.
            place, moving = ACCELERATOR, 0.0
            both = 0.3 + 0.7 * row[2]
            touch = driver.touch_strength * row[1]
    moving = max(0.0, moving - dt)
    if moving <= 0.0:
        if place == TO_BRAKE:
            place = ON_BRAKE
        elif place == TO_ACCELERATOR:
            place = ACCELERATOR
    return Foot(place, moving, least, touch, touch_left, both)
