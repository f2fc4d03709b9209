"""Weighing by speed alone: windows, averages, what the answer is made of, and refusals."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.noted import error, refused

import weighbridge as wb
from weighbridge import ConfigError, Drive, Signal, Vehicle
from weighbridge.balance import Reason
from weighbridge.estimators import ESTIMATORS
from weighbridge.vehicle import Driveline, Provenance

SPEED_EKF = wb.CalibrationSettings(method="speed-ekf")


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


def test_fit_takes_any_mass_it_is_told(car):
    other = wb.calibrate(drive(1), mass=1400.0, settings=SPEED_EKF).speed_model
    assert other.r_squared == pytest.approx(car.speed_model.r_squared, abs=1e-3)


def test_answer_is_the_start_and_is_told_as_such(car):
    weighed = wb.weigh(drive(2, graded=False), car, method="speed-ekf")
    assert weighed.status == "not_excited"
    assert math.isnan(weighed.mass)
    assert weighed.result.mass == pytest.approx(1092.0, rel=0.01)
    assert weighed.reason_id == "speed.no_mass"
    assert weighed.refusal.values["share"] == pytest.approx(100.0, abs=1.0)
    assert weighed.result.std > 0.2 * 0.99 * weighed.result.mass


def test_the_mass_is_the_mean_of_the_calmest_groups_of_the_last_samples(car):
    """Galvão et al., sec. 4: of ten groups of the last three quarters, those that move least."""
    printed = {"process_var": (0.1, 1e-10, 0.005)}
    found = wb.weigh(drive(2), car, method="speed-ekf", settings=printed).result
    running = found.running_mass[found.used]
    groups = np.array_split(running[running.size // 4 :], 10)
    spreads = [group.std() for group in groups]
    calm = [g for g, spread in zip(groups, spreads, strict=True) if spread <= np.mean(spreads)]
    assert 3 < len(calm) < 8
    assert found.mass == pytest.approx(np.concatenate(calm).mean(), rel=1e-12)


def test_windows_are_as_many_as_fit_and_need_most_of_their_samples(car):
    whole = drive(2, seconds=1190.1, rate=10.0, graded=False)
    speed = whole.signals["vehicle_speed"]
    keep = (speed.time < 350.0) | (speed.time > 380.0)
    gap = whole.with_signals(Signal("vehicle_speed", speed.time[keep], speed.values[keep]))
    for made, missing in ((whole, []), (gap, [50, 51, 52, 53])):
        table = wb.weigh(made, car, method="speed-ekf").result.balance.table
        assert table.time[-1] == 1190.0
        assert np.flatnonzero(np.isnan(table.speed)).tolist() == missing


def test_other_signals_are_not_looked_at(car):
    alone = drive(2, graded=False)
    more = alone.with_signals(
        Signal("engine_torque", np.arange(0.0, 1200.0), 80.0 + np.arange(1200.0) % 7)
    )
    a, b = (wb.weigh(d, car, method="speed-ekf").result.balance.table for d in (alone, more))
    np.testing.assert_array_equal(a.speed, b.speed)
    assert (a.reason == Reason.USED).sum() > 100


def test_gnss_speed_does_as_well(car):
    made = drive(2, graded=False)
    speed = made.signals["vehicle_speed"]
    by_gnss = Drive("gnss", {"gnss_speed": Signal("gnss_speed", speed.time, speed.values)})
    found = wb.weigh(by_gnss, car, method="speed-ekf")
    assert found.result.mass == wb.weigh(made, car, method="speed-ekf").result.mass


def test_a_start_that_is_forgotten_gives_a_mass_with_its_interval(car):
    # Not what recorded cars do: the paths beyond the refusal are tried by settings.
    forgets = {"initial_var": (1e-4, 1e-6, 1e-6), "process_var": (1e-3, 1e-14, 1e-8)}
    doubtful = wb.weigh(drive(2), car, method="speed-ekf", settings=forgets)
    assert doubtful.status == "not_excited"
    assert doubtful.reason_id == "speed.wide"
    sure = replace(car, speed_model=replace(car.speed_model, scale_std=0.1))
    weighed = wb.weigh(drive(2), sure, method="speed-ekf", settings=forgets)
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
    time = np.arange(0.0, 1200.0, 0.25)
    signals = {
        "vehicle_speed": Signal("vehicle_speed", time, 20.0 + 1e-6 * np.sin(time)),
        "grade": Signal("grade", time, 1e-9 * np.cos(time)),
    }
    with refused("calibration.speed_steady"):
        wb.calibrate(Drive("cruise", signals), mass=1092.0, settings=SPEED_EKF)


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
    assert made.speed_model.force_gain == 20.0


@pytest.mark.parametrize(
    "wrong", [{"initial_mass": -1.0}, {"speed_var": 0.0}, {"process_var": (0.1, -1e-9, 0.005)}]
)
def test_settings_are_checked(wrong):
    with pytest.raises(ConfigError, match="must"):
        ESTIMATORS["speed-ekf"].settings(**wrong)
