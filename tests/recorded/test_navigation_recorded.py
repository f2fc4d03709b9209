"""Inertial navigation on two recorded drives with independent truth."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from numba import config

from weighbridge.constants import GRAVITY
from weighbridge.navigation import find_motion

pytestmark = pytest.mark.skipif(
    bool(config.DISABLE_JIT), reason="a whole drive takes minutes without the compiler"
)

_SPEC = importlib.util.spec_from_file_location(
    "navigation_study", Path(__file__).resolve().parents[2] / "studies" / "navigation.py"
)
study = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(study)


@pytest.mark.parametrize("raw_gyro", [True, False])
@pytest.mark.parametrize("gnss_cut", [None, 20.0])
def test_highway_minute_of_a_phone(shared_data, raw_gyro, gnss_cut):
    drive, time, pitch, _ = study.load_comma(
        shared_data / "comma2k19", raw_gyro=raw_gyro, gnss_cut=gnss_cut
    )
    motion = find_motion(drive)
    _, std = study.score(motion, time, pitch, "pitch")
    assert std <= 0.15
    # the speed of the wheels reads 0.991 of the true speed
    assert motion.speed_scale == pytest.approx(0.991, abs=0.003)


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_hills_with_noisy_fixes(shared_data, seed):
    drive, time, grade = study.load_rtk(shared_data / "rtk-grade", seed=seed)
    motion = find_motion(drive)
    mean, std = study.score(motion, time - motion.speed_delay, grade, "grade")
    assert std <= 0.40
    assert abs(mean) <= 0.15
    # sensor axes z up and x back
    assert abs(np.degrees(motion.mounting[0])) > 178.0
    assert 0.002 < motion.squat < 0.008


def test_a_car_squats_on_hills_as_it_does_by_accelerating(shared_data):
    """Pitch of the body by the sensors, grade by heights good to centimetres."""
    drive, time, grade = study.load_rtk(shared_data / "rtk-grade", noise=0.02)
    motion = find_motion(drive)
    known = np.isfinite(grade)
    at = motion.time + motion.speed_delay
    road = np.interp(at, time[known], grade[known])
    near = np.interp(at, time, known.astype(float)) > 0.99
    second = round(motion.rate)
    rows = np.column_stack(
        [motion.pitch - road, motion.accel, GRAVITY * np.sin(road), near & (motion.speed > 5.0)]
    )
    rows = rows[: rows.shape[0] // second * second].reshape(-1, second, 4).mean(axis=1)
    rows = rows[rows[:, 3] == 1.0]
    columns = np.column_stack([rows[:, 1:3], np.ones(len(rows))])
    for _ in range(3):
        squat, *_ = np.linalg.lstsq(columns, rows[:, 0], rcond=None)
        left = rows[:, 0] - columns @ squat
        near = np.abs(left) < 4.0 * np.median(np.abs(left))
        rows, columns = rows[near], columns[near]
    cov = np.linalg.inv(columns.T @ columns) * np.var(left[near])
    assert squat[1] > 4.0 * np.sqrt(cov[1, 1])
    off = np.array([1.0, -1.0])
    assert abs(squat[0] - squat[1]) < 3.0 * np.sqrt(off @ cov[:2, :2] @ off)
