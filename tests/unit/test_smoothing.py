"""Acceleration and grade as conditional means: regressing on them is not drawn by their errors."""

import numpy as np
import pytest

from weighbridge import Signal
from weighbridge.navigation.smoothing import GRADE_NOISE, smooth_grade, smooth_height, smooth_speed


def gauss_markov(rng, step, length, std, n):
    keep = np.exp(-step / length)
    noise = std * np.sqrt(1.0 - keep**2) * rng.normal(size=n)
    out = np.zeros(n)
    for k in range(1, n):
        out[k] = keep * out[k - 1] + noise[k]
    return out


def slope(truth, found):
    """Of the truth regressed on what was found: 1 where the errors do not draw it [-]."""
    return float(found @ truth / (found @ found))


@pytest.mark.parametrize("period", [0.25, 1.0])
def test_acceleration_from_a_speed_in_whole_kmh(period):
    rng = np.random.default_rng(1)
    time = 0.1 * np.arange(30_000)
    accel = gauss_markov(rng, 0.1, 4.0, 0.5, time.size)
    speed = 15.0 + np.cumsum(accel) * 0.1
    stride = round(period / 0.1)
    polled = Signal("vehicle_speed", time[::stride], np.round(3.6 * speed[::stride]) / 3.6)
    found_speed, found, speed_std, std = smooth_speed(polled, time)
    assert slope(accel, found) == pytest.approx(1.0, abs=0.02)
    assert np.std(accel - found) == pytest.approx(np.mean(std), rel=0.15)
    assert np.std(speed - found_speed) == pytest.approx(np.mean(speed_std), rel=0.25)


def road(rng):
    distance = 1.5 * np.arange(36_000)
    grade = gauss_markov(rng, 1.5, 250.0, 0.02, distance.size)
    return 0.1 * np.arange(distance.size), distance, grade


def test_grade_from_heights_with_slow_errors():
    rng = np.random.default_rng(2)
    time, distance, grade = road(rng)
    height = np.cumsum(grade) * 1.5
    read = height + gauss_markov(rng, 0.1, 80.0, 3.0, time.size) + rng.normal(0.0, 0.7, time.size)
    found_height, found, std = smooth_height(
        Signal("altitude", time[::10], read[::10]), time, distance
    )
    assert slope(grade, found) == pytest.approx(1.0, abs=0.06)
    assert np.std(grade - found) == pytest.approx(np.sqrt(np.mean(std**2)), rel=0.15)
    assert np.std(grade - found) < 0.6 * np.std(grade)
    assert np.std(height - found_height) < 4.0


def test_a_noisy_measured_grade_is_drawn_towards_level():
    rng = np.random.default_rng(3)
    time, distance, grade = road(rng)
    read = Signal("grade", time[::10], grade[::10] + rng.normal(0.0, 0.02, time[::10].size))
    found, std = smooth_grade(read, time, distance)
    raw = np.interp(time, read.time, read.values)
    assert slope(grade, raw) < 0.7
    assert slope(grade, found) == pytest.approx(1.0, abs=0.05)
    assert np.std(grade - found) == pytest.approx(np.sqrt(np.mean(std**2)), rel=0.15)


@pytest.mark.parametrize("value", [0.0, 0.01])
def test_a_grade_that_never_changes_is_as_unsure_as_any(value):
    time = np.arange(0.0, 600.0, 0.5)
    found, std = smooth_grade(Signal("grade", time, np.full(time.size, value)), time, 15.0 * time)
    assert np.all(found == value)
    assert np.all(std == GRADE_NOISE)


def test_a_grade_that_changes_once_has_a_finite_std():
    time = np.arange(0.0, 600.0, 0.5)
    values = np.where(time < 599.0, 0.0, 0.3)
    found, std = smooth_grade(Signal("grade", time, values), time, 15.0 * time)
    assert np.all(np.isfinite(found) & np.isfinite(std))
