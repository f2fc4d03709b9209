"""Digits of the inertial sensor that are cut off or too few: mended, told or refused."""

from dataclasses import replace

import numpy as np
import pytest

from weighbridge import Signal
from weighbridge.checks import correct_drive
from weighbridge.simulation import make_scenario, simulate_car

ACCEL = ("accel_x", "accel_y", "accel_z")
GYRO = ("gyro_x", "gyro_y", "gyro_z")


@pytest.fixture(scope="module", params=[("car", 88), ("truck", 89)])
def drive(request):
    name, seed = request.param
    return simulate_car(replace(make_scenario(name, seed=seed), duration=600.0)).drive


def to_digits(drive, names, step, how):
    signals = [drive.signals[n] for n in names]
    return drive.with_signals(
        *(Signal(s.name, s.time, how(s.values / step) * step) for s in signals)
    )


def cut(drive):
    """Notes that digits were cut off."""
    return [p for p in drive.problems if p.id == "imu.digits_cut"]


def mean_slope(drive, other):
    """Slope of one drive's force along on another's, as means over a second."""
    a, b = (d.signals["accel_x"].values for d in (drive, other))
    each = round(1.0 / other.signals["accel_x"].period)
    a, b = (x[: x.size // each * each].reshape(-1, each).mean(axis=1) for x in (a, b))
    return np.polyfit(b, a, 1)[0]


def test_digits_as_they_come_are_left_to_the_last_bit(drive):
    kept = correct_drive(drive)
    assert not cut(kept)
    assert all(np.array_equal(kept.signals[n].values, drive.signals[n].values) for n in ACCEL)


@pytest.mark.parametrize("step", [0.01, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("how", [np.round, np.floor, np.ceil])
@pytest.mark.parametrize("centred", [False, True])
def test_rounded_digits_are_left_alone(drive, step, how, centred):
    if centred:
        signals = [drive.signals[n] for n in ACCEL[:2]]
        drive = drive.with_signals(
            *(Signal(s.name, s.time, s.values - np.median(s.values)) for s in signals)
        )
    coarse = to_digits(drive, ACCEL, step, how)
    kept = correct_drive(coarse)
    assert not cut(kept)
    # Coarse ones may be left out whole, and are never moved.
    for name in set(ACCEL) & set(kept.signals):
        assert np.isin(kept.signals[name].values, coarse.signals[name].values).all()


@pytest.mark.parametrize("step", [0.02, 0.05, 0.1])
def test_digits_that_are_cut_off_get_half_a_step(drive, step):
    short = to_digits(drive, ACCEL, step, np.trunc)
    mended = correct_drive(short)
    (problem,) = cut(mended)
    assert problem.values["step"] == pytest.approx(step, rel=0.01)
    assert not problem.serious
    was, now = mean_slope(short, drive), mean_slope(mended, drive)
    assert abs(now - 1.0) < 0.4 * abs(was - 1.0)
    assert now == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("step", "how", "id"),
    [
        (0.15, np.trunc, "imu.digits_dead"),
        (0.2, np.trunc, "imu.digits_dead"),
    ],
)
def test_digits_that_nothing_mends_are_refused(drive, step, how, id):
    found = correct_drive(to_digits(drive, ACCEL, step, how)).problems[0]
    assert found.serious
    assert found.id == id


@pytest.mark.parametrize("how", [np.trunc, np.round])
def test_a_gyro_with_few_digits_has_no_wrong_sign(drive, how):
    settled = correct_drive(to_digits(drive, GYRO, 0.02, how))
    assert not any(p.serious for p in settled.problems)


def test_a_mirrored_gyro_with_all_digits_is_still_refused():
    made = simulate_car(replace(make_scenario("car", seed=88), duration=900.0)).drive
    nod = made.signals["gyro_y"]
    mirrored = made.with_signals(Signal(nod.name, nod.time, -nod.values))
    assert any(p.id == "imu.gyro_sign" for p in correct_drive(mirrored).problems if p.serious)


@pytest.mark.parametrize("axes", [ACCEL + GYRO, ACCEL])
def test_an_inertial_sensor_averaged_to_a_second_is_slow_and_not_in_milliseconds(drive, axes):
    each = round(1.0 / drive.signals["accel_x"].period)
    slow = drive.without(*(n for n in GYRO if n not in axes))
    for name in axes:
        s = drive.signals[name]
        count = len(s) // each * each
        mean = s.values[:count].reshape(-1, each).mean(axis=1)
        slow = slow.with_signals(Signal(name, s.time[:count:each], mean))
    found = correct_drive(slow)
    assert not found.has("accel_x")
    assert "imu.slow_out" in [p.id for p in found.problems]
    assert not any(p.serious for p in found.problems)
    late = [slow.signals[n] for n in axes]
    late = slow.with_signals(*(Signal(s.name, s.time * 1e3, s.values) for s in late))
    assert correct_drive(late).problems[0].id == "clock.milliseconds"
