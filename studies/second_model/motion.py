"""Motion of one vehicle on one road: driver, engine, gearbox, tyres, body, air.

SI units. One step is ``DT``; every ``KEEP`` steps one row of ``COLUMNS`` is kept.
All compiled code and its parameters are in this file, so that the disk cache sees every edit.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

G = 9.80665
DT = 1.0 / 400.0
KEEP = 4
RATE = 1.0 / (DT * KEEP)  # rows per second

MANUAL, CONVERTER, DUAL_CLUTCH, FIXED, VARIATOR = 0, 1, 2, 3, 4
DRIVE, COAST, BRAKE = 0, 1, 2

COLUMNS = (
    "speed", "accel", "distance", "altitude", "grade", "pitch", "pitch_rate", "pitch_accel",
    "heave_accel", "yaw_rate", "lateral_accel", "roll", "gear", "engine_speed", "engine_torque",
    "indicated_torque", "indicated_limit", "warm_friction", "mass", "headwind", "brake_force",
    "drag_force", "rolling_force", "traction_force", "coupled_force", "slip", "pedal",
    "brake_pedal", "clutch_open", "fuel_rate", "engine_warmth", "oil_warmth", "tyre_warmth",
    "engine_brake_torque", "accessory_power", "rotor_warmth", "coupled_offset", "coupled_speed",
    "crosswind", "input_speed", "clutch_torque", "pump_torque", "turbine_torque", "gearbox_loss",
)  # fmt: skip


class Engine(NamedTuple):
    """Engine or motor.

    Attributes
    ----------
    full : net torque at full load on a uniform grid of engine speed from 0 to ``top`` [N m]
    top : end of the grid [rad/s]
    idle, limit : idle speed and governed speed [rad/s]; idle is 0 for a motor
    friction_0, friction_1, friction_2 : friction, N m and per (rad/s), per (rad/s)^2, warm
    pumping : further friction while the throttle is shut [N m]
    cold : friction at the start of a cold drive over that of the warm engine, less one [-]
    inertia : of engine and flywheel [kg m2]
    lag : of the torque [s]
    boost_share : part of the full load that needs boost [-]
    boost_lag : of the boost at idle and at governed speed [s]
    altitude : loss of torque over loss of air density [-]
    efficiency : indicated [-]; of motor and inverter for a motor
    heating : heating value of the fuel [J/kg]; 0 for a motor
    regen, regen_power : motor torque and power with the pedal released [N m, W]
    blend, blend_power : motor torque and power that brakes may use [N m, W]
    brake : engine brake torque at governed speed [N m]
    accessory, cycled : power always taken, and power that is switched on and off [W]
    warm_time : time of the coolant to warm up at ordinary load [s]
    stop_start : 1 where the engine is stopped at a standstill
    """

    full: np.ndarray
    top: float
    idle: float
    limit: float
    friction_0: float
    friction_1: float
    friction_2: float
    pumping: float
    cold: float
    inertia: float
    lag: float
    boost_share: float
    boost_lag_low: float
    boost_lag_high: float
    altitude: float
    efficiency: float
    heating: float
    regen: float
    regen_power: float
    blend: float
    blend_power: float
    brake: float
    accessory: float
    cycled: float
    warm_time: float
    stop_start: int


class Gearbox(NamedTuple):
    """Clutch or converter, gears, final drive and shafts.

    Attributes
    ----------
    kind : MANUAL, CONVERTER, DUAL_CLUTCH, FIXED or VARIATOR (behind a converter)
    robot : 1 where a control unit shifts, 0 where the driver does
    ratios : engine over wheel speed, gears 1..n; of a variator places along its range [-]
    efficiency : of gear mesh and final drive, gears 1..n [-]
    spin_0, spin_1 : loss without load at the input, N m and per rad/s, warm
    cold : spin loss at the start of a cold drive over the warm one, less one [-]
    oil_time : time of the oil to warm up [s]
    inertia : at the input [kg m2]
    capacity : of the clutch [N m]
    open_time, sync_time, close_time : phases of a shift [s]
    launch_low, launch_span : engine speeds between which the clutch bites at a start [rad/s]
    converter_k : pump torque over engine speed squared at stall [N m s2]
    converter_ratio : torque ratio at stall [-]
    lock_gear : first gear with lock-up
    stiffness, damping : of the shafts, at the wheels [N m/rad, N m s/rad]
    start_gear : gear used to start, 1..n
    input_low, input_speed, input_pedal : a variator turns its input at ``input_low`` [rad/s], and
        faster by so much per m/s and by so much at full pedal to the power ``input_bend``
    steps : factor between the virtual gears of a variator, used at pedals above ``step_pedal``; 1
        without
    up_rate, down_rate : fastest change of its ratio towards the last and the first one [1/s]
    """

    kind: int
    robot: int
    ratios: np.ndarray
    efficiency: np.ndarray
    spin_0: float
    spin_1: float
    cold: float
    oil_time: float
    inertia: float
    capacity: float
    open_time: float
    sync_time: float
    close_time: float
    launch_low: float
    launch_span: float
    converter_k: float
    converter_ratio: float
    lock_gear: int
    stiffness: float
    damping: float
    start_gear: int
    input_low: float
    input_speed: float
    input_pedal: float
    input_bend: float
    steps: float
    step_pedal: float
    up_rate: float
    down_rate: float


class Body(NamedTuple):
    """Chassis, tyres and shape.

    Attributes
    ----------
    reference_mass : mass the values below are for [kg]
    radius : rolling radius at the reference mass [m]
    radius_load : loss of radius over relative gain of mass [-]
    wheel_mass : inertia of all wheels over radius squared [kg]
    drag_area : drag coefficient times area, wind from ahead [m2]
    yaw_drag : gain of the drag area times sine squared of the wind's angle [-]
    rolling : rolling coefficient, warm, slow [-]
    rolling_speed : its gain with speed squared [s2/m2]
    tyre_cold : rolling at the start of a cold drive over that when warm, less one [-]
    tyre_time : time of the tyres to warm up at 25 m/s [s]
    slip_stiffness : traction over driven load per unit of slip [-]
    driven_share : part of the weight on driven wheels [-]
    corner_stiffness : side force over load per radian of slip angle [1/rad]
    wheelbase : [m]
    squat, dive : nose-up pitch per acceleration by traction and by brakes [rad s2/m]
    play : pitch that the friction of the springs holds back [rad]
    pitch_frequency, pitch_damping : [rad/s, -] at the reference mass
    heave_frequency, heave_damping : [rad/s, -]
    roll_per_accel : [rad s2/m]
    residual_brake : drag of the pads just after braking [N]
    coupled_share : part of the load above the reference mass that moves by itself [-]
    coupled_frequency, coupled_damping : [rad/s, -]
    """

    reference_mass: float
    radius: float
    radius_load: float
    wheel_mass: float
    drag_area: float
    yaw_drag: float
    rolling: float
    rolling_speed: float
    tyre_cold: float
    tyre_time: float
    slip_stiffness: float
    driven_share: float
    corner_stiffness: float
    wheelbase: float
    squat: float
    dive: float
    play: float
    pitch_frequency: float
    pitch_damping: float
    heave_frequency: float
    heave_damping: float
    roll_per_accel: float
    residual_brake: float
    coupled_share: float
    coupled_frequency: float
    coupled_damping: float


class Driver(NamedTuple):
    """Temperament.

    Attributes
    ----------
    accel, accel_speed : wanted acceleration from rest, and speed at which it has halved
    decel : usual deceleration for stops [m/s2]
    patience : deceleration beyond coasting at which the brake is used [m/s2]
    interval : time between corrections of the pedals [s]
    feel : guessed over true mass [-]
    pace : wanted speed over limit [-]
    top_speed : never faster [m/s]
    headway : time behind a leader [s]
    hardest : most deceleration ever asked for [m/s2]
    up_low, up_high : shift up at closed and full pedal, parts of the governed speed [-]
    lug : lowest engine speed under load, part of the governed speed [-]
    skip, neutral, rest, pre_brake, overlap : chances of a skipped gear, of coasting in neutral,
        of a foot resting on the brake, of a light touch before braking, of brake over accelerator
    cruise : 1 with cruise control on fast roads
    overtake : overtakings per second on fast roads [1/s]
    leaders : leaders met per second [1/s]
    lateral : lateral acceleration in bends [m/s2]
    """

    accel: float
    accel_speed: float
    decel: float
    patience: float
    interval: float
    feel: float
    pace: float
    top_speed: float
    headway: float
    hardest: float
    up_low: float
    up_high: float
    lug: float
    skip: float
    neutral: float
    rest: float
    pre_brake: float
    overlap: float
    cruise: int
    overtake: float
    leaders: float
    lateral: float


class Road(NamedTuple):
    """Road by distance: uniform grids, and stops.

    Attributes
    ----------
    step : of the grid [m]
    grade : [rad]
    curvature : positive to the left [1/m]
    crossfall : positive where the left side is higher [rad]
    heading : clockwise from north [rad]
    plan : speed wanted at pace 1, with slowing down ahead of bends [m/s]
    fast : 1 on open roads where one overtakes
    shelter : wind at the vehicle over the wind of the day [-]
    texture : rolling resistance over that of a mean surface [-]
    profile, profile_step : height of the unevenness and its grid [m]
    stop_at, stop_time, stop_decel : stops: place, duration, braking [m, s, m/s2]
    stop_release : distance before the stop at which the way is free after all; 0 if it is not
    stop_drop : mass taken off during the stop [kg]
    """

    step: float
    grade: np.ndarray
    curvature: np.ndarray
    crossfall: np.ndarray
    heading: np.ndarray
    plan: np.ndarray
    fast: np.ndarray
    shelter: np.ndarray
    texture: np.ndarray
    profile: np.ndarray
    profile_step: float
    stop_at: np.ndarray
    stop_time: np.ndarray
    stop_decel: np.ndarray
    stop_release: np.ndarray
    stop_drop: np.ndarray


class Day(NamedTuple):
    """One drive: load, weather, warmth, state of the vehicle.

    Attributes
    ----------
    mass : at the start [kg]
    density : of the air at height 0 of the drive [kg/m3]
    wind, wind_from : mean wind at the vehicle in the open [m/s, rad]
    gust : standard deviation of the gusts over the mean wind [-]
    engine_warmth, oil_warmth, tyre_warmth : at the start, 0 cold to 1 warm
    drag_factor : roof load, open window, dirt [-]
    window_time, window_factor : drag changes once, at this time, by this factor
    rolling_factor : pressure and tyres of the day [-]
    leak : gain of rolling resistance per second by pressure loss [1/s]
    wet : water on the road: share of rolling at 25 m/s [-]
    squat_factor : springs of the day [-]
    seat_pitch : nose-up lean by the load at rest [rad]
    accessory_factor : electric load of the day [-]
    cycled : 1 where the compressor of the air conditioning runs
    grip : coefficient of friction [-]
    draft : drag saved right behind a leader [-]
    """

    mass: float
    density: float
    wind: float
    wind_from: float
    gust: float
    engine_warmth: float
    oil_warmth: float
    tyre_warmth: float
    drag_factor: float
    window_time: float
    window_factor: float
    rolling_factor: float
    leak: float
    wet: float
    squat_factor: float
    seat_pitch: float
    accessory_factor: float
    cycled: int
    grip: float
    draft: float


@njit(cache=True, error_model="numpy")
def at(values, x):
    """Read a uniform grid of unit step at ``x``, held at its ends."""
    if x <= 0.0:
        return values[0]
    i = int(x)
    if i >= values.size - 1:
        return values[values.size - 1]
    f = x - i
    return values[i] * (1.0 - f) + values[i + 1] * f


@njit(cache=True, error_model="numpy")
def full_torque(engine, speed):
    """Net torque at full load, warm, at sea level [N m]."""
    return at(engine.full, max(speed, 0.0) / engine.top * (engine.full.size - 1))


@njit(cache=True, error_model="numpy")
def friction(engine, speed):
    """Friction of the warm engine [N m], at zero speed none."""
    s = max(speed, 0.0)
    f = engine.friction_0 + (engine.friction_1 + engine.friction_2 * s) * s
    return f * min(1.0, s / 20.0)


@njit(cache=True, error_model="numpy")
def regen_limit(torque, power, speed):
    """Braking torque of a motor: limited by torque, power, and fading out to a halt."""
    s = max(speed, 0.0)
    limit = min(torque, power / max(s, 1.0))
    return limit * min(1.0, max(0.0, (s - 15.0) / 60.0))


@njit(cache=True, error_model="numpy")
def run(engine, box, body, driver, road, day, rng, steps):
    """Drive for ``steps`` steps of ``DT``; return rows of ``COLUMNS``."""
    out = np.zeros((steps // KEEP, len(COLUMNS)))
    gears = box.ratios.size
    electric = engine.heating == 0.0
    fixed = box.kind == FIXED
    variator = box.kind == VARIATOR
    turbine = box.kind == CONVERTER or variator
    clutched = box.kind == MANUAL or box.kind == DUAL_CLUTCH

    mass = day.mass
    coupled = body.coupled_share * max(0.0, mass - body.reference_mass)
    load_ratio = mass / body.reference_mass
    radius = body.radius * (1.0 - body.radius_load * (load_ratio - 1.0))
    full_max = engine.full.max()
    pitch_w = body.pitch_frequency / np.sqrt(load_ratio)
    heave_w = body.heave_frequency / np.sqrt(load_ratio)
    squat_gain = body.squat * day.squat_factor / body.reference_mass
    dive_gain = body.dive * day.squat_factor / body.reference_mass

    # Motion.
    s, v, a, height = 30.0, 0.0, 0.0, 0.0
    a_felt, a_long = 0.0, 0.0
    first = at(road.grade, s / road.step)
    x_c, v_c = -G * np.sin(first) / body.coupled_frequency**2, 0.0
    pitch, pitch_rate, held = day.seat_pitch, 0.0, 0.0
    heave_rate = 0.0
    smooth_f = at(road.profile, s / road.profile_step)
    smooth_r = at(road.profile, (s - body.wheelbase) / road.profile_step)
    last_f, last_r = smooth_f, smooth_r
    heave = 0.5 * (smooth_f + smooth_r)
    roll = 0.0
    slip = 0.0
    f_roll, f_drag, f_brake, f_trac = 0.0, 0.0, 0.0, 0.0
    # Driveline.
    gear = 1 if fixed else box.start_gear
    ratio = box.ratios[gear - 1]
    we = engine.idle
    wi = 0.0
    twist = 0.0
    locked = fixed
    cap = 0.0
    lock_up = 0.0
    torque_i, boost = 0.0, 0.0
    idle_sum = 0.0
    phase, phase_time, next_gear = 0, 0.0, gear
    old_ratio = ratio
    since_shift, full_time = 9.0, 0.0
    held_ratio = 0.0
    in_neutral = False
    # Warmth.
    x_e, x_o, x_t, x_m = day.engine_warmth, day.oil_warmth, day.tyre_warmth, 0.3
    # Accessories.
    ac_on, ac_left = day.cycled == 1, 20.0
    alt, alt_left = engine.accessory, 10.0
    # Air.
    gust_u, gust_v, slow_u, slow_dir = 0.0, 0.0, 0.0, 0.0
    head, cross = 0.0, 0.0
    # Driver.
    mode, foot = COAST, 0.0
    pedal, pedal_goal, pedal_sum = 0.0, 0.0, 0.0
    brake, brake_goal, brake_sum = 0.0, 0.0, 0.0
    pads = 0.0
    wait = 3.0 + 10.0 * rng.random()
    standing = True
    stop, stop_stage = 0, 0
    urge = 1.0
    next_look = 0.0
    rest, pre_left, pre_level = 0.0, 0.0, 0.0
    over_left, over_level = 0.0, 0.0
    pace_noise = 0.0
    take_over = 0.0
    cruising = False
    # Leader.
    gap, v_lead, lead_left, lead_goal, lead_goal_left = 1e9, 0.0, 0.0, 0.0, 0.0
    lead_on, lead_big = False, 0.0
    a_des = 0.0

    s_pitch_rate, s_pitch_acc, s_heave = 0.0, 0.0, 0.0
    s_clutch, s_pump, s_turb, s_loss = 0.0, 0.0, 0.0, 0.0
    v_kept = 0.0
    fuel_rate = 0.0
    eb = 0.0
    t_drag = 0.0
    t_net = 0.0
    t_limit = 1.0
    off = False
    every = 20
    tick = DT * every

    for k in range(steps):
        t = k * DT
        x = s / road.step
        grade = at(road.grade, x)
        kappa = at(road.curvature, x)
        i_road = min(int(x), road.grade.size - 1)
        sin_g, cos_g = np.sin(grade), np.cos(grade)

        # ---- slow things, 20 per second -------------------------------------------------
        if k % every == 0:
            # Wind: mean that wanders, gusts with a length of 80 m (Dryden's form).
            speed_air = max(v, 3.0)
            q = np.exp(-tick * (speed_air + day.wind) / 80.0)
            sigma = day.gust * day.wind * road.shelter[i_road] + 0.15
            gust_u = q * gust_u + sigma * np.sqrt(1.0 - q * q) * rng.normal()
            gust_v = q * gust_v + sigma * np.sqrt(1.0 - q * q) * rng.normal()
            q = np.exp(-tick / 400.0)
            slow_u = q * slow_u + 0.2 * np.sqrt(1.0 - q * q) * rng.normal()
            slow_dir = q * slow_dir + 0.25 * np.sqrt(1.0 - q * q) * rng.normal()
            wind = day.wind * (1.0 + slow_u) * road.shelter[i_road]
            angle = day.wind_from + slow_dir - at(road.heading, x)
            head = wind * np.cos(angle) + gust_u
            cross = wind * np.sin(angle) + gust_v

            # Warmth of coolant, oil, tyres, rotor.
            power = abs(torque_i * we)
            heat = 0.25 + power / (0.35 * full_max * engine.limit * 0.6 + 1.0)
            x_e += tick / engine.warm_time * min(heat, 2.0) * (1.0 if x_e < 1.0 else 0.0)
            x_e = min(x_e, 1.0)
            x_o += tick / box.oil_time * (min(1.0, 0.25 + v / 25.0) - x_o) * (0.5 + v / 30.0)
            goal = min(1.25, (max(v, 0.0) / 25.0) ** 0.6)
            x_t += tick / body.tyre_time * (goal - x_t)
            if electric:
                share = abs(torque_i) / full_max
                x_m += tick / 900.0 * (min(1.0, 6.0 * share * share + 0.15 + v / 80.0) - x_m)

            # Accessories.
            ac_left -= tick
            if ac_left < 0.0:
                ac_on = day.cycled == 1 and not ac_on
                ac_left = (6.0 + 25.0 * rng.random()) if ac_on else (5.0 + 30.0 * rng.random())
            alt_left -= tick
            if alt_left < 0.0:
                alt = engine.accessory * day.accessory_factor * (0.5 + rng.random())
                alt_left = 15.0 + 60.0 * rng.random()

            # Leader.
            v_road = at(road.plan, x)
            if not lead_on:
                if rng.random() < driver.leaders * tick and v > 3.0:
                    lead_on = True
                    gap = v * (1.2 + 2.5 * rng.random()) + 5.0
                    v_lead = v * (0.8 + 0.2 * rng.random())
                    lead_left = 10.0 + 70.0 * rng.random()
                    lead_goal_left = 0.0
                    lead_big = 1.0 if rng.random() < 0.3 else 0.35
            else:
                lead_left -= tick
                lead_goal_left -= tick
                if lead_goal_left < 0.0:
                    lead_goal = v_road * (0.6 + 0.5 * rng.random())
                    if v_road < 16.0 and rng.random() < 0.12:
                        lead_goal = 0.0
                    lead_goal_left = 4.0 + 14.0 * rng.random()
                lead_a = min(1.2, max(-1.8, 0.4 * (lead_goal - v_lead)))
                v_lead = max(0.0, v_lead + lead_a * tick)
                gap = max(0.5, gap + (v_lead - v) * tick)
                if lead_left < 0.0 and v_lead > 2.0:
                    lead_on = False
                    gap = 1e9

            # What the driver wants.
            q = np.exp(-tick / 25.0)
            pace_noise = q * pace_noise + 0.05 * np.sqrt(1.0 - q * q) * rng.normal()
            v_goal = min(v_road * driver.pace * (0.98 + pace_noise), driver.top_speed)
            if take_over > 0.0:
                take_over -= tick
                v_goal = v_goal * 1.18
            elif road.fast[i_road] == 1.0 and v > 15.0 and rng.random() < driver.overtake * tick:
                take_over = 5.0 + 8.0 * rng.random()
                lead_on = False
                gap = 1e9
            want = driver.accel * urge / (1.0 + v / driver.accel_speed)
            dv = v_goal - v
            if dv > 0.0:
                a_des = want * min(1.0, dv / (0.08 * v_goal + 0.6))
            else:
                a_des = max(-2.5, 0.22 * dv)
            ahead = 8.0 + 0.6 * v
            v_next = at(road.plan, x + ahead / road.step) * driver.pace
            if v_next < v_goal and v > 0.92 * v_goal:
                a_des = min(a_des, (v_next * v_next - v * v) / (2.0 * ahead))
            if lead_on:
                near = 2.5 + v * driver.headway
                near += v * (v - v_lead) / (2.0 * np.sqrt(max(want, 0.5) * 1.5))
                near = max(near, 2.0)
                free = want * (1.0 - (v / max(v_goal, 1.0)) ** 4)
                # Who is close but not faster falls back gently.
                room = max(gap - 2.0, 1.0)
                needed = 0.5 * max(v - v_lead, 0.0) ** 2 / room
                yielding = max(free, -0.3) - want * (near / max(gap, 0.5)) ** 2
                a_des = min(a_des, max(yielding, -1.2 - 1.4 * needed))

            # Force with the pedal released, as felt.
            if fixed:
                t_drag = -regen_limit(engine.regen, engine.regen_power, we)
            else:
                t_drag = -friction(engine, we) * (1.0 + engine.cold * (1.0 - x_e)) - engine.pumping
            coupled_in = locked and not in_neutral and phase == 0
            f_free = t_drag * ratio / radius if coupled_in else 0.0
            if turbine and not locked:
                f_free = 0.4 * t_drag * ratio / radius
            a_coast = (f_free - f_roll - f_drag) / mass - G * sin_g

            # Stops.
            a_stop = 9.0
            if stop < road.stop_at.size:
                left = road.stop_at[stop] - s
                if left < 250.0:
                    need = v * v / (2.0 * max(left + 0.5, 0.7))
                    b = road.stop_decel[stop]
                    free = road.stop_release[stop]
                    if free > 0.0 and free > left and not standing:
                        stop += 1
                        stop_stage = 0
                    else:
                        if stop_stage == 0 and need > 0.45 * b:
                            stop_stage = 1
                        if stop_stage == 1 and (need > b or left < 12.0):
                            stop_stage = 2
                        if stop_stage == 1:
                            a_stop = max(a_coast - 0.02, -need)
                        elif stop_stage == 2:
                            a_stop = -min(need * 1.02, 1.5 * b + 0.7)
                            if left < 2.0:
                                a_stop = min(a_stop, -0.6)
                        if v < 2.0 and stop_stage == 0 and left < 8.0:
                            stop_stage = 2
                        if left < -6.0 or (left < -3.0 and v > 3.0):
                            stop += 1
                            stop_stage = 0
            a_des = max(min(a_des, a_stop), -driver.hardest)

            # Standing.
            if standing:
                wait -= tick
                if wait <= 0.0 and (not lead_on or (gap > 4.0 and v_lead > 0.3)):
                    standing = False
                    mode = DRIVE
                    foot = 0.15 + 0.4 * rng.random()
                    urge = np.exp(0.25 * rng.normal())
                    pedal_sum = 0.0
                    if rng.random() < driver.overlap or sin_g > 0.03:
                        over_left = 0.4 + 1.2 * rng.random()
                        over_level = (0.1 + 0.5 * rng.random()) + 6.0 * max(sin_g, 0.0)
                else:
                    a_des = -1.0
            elif v < 0.05 and (mode == BRAKE or a_des < 0.01):
                standing = True
                stop_stage = 0
                wait = 0.6 + 2.0 * rng.random()
                if stop < road.stop_at.size and road.stop_at[stop] - s < 8.0:
                    wait = road.stop_time[stop]
                    if road.stop_drop[stop] != 0.0:
                        mass -= road.stop_drop[stop]
                        coupled = body.coupled_share * max(0.0, mass - body.reference_mass)
                        load_ratio = mass / body.reference_mass
                        radius = body.radius * (1.0 - body.radius_load * (load_ratio - 1.0))
                        pitch_w = body.pitch_frequency / np.sqrt(load_ratio)
                        heave_w = body.heave_frequency / np.sqrt(load_ratio)
                    stop += 1
                    stop_stage = 0

            # The engine stops at a halt and is started before the start.
            if engine.stop_start == 1 and standing and we < 1.3 * engine.idle:
                off = x_e > 0.7 and wait > 0.5 and t > 15.0 and not (ac_on and wait < 15.0)
            else:
                off = False

            # Which pedal.
            foot -= tick
            over_left -= tick
            pre_left -= tick
            if not standing:
                new = mode
                if mode == DRIVE and a_des < a_coast - 0.02:
                    new = COAST
                elif mode == COAST:
                    if a_des > a_coast + 0.10 and a_des > -0.9:
                        new = DRIVE
                    elif a_des < a_coast - driver.patience:
                        new = BRAKE
                elif mode == BRAKE and (a_des > a_coast + 0.05 and stop_stage != 2):
                    new = COAST
                if stop_stage == 2 and v < 3.5 and road.stop_at[stop] - s < 10.0:
                    new = BRAKE
                if new != mode and foot < 0.0:
                    foot = 0.25 + 0.5 * rng.random()
                    if a_des < a_coast - 1.5:
                        foot = 0.2
                    if new == COAST:
                        rest = 0.0
                        chance = driver.rest * (2.0 if sin_g < -0.02 else 1.0)
                        if mode == DRIVE and v > 4.0 and rng.random() < chance:
                            rest = 0.03 + 0.22 * rng.random()
                        lone = not clutched or box.robot == 1
                        if mode == DRIVE and not lone and v > 6.0 and phase == 0:
                            in_neutral = rng.random() < driver.neutral
                    if new == BRAKE and rng.random() < driver.pre_brake:
                        pre_left = 0.4 + 1.8 * rng.random()
                        pre_level = 0.1 + 0.35 * rng.random()
                    if new == BRAKE:
                        brake_sum = 0.0
                    if new == DRIVE:
                        pedal_sum *= 0.5
                    mode = new

            # Cruise control holds the speed without a foot.
            cruising = (
                driver.cruise == 1 and v > 19.0 and not lead_on and take_over <= 0.0
                and stop_stage == 0 and mode != BRAKE and road.fast[i_road] == 1.0
            )  # fmt: skip

            # Pedals, corrected now and then.
            if t >= next_look or cruising:
                next_look = t + driver.interval * (0.5 + rng.random())
                felt = mass * driver.feel
                if mode == DRIVE and not standing:
                    lift = 1.0
                    if turbine and not locked:
                        nu = wi / max(we, 10.0)
                        low = 1.0 - (box.converter_ratio - 1.0) * (nu / 0.86 - 1.0)
                        lift = max(1.0, low)
                    need_f = felt * (a_des + G * sin_g) + f_roll + f_drag
                    turn = max(we, box.launch_low + 0.3 * box.launch_span)
                    hi = full_torque(engine, turn)
                    i_now = box.ratios[max(next_gear, 1) - 1]
                    need_t = need_f * radius / (i_now * 0.95 * lift)
                    p = (need_t - t_drag) / (hi - t_drag)
                    gain = 0.02 if cruising else 0.05
                    pedal_sum += gain * (a_des - a_felt)
                    pedal_sum = min(0.3, max(-0.3, pedal_sum))
                    p += pedal_sum
                    if take_over > 0.0 and v < v_goal - 0.5:
                        p = 1.0
                    p = min(1.0, max(0.0, p))
                    if abs(p - pedal_goal) > (0.002 if cruising else 0.025):
                        pedal_goal = p if cruising else p + 0.01 * rng.normal()
                    pedal_goal = min(1.0, max(0.02, pedal_goal))
                else:
                    pedal_goal = 0.0
                if standing:
                    brake_goal = mass * (3.0 + 10.0 * abs(sin_g))
                elif mode == BRAKE:
                    brake_sum += 0.12 * (a_felt - a_des)
                    brake_sum = min(2.5, max(-0.4, brake_sum))
                    more = felt * max(0.05, a_coast - a_des + brake_sum)
                    if pre_left > 0.0 and more < 2.5 * felt:
                        more = felt * pre_level
                    brake_goal = more * (1.0 + 0.04 * rng.normal())
                elif mode == COAST and rest > 0.0:
                    brake_goal = felt * rest
                elif mode == DRIVE and over_left > 0.0 and v < 4.0:
                    brake_goal = felt * over_level
                else:
                    brake_goal = 0.0
            if foot > 0.0 and not standing:
                if mode != DRIVE:
                    pedal_goal = 0.0
                if mode != BRAKE and not (mode == COAST and rest > 0.0) and over_left <= 0.0:
                    brake_goal = 0.0
                if mode == DRIVE and over_left <= 0.0:
                    pedal_goal = 0.0
                if mode == BRAKE and foot > 0.15:
                    brake_goal = 0.0

            # Gear choice.
            since_shift += tick
            n_max = engine.limit
            full_time = full_time + tick if pedal > 0.9 else 0.0
            if gear > 0 and phase == 0 and not fixed and not variator and not standing and v > 0.5:
                w_gear = v / radius * box.ratios[gear - 1]
                goal_gear = gear
                lug_w = driver.lug * n_max * (0.85 + 0.45 * pedal)
                many = 0.85 if gears > 8 else 1.0
                lowest = box.start_gear if sin_g < 0.06 else 1
                if mode != DRIVE:
                    lug_w = max(1.15 * engine.idle, 0.6 * driver.lug * n_max)
                if mode == DRIVE and not in_neutral:
                    up = n_max * (driver.up_low + (driver.up_high - driver.up_low) * pedal**1.4)
                    up *= 1.0 + 2.0 * max(0.0, sin_g)
                    ready = locked or turbine
                    if gear < gears and w_gear > up and since_shift > 1.0 and ready:
                        after = w_gear * box.ratios[gear] / box.ratios[gear - 1]
                        # The next gear has to carry the climb.
                        carry = full_torque(engine, after) * box.ratios[gear] / radius * 0.9
                        high = w_gear > 0.97 * n_max
                        if (
                            after > 1.07 * lug_w or high
                        ) and carry > f_roll + f_drag + mass * G * sin_g:
                            goal_gear = gear + 1
                            if gear + 1 < gears and rng.random() < driver.skip:
                                after2 = w_gear * box.ratios[gear + 1] / box.ratios[gear - 1]
                                if after2 > (1.15 if many == 1.0 else 0.92) * lug_w:
                                    goal_gear = gear + 2
                    elif gear > lowest and w_gear < many * lug_w and since_shift > 2.0:
                        goal_gear = gear - 1
                    elif gear > 1 and full_time > 0.8 and a_des - a_felt > 0.15:
                        after = w_gear * box.ratios[gear - 2] / box.ratios[gear - 1]
                        if after < 0.88 * n_max and since_shift > 2.5:
                            goal_gear = gear - 1
                elif mode in (COAST, BRAKE):
                    slow = gear > lowest and w_gear < lug_w and not in_neutral
                    if slow and since_shift > 1.5:
                        if box.robot == 1 or box.kind != MANUAL or v > 5.0:
                            goal_gear = gear - 1
                            if box.kind == MANUAL:
                                # Further down in one go if braking.
                                while goal_gear > max(lowest, gear - 3) and mode == BRAKE:
                                    if v / radius * box.ratios[goal_gear - 1] > 1.2 * lug_w:
                                        break
                                    goal_gear -= 1
                    elif gear < gears and w_gear > 0.93 * n_max:
                        goal_gear = gear + 1
                if in_neutral and (mode != COAST or v < 4.0):
                    in_neutral = False
                    goal_gear = gear
                    phase, phase_time = 2, 0.0
                # Nobody goes down into the lowest gear while the vehicle rolls well.
                rolls = v > 2.5 and sin_g < 0.06 and pedal < 0.7
                if rolls and goal_gear == 1 and gear > 1:
                    goal_gear = 2
                if goal_gear < gear:
                    while (
                        goal_gear > lowest and v / radius * box.ratios[goal_gear - 1] < 0.9 * lug_w
                    ):
                        if v / radius * box.ratios[goal_gear - 2] > 0.8 * n_max:
                            break
                        if rolls and goal_gear == 2:
                            break
                        goal_gear -= 1
                if goal_gear != gear:
                    next_gear = goal_gear
                    phase, phase_time = 1, 0.0
                    since_shift = 0.0
                    old_ratio = box.ratios[gear - 1]
            if standing and not fixed and phase == 0 and gear != box.start_gear:
                gear = box.start_gear
                next_gear = gear
                in_neutral = False
                locked = False
                ratio = box.ratios[gear - 1]
                wi = 0.0
                twist = 0.0
            if variator and not standing and v > 0.5:
                # The input turns by pedal and speed; at a high pedal in steps, as gears would.
                turn = box.input_low + box.input_speed * v + box.input_pedal * pedal**box.input_bend
                goal_ratio = min(turn, 0.97 * engine.limit) * radius / v
                if box.steps > 1.0 and pedal > box.step_pedal:
                    if held_ratio == 0.0:
                        held_ratio = max(ratio, goal_ratio)
                    elif held_ratio > box.steps * goal_ratio:
                        held_ratio = goal_ratio
                    goal_ratio = held_ratio
                elif pedal < box.step_pedal - 0.1:
                    held_ratio = 0.0
                goal_ratio = min(box.ratios[0], max(box.ratios[-1], goal_ratio))
                change = (goal_ratio - ratio) / (0.25 * ratio)
                change = min(box.down_rate, max(-box.up_rate, change))
                ratio *= 1.0 + change * tick
                span = np.log(box.ratios[0] / box.ratios[-1])
                gear = 1 + int(np.log(box.ratios[0] / ratio) / span * (gears - 1) + 0.5)
                gear = min(gears, max(1, gear))
                next_gear = gear

        # ---- pedals ---------------------------------------------------------------------
        pedal += DT / 0.12 * (pedal_goal - pedal)
        brake += DT / 0.15 * (brake_goal - brake)
        if brake < 1.0 and brake_goal == 0.0:
            brake = 0.0

        # ---- shift ----------------------------------------------------------------------
        cut = 1.0
        if phase > 0:
            phase_time += DT
        if clutched:
            full_cap = box.capacity
            if box.kind == MANUAL:
                if phase == 1:
                    cut = 0.0
                    cap = max(0.0, 1.0 - phase_time / box.open_time) * full_cap * 0.7
                    if phase_time > box.open_time:
                        phase, phase_time, gear, cap = 2, 0.0, 0, 0.0
                        locked = False
                elif phase == 2:
                    cut = 0.0
                    cap = 0.0
                    locked = False
                    if phase_time > box.sync_time:
                        phase, phase_time, gear = 3, 0.0, next_gear
                        ratio = box.ratios[gear - 1]
                        wi = v / radius * (1.0 + slip) * ratio
                        twist = 0.0
                elif phase == 3:
                    cut = min(1.0, 0.2 + phase_time / box.close_time)
                    cap = min(1.0, (phase_time / box.close_time) ** 2 + 0.03) * full_cap
                    # The foot lets the speeds meet before it lets go.
                    cap = min(cap, 1.1 * max(t_net, 0.0) + (0.12 + 0.25 * phase_time) * full_max)
                    if locked or phase_time > 2.0 or wi < 1.12 * engine.idle:
                        phase = 0
            elif phase == 1:
                # Power shift: the next gear's clutch slips until the speeds are equal.
                if gear != next_gear:
                    gear = next_gear
                    ratio = box.ratios[gear - 1]
                    wi = v / radius * (1.0 + slip) * ratio
                    twist = twist * old_ratio / ratio
                    locked = False
                cut = 0.8
                cap = 1.05 * abs(t_net) + (0.03 + 0.25 * phase_time) * full_max
                if locked or phase_time > 1.5 or wi < 1.12 * engine.idle:
                    phase = 0
            if in_neutral and phase == 0:
                cap = 0.0
                locked = False
            elif phase == 0:
                low = 1.12 * engine.idle
                if wi < low and not (locked and we > low):
                    if pedal > 0.01:
                        bite = max(0.0, (we - box.launch_low) / box.launch_span)
                        cap = min(1.0, bite**1.3) * full_cap
                    elif box.kind == DUAL_CLUTCH and brake < 1.0:
                        cap = 0.05 * full_cap
                    else:
                        cap = 0.0
                elif not locked:
                    if pedal > 0.01 or mode == DRIVE:
                        bite = max(0.0, (we - 0.9 * box.launch_low) / box.launch_span)
                        cap = min(1.0, max(bite**1.3, cap / full_cap + DT * 0.6)) * full_cap
                        # The foot feels the speeds meet.
                        cap = min(cap, 1.1 * max(t_net, 0.0) + 0.08 * full_max)
                    else:
                        cap = min(full_cap, cap + full_cap * DT * 0.6)
                else:
                    cap = full_cap
                if locked and (we < 0.95 * engine.idle or (we < low * 0.98 and pedal < 0.02)):
                    cap = 0.0
            if we < 0.9 * engine.idle:
                cap = 0.0  # the clutch opens before the engine stalls
        elif turbine:
            if phase == 1:
                gear = next_gear
                # A wide step takes longer. Upwards the engine's inertia pushes as it slows down:
                # its torque is taken back for as long.
                wide = abs(np.log(old_ratio / box.ratios[gear - 1])) / 0.35
                f = min(1.0, phase_time / (box.sync_time * max(1.0, wide)))
                cut = 0.7 - (2.0 * f * (1.0 - f) if old_ratio > box.ratios[gear - 1] else 0.0)
                f = f * f * (3.0 - 2.0 * f)
                ratio = old_ratio * (1.0 - f) + box.ratios[gear - 1] * f
                if f >= 1.0:
                    phase = 0
            want_lock = (
                gear >= box.lock_gear and phase == 0 and wi > 1.45 * engine.idle
                and (v > 4.0) and not (pedal > 0.75 and wi < 0.3 * engine.limit)
            )  # fmt: skip
            if want_lock:
                lock_up = min(1.0, lock_up + DT / 0.6)
            else:
                lock_up = max(0.0, lock_up - DT / (0.15 if phase == 0 else 0.4))
            cap = box.capacity * lock_up
            if phase == 1:
                # Lock-up slips in the shift, so that the engine's inertia does not jolt.
                cap = min(cap, 1.1 * abs(t_net) + 0.05 * full_max)
        in_gear = gear > 0 and not in_neutral

        # ---- engine ---------------------------------------------------------------------
        lightness = np.exp(-height / 8500.0)
        cold = 1.0 + engine.cold * (1.0 - x_e) ** 1.5
        if electric:
            hi = full_torque(engine, we)
            lo = t_drag
            demand = lo + pedal * (hi - lo)
            # Cold or full batteries take less; the brakes make up for it.
            blend = 0.0
            if brake > 0.0 and not standing:
                room = regen_limit(engine.blend, engine.blend_power, we) + min(demand, 0.0)
                blend = min(max(room, 0.0), brake * radius / ratio)
            demand -= blend
            grip = 0.85 * day.grip * body.driven_share * mass * G * radius / ratio
            demand = min(max(demand, -grip), grip)
            torque_i += DT / engine.lag * (demand - torque_i)
            loss = friction(engine, we)
            t_net = torque_i - loss
            t_limit = hi
            brake_asked = max(0.0, brake - blend * ratio / radius)
            if standing or v < 0.3:
                brake_asked = brake
            acc_power = alt + (engine.cycled if ac_on else 0.0)
            fuel_rate = 0.0
        else:
            fric = friction(engine, we) * cold
            t_limit = full_torque(engine, we) * (1.0 - engine.altitude * (1.0 - lightness))
            t_limit += friction(engine, we)
            boosted = t_limit * (1.0 - engine.boost_share * (1.0 - boost))
            ask = pedal * cut
            demand = ask * t_limit
            if in_gear and ratio > 0.0:
                grip = 0.85 * day.grip * body.driven_share * mass * G * radius / ratio
                if turbine and not locked:
                    low = 1.0 - (box.converter_ratio - 1.0) * (wi / max(we, 10.0) / 0.86 - 1.0)
                    grip /= max(1.0, low)
                demand = min(demand, grip + fric)
            if we > engine.limit:
                demand *= max(0.0, 1.0 - (we - engine.limit) / (0.03 * engine.limit))
            # Idle governor; a cold engine idles faster.
            idle = engine.idle * (1.0 + 0.3 * (1.0 - x_e))
            short = idle - we
            acc_power = alt + (engine.cycled if ac_on else 0.0)
            t_acc = acc_power / max(we, 0.7 * engine.idle)
            if we < 1.25 * idle:
                idle_sum = min(1.0, max(-0.3, idle_sum + DT * 0.02 * short))
                hold = fric + t_acc + (0.02 * short + idle_sum) * full_max * 0.5
                fade = min(1.0, max(0.0, (1.25 * idle - we) / (0.2 * idle)))
                demand = max(demand, hold * fade)
            else:
                idle_sum = 0.0
            meet = phase >= 2 or (phase == 1 and box.kind == DUAL_CLUTCH)
            if meet and clutched and next_gear > 0 and not locked:
                # The engine is turned up to the speed of a lower gear, by most drivers a little.
                target = v / radius * box.ratios[next_gear - 1]
                match = 0.97 if box.robot == 1 else 0.85
                if match * target > we and v > 1.0:
                    demand = max(demand, fric + min(0.35, 0.01 * (target - we)) * full_max)
            demand = max(0.0, demand)
            base = 1.0 - engine.boost_share
            wanted_boost = 0.0
            if engine.boost_share > 0.0:
                wanted_boost = min(1.0, max(0.0, (demand / t_limit - base) / engine.boost_share))
            part = min(1.0, we / engine.limit)
            b_lag = engine.boost_lag_low * (1.0 - part) ** 2 + engine.boost_lag_high
            boost += DT / b_lag * (wanted_boost - boost) * (1.0 if wanted_boost > boost else 1.5)
            demand = min(demand, max(boosted, 0.0))
            torque_i += DT / engine.lag * (demand - torque_i)
            shut = engine.pumping * max(0.0, 1.0 - demand / (0.25 * t_limit))
            # Engine brake of heavy vehicles: part of the braking, while in gear.
            eb_goal = 0.0
            if engine.brake > 0.0 and brake > 0.0 and locked and in_gear and we > 1.4 * engine.idle:
                most = engine.brake * (we / engine.limit) ** 1.5
                eb_goal = min(most, brake * radius / ratio)
            eb += DT / 0.25 * (eb_goal - eb)
            brake_asked = max(0.0, brake - (eb * ratio / radius if in_gear else 0.0))
            if standing or v < 0.3:
                brake_asked = brake
            t_net = torque_i - fric - shut - t_acc - eb
            fuel_rate = torque_i * we / (engine.efficiency * engine.heating)

        # ---- driveline ------------------------------------------------------------------
        we_before = we
        t_clutch, t_pump, t_turb, loss = 0.0, 0.0, 0.0, 0.0
        w_wheel = v / radius * (1.0 + slip)
        if not in_gear:
            twist -= DT / 0.05 * twist
            t_shaft = 0.0
            thick = 1.0 + box.cold * (1.0 - x_o)
            t_shaft = -0.6 * box.spin_0 * thick * min(1.0, w_wheel)
            acc = t_net / engine.inertia
            we = max(we + DT * acc, 0.4 * engine.idle)
            wi = w_wheel * box.ratios[max(gear, next_gear, 1) - 1]
            locked = False
        else:
            wi_before = wi
            d_twist = wi / ratio - w_wheel
            t_shaft = box.stiffness * twist + box.damping * d_twist
            through = t_shaft / ratio
            eff = box.efficiency[gear - 1]
            loss = through * (1.0 / eff - 1.0) if through > 0.0 else -through * (1.0 - eff)
            spin = (box.spin_0 + box.spin_1 * abs(wi)) * (1.0 + box.cold * (1.0 - x_o))
            loss = (loss + spin) * wi / (abs(wi) + 1.0)
            load = through + loss
            if turbine and not locked:
                nu = min(wi / max(we, 20.0), 1.35)
                ease = max(-0.8, 1.0 - nu**5)
                t_pump = box.converter_k * we * we * ease
                lift = 1.0 - (box.converter_ratio - 1.0) * (nu / 0.86 - 1.0)
                t_turb = t_pump * max(1.0, lift)
            # The clutch carries what keeps both sides together, at most its capacity. It is solved
            # with the shafts' damping at the end of the step, else stiff gears diverge; whoever
            # lets it break and joins the sides afterwards hides torque from the shafts.
            slow = box.inertia + DT * box.damping / (ratio * ratio)
            drive, drag = t_net - t_pump, load - t_turb
            joint = engine.inertia * we + slow * wi + DT * (drive - drag)
            joint /= engine.inertia + slow
            t_clutch = drive - engine.inertia * (joint - we) / DT
            locked = fixed or (cap > 1.0 and abs(t_clutch) <= cap)
            if locked:
                we, wi = joint, joint
            else:
                t_clutch = min(max(t_clutch, -cap), cap)
                we += DT * (drive - t_clutch) / engine.inertia
                wi += DT * (t_clutch - drag) / slow
                we = max(we, 0.4 * engine.idle)
            t_shaft += box.damping * (wi - wi_before) / ratio
            twist += DT * (wi / ratio - w_wheel)

        if off:
            we = max(0.0, we_before - 250.0 * DT)
            torque_i, t_net, fuel_rate = 0.0, 0.0, 0.0
        s_clutch += t_clutch
        s_pump += t_pump
        s_turb += t_turb
        s_loss += loss

        # ---- forces ---------------------------------------------------------------------
        f_trac = t_shaft / radius
        air = head + v
        v_air2 = air * air + cross * cross
        sine2 = cross * cross / max(v_air2, 1.0)
        area = body.drag_area * day.drag_factor * (1.0 + body.yaw_drag * min(sine2, 0.35))
        if t > day.window_time:
            area *= day.window_factor
        if lead_on and v > 8.0:
            area *= 1.0 - day.draft * lead_big * np.exp(-gap / 25.0)
        f_drag = 0.5 * day.density * lightness * area * v_air2
        f_drag *= air / np.sqrt(v_air2 + 1e-9)
        c_roll = body.rolling * day.rolling_factor * road.texture[i_road]
        c_roll *= 1.0 + body.rolling_speed * v * v + day.leak * t
        c_roll *= 1.0 + body.tyre_cold * max(1.0 - x_t, -0.3)
        c_roll *= 1.0 + day.wet * v * v / 625.0
        a_side = v * v * kappa
        c_side = (a_side / G) ** 2 / body.corner_stiffness
        f_roll = mass * G * (c_roll * cos_g + c_side)
        pads += DT * (brake_asked - pads) / 0.05 if brake_asked > pads else 0.0
        if brake_asked < pads:
            rest_drag = body.residual_brake
            pads = max(brake_asked, pads - DT * 20.0 * max(pads - rest_drag, 0.0))
            pads -= DT / 6.0 * pads if pads <= rest_drag * 1.05 else 0.0
        f_brake = min(pads, 0.95 * day.grip * mass * G)

        rigid = mass - coupled + body.wheel_mass
        f_coupled = coupled * (
            body.coupled_frequency**2 * x_c
            + 2.0 * body.coupled_damping * body.coupled_frequency * v_c
        )
        push = f_trac - f_drag - (mass - coupled) * G * sin_g + f_coupled
        hold = f_roll + f_brake
        if v <= 0.0 and push <= hold:
            a, v_new = 0.0, 0.0
        else:
            a = (push - hold) / rigid
            v_new = v + DT * a
            if v_new < 0.0:
                v_new = 0.0
                a = -v / DT
        v_mid = 0.5 * (v + v_new)
        if v > 0.0 and v_new == 0.0:
            # The halt ends within the step: the brake takes what is left.
            f_brake = push - f_roll + rigid * v / DT
        if coupled > 0.0:
            acc_c = -a - G * sin_g - body.coupled_frequency**2 * x_c
            acc_c -= 2.0 * body.coupled_damping * body.coupled_frequency * v_c
            v_c += DT * acc_c
            x_c += DT * v_c
        v = v_new
        s += DT * v_mid
        height += DT * v_mid * sin_g
        mass -= DT * fuel_rate
        driven = body.driven_share * mass * G
        goal_slip = f_trac / (body.slip_stiffness * driven)
        slip += DT / 0.04 * (goal_slip - slip)
        a_felt += DT / 0.25 * (a - a_felt)
        a_long += DT / 0.02 * (a - a_long)

        # ---- body -----------------------------------------------------------------------
        y = s / road.profile_step
        in_f = at(road.profile, y)
        in_r = at(road.profile, y - body.wheelbase / road.profile_step)
        smooth_f += DT * 75.0 * (in_f - smooth_f)
        smooth_r += DT * 75.0 * (in_r - smooth_r)
        rate_f, rate_r = (smooth_f - last_f) / DT, (smooth_r - last_r) / DT
        last_f, last_r = smooth_f, smooth_r
        bump = 0.5 * (smooth_f + smooth_r)
        bump_rate = 0.5 * (rate_f + rate_r)
        heave_acc = heave_w**2 * (bump - heave)
        heave_acc += 2.0 * body.heave_damping * heave_w * (bump_rate - heave_rate)
        heave_rate += DT * heave_acc
        heave += DT * heave_rate
        lean = squat_gain * f_trac - dive_gain * (f_brake if v > 0.0 else 0.0)
        # Friction of the springs: they move once the force exceeds it.
        held = min(max(held, lean - body.play), lean + body.play)
        lean = held + day.seat_pitch + (smooth_f - smooth_r) / body.wheelbase
        lean_rate = (rate_f - rate_r) / body.wheelbase
        pitch_acc = pitch_w**2 * (lean - pitch)
        pitch_acc += 2.0 * body.pitch_damping * pitch_w * (lean_rate - pitch_rate)
        pitch_rate += DT * pitch_acc
        pitch += DT * pitch_rate
        roll += DT / 0.2 * (body.roll_per_accel * a_side - roll)
        s_pitch_rate += pitch_rate
        s_pitch_acc += pitch_acc
        s_heave += heave_acc

        if k % KEEP == KEEP - 1:
            o = out[k // KEEP]
            slope = (at(road.grade, x + 1.0) - grade) / road.step
            o[0] = v
            o[1] = (v - v_kept) / (KEEP * DT)
            o[2] = s
            o[3] = height
            o[4] = grade
            o[5] = pitch
            o[6] = s_pitch_rate / KEEP + slope * v
            o[7] = s_pitch_acc / KEEP
            o[8] = s_heave / KEEP + slope * v * v
            o[9] = v * kappa
            o[10] = a_side
            o[11] = roll + at(road.crossfall, x)
            o[12] = gear if in_gear else 0
            o[13] = we
            o[14] = t_net
            o[15] = torque_i
            o[16] = t_limit
            o[17] = friction(engine, we)
            o[18] = mass
            o[19] = head
            o[20] = f_brake
            o[21] = f_drag
            o[22] = f_roll
            o[23] = f_trac
            o[24] = f_coupled
            o[25] = slip
            o[26] = pedal
            o[27] = 1.0 if brake > 0.004 * mass else 0.0
            o[28] = 0.0 if locked else 1.0
            o[29] = fuel_rate
            o[30] = x_e
            o[31] = x_o
            o[32] = x_t
            o[33] = eb
            o[34] = acc_power
            o[35] = x_m
            o[36] = x_c
            o[37] = v_c
            o[38] = cross
            o[39] = wi
            # Means over the row, so that momentum can be counted.
            o[40] = s_clutch / KEEP
            o[41] = s_pump / KEEP
            o[42] = s_turb / KEEP
            o[43] = s_loss / KEEP
            v_kept = v
            s_pitch_rate = 0.0
            s_pitch_acc = 0.0
            s_heave = 0.0
            s_clutch, s_pump, s_turb, s_loss = 0.0, 0.0, 0.0, 0.0
    return out
