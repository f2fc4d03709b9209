"""Faults of the inertial sensor on the way: moved, mis-scaled, frozen, noisy, slow, clipped."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numba import config
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter
from tests.noted import refused

from weighbridge import Signal, Vehicle
from weighbridge.checks import check_drive, correct_drive
from weighbridge.navigation import find_motion
from weighbridge.simulation import Sensors, make_scenario, simulate_car
from weighbridge.vehicle import Mounting

pytestmark = pytest.mark.skipif(
    bool(config.DISABLE_JIT), reason="whole drives take minutes without the compiler"
)

ACCEL = ("accel_x", "accel_y", "accel_z")
GYRO = ("gyro_x", "gyro_y", "gyro_z")
MIDDLE = 600.0


@cache
def made_of(name, seed):
    """Drive, and its motion with a squat that is known, as vehicle files have it."""
    scenario = replace(make_scenario(name, seed=seed), sensors=Sensors(imu_rate=50.0))
    made = simulate_car(replace(scenario, duration=1200.0))
    free = find_motion(made.drive)
    return made.drive, find_motion(made.drive, known(free))


def known(motion):
    return Vehicle(
        mounting=Mounting(
            roll=motion.mounting[0],
            pitch=motion.mounting[1],
            yaw=motion.mounting[2],
            std=motion.mounting_std,
            squat=motion.squat,
            squat_std=5e-4,
        )
    )


@pytest.fixture(scope="module", params=[("car", 81), ("truck", 82), ("electric", 83)])
def any_vehicle(request):
    return made_of(*request.param)


@pytest.fixture(scope="module")
def car():
    return made_of("car", 81)


def columns(drive, names):
    return np.column_stack([drive.signals[n].values for n in names])


def replaced(drive, names, values, keep=slice(None)):
    return drive.with_signals(
        *(
            Signal(n, drive.signals[n].time[keep], values[keep, i].copy())
            for i, n in enumerate(names)
        )
    )


def turned(drive, axis, degrees, *, slow=0.0):
    """Turn both sensors from the middle on; at once, or within ``slow`` seconds."""
    time = drive.signals["accel_x"].time
    share = np.clip((time - MIDDLE) / slow, 0.0, 1.0) if slow else time >= MIDDLE
    angle = np.radians(degrees) * share
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    for names in (ACCEL, GYRO):
        old = columns(drive, names)
        new = old.copy()
        new[:, i] = np.cos(angle) * old[:, i] - np.sin(angle) * old[:, j]
        new[:, j] = np.sin(angle) * old[:, i] + np.cos(angle) * old[:, j]
        drive = replaced(drive, names, new)
    return drive


def scaled(drive, gain):
    """Multiply the accelerometer by ``gain`` of the time's share."""
    time = drive.signals["accel_x"].time
    share = (time - time[0]) / (time[-1] - time[0])
    return replaced(drive, ACCEL, columns(drive, ACCEL) * gain(share)[:, None])


def force_slope(motion, plain):
    """Slope and offset of the force along the road on that of the drive as it was."""
    at = np.interp(motion.time, plain.time, plain.specific_force)
    use = motion.valid & (motion.speed > 2.0) & (motion.time < plain.time[-1])
    use &= np.interp(motion.time, plain.time, plain.valid) == 1.0
    slope, offset = np.polyfit(at[use], motion.specific_force[use], 1)
    return slope, offset


def halves_apart(motion, plain):
    """Mean error of the force after the middle less that before it [m/s^2]."""
    at = np.interp(motion.time, plain.time, plain.specific_force)
    use = motion.valid & (motion.speed > 2.0)
    late = motion.time > MIDDLE
    error = motion.specific_force - at
    return np.mean(error[use & late]) - np.mean(error[use & ~late])


@pytest.mark.parametrize(("axis", "degrees"), [("y", 3.0), ("y", -8.0), ("z", 30.0)])
def test_a_sensor_moved_on_the_way_is_found_anew(any_vehicle, axis, degrees):
    drive, plain = any_vehicle
    motion = find_motion(turned(drive, axis, degrees), known(plain))
    (note,) = [n for n in motion.notes if n.id == "imu.moved"]
    size = float(note.values["size"].split()[0])
    assert size == pytest.approx(abs(degrees), abs=4.0)
    assert abs(halves_apart(motion, plain)) < 0.03
    slope, _ = force_slope(motion, plain)
    assert slope == pytest.approx(1.0, abs=0.03)


def test_a_mount_that_creeps_is_followed(any_vehicle):
    drive, plain = any_vehicle
    motion = find_motion(turned(drive, "y", 5.0, slow=500.0), known(plain))
    assert any(n.id == "imu.moved" for n in motion.notes)
    assert abs(halves_apart(motion, plain)) < 0.1


def test_a_moved_sensor_is_found_without_heights(car):
    drive, _ = car
    without = drive.without("altitude")
    plain = find_motion(without)
    assert not any(n.id == "imu.moved" for n in plain.notes)
    motion = find_motion(turned(without, "y", 5.0), known(plain))
    assert any(n.id == "imu.moved" for n in motion.notes)
    assert abs(halves_apart(motion, plain)) < 0.05


@pytest.mark.parametrize("start", [0.0, 300.0, 700.0])
def test_no_steady_drive_is_called_moved(any_vehicle, start):
    drive, plain = any_vehicle
    assert not any(n.id == "imu.moved" for n in plain.notes)
    part = drive.between(start, start + 300.0)
    assert not any(n.id == "imu.moved" for n in find_motion(part, known(plain)).notes)


@pytest.mark.parametrize(
    "gain",
    [
        lambda u: np.full(u.size, 0.95),
        lambda u: np.full(u.size, 1.1),
        lambda u: 1.0 + 0.1 * u,
        lambda u: np.where(u < 0.5, 1.0, 1.1),
    ],
    ids=["low", "high", "ramp", "step"],
)
def test_a_wrong_scale_is_corrected(any_vehicle, gain):
    drive, plain = any_vehicle
    motion = find_motion(scaled(drive, gain), known(plain))
    assert any(n.id == "imu.scale_corrected" for n in motion.notes)
    assert not any(n.id == "imu.scale_corrected" for n in plain.notes)
    assert motion.specific_force_scale_std > 0.0
    slope, _ = force_slope(motion, plain)
    # Left as it is the worst of them is 10 % off, the step half of that on average.
    assert slope == pytest.approx(1.0, abs=0.035)


@pytest.mark.parametrize("lag", [0.7, 1.5, 3.0])
def test_a_speed_that_is_smoothed_is_no_fault_of_the_sensor(any_vehicle, lag):
    drive, right = any_vehicle
    speed = drive.signals["vehicle_speed"]
    time = np.arange(speed.time[0], speed.time[-1], 0.05)
    kept = np.exp(-0.05 / lag)
    values = speed.at(time)
    late, _ = lfilter([1.0 - kept], [1.0, -kept], values, zi=[kept * values[0]])
    smoothed = Signal(speed.name, speed.time, np.interp(speed.time, time, late))
    motion = find_motion(drive.with_signals(smoothed), known(right))
    assert not any(note.id == "imu.scale_corrected" for note in motion.notes)


def test_a_small_scale_that_gravity_denies_is_left_to_the_squat(any_vehicle):
    drive, right = any_vehicle
    ahead = drive.signals["accel_x"]
    scaled = drive.with_signals(Signal(ahead.name, ahead.time, 1.05 * ahead.values))
    motion = find_motion(scaled, known(right))
    assert not any(note.id == "imu.scale_corrected" for note in motion.notes)
    # It is told and left open, for it may be the scale nevertheless.
    assert any(note.id == "imu.gain_unsure" for note in motion.notes)
    assert 0.02 < motion.specific_force_scale_std < 0.04


@pytest.mark.parametrize("gain", [0.9, 0.95, 1.05, 1.1])
def test_the_interval_holds_a_scale_that_is_left_to_the_squat(any_vehicle, gain):
    drive, right = any_vehicle
    ahead = drive.signals["accel_x"]
    scaled = drive.with_signals(Signal(ahead.name, ahead.time, gain * ahead.values))
    motion = find_motion(scaled, known(right))
    if not any(note.id == "imu.gain_unsure" for note in motion.notes):
        return
    slope, _ = force_slope(motion, right)
    assert abs(slope - 1.0) < 1.96 * motion.specific_force_scale_std


def test_without_gnss_other_tyres_may_be_what_looks_like_a_scale(any_vehicle):
    drive, right = any_vehicle
    alone = drive.without(
        *(n for n in drive.signals if n.startswith(("gnss", "lat", "lon", "alt")))
    )
    speed = drive.signals["vehicle_speed"]
    faster = Signal(speed.name, speed.time, 1.05 * speed.values)
    motion = find_motion(alone.with_signals(faster), known(right))
    assert any(note.values.get("tyres") for note in motion.notes)
    assert 0.025 < motion.specific_force_scale_std < 0.045
    assert not any(note.values.get("tyres") for note in find_motion(alone, known(right)).notes)


def test_frozen_stretches_are_left_out(car):
    drive, plain = car
    for name in ("accel_x", "gyro_y"):
        s = drive.signals[name]
        values = s.values.copy()
        stuck = (s.time >= 400.0) & (s.time < 460.0)
        values[stuck] = values[np.flatnonzero(stuck)[0]]
        frozen = drive.with_signals(Signal(name, s.time, values))
        (problem,) = [p for p in check_drive(frozen) if p.signal == name]
        assert problem.id == "frozen.imu"
        assert f"{problem.values['longest']:.1f}" == "60.0"
        assert not problem.serious
        motion = find_motion(frozen, known(plain))
        assert not motion.valid[(motion.time > 402.0) & (motion.time < 458.0)].any()
        slope, _ = force_slope(motion, plain)
        assert slope == pytest.approx(1.0, abs=0.01)


def test_an_axis_that_dies_leaves_what_was_before(car):
    drive, _ = car
    s = drive.signals["gyro_z"]
    dead = drive.with_signals(Signal("gyro_z", s.time, np.where(s.time < 700.0, s.values, 0.0)))
    assert not any(p.serious for p in check_drive(dead))
    motion = find_motion(dead)
    assert motion.valid[motion.time < 650.0].any()
    assert not motion.valid[motion.time > 702.0].any()


def test_rounding_is_not_called_frozen(car):
    drive, _ = car
    rounded = replaced(drive, GYRO, np.round(columns(drive, GYRO) / 0.005) * 0.005)
    before, after = (np.mean(find_motion(d).valid) for d in (drive, rounded))
    assert after > 0.95 * before > 0.9


@pytest.mark.parametrize("value", [0.0, 40.0])
def test_dropouts_and_spikes_are_left_out(any_vehicle, value):
    drive, plain = any_vehicle
    force = columns(drive, ACCEL)
    force[np.random.default_rng(5).random(force.shape[0]) < 0.03] = value
    motion = find_motion(replaced(drive, ACCEL, force), known(plain))
    assert any(n.id == "imu.false_samples" for n in motion.notes)
    slope, _ = force_slope(motion, plain)
    assert slope == pytest.approx(1.0, abs=0.005)


def test_one_axis_that_drops_out_to_zero_is_left_out(car):
    drive, plain = car
    force = columns(drive, ACCEL)
    force[np.random.default_rng(6).random(force.shape[0]) < 0.05, 0] = 0.0
    slope, _ = force_slope(find_motion(replaced(drive, ACCEL, force), known(plain)), plain)
    assert slope == pytest.approx(1.0, abs=0.005)


def test_a_range_too_small_for_gravity_is_told(car):
    drive, _ = car
    force = np.clip(columns(drive, ACCEL), -10.0, 10.0)
    (problem,) = [p for p in check_drive(replaced(drive, ACCEL, force)) if p.serious]
    assert problem.signal == "accel_z"
    assert problem.id == "imu.clipped"


def test_an_axis_along_the_road_at_its_limit_is_refused(car):
    drive, _ = car
    force = columns(drive, ACCEL)
    cut = np.column_stack([np.clip(force[:, 0], -0.8, 0.8), force[:, 1:]])
    found = [p for p in check_drive(replaced(drive, ACCEL, cut)) if p.serious]
    assert {(p.id, p.signal) for p in found} == {("imu.clipped", "accel_x")}
    spiked = force.copy()
    spiked[np.random.default_rng(5).random(len(force)) < 0.05] = 40.0
    assert "imu.clipped" not in {p.id for p in check_drive(replaced(drive, ACCEL, spiked))}


def at_ten_hertz(drive):
    """Average the inertial samples over a tenth of a second."""
    for names in (ACCEL, GYRO):
        time, values = drive.signals[names[0]].time, columns(drive, names)
        each = round(0.1 / np.median(np.diff(time)))
        count = time.size // each
        mean = values[: count * each].reshape(count, each, 3).mean(axis=1)
        stamps = time[: count * each].reshape(count, each).mean(axis=1)
        drive = drive.with_signals(*(Signal(n, stamps, mean[:, i]) for i, n in enumerate(names)))
    return drive


def test_ten_samples_a_second_leave_no_holes(any_vehicle):
    drive, plain = any_vehicle
    motion = find_motion(at_ten_hertz(drive), known(plain))
    assert motion.speed_delay == pytest.approx(plain.speed_delay, abs=0.03)
    assert np.mean(motion.valid) > 0.98 * np.mean(plain.valid)


def test_a_sensor_slower_than_its_table_is_told(car):
    drive, _ = car
    for names in (ACCEL, GYRO):
        values = columns(drive, names)
        drive = replaced(drive, names, values[np.arange(values.shape[0]) // 15 * 15])
    with refused("imu.slow"):
        find_motion(correct_drive(drive))


@pytest.mark.parametrize("degrees", [3.0, -3.0])
def test_a_holder_that_nods_is_no_unit_of_the_speed(any_vehicle, degrees):
    drive, _ = any_vehicle
    time = drive.signals["accel_x"].time
    speed = drive.signals["vehicle_speed"]
    coarse = np.arange(0.0, time[-1], 0.1)
    smooth = gaussian_filter1d(np.interp(coarse, speed.time, speed.values), 5.0)
    angle = np.radians(degrees) * np.interp(time, coarse, np.gradient(smooth, 0.1))
    force, rate = columns(drive, ACCEL), columns(drive, GYRO)
    for old in (force, rate):
        x, z = old[:, 0].copy(), old[:, 2].copy()
        old[:, 0] = np.cos(angle) * x + np.sin(angle) * z
        old[:, 2] = np.cos(angle) * z - np.sin(angle) * x
    rate[:, 1] -= np.gradient(angle, time)
    nodding = replaced(replaced(drive, ACCEL, force), GYRO, rate)
    with refused("imu.mount_loose"):
        find_motion(nodding)


@pytest.mark.parametrize("scale", [0.621, 1.609])
def test_a_speed_in_another_unit_is_no_holder_that_nods(any_vehicle, scale):
    drive, _ = any_vehicle
    speed = drive.signals["vehicle_speed"]
    other = drive.with_signals(Signal(speed.name, speed.time, scale * speed.values))
    with refused("speed.unit_of_accel"):
        find_motion(other.without("gnss_speed", "latitude", "longitude", "altitude"))
