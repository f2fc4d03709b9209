"""Grade and squat of the navigation: errors are as large as it says, on simulated drives."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from weighbridge.navigation import find_motion
from weighbridge.simulation import Sensors, make_scenario, simulate_car

SEEDS = range(401, 407)
APART = 60.0
"""Errors of the grade so far apart are independent [s]."""


@pytest.fixture(scope="module")
def errors():
    """Return errors over standard deviations: of the grade (drives, n), of the squat (drives,)."""
    grade, squat = [], []
    for seed in SEEDS:
        scenario = make_scenario("car-short", payload=100.0, seed=seed)
        made = simulate_car(replace(scenario, sensors=Sensors(imu_rate=50.0)))
        motion, truth = find_motion(made.drive), made.truth
        at = np.searchsorted(motion.time, np.arange(APART, made.drive.duration - APART, APART))
        true = np.interp(motion.time[at], truth.time, truth.grade)
        grade.append((motion.grade[at] - true) / motion.grade_std[at])
        slope = np.polyfit(truth.accel, truth.pitch - truth.grade, 1)[0]
        squat.append((motion.squat - slope) / motion.squat_std)
    return np.concatenate(grade), np.array(squat)


def test_the_grade_has_the_standard_deviation_it_is_said_to_have(errors):
    grade, _ = errors
    low, high = chi2.ppf((0.001, 0.999), grade.size)
    assert grade.size > 50
    assert low < np.sum(grade**2) < high


def test_the_squat_has_the_standard_deviation_it_is_said_to_have(errors):
    _, squat = errors
    # The prior of the squat is that of all cars: it may be wide, not narrow.
    assert np.sum(squat**2) < chi2.ppf(0.999, squat.size)
    assert np.sum(squat**2) > chi2.ppf(0.001, squat.size) / 4.0
