"""An accelerometer that leans with the body, and a vehicle file that knows of it or not."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.ndimage import uniform_filter1d

import weighbridge as wb
from weighbridge import Drive, Signal
from weighbridge.constants import GRAVITY
from weighbridge.estimators import ESTIMATORS
from weighbridge.estimators.squat import (
    DRIVE_STD,
    SQUAT,
    ResidualSquat,
    of_vehicle,
    pooled,
    residual_squat,
    squat_at,
    squat_by_speed,
)
from weighbridge.navigation import find_motion, with_squat
from weighbridge.simulation import (
    MIDSIZE,
    Scenario,
    Sensors,
    mixed_route,
    short_route,
    simulate_car,
)
from weighbridge.vehicle import VEHICLE_CLASSES

joint = ESTIMATORS["joint"]

K = 0.004
"""Pitch per specific force [rad per m/s^2]."""


@pytest.fixture(scope="module")
def weighed():
    sensors, route = Sensors(imu_rate=50.0), short_route()
    made = simulate_car(Scenario(name="squat", car=MIDSIZE, route=route, seed=72, sensors=sensors))
    car = wb.calibrate([made.drive], mass=made.scenario.mass)
    return car, wb.weigh(made.drive, car)


def seen(balance, squat, *, factor):
    """The balance with ``factor`` of a lean in its readings, and the squat the drive shows."""
    squat_accel = factor * GRAVITY * K * balance.table.specific_force
    table = replace(balance.table, specific_force=balance.table.specific_force + squat_accel)
    std = None if squat is None else 2e-4
    return replace(balance, table=table, motion=replace(balance.motion, squat=squat, squat_std=std))


def calibrated(car, squat):
    mounting = replace(car.mounting, squat=squat, squat_std=None if squat is None else 2e-4)
    return replace(car, mounting=mounting)


def uncalibrated(car):
    made = replace(car.provenance, method=None, motion=None, mass_scale_std=None, masses=())
    return replace(car, mounting=None, provenance=made)


def test_what_the_calibration_took_out_is_taken_out(weighed):
    car, weighing = weighed
    balance = weighing.result.balance
    knows = calibrated(car, K)
    right = joint.estimate(seen(balance, K, factor=0.0), knows)
    leaning = joint.estimate(seen(balance, None, factor=1.0), knows)
    # The noise of the motion is learnt with the lean in it.
    assert_allclose(leaning.mass, right.mass, rtol=1e-5)


def test_what_the_calibration_left_in_is_put_back(weighed):
    car, weighing = weighed
    balance = weighing.result.balance
    without = calibrated(car, None)
    as_calibrated = joint.estimate(seen(balance, None, factor=1.0), without)
    shown = joint.estimate(seen(balance, K, factor=0.0), without)
    assert_allclose(shown.mass, as_calibrated.mass, rtol=1e-5)
    # Left as it is, the reading would be too small by 1 + g k.
    assert joint.estimate(seen(balance, None, factor=0.0), without).mass > 1.01 * shown.mass


def test_without_a_calibration_an_unknown_squat_widens_the_interval(weighed):
    car, weighing = weighed
    balance = weighing.result.balance
    sheet = uncalibrated(car)
    shown = joint.estimate(seen(balance, K, factor=0.0), sheet)
    hidden = joint.estimate(seen(balance, None, factor=1.0), sheet)
    added = np.sqrt(hidden.std**2 - shown.std**2) / hidden.mass
    assert 0.3 * GRAVITY * SQUAT[1] < added <= 1.05 * GRAVITY * SQUAT[1]
    # The middle of what cars do is taken out: what is left is the difference.
    off = GRAVITY * abs(K - SQUAT[0])
    assert abs(hidden.mass / shown.mass - 1.0) < 2.0 * off


@pytest.mark.parametrize(
    ("calibrated_by", "given", "weighed_by", "shown", "expected"),
    [
        ("inertial", K, "inertial", K, ResidualSquat(0.0, 2e-4)),
        ("inertial", K, "speed", None, ResidualSquat(0.0, 0.0)),
        ("inertial", None, "longitudinal_accel", None, ResidualSquat(0.0, 0.0)),
        ("inertial", None, "speed", None, ResidualSquat(-SQUAT[0], SQUAT[1])),
        ("speed", None, "speed_grade", None, ResidualSquat(0.0, 0.0)),
        ("speed", None, "inertial", K, ResidualSquat(0.0, 2e-4)),
        ("speed", None, "inertial", None, ResidualSquat(*SQUAT)),
        # A vehicle file that does not say how its drives moved.
        (None, None, "inertial", K, ResidualSquat(0.0, 2e-4)),
    ],
)
def test_torque_meets_what_it_was_calibrated_with(
    weighed, calibrated_by, given, weighed_by, shown, expected
):
    car, weighing = weighed
    made = replace(car.provenance, motion=calibrated_by)
    car = replace(calibrated(car, given), provenance=made)
    balance = seen(weighing.result.balance, shown, factor=0.0)
    balance = replace(balance, motion=replace(balance.motion, source=weighed_by))
    assert residual_squat(balance, car, 1500.0) == expected


def test_a_speed_does_not_lean(weighed):
    car, weighing = weighed
    balance = seen(weighing.result.balance, None, factor=0.0)
    by_speed = replace(balance, motion=replace(balance.motion, source="speed"))
    assert residual_squat(by_speed, uncalibrated(car), 1500.0) == ResidualSquat(0.0, 0.0)


def test_what_leans_is_taken_out_and_put_back():
    force = np.array([-1.0, 0.5, 2.0])
    read = (1.0 + GRAVITY * K) * force
    assert_allclose(read - ResidualSquat(K, 0.0).squat_accel(read), force)
    assert_allclose(force - ResidualSquat(-K, 0.0).squat_accel(force), read)
    assert ResidualSquat(0.0, 0.0025).relative_std == GRAVITY * 0.0025


def along(k, *, hills=0.02, seconds=900.0, swing=1.0, seed=4):
    """A drive with one accelerometer that leans by ``k`` per specific force."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 0.1)
    noise = np.convolve(rng.normal(size=time.size + 80), np.hanning(81), "valid")
    accel = swing * noise / noise.std()
    speed = 15.0 + np.cumsum(accel - accel.mean()) * 0.1
    speed = 15.0 + 8.0 * np.tanh((speed - 15.0) / 8.0)
    accel = np.gradient(speed, 0.1)
    grade = hills * np.sin(time / 31.0)
    read = (1.0 + GRAVITY * k) * (accel + GRAVITY * np.sin(grade))
    read += rng.normal(0.0, 0.05, time.size)
    signals = {
        "longitudinal_accel": Signal("longitudinal_accel", time, read),
        "vehicle_speed": Signal("vehicle_speed", time, speed),
    }
    return find_motion(Drive("d", signals))


@pytest.mark.parametrize("k", [0.0, 0.005])
def test_one_accelerometer_shows_its_lean_against_the_wheels(weighed, k):
    motion = along(k)
    found, std = squat_by_speed(motion)
    assert found == pytest.approx(k, abs=7e-4)
    # The scales of speed and accelerometer stay open.
    assert 1.5e-3 < std < 2.5e-3
    car, weighing = weighed
    balance = replace(weighing.result.balance, motion=motion)
    taken = residual_squat(balance, uncalibrated(car), 1500.0)
    assert min(k, SQUAT[0]) < taken.squat < max(k, SQUAT[0])
    assert taken.std < 0.75 * SQUAT[1]


def test_a_drive_that_hardly_accelerates_shows_no_lean():
    assert squat_by_speed(along(0.0, swing=0.05)) is None
    assert squat_by_speed(along(0.0, seconds=120.0)) is None


def moved(squat, *, std=2e-4):
    """Motion of a drive that shows a squat."""
    return replace(along(0.0, seconds=200.0), source="inertial", squat=squat, squat_std=std)


def test_drives_of_a_calibration_share_one_squat():
    squat, std = pooled(
        [moved(0.003), moved(0.005), moved(0.004)], (1500.0,) * 3, VEHICLE_CLASSES["car"]
    )
    # Three drives and the usual squat, by their variances.
    drives, usual = 3.0 / (2e-4**2 + DRIVE_STD**2), 1.0 / SQUAT[1] ** 2
    assert squat == pytest.approx((0.004 * drives + SQUAT[0] * usual) / (drives + usual))
    assert std == pytest.approx((drives + usual) ** -0.5)
    assert pooled([replace(moved(0.003), squat=None)], (1500.0,), VEHICLE_CLASSES["car"]) is None


def test_squat_of_a_truck_grows_with_its_mass():
    masses = (8000.0, 16_000.0)
    squat, _ = pooled([moved(0.001), moved(0.002)], masses, VEHICLE_CLASSES["truck"])
    assert squat == pytest.approx(0.0015, rel=0.2)
    assert squat_at(squat, 16_000.0, masses, VEHICLE_CLASSES["truck"]) == pytest.approx(
        squat * 4.0 / 3.0
    )
    assert squat_at(squat, 16_000.0, masses, VEHICLE_CLASSES["car"]) == squat


def test_another_squat_is_taken_out_of_grade_and_specific_force():
    motion = moved(0.003)
    other = with_squat(motion, 0.005, 1e-4)
    read = (1.0 + GRAVITY * 0.003) * motion.specific_force
    assert_allclose(other.specific_force, read / (1.0 + GRAVITY * 0.005), rtol=1e-4)
    lean = 0.005 * other.specific_force - 0.003 * motion.specific_force
    assert_allclose(other.grade, motion.grade - lean, atol=1e-6)


def test_weighing_holds_the_squat_of_the_calibration(weighed):
    car, _ = weighed
    held = of_vehicle(moved(0.0055), calibrated(car, K))
    assert held.squat == K
    assert held.notes == moved(0.0055).notes
    assert of_vehicle(moved(0.009), uncalibrated(car)).squat == 0.009


def test_a_squat_that_may_be_another_is_in_the_interval(weighed):
    car, _ = weighed
    held = of_vehicle(moved(0.007), calibrated(car, K))
    assert held.squat == K
    assert held.squat_std == pytest.approx(0.0015)
    assert held.notes[-1].id == "imu.lean_doubtful"
    assert "0.40°" in held.notes[-1].values["leans"]


def test_the_own_squat_of_a_drive_is_not_put_back(weighed):
    car, weighing = weighed
    own = of_vehicle(moved(0.012), calibrated(car, K))
    assert (own.squat, own.own_squat) == (0.012, True)
    assert own.notes[-1].id == "imu.lean"
    balance = replace(weighing.result.balance, motion=own)
    assert residual_squat(balance, calibrated(car, K), 1500.0).squat == 0.0


def swinging(made, per_force):
    """The drive with a sensor whose holder pitches by so much per specific force [rad s^2/m]."""
    signals = dict(made.drive.signals)
    time = signals["accel_x"].time
    along = made.truth.accel + GRAVITY * np.sin(made.truth.grade)
    lean = per_force * uniform_filter1d(np.interp(time, made.truth.time, along), 41)
    x, z = signals["accel_x"].values, signals["accel_z"].values
    turned = {
        "accel_x": x * np.cos(lean) - z * np.sin(lean),
        "accel_z": z * np.cos(lean) + x * np.sin(lean),
        "gyro_y": signals["gyro_y"].values + np.gradient(lean, time),
    }
    for name, values in turned.items():
        signals[name] = replace(signals[name], values=values)
    return replace(made.drive, signals=signals)


def test_a_holder_that_swings_is_told_and_the_mass_is_right(weighed):
    car, _ = weighed
    made = simulate_car(Scenario(name="holder", car=MIDSIZE, route=short_route(), seed=73))
    found = wb.weigh(swinging(made, np.radians(0.7)), car)
    assert any(p.id in ("imu.lean", "imu.lean_doubtful") for p in found.problems)
    low, high = found.interval(0.95)
    assert low < made.scenario.mass < high


def test_gravity_on_hills_is_read_as_right_as_acceleration():
    route = mixed_route(75, out=[("hills", 4000)], back=[("hills", 4000)])
    made = simulate_car(Scenario(name="hills", car=MIDSIZE, route=route, seed=75))
    motion = find_motion(made.drive)
    assert motion.squat == pytest.approx(MIDSIZE.squat, abs=1e-3)
    truth = made.truth
    accel = np.interp(motion.time, truth.time, truth.accel)
    gravity = GRAVITY * np.sin(np.interp(motion.time, truth.time, truth.grade))
    second = round(motion.rate)
    rows = np.column_stack([motion.specific_force, accel, gravity, motion.speed > 3.0])
    rows = rows[: len(rows) // second * second].reshape(-1, second, 4).mean(axis=1)
    rows = rows[rows[:, 3] == 1.0]
    gains, *_ = np.linalg.lstsq(
        np.column_stack([rows[:, 1:3], np.ones(len(rows))]), rows[:, 0], rcond=None
    )
    # With a squat by acceleration alone, gravity would read 1 + g k: 3.6 % too much.
    assert_allclose(gains[:2], 1.0, atol=0.012)
