"""Three accelerometer axes without gyroscope: what they read along the vehicle."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import weighbridge as wb
from weighbridge import Drive, Signal, inspect_drive
from weighbridge.checks import correct_drive
from weighbridge.estimators.joint import changing
from weighbridge.simulation import make_scenario, simulate_car

AXES = ("accel_x", "accel_y", "accel_z")
GYRO = ("gyro_x", "gyro_y", "gyro_z")
TIME = np.arange(0.0, 600.0, 0.05)
W = 2.0 * np.pi / 25.0
SPEED = 15.0 + 5.0 * np.sin(W * TIME)
GRADE = 0.03 * np.sin(2.0 * np.pi * TIME / 150.0)
FORCE = 5.0 * W * np.cos(W * TIME) + 9.81 * np.sin(GRADE)


def recorded(turns, late=0.3):
    """Axes of a sensor that is turned, a bend now and then, a rough road, a late speed."""
    rng = np.random.default_rng(4)
    side = 2.0 * np.sin(2.0 * np.pi * TIME / 41.0) ** 3
    body = np.column_stack([FORCE, side, -9.81 * np.cos(GRADE)])
    body += rng.normal(0.0, 0.3, body.shape)
    parts = zip(turns, np.array_split(body, len(turns)), strict=True)
    read = np.vstack([turn.apply(part) for turn, part in parts])
    signals = {f"accel_{a}": read[:, k] for k, a in enumerate("xyz")}
    signals["vehicle_speed"] = np.interp(TIME - late, TIME, SPEED)
    return Drive("d", {k: Signal(k, TIME, v) for k, v in signals.items()})


TURN = Rotation.from_euler("zyx", (140.0, 25.0, -70.0), degrees=True)


@pytest.mark.parametrize("late", [0.0, 0.3, -0.4])
def test_what_a_turned_sensor_reads_along_the_vehicle_is_found(late):
    found = correct_drive(recorded([TURN], late)).signals["longitudinal_accel"]
    off = found.values - FORCE
    slow = np.convolve(off - off.mean(), np.full(100, 0.01), mode="valid")
    assert np.std(slow) < 0.08
    assert np.cov(found.values, FORCE)[0, 1] / np.var(FORCE) == pytest.approx(1.0, abs=0.01)


def test_a_device_that_was_moved_is_not_used():
    moved = correct_drive(recorded([TURN, TURN * Rotation.from_euler("z", 1.0)]))
    assert not moved.has("longitudinal_accel")
    (problem,) = [p for p in moved.problems if p.id == "imu.no_direction"]
    assert not problem.serious


def test_a_gyroscope_or_an_axis_along_the_vehicle_is_better():
    drive = recorded([TURN])
    rest = Signal("", TIME, np.zeros_like(TIME))
    whole = drive.with_signals(*(replace(rest, name=name) for name in GYRO))
    along = drive.with_signals(replace(rest, name="longitudinal_accel"))
    for better in (whole, along, drive.without("accel_z"), drive.without("vehicle_speed")):
        kept = correct_drive(better)
        assert kept.has("longitudinal_accel") == (better is along)
        assert better is not along or not kept.signals["longitudinal_accel"].values.any()


def simulated(name, seed, payload, duration):
    made = make_scenario(name, payload=payload, seed=seed)
    sensors = replace(made.sensors, imu_rate=20.0)
    made = simulate_car(replace(made, duration=duration, sensors=sensors))
    return made.drive.without(*GYRO), float(made.truth.mass[0])


@pytest.fixture(scope="module")
def car():
    known, mass = simulated("car-calibration", 741, 0.0, 1000.0)
    return wb.calibrate([known], mass=mass)


def test_a_drive_without_a_gyroscope_is_weighed_by_its_accelerometer(car):
    drive, mass = simulated("car", 742, 260.0, 1200.0)
    found = wb.weigh(drive, car)
    low, high = found.interval(0.95)
    assert found.result.balance.motion.source == "longitudinal_accel"
    assert low < mass < high
    assert found.std < 0.035 * mass
    assert any(w.id == "motion.no_gyro" for w in found.problems)
    (way,) = [w for w in inspect_drive(drive, car).ways if w.chosen]
    assert way.motion == "longitudinal_accel"


def weakened(drive, factor, since):
    """Its control unit tells less load from an instant on, in its own steps."""
    load, step = drive.signals["engine_load"], 1.0 / 255.0
    told = np.round(factor * load.values / step) * step
    return drive.with_signals(replace(load, values=np.where(load.time > since, told, load.values)))


@pytest.mark.parametrize("seed", [742, 743, 744])
def test_a_torque_that_changes_its_scale_is_refused_or_told_without_a_gyroscope(car, seed):
    drive, _ = simulated("car", seed, 260.0, 1200.0)
    found = wb.weigh(weakened(drive, 0.75, 500.0), replace(car, witnesses=()))
    ids = (found.reason_id or "", *(p.id for p in found.problems))
    assert len([id for id in ids if id.startswith("load.change")]) == 1
    assert "load.change_by_heights" not in ids
    if seed != 742:
        assert np.isnan(found.mass)


def test_a_torque_that_changes_its_scale_is_refused_or_told_by_speed():
    known, mass = simulated("car-calibration", 741, 0.0, 1000.0)
    by_speed = replace(wb.calibrate([known.without(*AXES)], mass=mass), witnesses=())
    drive, _ = simulated("car", 742, 260.0, 1200.0)
    drive = drive.without(*AXES)
    refused = wb.weigh(weakened(drive, 0.5, 400.0), by_speed)
    assert refused.reason_id == "load.change_by_heights"
    assert np.isnan(refused.mass)
    change = changing.ScaleChange(900.0, 900.0, 0.2, 0.01, 20.0)
    assert change.refusal("speed").id == "load.change_by_speed"
    assert change.refusal("inertial").id == "load.change_moving"
    told = wb.weigh(weakened(drive, 0.6, 600.0), by_speed)
    assert "load.change_or_stop" in (told.reason_id, *(w.id for w in told.problems))
    whole = wb.weigh(drive, by_speed)
    assert not any(w.id == "load.change_or_stop" for w in whole.problems)
