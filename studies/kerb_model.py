"""A vehicle that stands at the kerb: springs, friction, people, wind, and an accelerometer.

Written from physics, without a look at what estimates the change of load from it; nothing of
weighbridge is imported. Quasi-static: axle loads deflect springs with friction, and tyres. Body
axes are forward, right, down; pitch is positive nose up, roll positive right side down.

Values and where they are from:

- Frequencies of the sprung mass on each axle, 1.0 to 1.3 Hz in front and 1.2 to 1.5 Hz in the rear
  of cars: Gillespie, Fundamentals of Vehicle Dynamics, 1992, ch. 5. Vans are stiffer, by the leaf
  springs of their rear axle.
- Springs of trucks, 180 to 300 N/mm each in front and 500 to 900 N/mm in the rear, tyres of 850
  N/mm, and friction up to a tenth of the load of a leaf spring: Fancher, Ervin, Winkler, Gillespie,
  A Factbook of the Mechanical Properties of the Components for Single-Unit and Articulated Heavy
  Trucks, UMTRI-86-12, 1986.
- Friction of cars, 1.2 to 3 % of the load, 50 to 120 N at a wheel: of the order of what is measured
  at struts (Deubel, Prokop, J. Vibration and Control 2022, who show how much it varies).
- Body modes of 1.1 to 1.7 Hz, damped by 0.2 to 0.35 of the critical: Gillespie, ch. 5.
- Friction before it slips is a spring of its own (Jenkins element), and creeps.
- Offset of the accelerometer with temperature, 0.05 to 0.5 mg/K: what data sheets of sensors of a
  few euros state as typical.

The rest is assumed: where loads lie, what people do, how long a stop takes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numba import njit
from scipy.linalg import expm
from scipy.signal import lfilter

GRAVITY: Final = 9.81
RATE: Final = 10.0
"""Of the samples [Hz]."""

BEFORE: Final = 3.0
"""It brakes for so long before it stands [s]."""

DRIVER: Final = 80.0
CAR, VAN, TRUCK = "car", "van", "truck"
CLASSES: Final = (CAR, VAN, TRUCK)


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """One vehicle.

    Attributes
    ----------
    kind : one of `CLASSES`
    tare, payload : mass with driver, and most load [kg]
    wheelbase, track, height : of the centre of gravity [m]
    front_share : of the tare that is on the front axle [-]
    stiffness, tyre : (2,) of the springs of front and rear axle, and of its tyres [N/m]
    progression : growth of the rear stiffness at full load [-]
    friction : (2,) force over the load of the axle [-]
    presliding : (2,) travel in which the friction builds up [m]
    creep : time constant with which it relaxes [s]
    mode, damping : frequency [Hz] of the body on its springs, and damping over the critical [-]
    roll_stiffness : of both axles [N m/rad]
    levels : (2,) which axles level themselves
    level_band, level_delay, level_rate : travel, time and speed of the levelling [m, s, m/s]
    habit : where its load lies usually, 0 at the front axle, 1 at the rear axle [-]
    habit_std : how much that differs from stop to stop [-]
    floor : foremost and rearmost place of it [-]
    seat : of the driver, likewise [-]
    tank, litres : likewise of the fuel [-], and most that is filled in [l]
    side_area : [m^2]
    jacking : (2,) vertical over longitudinal force at an axle that is braked [-]
    bias_slope : offset of the accelerometer [m/s^2/K] along each axis (3,)
    noise : standard deviation of a sample [m/s^2]
    mounting : (3,) small angles by which the known mounting is off [rad]
    """

    kind: str
    tare: float
    payload: float
    wheelbase: float
    track: float
    height: float
    front_share: float
    stiffness: np.ndarray
    tyre: np.ndarray
    progression: float
    friction: np.ndarray
    presliding: np.ndarray
    creep: float
    mode: float
    damping: float
    roll_stiffness: float
    levels: np.ndarray
    level_band: float
    level_delay: float
    level_rate: float
    habit: float
    habit_std: float
    floor: tuple[float, float]
    seat: float
    tank: float
    litres: float
    side_area: float
    jacking: np.ndarray
    bias_slope: np.ndarray
    noise: float
    mounting: np.ndarray


def random_vehicle(kind: str, seed: int, *, levels: bool = False) -> Vehicle:
    """Draw a vehicle of a class; with ``levels`` its rear axle levels itself, or both."""
    rng = np.random.default_rng([seed, CLASSES.index(kind), 17])
    u = rng.uniform
    if kind == TRUCK:
        gross = u(7_500.0, 18_000.0)
        tare = gross * u(0.45, 0.58)
        size = gross / 16_000.0
        wheelbase, track, height = u(4.0, 5.6), u(1.8, 2.0), u(1.1, 1.5)
        front = u(0.55, 0.65)
        stiffness = 2e3 * size * np.array([u(180.0, 300.0), u(500.0, 900.0)])
        tyre = 850e3 * np.sqrt(size) * np.array([2.0, 4.0])
        friction = np.array([u(0.03, 0.06), u(0.04, 0.10)])
        payload, progression, roll = gross - tare, u(0.0, 0.5), gross * u(60.0, 110.0)
        habit, habit_std, seat = u(0.6, 0.9), u(0.05, 0.25), u(-0.1, 0.1)
        floor = (0.2, 1.2)
        tank, litres, side = u(0.35, 0.6), 250.0, u(14.0, 24.0)
    else:
        car = kind == CAR
        tare = u(1200.0, 1850.0) if car else u(1900.0, 2400.0)
        wheelbase = u(2.5, 2.85) if car else u(3.2, 3.9)
        track, height = (u(1.45, 1.6), u(0.52, 0.6)) if car else (u(1.6, 1.75), u(0.7, 0.85))
        front = u(0.52, 0.62) if car else u(0.56, 0.62)
        hertz = (u(1.0, 1.3), u(1.2, 1.5)) if car else (u(1.2, 1.45), u(1.7, 2.1))
        load = tare * np.array([front, 1.0 - front])
        stiffness = 0.88 * load * (2.0 * np.pi * np.array(hertz)) ** 2
        tyre = 2e3 * np.full(2, u(180.0, 230.0) if car else u(230.0, 300.0))
        friction = np.array([u(0.012, 0.03), u(0.012, 0.03) if car else u(0.03, 0.08)])
        payload = u(400.0, 550.0) if car else 3500.0 - tare
        progression = 0.0 if car else u(0.0, 0.5)
        roll = tare * (u(35.0, 55.0) if car else u(38.0, 55.0))
        habit, habit_std = (u(0.9, 1.15), u(0.03, 0.15)) if car else (u(0.7, 1.0), u(0.05, 0.25))
        floor = (0.75, 1.25) if car else (0.35, 1.2)
        seat = u(0.38, 0.46) if car else u(0.22, 0.30)
        tank, litres = (u(0.82, 0.95), 55.0) if car else (u(0.4, 0.6), 80.0)
        side = u(3.5, 4.5) if car else u(6.5, 9.5)
    return Vehicle(
        kind=kind, tare=tare, payload=payload, wheelbase=wheelbase, track=track, height=height,
        front_share=front, stiffness=stiffness, tyre=tyre, progression=progression,
        friction=friction, presliding=u(0.8e-3, 2.0e-3, 2), creep=u(100.0, 1000.0),
        mode=u(1.1, 1.7), damping=u(0.2, 0.35),
        roll_stiffness=roll, levels=np.array([levels and u() < 0.3, levels]),
        level_band=u(4e-3, 10e-3) if kind != TRUCK else u(3e-3, 8e-3), level_delay=u(1.0, 8.0),
        level_rate=u(1.5e-3, 6e-3), habit=habit, habit_std=habit_std, floor=floor, seat=seat,
        tank=tank, litres=litres, side_area=side, jacking=u(0.0, 0.25, 2),
        bias_slope=9.81e-3 * rng.choice([-1.0, 1.0], 3) * np.exp(u(np.log(0.05), np.log(0.5), 3)),
        noise=u(0.01, 0.04), mounting=rng.normal(0.0, 0.015, 3),
    )  # fmt: skip


@dataclass
class Forces:
    """What presses on the vehicle during one stop, at each sample (n,).

    Attributes
    ----------
    time : since it stands [s]
    axle : (n, 2) force on front and rear axle beside that of the beginning [N]
    roll : moment about the long axis [N m]
    mass : change of the mass on the wheels [kg]
    shake : standard deviation of what the engine adds to a sample [m/s^2]
    load_end : when the last of the load is on or off [s]; NaN without any
    slope : of the road [rad]
    what : words for what happened
    """

    time: np.ndarray
    axle: np.ndarray
    roll: np.ndarray
    mass: np.ndarray
    shake: np.ndarray
    load_end: float = np.nan
    slope: float = 0.0
    what: list[str] = field(default_factory=list)

    def put(self, when, kg, place, side, *, until=np.inf, over=1.0, counts=True) -> None:
        """Put a mass on, over some time [s], and take it off at ``until``."""
        on = np.clip((self.time - when) / over, 0.0, 1.0)
        on = on * np.clip((until - self.time) / over, 0.0, 1.0)
        force = GRAVITY * kg * on
        self.axle += force[:, None] * np.array([1.0 - place, place])
        self.roll += force * side
        if counts:
            self.mass += kg * on

    def turn(self, when, until, pitch, roll, wheelbase) -> None:
        """Let moments act on the body for a while [N m]: pitch presses the rear axle."""
        on = np.clip((self.time - when) / 0.7, 0.0, 1.0) * np.clip((until - self.time) / 0.7, 0, 1)
        self.axle += (on * pitch / wheelbase)[:, None] * np.array([-1.0, 1.0])
        self.roll += on * roll


def quiet_forces(car: Vehicle, length: float, rng) -> Forces:
    """What happens at any stop: people, doors, engine, wind, brake on a slope, perhaps fuel."""
    u = rng.uniform
    time = np.arange(-BEFORE, length, 1.0 / RATE)
    n = time.size
    f = Forces(time, np.zeros((n, 2)), np.zeros(n), np.zeros(n), np.zeros(n))
    big = car.tare / 1500.0 if car.kind == TRUCK else 1.0
    for _ in range(rng.poisson(1.0)):
        when = u(3.0, length)
        until, edge = when + np.exp(u(np.log(2.0), np.log(60.0))), rng.choice([-1.0, 1.0])
        kg = u(5.0, 25.0) if u() < 0.85 else u(25.0, 45.0)
        f.put(when, kg, u(-0.3, 1.3), edge * 0.5 * car.track, until=until, counts=False)
        along = u(-120.0, 120.0) if u() < 0.3 else 0.0
        f.turn(when, until, along, u(-120.0, 120.0), car.wheelbase)
        f.what.append("leans")
    for _ in range(rng.poisson(1.5)):
        when = u(3.0, length)
        until = when + np.exp(u(np.log(3.0), np.log(100.0)))
        if u() < 0.3:
            f.turn(when, until, u(60.0, 160.0), 0.0, car.wheelbase)
        else:
            f.turn(when, until, 0.0, rng.choice([-1.0, 1.0]) * u(80.0, 180.0), car.wheelbase)
    # Turbulence of a third of the mean, correlated over 3 s.
    wind, keep = u(0.0, 9.0), 1.0 - 1.0 / (3.0 * RATE)
    step = rng.normal(0.0, 0.35 * wind * np.sqrt(2.0 / (3.0 * RATE)), n)
    gust = lfilter([1.0], [1.0, -keep], step)
    side = 0.5 * 1.2 * car.side_area * 1.1 * (wind + gust) * np.abs(wind + gust) * u(-1.0, 1.0)
    f.roll += side * car.height * 1.2
    along = 0.15 * side * u(-1.0, 1.0) * car.height / car.wheelbase
    f.axle += along[:, None] * np.array([-1.0, 1.0])
    runs = np.ones(n, dtype=bool)
    if u() < 0.6:
        off = u(0.0, 15.0)
        runs = (time < off) | (time > length - u(3.0, 15.0))
    idle, torque = u(0.03, 0.25), u(5.0, 40.0)
    f.shake += 0.01 + idle * runs
    f.roll += torque * big * runs
    f.axle += (runs * u(20.0, 80.0) * big)[:, None] * rng.normal(size=(n, 2))
    slope = float(np.clip(rng.normal(0.0, 0.025), -0.1, 0.1))
    brake = u(1.0, 10.0)
    # The service brake holds all wheels, the parking brake those of the rear.
    held = car.tare * GRAVITY * slope
    f.axle += np.where(time < brake, 0.5, 0.0)[:, None] * held * car.jacking * [1.0, -1.0]
    f.axle += np.where(time < brake, 0.0, 1.0)[:, None] * held * car.jacking * [0.0, -1.0]
    decel = u(0.8, 2.5) * np.clip((0.3 - time) / 0.6, 0.0, 1.0)
    f.axle += (car.tare * decel * car.height / car.wheelbase)[:, None] * [1.0, -1.0]
    drives = (time < 0.0)[:, None] * 0.08 * car.tare * GRAVITY
    f.axle += drives * rng.normal(size=(n, 2))
    f.slope = slope
    return f


def leave_driver(f: Forces, car: Vehicle, out: float, back: float) -> None:
    """Let the driver be away between two instants [s]."""
    f.put(out, -DRIVER, car.seat, -0.36, until=back)
    f.what.append("driver away")


def quiet_stop(car: Vehicle, rng) -> Forces:
    """A stop without a change of load; fuel may come in, and the driver may go for a while."""
    u = rng.uniform
    length = np.exp(u(np.log(15.0), np.log(300.0)))
    f = quiet_forces(car, length, rng)
    if length > 60.0 and u() < 0.15:
        litres = u(0.3, 1.0) * car.litres
        rate = 0.6 if car.kind != TRUCK else 1.3
        begin = u(20.0, 40.0)
        if begin + litres / rate < length:
            f.put(begin, 0.8 * litres, car.tank, 0.2, over=litres / rate)
            f.what.append("fuel")
    if length > 40.0 and u() < 0.5:
        out = u(5.0, 20.0)
        leave_driver(f, car, out, max(length - u(6.0, 20.0), out + 5.0))
    return f


def load_stop(car: Vehicle, now: float, rng) -> Forces:
    """A stop at which the load changes by 5 % of the mass or more.

    Parameters
    ----------
    car
    now : load before it [kg]
    rng : numpy generator
    """
    u = rng.uniform
    mass = car.tare + now
    least, most = 0.055 * mass, min(0.3 * mass, 0.9 * car.payload)
    room, held = car.payload - now, now
    on = held < least or (room >= least and u() < 0.5)
    total = u(least, max(min(most, room if on else held), least * 1.001))
    sign = 1.0 if on else -1.0
    people = car.kind == CAR and u() < 0.4
    items: list[tuple[float, float, float]] = []
    centre = float(np.clip(rng.normal(car.habit, car.habit_std), *car.floor))
    while total > 0.0:
        one = u(50.0, 100.0) if people else u(8.0, 40.0) if car.kind != TRUCK else u(150.0, 600.0)
        one = min(one, total)
        if people:
            place, side = (u(0.4, 0.48), 0.36) if not items else (u(0.78, 0.88), u(-0.4, 0.4))
        else:
            place, side = centre + rng.normal(0.0, 0.08), u(-0.3, 0.3) * car.track
        items.append((one, place, side))
        total -= one
    begin, spread = u(10.0, 30.0), u(3.0, 90.0) if len(items) > 1 else 0.1
    when = begin + np.sort(u(0.0, spread, len(items)))
    length = when[-1] + 2.0 + np.exp(u(np.log(12.0), np.log(120.0)))
    f = quiet_forces(car, length, rng)
    walks = car.kind == VAN and u() < 0.6
    for at, (one, place, side) in zip(when, items, strict=True):
        f.put(at, sign * one, place, side, over=u(0.5, 2.0))
        if walks:
            f.put(at - u(1.0, 4.0), DRIVER, u(0.8, 1.15), 0.0, until=at + u(1.0, 4.0), counts=False)
    if car.kind != CAR or u() < 0.5:
        out = u(4.0, 9.0)
        leave_driver(f, car, out, max(length - u(5.0, 20.0), when[-1] + 2.0))
    f.load_end = float(when[-1]) + 2.0
    f.what.append("people" if people else "goods")
    return f


@dataclass(frozen=True)
class Stop:
    """What an accelerometer records, and the truth.

    Attributes
    ----------
    time : (n,) since the vehicle stands [s]
    accel : (n, 3) specific force along forward, right, down as the mounting is known [m/s^2]
    mass : (n,) true change of the mass on the wheels [kg]
    pitch, roll : (n,) true change [rad]
    load_end : when the last of the load is on or off [s]; NaN without any
    net : change from before to after the stop [kg]
    what : words for what happened
    """

    time: np.ndarray
    accel: np.ndarray
    mass: np.ndarray
    pitch: np.ndarray
    roll: np.ndarray
    load_end: float
    net: float
    what: tuple[str, ...]


@njit(cache=True)
def _deflection(time, force, mode, stiff, grip, limit, tyre, creep, level):
    """Deflection of a spring (n,) with friction and tyre under a force that the body lags behind.

    Parameters
    ----------
    time, force : (n,) [s], [N]; for roll moments and angles
    mode : (2, 2) transition of the body's motion over a sample
    stiff, grip, limit, tyre : stiffness, that of friction before it slips, most of it, of the tyre
    creep : time constant of friction [s]
    level : (3,) travel and time before it is levelled, and how fast; 0 for never
    """
    dt = time[1] - time[0]
    felt, rate, friction, lift, off_for = force[0], 0.0, 0.0, 0.0, 0.0
    found = np.empty(time.size)
    for k in range(time.size):
        before, away = felt, felt - force[k]
        felt = force[k] + mode[0, 0] * away + mode[0, 1] * rate
        rate = mode[1, 0] * away + mode[1, 1] * rate
        friction = friction * (1.0 - dt / creep) + grip * (felt - before) / (stiff + grip)
        friction = min(max(friction, -limit), limit)
        travel = (felt - friction) / stiff
        off = travel - lift
        if abs(off) > level[0]:
            off_for += dt
        elif abs(off) < 0.2 * level[0]:
            off_for = 0.0
        if off_for > level[1] and time[k] > 0.0:
            lift += level[2] * dt * np.sign(off)
        found[k] = travel - lift + felt / tyre
    return found


def stand(car: Vehicle, load: float, f: Forces, rng) -> Stop:
    """Let the forces act on the springs, and read the accelerometer.

    Parameters
    ----------
    car
    load : on board at the beginning [kg]
    f : forces
    rng : numpy generator
    """
    n, dt = f.time.size, 1.0 / RATE
    spring = car.stiffness * [1.0, 1.0 + car.progression * load / car.payload]
    at = np.array([car.front_share, 1.0 - car.front_share])
    static = GRAVITY * (car.tare * at + load * np.array([1.0 - car.habit, car.habit]))
    limit = np.append(car.friction * static, 0.0)
    limit[2] = 0.25 * (limit[0] + limit[1]) * car.track
    stiff = np.append(spring, car.roll_stiffness)
    grip = np.append(limit[:2] / car.presliding, 0.0)
    grip[2] = limit[2] / (np.mean(car.presliding) / (0.5 * car.track))
    tyre = np.append(car.tyre, car.tyre.sum() * car.track**2 / 4.0)
    levels = np.append(car.levels, False)
    force = np.column_stack([f.axle, f.roll])
    omega = 2.0 * np.pi * car.mode
    mode = expm(dt * np.array([[0.0, 1.0], [-(omega**2), -2.0 * car.damping * omega]]))
    deflection = np.column_stack(
        [
            _deflection(
                f.time, force[:, k], mode, stiff[k], grip[k], limit[k], tyre[k], car.creep,
                np.array([car.level_band, car.level_delay, car.level_rate * float(levels[k])]),
            )
            for k in range(3)
        ]
    )  # fmt: skip
    pitch = (deflection[:, 1] - deflection[:, 0]) / car.wheelbase
    roll = deflection[:, 2]
    slope, cross = f.slope, rng.normal(0.0, 0.02)
    theta, phi = slope + pitch, cross + roll
    accel = GRAVITY * np.column_stack(
        [np.sin(theta), -np.cos(theta) * np.sin(phi), -np.cos(theta) * np.cos(phi)]
    )
    a, b, c = car.mounting
    turn = np.array([[1.0, -c, b], [c, 1.0, -a], [-b, a, 1.0]])
    warmer = rng.uniform(-4.0, 4.0) * (1.0 - np.exp(-np.maximum(f.time, 0.0) / 400.0))
    accel = accel @ turn.T + warmer[:, None] * car.bias_slope
    accel += rng.normal(size=(n, 3)) * np.hypot(car.noise, f.shake)[:, None]
    keep = f.time >= 0.0
    return Stop(
        f.time[keep], accel[keep], f.mass[keep], pitch[keep], roll[keep], f.load_end,
        float(f.mass[-1]), tuple(f.what),
    )  # fmt: skip


def stops(car: Vehicle, seed: int, loads: int, quiet: int):
    """Give the stops of a vehicle: two with a change of load, and then others in any order.

    Yields
    ------
    stop : what happens there
    mass : before it [kg]
    """
    rng = np.random.default_rng([seed, 29])
    load = rng.uniform(0.2, 0.6) * car.payload
    kinds = [True, True, *rng.permutation([True] * loads + [False] * quiet)]
    for loaded in kinds:
        f = load_stop(car, load, rng) if loaded else quiet_stop(car, rng)
        found = stand(car, load, f, rng)
        yield found, car.tare + load
        if loaded:
            load += found.net
