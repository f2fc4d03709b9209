"""Weighing by speed alone: windows, averages, what the answer is made of, and refusals."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.noted import error, refused

import weighbridge as wb
from weighbridge import ConfigError, Drive, Signal, Vehicle
from weighbridge.balance import Reason
from weighbridge.balance.speed_balance import running, speed_balance, window_means
from weighbridge.calibration.speed import nominal_of
from weighbridge.calibration.speed_fit import Nominal, SpeedRows, fit_speed_model, model_speed
from weighbridge.estimators.speed_ekf import (
    PRINTED,
    SpeedEkfSettings,
    mean_mass,
    run_filter,
    start_share,
)
from weighbridge.navigation.speed import speed_motion
from weighbridge.vehicle.model import Driveline, Provenance, SpeedModel
from weighbridge.vehicle.speed_model import SpeedSampling

NOMINAL = Nominal(force_gain=19.83, drag=0.918, rolling_coefficient=0.01, rotating_mass=71.0)
SPEED_EKF = wb.CalibrationSettings(method="speed-ekf")
TRUE = (0.0, -0.55, 0.04, 0.012, -3.0, 0.1, 1.9)
CAR = Vehicle(
    name="compact",
    speed_model=SpeedModel(
        mass=1092.0,
        force_gain=19.83,
        drag=0.918,
        rotating_mass=71.0,
        corrections=TRUE,
        scale_std=0.2,
    ),
)


def wander(n, seed, low=12.0, high=24.0):
    """Speeds that rise and fall without braking."""
    rng = np.random.default_rng(seed)
    t = 7.0 * np.arange(n)
    waves = sum(
        rng.normal() * np.sin(2.0 * math.pi * t / period + rng.uniform(0.0, 6.0))
        for period in (97.0, 143.0, 211.0, 307.0)
    )
    part = (waves - waves.min()) / np.ptp(waves)
    return low + (high - low) * part


def drive(seed=1, seconds=1200.0, rate=4.0, *, graded=True):
    time = np.arange(0.0, seconds, 1.0 / rate)
    coarse = wander(int(seconds / 7.0) + 3, seed)
    speed = np.interp(time, 7.0 * np.arange(coarse.size), coarse)
    rng = np.random.default_rng(seed + 50)
    signals = [Signal("vehicle_speed", time, np.round(speed * 3.6) / 3.6)]
    if graded:
        grade = 0.01 * np.sin(time / 60.0) + 0.002 * rng.standard_normal(time.size)
        signals.append(Signal("grade", time, grade))
    return Drive(f"drive-{seed}", {s.name: s for s in signals})


@pytest.fixture(scope="module")
def car():
    return wb.calibrate(drive(1), mass=1092.0, settings=SPEED_EKF)


def test_windows_are_means_and_gaps_leave_none():
    time = np.concatenate([np.arange(0.0, 35.0, 0.1), np.arange(56.0, 140.4, 0.1)])
    values = 10.0 + 0.1 * time
    motion = speed_motion(Drive("d", {"vehicle_speed": Signal("vehicle_speed", time, values)}))
    means = window_means(motion, motion.speed, SpeedSampling())
    assert means.size == 20
    middles = 7.0 * np.arange(20) + 3.45
    assert np.isnan(means[5:8]).all()
    sound = np.r_[0:5, 8:20]
    assert_allclose(means[sound], 10.0 + 0.1 * middles[sound], atol=0.02)
    points = window_means(motion, motion.speed, SpeedSampling(averaged=0.0))
    assert_allclose(points[sound], means[sound] + 0.35, atol=0.03)
    halves = window_means(motion, motion.speed, SpeedSampling(averaged=0.5))
    assert_allclose(halves[sound], means[sound] + 0.175, atol=0.03)


def test_on_and_off_by_speed_alone():
    speed = np.array([3.0, 12.0, 15.0, 11.0, 10.0, np.nan, 14.0, 2.0])
    known, slow, braked = running(speed, SpeedSampling())
    assert known.tolist() == [True] * 5 + [False, True, True]
    assert (slow & known).tolist() == [True] + [False] * 6 + [True]
    # 4 m/s in 7 s is braking, 1 m/s is not, and after a gap nobody knows.
    assert braked.tolist() == [False] * 3 + [True] + [False] * 3 + [True]
    _, slow, braked = running(speed, SpeedSampling(slowest=11.5, hardest=2.0))
    assert slow[known].tolist() == [True, False, False, True, True, False, True]
    assert not braked.any()


def test_calm_groups_count():
    mass = np.concatenate([np.full(100, 1500.0), np.full(300, 1100.0)])
    mass[250:280] += 80.0 * np.sin(np.arange(30.0))
    used = np.ones(400, dtype=bool)
    assert mean_mass(mass, used) == 1100.0
    assert mean_mass(np.full(40, 900.0), np.arange(40) < 3) == 900.0
    assert np.isnan(mean_mass(mass, ~used))


def test_fit_finds_the_model_that_made_the_speed():
    rng = np.random.default_rng(4)
    mass = 1092.0
    model = CAR.speed_model
    speed = wander(180, 3)
    grade = rng.normal(0.0, 0.01, 180)
    rows = SpeedRows(
        name="made", mass=mass, speed=speed, grade=grade, used=np.ones(180, dtype=bool)
    )
    # Steps of the true model from each of the speeds: pairs of windows.
    ahead = model_speed(rows, model)[1:]
    paired = np.column_stack([speed[:-1], ahead]).ravel()
    slope = np.sin(grade + math.atan(0.01))
    slope = 0.5 * (slope[:-1] + slope[1:])
    pairs = SpeedRows(
        name="pairs",
        mass=mass,
        speed=paired,
        grade=np.repeat(np.arcsin(slope) - math.atan(0.01), 2),
        used=np.ones(paired.size, dtype=bool),
    )
    halves = [
        replace(pairs, speed=pairs.speed[k : k + 2], grade=pairs.grade[k : k + 2],
                used=pairs.used[k : k + 2])
        for k in range(0, paired.size, 2)
    ]  # fmt: skip
    found = fit_speed_model(halves, NOMINAL, 7.0)
    assert found.r_squared == pytest.approx(1.0, abs=1e-9)
    predicted = model_speed(rows, replace(model, corrections=found.corrections))
    assert_allclose(predicted[1:], ahead, atol=1e-6)
    p, true = found.corrections, TRUE
    assert p[0] == 0.0
    assert p[6] == pytest.approx(true[6], rel=1e-6)
    assert_allclose(p[3:6], true[3:6], atol=1e-6)
    # p2 and p3 both multiply the square of the speed: only their sum shows.
    assert p[1] * p[6] - 0.5 * p[2] == pytest.approx(true[1] * true[6] - 0.5 * true[2], rel=1e-6)


def test_fit_takes_any_mass_it_is_told(car):
    other = wb.calibrate(drive(1), mass=1400.0, settings=SPEED_EKF).speed_model
    assert other.r_squared == pytest.approx(car.speed_model.r_squared, abs=1e-3)


def test_answer_is_the_start_and_is_told_as_such(car):
    weighed = wb.weigh(drive(2, graded=False), car, method="speed-ekf")
    assert weighed.status == "not_excited"
    assert math.isnan(weighed.mass)
    assert weighed.result.mass == pytest.approx(1092.0, rel=0.01)
    assert weighed.reason_id == "speed.no_mass"
    balance = weighed.result.balance
    assert start_share(balance, car, SpeedEkfSettings()) == pytest.approx(1.0, abs=0.1)
    assert weighed.result.std > 0.2 * 0.99 * weighed.result.mass
    printed = run_filter(balance, car, PRINTED)
    assert mean_mass(printed.mass, printed.used) > 1300.0


def test_other_signals_are_not_looked_at(car):
    alone = drive(2, graded=False)
    more = alone.with_signals(
        Signal("engine_torque", np.arange(0.0, 1200.0), 80.0 + np.arange(1200.0) % 7)
    )
    a, b = (speed_balance(d, car).table for d in (alone, more))
    np.testing.assert_array_equal(a.speed, b.speed)
    assert (a.reason == Reason.USED).sum() > 100


def test_gnss_speed_does_as_well(car):
    made = drive(2, graded=False)
    speed = made.signals["vehicle_speed"]
    by_gnss = Drive("gnss", {"gnss_speed": Signal("gnss_speed", speed.time, speed.values)})
    found = wb.weigh(by_gnss, car, method="speed-ekf")
    assert found.result.mass == wb.weigh(made, car, method="speed-ekf").result.mass


def test_a_start_that_is_forgotten_gives_a_mass_with_its_interval(car, monkeypatch):
    # Not what recorded cars do: the paths beyond the refusal are tried on their own.
    monkeypatch.setattr("weighbridge.estimators.speed_ekf.start_share", lambda *_: 0.1)
    doubtful = wb.weigh(drive(2), car, method="speed-ekf")
    assert doubtful.status == "not_excited"
    assert doubtful.reason_id == "speed.wide"
    sure = replace(car, speed_model=replace(car.speed_model, scale_std=0.1))
    weighed = wb.weigh(drive(2), sure, method="speed-ekf")
    low, high = weighed.interval(0.95)
    assert weighed.status == "converged"
    assert high - low > 0.35 * weighed.mass


def test_short_drive_and_no_speed_are_told(car):
    short = wb.weigh(drive(3, seconds=120.0), car, method="speed-ekf")
    assert short.status == "not_excited"
    assert short.reason_id == "speed.few_samples"
    assert f"{short.refusal.values['period']:g}" == "7"
    without = wb.weigh(drive(3).without("vehicle_speed"), car, method="speed-ekf")
    assert without.status == "missing_signals"
    assert without.reason_id == "speed.none_of"


def test_speed_that_comes_too_rarely_is_told(car):
    with refused("speed.slow", speed="vehicle_speed", period=pytest.approx(5.0)):
        wb.weigh(drive(3, rate=0.2), car, method="speed-ekf")


def test_vehicle_without_a_model_is_refused():
    with error(ConfigError, "new [speed_model] --method speed-ekf"):
        wb.weigh(drive(2), Vehicle(name="new"), method="speed-ekf")


@pytest.mark.parametrize(
    ("made", "id", "values"),
    [
        (drive(1, graded=False), "calibration.no_grade", {}),
        (
            drive(1).without("vehicle_speed"),
            "calibration.no_speed",
            {"missing": "vehicle_speed and no gnss_speed"},
        ),
        (drive(1, seconds=180.0), "calibration.few_steps", {"least": 40}),
    ],
)
def test_calibration_says_what_it_lacks(made, id, values):
    with refused(id, **values):
        wb.calibrate(made, mass=1092.0, settings=SPEED_EKF)


def test_even_speed_on_an_even_road_cannot_be_fitted():
    rows = SpeedRows(
        name="cruise",
        mass=1092.0,
        speed=np.full(100, 20.0),
        grade=np.zeros(100),
        used=np.ones(100, dtype=bool),
    )
    with refused("calibration.speed_steady"):
        fit_speed_model([rows], NOMINAL, 7.0)


def test_calibration_keeps_the_rest_of_the_vehicle(car):
    """A file says what was fitted unless torque was fitted before."""
    before = Provenance(drives=("a",), masses=(1000.0,), method="joint", mass_scale_std=0.01)
    line = Driveline(gearings=(30.0, 20.0, 12.0))
    base = Vehicle(name="mine", tare=1000.0, driveline=line, provenance=before)
    made = wb.calibrate(drive(1), mass=1092.0, vehicle=base, settings=SPEED_EKF)
    assert (made.name, made.tare, made.driveline) == ("mine", 1000.0, base.driveline)
    assert made.speed_model.mass == 1092.0
    assert made.provenance == before
    assert car.provenance.method == "speed-ekf"
    assert nominal_of(base).force_gain == 20.0


@pytest.mark.parametrize(
    "wrong", [{"initial_mass": -1.0}, {"speed_var": 0.0}, {"process_var": (0.1, -1e-9, 0.005)}]
)
def test_settings_are_checked(wrong):
    with pytest.raises(ConfigError, match="must"):
        SpeedEkfSettings(**wrong)
