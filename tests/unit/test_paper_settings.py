"""Each setting that the papers print or vary, by its name in a command, moves the mass."""

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.estimators import ESTIMATORS, parsed

LEAST_SQUARES = (
    "memory=30", "forgetting=0.999", "window=0", "kept_information=0", "threshold=0.5",
    "weight_information=false", "start_mass=900 start_information=3", "rolling_coefficient=0.0005",
    "threshold_force=50", "settle_windows=0 threshold=0.5", "every_row=true",
    "offset_std=0", "noisy_motion=false", "count_grade_twice=true", "first_information=3",
    "offset_memory=20",
)  # fmt: skip
KALMAN = (
    "start_mass=900", "start_std=0.1", "start_speed_std=0.001",
    "start_grade_std=0.001", "speed_noise=0.03", "grade_noise=0.02", "accel_walk=0.3",
    "grade_walk=0.02", "mass_walk=0.005", "grade_offset=0", "offset_walk=0", "gate=0.1",
    "jacobian_window=0", "jacobian_window=6",
)  # fmt: skip
BLENDS = (
    "blend=speed", "blend=variance", "blend=covariance", "blend=intersection", "blend=share",
    "blend=share blend_share=0.2", "blend=speed blend_speed=15", "blend=speed blend_width=5",
    "blend=covariance blend_correlation=0.2", "blend_memory=40", "blend_caution=1",
)  # fmt: skip
TORQUE = (
    "initial_mass=900", "initial_std=0.1", "initial_slope_std=0.1",
    "initial_rolling_std=0.01", "sample_time=7", "speed_noise=0.5", "accel_noise=0.3",
    "slope_std=0.02", "slope_length=inf slope_walk=0.001", "rolling_std=0", "rolling_time=60",
    "mass_walk=0.01", "measured_grade=false", "measured_jacobian=false", "constant_errors=false",
    "gate=1",
)  # fmt: skip
CASES = [
    *(("rls", s) for s in (
        "forgetting=0.998", "forgetting=0.9999", "initial_mass=1500", "initial_gain=1e-4",
        "every_row=true", "gate=1",
    )),
    *(("robust-rls", s) for s in LEAST_SQUARES),
    *(("ekf", s) for s in KALMAN),
    *(("ekf", " ".join(f"start.{word}" for word in s.split()))
      for s in ("threshold=0.5", "rolling_coefficient=0.0005")),
    *(("hybrid", s) for s in BLENDS),
    *(("hybrid", s) for s in ("ekf.accel_walk=0.3", "ekf.start.window=0")),
    *(("speed-torque-ekf", s) for s in TORQUE),
]  # fmt: skip


@pytest.fixture(scope="module")
def weighed(short_drive, short_car):
    done = {m: wb.weigh(short_drive.drive, short_car, m) for m in ("rls", "speed-torque-ekf")}
    assert all(w.result is not None for w in done.values())
    return done


@pytest.fixture(scope="module")
def usual(weighed):
    return {method: track(weighed, method, {}) for method in {m for m, _ in CASES}}


def track(weighed, method, given):
    w = weighed["speed-torque-ekf" if method == "speed-torque-ekf" else "rls"]
    estimator = ESTIMATORS[method]
    return estimator.track(w.result.balance, w.vehicle, estimator.settings_of(given))


@pytest.mark.parametrize(("method", "words"), CASES)
def test_a_setting_moves_the_mass_or_its_course(weighed, usual, method, words):
    before, after = usual[method], track(weighed, method, parsed(words.split()))
    assert np.isfinite(after.mass)
    same = np.array_equal(before.running_mass, after.running_mass, equal_nan=True)
    assert not same or after.mass != before.mass


@pytest.mark.parametrize("method", ["rls", "ekf", "hybrid", "speed-torque-ekf"])
def test_a_gate_may_be_left_open_as_in_print(weighed, method):
    name = "ekf.gate" if method == "hybrid" else "gate"
    found = track(weighed, method, parsed([f"{name}=inf"]))
    assert found.mass > 0.0


def test_bends_are_told_to_the_estimator_where_there_is_a_heading(weighed, usual):
    turned = track(weighed, "robust-rls", {"sensor_ahead": 4.0})
    assert turned.mass < usual["robust-rls"].mass


@pytest.fixture(scope="module")
def by_speed(short_drive):
    truth = short_drive.truth
    known = short_drive.drive.without("altitude").with_signals(
        wb.signals.Signal("grade", truth.time[::20], truth.grade[::20])
    )
    settings = wb.CalibrationSettings(method="speed-ekf")
    car = wb.calibrate([known], mass=float(truth.mass[0]), settings=settings)
    return wb.weigh(known, car, "speed-ekf")


@pytest.mark.parametrize(
    "words",
    [
        "initial_mass=1500",
        "initial_slope=0.05",
        "process_var=[0.1,1e-10,0.005]",
        "initial_var=0.1,1e-6,0.005",
        "speed_var=1e-2",
    ],
)
def test_settings_of_speed_alone(by_speed, words):
    estimator, before = ESTIMATORS["speed-ekf"], by_speed.result
    given = estimator.settings_of(parsed([words]))
    after = estimator.track(before.balance, by_speed.vehicle, given)
    assert not np.array_equal(before.running_mass, after.running_mass, equal_nan=True)
    assert after.status == "not_excited"
