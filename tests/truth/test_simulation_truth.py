"""The simulator against physics worked out another way."""

import math
from dataclasses import replace

import numpy as np
import pymap3d
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from weighbridge.simulation import (
    BUS,
    DIESEL_AUTOMATIC,
    MIDSIZE,
    TRUCK18,
    VAN,
    Braking,
    Effects,
    Loading,
    Scenario,
    Sensors,
    flat_route,
    make_scenario,
    mixed_route,
    simulate_car,
)
from weighbridge.simulation.body import simulate_pose
from weighbridge.simulation.longitudinal import DT, simulate_trajectory
from weighbridge.simulation.sensing import simulate_imu

GRAVITY = 9.81
SENSOR_ERRORS = (
    "imu_noise",
    "imu_bias",
    "imu_bias_walk",
    "imu_scale",
    "imu_cross_axis",
    "imu_mounting",
    "imu_quantisation",
    "imu_vibration",
    "imu_jitter",
)


def short(*, without=(), duration=150.0, **changes):
    made = replace(make_scenario("car-short", seed=5), duration=duration, start_rest=4.0)
    made = replace(made, **changes)
    return replace(made, effects=made.effects.without(*without))


def inside(scenario):
    """Trajectory, pose and inertial signals at the full rate."""
    random = scenario.streams()
    drive = simulate_trajectory(scenario, random["plan"], random["drive"], random["habits"])
    pose = simulate_pose(scenario, drive, random["road"])
    imu = {s.name: s for s in simulate_imu(scenario, drive, pose, random["imu"])}
    return drive, pose, imu


def attitude(pose, k=slice(None)):
    angles = np.stack((pose.heading[k], pose.pitch[k], pose.roll[k]), axis=-1)
    return Rotation.from_euler("ZYX", angles)


@pytest.mark.parametrize("lever_size", [0.0, 1.0])
def test_strapdown_of_the_ideal_sensor_gives_the_drive_back(lever_size):
    # Through a town, round at its end and back.
    town = mixed_route(9, out=[("city", 600)], back=[("city", 600)])
    scenario = short(without=SENSOR_ERRORS, duration=160.0, route=town)
    scenario = replace(scenario, effects=replace(scenario.effects, imu_lever=lever_size))
    lever = lever_size * np.array(scenario.sensors.lever)
    drive, pose, imu = inside(scenario)
    force = np.stack([imu[f"accel_{a}"].values for a in "xyz"], axis=1)
    rate = np.stack([imu[f"gyro_{a}"].values for a in "xyz"], axis=1)

    # Attitude by rotation vectors between samples, velocity by trapezoids.
    between = Rotation.from_rotvec(0.5 * DT * (rate[1:] + rate[:-1])).as_quat()
    turned = attitude(pose, 0)
    turns = [turned]
    for q in between:
        turned = turned * Rotation.from_quat(q)
        turns.append(turned)
    turns = Rotation.concatenate(turns)
    accel_n = turns.apply(force) + np.array([0.0, 0.0, GRAVITY])
    swing = turns.apply(np.cross(rate, lever))
    start = pose.velocity_n[:, 0] + swing[0]
    steps = 0.5 * DT * (accel_n[1:] + accel_n[:-1])
    velocity = start + np.vstack((np.zeros(3), np.cumsum(steps, axis=0)))
    steps = 0.5 * DT * (velocity[1:] + velocity[:-1])
    moved = np.vstack((np.zeros(3), np.cumsum(steps, axis=0)))

    apart = (attitude(pose).inv() * turns).magnitude()
    arm = attitude(pose).apply(lever)
    steps = 0.5 * DT * (pose.velocity_n[:, 1:] + pose.velocity_n[:, :-1]).T
    truth = np.vstack((np.zeros(3), np.cumsum(steps, axis=0))) + arm - arm[0]
    assert drive.distance[-1] > 500.0
    assert np.abs(np.diff(pose.heading)).sum() > 3.0
    assert apart.max() < math.radians(0.01)
    assert np.abs(velocity - pose.velocity_n.T - swing).max() < 0.01
    assert np.abs(moved - truth).max() < 0.02


def test_mounting_turns_the_ideal_sensor():
    scenario = short(without=[e for e in SENSOR_ERRORS if e != "imu_mounting"], duration=40.0)
    angles = (0.3, -0.2, 2.1)
    mounted = replace(scenario, sensors=replace(scenario.sensors, mounting=angles))
    aligned = replace(scenario, sensors=replace(scenario.sensors, mounting=(0.0, 0.0, 0.0)))
    _, _, turned = inside(mounted)
    _, _, straight = inside(aligned)
    roll, pitch, yaw = angles
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    rz = np.array(
        [[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]
    )
    for kind in ("accel", "gyro"):
        sensor = np.stack([turned[f"{kind}_{a}"].values for a in "xyz"])
        body = np.stack([straight[f"{kind}_{a}"].values for a in "xyz"])
        assert_allclose(rz @ ry @ rx @ sensor, body, atol=1e-9)


def test_at_rest_the_sensor_reads_the_slope_and_gravity():
    scenario = short(without=(*SENSOR_ERRORS, "imu_lever"), duration=20.0, payload=200.0)
    _, pose, imu = inside(scenario)
    k = 300
    pitch = scenario.car.load_pitch * 200.0
    assert_allclose(pose.pitch[k], pitch, atol=1e-9)
    assert_allclose(imu["accel_x"].values[k], GRAVITY * math.sin(pitch), atol=1e-9)
    expected = -GRAVITY * math.cos(pitch) * math.cos(pose.roll[k])
    assert_allclose(imu["accel_z"].values[k], expected, atol=1e-9)


@pytest.mark.parametrize("car", [MIDSIZE, DIESEL_AUTOMATIC, VAN, BUS, TRUCK18])
def test_work_of_the_driveline_is_energy_gained_and_lost(car):
    scenario = short(duration=300.0, without=["fuel_burn"], car=car)
    drive, _, _ = inside(scenario)
    way = np.diff(drive.distance)
    rotating = car.wheel_inertia / car.wheel_radius**2
    kinetic = 0.5 * (scenario.mass + rotating) * drive.speed[-1] ** 2
    lift = np.interp(
        drive.distance[-1], np.arange(scenario.route.grade.size), scenario.route.height
    )
    potential = scenario.mass * GRAVITY * lift
    driven = np.sum(drive.traction_force[:-1] * way)
    lost = sum(
        np.sum(f[:-1] * way) for f in (drive.drag_force, drive.rolling_force, drive.brake_force)
    )
    turnover = np.sum(np.abs(drive.traction_force[:-1]) * way)
    assert turnover > 5e5
    assert abs(driven - lost - kinetic - potential) < 5e-4 * turnover


@pytest.mark.parametrize("car", [MIDSIZE, DIESEL_AUTOMATIC, TRUCK18])
def test_locked_driveline_obeys_the_force_balance(car):
    effects = Effects.only(traffic=1.0, driver_ripple=1.0, brake_drag=1.0)
    scenario = short(duration=200.0, effects=effects, car=car)
    drive, pose, _ = inside(scenario)
    moving = (drive.phase == 0) & (drive.speed > 3.0)
    gearing = np.array(car.gearings)[drive.gear.astype(int) - 1]
    inertia = scenario.mass + car.wheel_inertia / car.wheel_radius**2
    inertia = inertia + car.engine_inertia * gearing**2
    force = drive.engine_torque * gearing - scenario.mass * GRAVITY * np.sin(pose.grade)
    force -= drive.drag_force + drive.rolling_force + drive.brake_force
    assert moving.sum() > 10_000
    assert_allclose(inertia[moving] * drive.accel[moving], force[moving], atol=1e-3)
    assert_allclose(drive.engine_speed[moving], (gearing * drive.speed)[moving], rtol=1e-9)


def test_what_is_loaded_is_accelerated_and_tilts_the_body():
    loading = (Loading(distance=300.0, duration=20.0, load=400.0),)
    effects = Effects.only(traffic=1.0, driver_ripple=1.0, load_pitch=1.0, tyre_slip=1.0)
    scenario = short(duration=200.0, route=flat_route(2000.0), loading=loading, effects=effects)
    drive, pose, _ = inside(scenario)
    rotating = MIDSIZE.wheel_inertia / MIDSIZE.wheel_radius**2
    force = drive.traction_force - drive.drag_force - drive.rolling_force - drive.brake_force
    gearing = np.array(MIDSIZE.gearings)[drive.gear.astype(int) - 1]
    slip = drive.engine_speed / (gearing * np.maximum(drive.speed, 1.0)) - 1.0
    for after, mass in ((False, 1580.0), (True, 1980.0)):
        rows = (drive.phase == 0) & (drive.speed > 3.0) & ((drive.loaded > 0.0) == after)
        assert rows.sum() > 1000
        assert_allclose((mass + rotating) * drive.accel[rows], force[rows], atol=1e-6 * mass)
        assert_allclose(pose.pitch[rows], MIDSIZE.load_pitch * (mass - 1580.0), atol=1e-9)
        # Slip is per traction over weight, whatever the weight; pulls of one step before.
        pull = mass * drive.accel + drive.drag_force + drive.rolling_force
        steady = rows & (np.abs(np.gradient(drive.accel)) < 1e-3)
        expected = MIDSIZE.tyre_slip * pull[steady] / (mass * GRAVITY)
        assert_allclose(slip[steady], expected, atol=2e-5)


def test_open_converter_gives_less_power_than_it_takes():
    scenario = short(duration=200.0, effects=Effects.only(traffic=1.0), car=DIESEL_AUTOMATIC)
    drive, _, _ = inside(scenario)
    gearing = np.array(DIESEL_AUTOMATIC.gearings)[drive.gear.astype(int) - 1]
    inertia = DIESEL_AUTOMATIC.engine_inertia
    slipping = (drive.phase == 2) & (drive.pedal > 0.05) & (drive.speed > 0.5)
    slipping &= gearing * drive.speed < 0.98 * drive.engine_speed
    # Not where gear or lock-up change within the differences.
    slipping &= (np.gradient(drive.phase) == 0.0) & (np.gradient(drive.gear) == 0.0)
    speed = drive.engine_speed
    gain = np.diff(speed, prepend=speed[0]) / DT
    taken = (drive.engine_torque - inertia * gain) * speed
    given = drive.traction_force * drive.speed
    assert slipping.sum() > 1000
    efficiency = (given / taken)[slipping]
    nu = (gearing * drive.speed / speed)[slipping]
    # Straight from stall ratio to the coupling point, then 1.
    ratio = np.where(nu < 0.86, 2.0 - nu / 0.86, 1.0)
    assert np.quantile(np.abs(efficiency - nu * ratio), 0.95) < 0.02
    assert efficiency.max() < 1.0


def test_braking_at_a_time_slows_the_vehicle_as_asked():
    braking = Braking(time=60.0, duration=4.0, decel=1.5)
    effects = Effects.only(driver_ripple=1.0)
    scenario = short(
        car=BUS, route=flat_route(3000.0), duration=80.0, brakings=(braking,), effects=effects
    )
    drive, _, _ = inside(scenario)
    slowing = (drive.time > 62.0) & (drive.time < 63.9)
    assert_allclose(drive.accel[slowing], -1.5, atol=0.1)
    assert drive.brake_force[(drive.time > 50.0) & (drive.time < 59.9)].max() < 100.0


def test_resistance_in_steady_wind_is_the_textbooks():
    scenario = Scenario(
        name="flat",
        car=MIDSIZE,
        route=flat_route(3000.0),
        seed=3,
        effects=Effects.none(),
        sensors=Sensors(imu_rate=0.0, gnss_rate=0.0),
        wind_speed=8.0,
        wind_from=0.0,
        ambient_temperature=293.15,
        duration=100.0,
    )
    truth = simulate_car(scenario).truth
    fast = truth.speed > 5.0
    density = 101_325.0 / (287.05 * 293.15)
    head = 8.0 * math.log(1.0 / 0.1) / math.log(10.0 / 0.1)
    drag = 0.5 * density * 0.27 * 2.2 * (truth.speed + head) ** 2
    assert_allclose(truth.drag_force[fast], drag[fast], rtol=1e-9)
    assert_allclose(truth.wind_along[fast], -head, rtol=1e-9)
    rolling = 1580.0 * GRAVITY * MIDSIZE.rolling_coefficient
    assert_allclose(truth.rolling_force[fast], rolling, rtol=1e-9)


def test_positions_on_the_ellipsoid_follow_the_velocity():
    scenario = short(duration=300.0)
    _, pose, _ = inside(scenario)
    east, north, up = pymap3d.geodetic2enu(
        pose.latitude[-1], pose.longitude[-1], pose.altitude[-1],
        pose.latitude[0], pose.longitude[0], pose.altitude[0], deg=False,
    )  # fmt: skip
    north_moved = np.trapezoid(pose.velocity_n[0], dx=DT)
    east_moved = np.trapezoid(pose.velocity_n[1], dx=DT)
    way = math.hypot(north_moved, east_moved)
    assert way > 800.0
    assert math.hypot(north - north_moved, east - east_moved) < 2e-4 * way
    # The tangent plane leaves the ellipsoid by way^2 / 2 R.
    climbed = pose.altitude[-1] - pose.altitude[0]
    assert abs(up + way**2 / (2 * 6.38e6) - climbed) < 0.01


def test_squat_is_the_cars_coefficient():
    effects = Effects.only(squat=1.0, traffic=1.0, driver_ripple=1.0)
    drive, pose, _ = inside(short(duration=250.0, effects=effects))
    accel = np.gradient(drive.speed, DT)
    # Slow parts only, where the body has settled.
    block = 200
    n = accel.size // block * block
    accel = accel[:n].reshape(-1, block).mean(axis=1)
    lean = (pose.pitch - pose.grade)[:n].reshape(-1, block).mean(axis=1)
    slope = (accel @ lean) / (accel @ accel)
    assert accel.std() > 0.3
    assert_allclose(slope, MIDSIZE.squat, rtol=0.03)


def test_roughness_has_the_level_of_the_standard():
    """A flat road at constant speed: the body's vertical acceleration density.

    The integral of road velocity density times the squared gain of the same
    two-stage system, worked out in the frequency domain.
    """
    scenario = Scenario(
        name="flat",
        car=MIDSIZE,
        route=flat_route(9000.0, limit=25.0),
        seed=4,
        effects=Effects.only(roughness=1.0),
        sensors=Sensors(lever=(0.0, 0.0, 0.0), mounting=(0.0, 0.0, 0.0)),
        start_rest=1.0,
        duration=330.0,
    )
    drive, _, imu = inside(scenario)
    steady = np.abs(drive.speed - 25.0) < 0.3
    assert steady.sum() > 40_000
    measured = np.std(imu["accel_z"].values[steady])

    f = np.linspace(0.05, 99.95, 20_000)
    s = 2j * np.pi * f

    def gain(frequency, damping, base):
        w = 2 * np.pi * frequency
        top = 2 * damping * w * s + w * w if base else w * w
        return top / (s * s + 2 * damping * w * s + w * w)

    road = (2 * np.pi * 0.1) ** 2 * 48e-6 * 25.0 * 0.75**2
    body = np.abs(s * gain(11.0, 0.35, False) * gain(MIDSIZE.heave_frequency, 0.3, True)) ** 2
    expected = math.sqrt(np.trapezoid(road * body, f))
    assert_allclose(measured, expected, rtol=0.10)


def test_fuel_is_taken_from_the_mass():
    truth = simulate_car(short(duration=200.0)).truth
    burnt = np.trapezoid(truth.fuel_flow, truth.time)
    assert burnt > 0.02
    assert_allclose(truth.mass[0] - truth.mass[-1], burnt, rtol=0.02)
