"""Engine or motor, clutch or torque converter, and gearbox of a simulated vehicle."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import inlined_kernel

DRIVING, SHIFTING, SLIPPING, OPEN = range(4)
"""Phases of the driveline: locked, changing gear, clutch or converter slipping, open."""

COUPLING_POINT = 0.86
"""Turbine over pump speed from which a converter no longer multiplies torque [-]
(Gillespie, Fundamentals of Vehicle Dynamics, 1992, ch. 2)."""

CREEPING_CAPACITY = 0.3
"""Part of the converter's capacity left with the foot off the pedal [-]: automatics open a
clutch a little then, to save fuel and to creep gently."""


class Powertrain(NamedTuple):
    """Engine or motor, clutch and gears."""

    electric: bool
    gearings: np.ndarray  # (n,) engine angle over distance [1/m]
    launch_gear: int  # gear to pull away in
    skip: int  # gears that one shift may pass
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
    fuel_efficiency: float  # best indicated [-]
    regeneration: float  # largest braking torque of a motor [N m]
    automated: bool  # a control unit works the clutch: no shift stalls the engine
    converter: float  # pump torque at stall over squared speed, 0 for a clutch [N m s^2/rad^2]
    stall_ratio: float  # turbine over pump torque at stall [-]
    lock_gear: int  # lowest gear in which the converter is locked
    lock_speed: float  # turbine speed from which it is [rad/s]
    spin_loss: float  # drag of gearbox and axle per speed, warm [N s/m]
    spin_cold: float  # its growth at the start [-]
    overrun_charge: float  # charge kept in overrun before the fuel is cut, over that of idling [-]
    cut_delay: float  # foot off the pedal until the fuel is cut [s]
    cut_speed: float  # engine speed below which it is not [rad/s]
    stepless: bool  # the gearing moves between the first and the last
    economy: float  # lowest engine speed that a stepless box holds [rad/s]
    power_share: float  # part of the highest torque that it lets the engine give [-]
    ratio_lag: float  # of its ratio [s]
    ratio_bend: float  # growth of its losses with the squared logarithm of the ratio [-]
    pump: float  # torque of its pump over engine speed [N m s/rad]


class Shaft(NamedTuple):
    """State of engine, clutch and gearbox."""

    engine: float  # speed [rad/s]
    torque: float  # behind the lag of engine or motor [N m]
    gear: int
    gear_from: int  # gear before the shift
    since_shift: float  # [s]
    shifting: float  # time left of a shift [s]
    locked: bool  # engine speed follows the wheels
    fuel_cut: bool
    phase: int
    pedal_torque: float  # asked for by the pedal [N m]
    calm_pedal: float  # pedal as the gearbox sees it [-]
    gearing: float  # of the gear, or of a stepless box at the moment [1/m]


class Drag(NamedTuple):
    """Torques against the crank, and what the engine can give."""

    full: float  # [N m]
    lowest: float  # torque with the foot off the pedal [N m]
    friction: float  # and pumping [N m]
    accessory: float  # [N m]
    loss_constant: float  # of the driveline [N m]
    charge: float  # torque still burnt with the foot off the pedal [N m]


@inlined_kernel
def full_torque(power, speed):
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


@inlined_kernel
def crank_drag(power, engine, v, t, cold, electric_load, uncut):
    """Torques against the crank.

    Parameters
    ----------
    power : Powertrain
    engine, v, t : float
        Engine speed [rad/s], vehicle speed [m/s], time since the start [s].
    cold : float
        How cold engine and oil are, 1 at the start to 0 [-].
    electric_load : float
        Wandering of the alternator's load, unit standard deviation.
    uncut : float
        Part of the charge of overrun that still burns [-].

    Returns
    -------
    Drag

    Notes
    -----
    A closed throttle passes the air that idling needs. Each cycle gets the less of it the
    faster the engine turns.
    """
    full = full_torque(power, engine)
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
    charge = power.overrun_charge * uncut * (friction + accessory)
    charge *= min(1.0, power.idle_speed / max(engine, 1.0))
    lowest = min(0.0, -friction - accessory + charge)
    if power.electric:
        lowest = -power.regeneration * min(1.0, v / 3.0)
    return Drag(full, lowest, friction, accessory, loss_constant, charge)


@inlined_kernel
def cut_fuel(power, shaft, drag, lifted, uncut, dt):
    """Let the control unit cut the fuel of overrun, late and above some engine speed.

    Parameters
    ----------
    power, shaft, drag
        See the types.
    lifted : float
        How long the foot has been off the pedal [s].
    uncut : float
        Part of the charge of overrun that still burns [-].
    dt : float
        Step [s].

    Returns
    -------
    lifted, uncut : float
    """
    off = shaft.pedal_torque < drag.lowest + 0.25 * drag.friction
    lifted = lifted + dt if off else 0.0
    aim = 0.0 if lifted > power.cut_delay and shaft.engine > power.cut_speed else 1.0
    return lifted, uncut + (aim - uncut) * dt / 0.3


@inlined_kernel
def _upshift_speed(power, eager):
    """Engine speed at which the next gear is taken."""
    return power.upshift + (0.965 * power.max_speed - power.upshift) * min(1.0, eager) ** 1.6


@inlined_kernel
def _downshift_speed(power, eager):
    """Engine speed below which the gear before is taken."""
    return power.downshift + (0.55 * power.max_speed - power.downshift) * min(1.0, eager) ** 2


@inlined_kernel
def choose_gear(power, shaft, sync, revs, braking):
    """Choose the gear. A shift must not call for its own undoing: the pedal in the new gear
    is what decides there.

    Parameters
    ----------
    power, shaft
        See the types.
    sync : float
        Speed of the gearbox input [rad/s].
    revs : float
        Eagerness to rev [-].
    braking : bool

    Returns
    -------
    int
    """
    gear, gears = shaft.gear, power.gearings.size
    gearing = power.gearings[gear - 1]
    new = gear
    if gear < gears and shaft.since_shift > 1.2 and not braking:
        up = _upshift_speed(power, max(shaft.calm_pedal, revs))
        if sync > up:
            for n in range(min(power.skip, gears - gear), 0, -1):
                ratio = power.gearings[gear - 1 + n] / gearing
                asked = shaft.calm_pedal / ratio
                after = sync * ratio
                enough = after > 1.1 * _downshift_speed(power, max(asked, revs))
                if enough and asked < (0.95 if n == 1 else 0.7):
                    new = gear + n
                    break
            if new == gear and sync > 0.96 * power.max_speed:
                new = gear + 1
    if gear > 1 and shaft.since_shift > 1.0:
        if sync < _downshift_speed(power, max(shaft.calm_pedal, revs)):
            for n in range(min(power.skip, gear - 1), 0, -1):
                ratio = power.gearings[gear - 1 - n] / gearing
                asked = shaft.calm_pedal / ratio
                margin = 0.93 if n == 1 else 0.8
                if sync * ratio < margin * _upshift_speed(power, max(asked, revs)):
                    new = gear - n
                    break
        if sync < 1.15 * power.idle_speed and new >= gear:
            new = gear - 1
    return new


@inlined_kernel
def steered_gearing(power, shaft, v, dt):
    """Gearing of a stepless box after one step [1/m].

    Parameters
    ----------
    power, shaft
        See the types.
    v : float
        Vehicle speed [m/s].
    dt : float
        Step [s].

    Notes
    -----
    The engine turns as fast as the power asked for needs at some part of its highest torque, and
    not below some speed. The ratio follows with a lag, at most by a factor of e per second.
    """
    first, last = power.gearings[0], power.gearings[-1]
    asked = max(0.0, shaft.pedal_torque) * shaft.engine
    wanted = max(power.economy, asked / (power.power_share * power.curve_torque.max()))
    wanted = min(wanted, 0.95 * power.max_speed)
    goal = min(first, max(last, wanted / max(v, 0.5)))
    rate = np.log(goal / shaft.gearing) / power.ratio_lag
    return shaft.gearing * np.exp(min(1.0, max(-1.0, rate)) * dt)


@inlined_kernel
def gearbox_loss(power, drag, gearing, engine, net, v):
    """Torque that the driveline loses, at the gearbox input [N m].

    Parameters
    ----------
    power, drag
        See the types.
    gearing, engine, net, v : float
        Gearing [1/m], engine speed [rad/s], torque at the gearbox input [N m], speed [m/s].
    """
    loss = drag.loss_constant * min(1.0, v / 0.5) + power.loss_slope * abs(net)
    if power.stepless:
        off = np.log(gearing / np.sqrt(power.gearings[0] * power.gearings[-1]))
        loss += power.pump * engine * min(1.0, v / 0.5)
        loss *= 1.0 + power.ratio_bend * off * off
    return loss


@inlined_kernel
def converter_torques(power, engine, turbine, capacity):
    """Torques of a torque converter.

    Parameters
    ----------
    power : Powertrain
    engine, turbine : float
        Speeds of pump and turbine [rad/s].
    capacity : float
        Part of the capacity that works [-].

    Returns
    -------
    pump : float
        Torque taken from the engine [N m].
    ratio : float
        Turbine over pump torque [-].

    Notes
    -----
    The pump takes ``K (1 - nu^6) w^2`` at a speed ratio ``nu``, near constant at low
    ratios and falling to nothing when both turn alike; the torque ratio falls in a
    straight line from stall to the coupling point. The turbine drags the pump when it is
    the faster one.
    """
    nu = min(1.02, max(0.0, turbine / max(engine, 1.0)))
    square = nu * nu
    pump = capacity * power.converter * (1.0 - square * square * square) * engine * engine
    ratio = 1.0
    if nu < COUPLING_POINT:
        ratio = power.stall_ratio - (power.stall_ratio - 1.0) * nu / COUPLING_POINT
    return pump, ratio


@inlined_kernel
def foot_off(power, shaft, drag, sync):
    """Torque at the gearbox input with the foot off the pedal [N m]: the engine drags, or
    an idling one creeps through the converter.
    """
    if shaft.locked:
        return drag.lowest - drag.loss_constant
    if power.converter == 0.0:
        return 0.0
    pump, ratio = converter_torques(power, power.idle_speed, sync, CREEPING_CAPACITY)
    return pump * ratio


@inlined_kernel
def _idling(power, engine, load):
    """Torque that brings a slow engine back to idling against a load [N m]."""
    return load + power.engine_inertia * (power.idle_speed - engine) / 0.15


@inlined_kernel
def _locking_speed(power, shaft):
    """Turbine speed from which the converter is locked; of a stepless box in its first ratio."""
    if power.stepless:
        return power.lock_speed * shaft.gearing / power.gearings[0]
    return power.lock_speed


@inlined_kernel
def through_converter(power, shaft, drag, turbine, pedal, keep, dt):
    """Run the engine against an open converter for one step.

    Parameters
    ----------
    power, shaft, drag
        See the types.
    turbine : float
        Speed of the turbine [rad/s].
    pedal : float
        Torque asked for over torque there is [-].
    keep : float
        Part of the turbine's torque that a shift lets through [-].
    dt : float
        Step [s].

    Returns
    -------
    engine, torque : float
        New states.
    net, crank : float
        Torque at the gearbox input and of the engine [N m].
    locked : bool
        Whether the lock-up clutch has caught.
    """
    before = shaft.engine
    asked = min(drag.full, max(drag.lowest, shaft.pedal_torque))
    torque = shaft.torque + (asked - shaft.torque) * dt / power.torque_lag
    slowest = _locking_speed(power, shaft)
    closing = shaft.gear >= power.lock_gear and turbine > slowest and shaft.shifting <= 0.0
    if closing:
        # The clutch draws the engine to the turbine's speed.
        engine = before + (turbine - before) * dt / 0.15
        net = torque - power.engine_inertia * (engine - before) / dt
        return engine, torque, net, torque, abs(engine - turbine) < 2.0
    capacity = min(1.0, CREEPING_CAPACITY + 10.0 * pedal)
    pump, ratio = converter_torques(power, before, turbine, capacity)
    if before < 1.05 * power.idle_speed:
        torque = max(torque, min(drag.full, _idling(power, before, pump)))
    engine = before + (torque - pump) / power.engine_inertia * dt
    return engine, torque, pump * ratio * keep, torque, False


@inlined_kernel
def _between_gears(power, shaft, drag, v, grip, gearing, pedal, asked, dt):
    """Blend the gearings of a shift, with less torque in its middle.

    ``grip`` is 1 and the slip of the driven tyres [-], ``asked`` what engine or motor can give of
    the torque that the pedal asks for [N m].
    """
    shifting = shaft.shifting - dt
    torque = shaft.torque
    part = min(1.0, max(0.0, 1.0 - shifting / power.shift_time))
    blend = part * part * (3.0 - 2.0 * part)
    old = power.gearings[shaft.gear_from - 1]
    gearing = old + blend * (power.gearings[shaft.gear - 1] - old)
    dip = min(1.0, 1.6 * (4.0 * part * (1.0 - part)))
    keep = 1.0 - (1.0 - power.shift_floor) * dip
    turbine = gearing * v * grip
    if power.converter > 0.0 and not shaft.locked:
        engine, torque, net, crank, locked = through_converter(
            power, shaft, drag, turbine, pedal, keep, dt
        )
    else:
        engine = max(turbine, power.idle_speed) if power.automated else turbine
        torque += (asked - torque) * dt / power.torque_lag
        locked = True
        net = torque * keep
        crank = net + power.engine_inertia * (engine - shaft.engine) / dt
        crank = min(drag.full, max(drag.lowest, crank))
    return gearing, max(shifting, 0.0), engine, torque, net, crank, locked


@inlined_kernel
def _overrun(shaft, drag, torque):
    """Cut combustion below some charge; it comes back softly."""
    gross = torque + drag.friction + drag.accessory
    least = 0.25 if shaft.fuel_cut else 0.05
    fuel_cut = shaft.pedal_torque < drag.lowest + least * drag.friction
    fuel_cut = fuel_cut and drag.charge <= 0.02 * drag.friction
    if gross < 0.0:
        torque = drag.lowest - drag.charge
    return torque, fuel_cut


@inlined_kernel
def _slip_clutch(power, shaft, full, sync, pedal, braking, dt):
    """Slip the clutch of a launch, or hold it open."""
    torque, lift = shaft.torque, 0.0
    if shaft.pedal_torque > 2.0 and not braking:
        phase = SLIPPING
        lift = min(1.0, pedal)
        least = max(power.torque_lag, 0.15)
        torque += (min(full, shaft.pedal_torque) - torque) * dt / least
    else:
        phase = OPEN
        torque += (0.0 - torque) * dt / 0.1
    hold = power.idle_speed + lift * 1.2 * power.idle_speed
    engine = shaft.engine + (max(hold, sync) - shaft.engine) * dt / 0.2
    locked = phase == SLIPPING and sync >= engine - 3.0
    if locked:
        engine = sync
    return phase, engine, torque, locked


@inlined_kernel
def transmit(power, shaft, drag, gearing, v, slip, pedal, braking, dt):
    """Turn engine, clutch and gearbox for one step.

    Parameters
    ----------
    power, shaft, drag
        See the types.
    gearing : float
        Engine angle over distance at the start of the step [1/m].
    v : float
        Vehicle speed [m/s].
    slip : float
        Of the driven tyres [-].
    pedal : float
        Torque asked for over torque there is [-].
    braking : bool
    dt : float
        Step [s].

    Returns
    -------
    shaft : Shaft
    gearing : float
        Engine angle over distance of the moment [1/m].
    net : float
        Torque at the gearbox input [N m].
    crank : float
        Torque of engine or motor, its inertia not yet taken off [N m].
    """
    full, lowest = drag.full, drag.lowest
    gear, shifting = shaft.gear, shaft.shifting
    torque, locked, fuel_cut = shaft.torque, shaft.locked, shaft.fuel_cut
    asked = min(full, max(lowest, shaft.pedal_torque))
    before = shaft.engine
    turning = 0.0
    if power.stepless:
        # The engine gains speed apart from the wheels.
        old, gearing = gearing, steered_gearing(power, shaft, v, dt)
        turning = power.engine_inertia * (gearing - old) / dt * v * (1.0 + slip)
    sync = gearing * v * (1.0 + slip)
    if shifting > 0.0 and v > 0.5:
        phase = SHIFTING
        gearing, shifting, engine, torque, net, crank, locked = _between_gears(
            power, shaft, drag, v, 1.0 + slip, gearing, pedal, asked, dt
        )
    elif power.electric or (locked and sync > _lowest_locked(power, shaft)):
        phase = DRIVING
        torque += (asked - torque) * dt / power.torque_lag
        if not power.electric:
            torque, fuel_cut = _overrun(shaft, drag, torque)
        engine = sync
        if engine > power.max_speed:
            # A limiter cuts the fuel at once.
            torque = min(torque, full)
        net = torque - turning
        crank = torque
    elif power.converter > 0.0:
        phase = SLIPPING
        shifting = 0.0
        engine, torque, net, crank, locked = through_converter(
            power, shaft, drag, sync, pedal, 1.0, dt
        )
        fuel_cut = False
    else:
        gear = power.launch_gear
        shifting = 0.0
        gearing = power.gearings[gear - 1]
        sync = gearing * v * (1.0 + slip)
        phase, engine, torque, locked = _slip_clutch(power, shaft, full, sync, pedal, braking, dt)
        net = torque
        crank = net + power.engine_inertia * (engine - before) / dt
        crank = min(full, max(lowest, crank))
        fuel_cut = False
    slow = not power.electric and sync <= _lowest_locked(power, shaft)
    if slow and (phase == DRIVING or (gear <= power.launch_gear and phase != SLIPPING)):
        locked = False
    return (
        Shaft(
            engine, torque, gear, shaft.gear_from, shaft.since_shift, shifting, locked, fuel_cut,
            phase, shaft.pedal_torque, shaft.calm_pedal, gearing,
        ),
        gearing,
        net,
        crank,
    )  # fmt: skip


@inlined_kernel
def _lowest_locked(power, shaft):
    """Speed of the gearbox input below which clutch or lock-up opens [rad/s]."""
    if power.converter == 0.0:
        return power.idle_speed * 0.98
    return 0.85 * _locking_speed(power, shaft) if shaft.gear >= power.lock_gear else np.inf


@inlined_kernel
def fuel_flow(power, shaft, drag, gross):
    """Fuel burnt [kg/s] for a gross torque [N m]: indicated efficiency is lower at very low
    load and at full load.
    """
    if shaft.fuel_cut and shaft.phase == DRIVING and shaft.engine > 1.25 * power.idle_speed:
        return 0.0
    share = gross / (power.curve_torque.max() + drag.friction + drag.accessory)
    efficiency = (
        power.fuel_efficiency - 0.05 * np.exp(-share / 0.12) - 0.04 * max(0.0, share - 0.75) / 0.25
    )
    return gross * shaft.engine / (efficiency * power.heating_value)
