"""Gear ratios from speeds, and the gear of the moment."""

from types import SimpleNamespace

import numpy as np
import pytest
from tests.noted import refused

import weighbridge as wb
from weighbridge import Signal
from weighbridge.calibration.problem import find_gears
from weighbridge.vehicle import (
    detect_gearings,
    find_engine_delay,
    gathered_delay,
    idling,
    number_reported_gears,
    predict_gear,
    reported_gear_numbers,
    shifting,
    stepless_range,
)

GEARINGS = np.array([36.0, 22.0, 14.5, 10.6, 8.4])


def drive(rng, *, minutes=20, step=0.0, rate=4.0):
    """Speeds of a car that works through its gears, with slipping clutches between."""
    n = int(minutes * 60 * rate)
    time = np.arange(n) / rate
    speed = 12.0 + 11.0 * np.sin(time / 17.0) + rng.normal(0.0, 0.05, n)
    speed = np.clip(speed, 0.0, None)
    gear = np.searchsorted([4.0, 8.0, 13.0, 18.0], speed)
    engine = GEARINGS[gear] * speed * (1.0 + rng.normal(0.0, 0.002, n))
    shift = np.concatenate(([False], np.diff(gear) != 0))
    engine[shift] *= rng.uniform(0.8, 1.2, np.count_nonzero(shift))
    engine = np.maximum(engine, 85.0)
    if step:
        speed = np.floor(speed / step) * step + 0.5 * step
    return time, engine, speed


def test_no_more_gears_are_found_than_the_gear_signal_tells():
    time, engine, speed = drive(np.random.default_rng(3))
    # Twice as the clutch closes the ratio stays at one between two gears for some seconds.
    for begin in (300, 2100):
        engine[begin : begin + 40] = 12.4 * speed[begin : begin + 40]
    motion = SimpleNamespace(time=time, speed=speed, speed_delay=0.0)
    logged = wb.Drive("d", {"engine_speed": Signal("engine_speed", time, engine)})
    assert find_gears([logged], [motion]).gearings.size == 6
    gear = 1.0 + np.searchsorted([4.0, 8.0, 13.0, 18.0], speed)
    gear[:3] = 9.0
    told = logged.with_signals(Signal("gear", time, gear))
    assert find_gears([told], [motion]).gearings == pytest.approx(GEARINGS, rel=0.01)


@pytest.mark.parametrize("engine_late", [0.1, 0.35, 0.5])
def test_an_engine_speed_that_is_not_as_late_as_the_vehicle_speed_moves_no_gear(engine_late):
    time, engine, speed = drive(np.random.default_rng(7), rate=20.0)
    motion = SimpleNamespace(time=time, speed=speed, speed_delay=0.35)
    stamps = time + engine_late
    gearings = GEARINGS * np.array([1.05, 1.02, 1.0, 1.0, 1.0])
    found = find_engine_delay(stamps, engine, (time, speed), gearings, motion.speed_delay)
    assert found == pytest.approx(engine_late, abs=0.03)
    logged = wb.Drive("d", {"engine_speed": Signal("engine_speed", stamps, engine)})
    assert find_gears([logged], [motion]).gearings == pytest.approx(GEARINGS, rel=0.005)


def test_gears_that_never_pull_leave_the_engine_speed_as_late_as_the_vehicle_speed():
    time = np.arange(4000) * 0.1
    speed = np.full(time.size, 20.0)
    engine = 8.4 * speed * (1.0 + np.random.default_rng(8).normal(0.0, 0.002, time.size))
    late = find_engine_delay(time, engine, (time, speed), GEARINGS, 0.2)
    assert late == pytest.approx(0.2, abs=1e-3)
    assert find_engine_delay(time[:5], engine[:5], (time, speed), GEARINGS, 0.2) == 0.2


def test_a_delay_at_which_nothing_moves_is_no_reason_for_another():
    """Of 40 samples on the move, fewer than 30 are left at the usual delay of 2 s."""
    time = np.arange(0.0, 100.0, 0.1)
    speed = np.where((time > 50.0) & (time < 54.0), 10.0, 0.0)
    stamps, engine = time[500:540], np.full(40, 150.0)
    assert gathered_delay(stamps, engine, (time, speed), 2.0) == 2.0


def test_gearings_are_found_within_a_percent():
    found = detect_gearings(*drive(np.random.default_rng(3)))
    assert found.gearings == pytest.approx(GEARINGS, rel=0.01)
    assert (found.stds < 0.01 * found.gearings).all()


def test_gearings_are_found_from_whole_kmh():
    step = 1.0 / 3.6
    found = detect_gearings(*drive(np.random.default_rng(4), step=step), speed_step=step)
    # The first gear is used below 15 km/h only, where a step is a tenth of the speed.
    assert found.gearings[-4:] == pytest.approx(GEARINGS[-4:], rel=0.01)


def test_a_single_speed_is_found():
    rng = np.random.default_rng(5)
    time, _, speed = drive(rng)
    found = detect_gearings(time, 28.85 * speed, speed, idle_speed=0.0)
    assert found.gearings == pytest.approx([28.85], rel=0.005)


def test_a_stepless_gearbox_is_refused():
    rng = np.random.default_rng(6)
    time = np.arange(20_000) * 0.25
    speed = 15.0 + 10.0 * np.sin(time / 40.0)
    engine = speed * np.exp(np.log(8.0) + np.cumsum(rng.normal(0, 0.01, time.size)) * 0.2)
    engine = np.clip(engine, 90.0, 500.0) * (1 + rng.normal(0, 0.2, time.size))
    with refused("gear.few_samples", "gear.none", "gear.unclear"):
        detect_gearings(time, engine, speed)


def test_a_stepless_gearbox_is_told_from_gears():
    time = np.arange(4000) * 0.25
    speed = 15.0 + 8.0 * np.sin(time / 20.0)
    engine = np.clip(220.0 + 90.0 * np.sin(time / 13.0), 6.0 * speed, 40.0 * speed)
    low, high = stepless_range(time, engine, speed, idle_speed=80.0)
    seen = (engine / speed)[speed > 6.0]
    assert (low, high) == pytest.approx((seen.min(), seen.max()), rel=0.02)
    assert stepless_range(time[:90], engine[:90], speed[:90], idle_speed=80.0) is None
    assert stepless_range(*drive(np.random.default_rng(4)), idle_speed=80.0) is None


def test_a_stepless_gearbox_that_rests_at_its_last_ratio_is_no_gear():
    time = np.arange(8000) * 0.25
    speed = np.where(time < 1200.0, 25.0 + np.sin(time / 20.0), 15.0 + 8.0 * np.sin(time / 20.0))
    engine = np.clip(190.0 + 60.0 * np.sin(time / 13.0), 12.0 * speed, 40.0 * speed)
    assert np.mean(engine < 12.01 * speed) > 0.6
    low, _ = stepless_range(time, engine, speed, idle_speed=80.0)
    assert low == pytest.approx(12.0, rel=0.01)


def test_a_motor_in_the_hub_is_a_gear():
    time, _, speed = drive(np.random.default_rng(5))
    found = detect_gearings(time, speed / 0.345, speed, idle_speed=0.0)
    assert found.gearings == pytest.approx([1.0 / 0.345], rel=0.005)


def test_too_slow_an_engine_speed_says_so():
    time, engine, speed = drive(np.random.default_rng(5))
    motion = SimpleNamespace(time=time, speed=speed, speed_delay=0.0)
    slow = Signal("engine_speed", time[::20], engine[::20])
    with refused("calibration.slow_engine_speed", period=pytest.approx(slow.period)):
        find_gears([wb.Drive("d", {"engine_speed": slow})], [motion])


def test_too_short_a_drive_says_so():
    time = np.arange(20) * 0.25
    with refused("gear.few_samples"):
        detect_gearings(time, np.full(20, 200.0), np.full(20, 10.0))


def test_nearest_gear_is_predicted_and_slip_is_none():
    speed = np.array([10.0, 10.0, 10.0, 0.0, 10.0])
    engine = np.array([220.0, 145.0, 180.0, 85.0, 36.0 * 10.0 * 1.03])
    gear, mismatch = predict_gear(engine, speed, GEARINGS)
    assert gear.tolist() == [2, 3, 0, 0, 1]
    assert mismatch[4] == pytest.approx(0.03)
    assert np.isnan(mismatch[3])


def test_shifts_are_marked_on_both_sides():
    time = np.arange(10) * 0.25
    gear = np.array([1, 1, 1, 1, 2, 2, 2, 2, 2, 2])
    marked = shifting(time, gear, margin=0.3)
    assert marked.tolist() == [False, False, False, True, True, False, False, False, False, False]
    assert not shifting(time, np.ones(10, dtype=np.int64), margin=0.3).any()


def test_gears_told_are_numbered_by_the_gearings_of_the_file():
    """A truck that began in second: its file knows three gears, the gearbox counts 2 to 4."""
    gearings = np.array([18.9, 14.7, 10.5])
    told = np.repeat([2, 3, 4, 0, -1, 9], 10)
    ratio = np.repeat([18.8, 14.8, 10.5, 30.0, 40.0, np.nan], 10)
    gear = number_reported_gears(told, reported_gear_numbers(told, ratio, gearings))
    assert gear[::10].tolist() == [1, 2, 3, 0, 0, 0]


def test_a_gear_told_that_slips_keeps_its_number():
    told = np.full(10, 2)
    numbers = reported_gear_numbers(told, np.full(10, 17.0), np.array([18.9, 14.7, 10.5]))
    gear = number_reported_gears(told, numbers)
    assert gear.tolist() == [2] * 10


def test_idle_is_the_usual_speed_at_standstill_not_that_of_starts_and_feet():
    standing = np.concatenate((np.linspace(32.0, 85.0, 300), np.linspace(84.0, 180.0, 900)))
    idle = 83.0 + 0.3 * np.sin(np.arange(500.0))
    engine = np.concatenate((standing, idle, np.full(900, 250.0), np.zeros(400)))
    speed = np.concatenate((np.zeros(1700), np.full(900, 20.0), np.zeros(400)))
    assert idling(engine, speed) == pytest.approx(83.0, rel=0.01)
    assert idling(engine[2600:], speed[2600:]) == 0.0


def test_a_start_of_the_engine_is_no_idle():
    engine = np.concatenate((np.zeros(20), np.repeat([31.0, 31.4], 4), np.linspace(35.0, 90.0, 15)))
    assert idling(engine, np.zeros(engine.size)) == 0.0
