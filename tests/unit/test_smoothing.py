"""Acceleration and grade as conditional means: regressing on them is not drawn by their errors."""

import numpy as np
import pytest

from weighbridge import Drive, Signal
from weighbridge.navigation import find_motion


def gauss_markov(rng, step, length, std, n):
    keep = np.exp(-step / length)
    noise = std * np.sqrt(1.0 - keep**2) * rng.normal(size=n)
    out = np.zeros(n)
    for k in range(1, n):
        out[k] = keep * out[k - 1] + noise[k]
    return out


def moved(*signals):
    return find_motion(Drive("d", {s.name: s for s in signals}))


def slope(truth, found):
    """Of the truth regressed on what was found: 1 where the errors do not draw it [-]."""
    return float(found @ truth / (found @ found))


@pytest.mark.parametrize("period", [0.25, 1.0])
def test_acceleration_from_a_speed_in_whole_kmh(period):
    rng = np.random.default_rng(1)
    time = 0.1 * np.arange(30_000)
    accel = gauss_markov(rng, 0.1, 4.0, 0.5, time.size)
    speed = np.cumsum(accel) * 0.1
    speed -= speed.min()
    stride = round(period / 0.1)
    polled = Signal("vehicle_speed", time[::stride], np.round(3.6 * speed[::stride]) / 3.6)
    found = moved(polled)
    accel, speed = (np.interp(found.time, time, true) for true in (accel, speed))
    assert slope(accel, found.accel) == pytest.approx(1.0, abs=0.02)
    assert np.std(accel - found.accel) == pytest.approx(found.specific_force_std, rel=0.15)
    assert np.std(speed - found.speed) == pytest.approx(found.speed_std, rel=0.25)


def road(rng):
    """A road of 54 km, and the speed that drives it at 15 m/s."""
    distance = 1.5 * np.arange(36_000)
    grade = gauss_markov(rng, 1.5, 250.0, 0.02, distance.size)
    time = 0.1 * np.arange(distance.size)
    return time, grade, Signal("vehicle_speed", time[::10], np.full(time[::10].size, 15.0))


def test_grade_from_heights_with_slow_errors():
    rng = np.random.default_rng(2)
    time, grade, speed = road(rng)
    height = np.cumsum(grade) * 1.5
    read = height + gauss_markov(rng, 0.1, 80.0, 3.0, time.size) + rng.normal(0.0, 0.7, time.size)
    found = moved(speed, Signal("altitude", time[::10], read[::10]))
    grade, height = (np.interp(found.time, time, true) for true in (grade, height))
    error = grade - np.tan(found.grade)
    assert slope(grade, np.tan(found.grade)) == pytest.approx(1.0, abs=0.06)
    assert np.std(error) == pytest.approx(np.sqrt(np.mean(found.grade_std**2)), rel=0.15)
    assert np.std(error) < 0.6 * np.std(grade)
    assert np.std(height - found.altitude) < 4.0


def test_a_noisy_measured_grade_is_drawn_towards_level():
    rng = np.random.default_rng(3)
    time, grade, speed = road(rng)
    read = Signal("grade", time[::10], grade[::10] + rng.normal(0.0, 0.02, time[::10].size))
    found = moved(speed, read)
    grade = np.interp(found.time, time, grade)
    assert slope(grade, np.interp(found.time, read.time, read.values)) < 0.7
    assert slope(grade, found.grade) == pytest.approx(1.0, abs=0.05)
    error = np.std(grade - found.grade)
    assert error == pytest.approx(np.sqrt(np.mean(found.grade_std**2)), rel=0.15)


def slow(values):
    """Ten minutes at 15 m/s with a measured grade."""
    time = np.arange(0.0, 600.0, 0.5)
    speed = Signal("vehicle_speed", time, np.full(time.size, 15.0))
    return moved(speed, Signal("grade", time, np.where(time < 599.0, *values)))


@pytest.mark.parametrize("value", [0.0, 0.01])
def test_a_grade_that_never_changes_is_as_unsure_as_any(value):
    found = slow((value, value))
    assert np.all(found.grade == value)
    assert np.all(found.grade_std == 0.01)


def test_a_grade_that_changes_once_has_a_finite_std():
    found = slow((0.0, 0.3))
    assert np.all(np.isfinite(found.grade) & np.isfinite(found.grade_std))
