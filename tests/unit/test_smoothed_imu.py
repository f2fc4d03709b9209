"""An accelerometer that was smoothed does not shake as a road shakes it."""

from dataclasses import replace

import numpy as np
import pytest
from numba import config

import weighbridge as wb
from weighbridge import Signal
from weighbridge.checks import check_drive, correct_drive
from weighbridge.simulation import make_scenario, simulate_car
from weighbridge.vehicle import Known, describe

IMU_SIGNALS = tuple(f"{kind}_{axis}" for kind in ("accel", "gyro") for axis in "xyz")


def refusals(drive):
    return [p for p in check_drive(drive.without("altitude")) if p.id == "imu.smoothed"]


@pytest.fixture(scope="module", params=[("car", 51), ("truck", 52), ("electric", 53)])
def drive(request):
    name, seed = request.param
    return simulate_car(replace(make_scenario(name, seed=seed), duration=600.0)).drive


def smoothed(drive, seconds, *, since=-np.inf):
    signals = []
    for name in IMU_SIGNALS:
        s = drive.signals[name]
        many = round(seconds / s.period)
        level = s.values[0]
        mean = np.convolve(s.values - level, np.full(many, 1.0 / many), "same") + level
        signals.append(Signal(name, s.time, np.where(s.time > since, mean, s.values)))
    return drive.with_signals(*signals)


def test_a_raw_sensor_and_short_means_are_fine(drive):
    assert not refusals(drive)
    assert not refusals(smoothed(drive, 0.3))


@pytest.mark.parametrize("seconds", [2.0, 3.0])
def test_long_means_are_refused(drive, seconds):
    (found,) = refusals(smoothed(drive, seconds))
    assert found.serious
    assert found.id == "imu.smoothed"


def test_a_part_is_enough_and_named(drive):
    (found,) = refusals(smoothed(drive, 3.0, since=300.0))
    assert (found.start, found.end) == pytest.approx((300.0, 600.0), abs=0.02)


def test_a_sensor_of_few_samples_cannot_tell(drive):
    slow = (
        Signal(n, drive.signals[n].time[::100], drive.signals[n].values[::100]) for n in IMU_SIGNALS
    )
    assert not refusals(drive.with_signals(*slow))
    standing = replace(drive.signals["vehicle_speed"], values=0.0 * drive.speed.values)
    assert not refusals(smoothed(drive.with_signals(standing), 3.0))


def test_with_heights_a_smoothed_sensor_is_left_out_and_the_rest_weighs(drive):
    found = correct_drive(smoothed(drive, 3.0))
    assert not any(p.serious for p in found.problems)
    assert not set(found.signals) & set(IMU_SIGNALS)
    assert {"vehicle_speed", "altitude"} <= set(found.signals)
    assert [p.id for p in found.problems if p.id.startswith("imu.")] == ["imu.smoothed_out"]


def test_without_heights_or_where_a_person_vouches_nothing_is_left_out(drive):
    flat = correct_drive(smoothed(drive.without("altitude"), 3.0))
    assert any(p.serious and p.id == "imu.smoothed" for p in flat.problems)
    vouched = replace(drive, info=replace(drive.info, trusted=IMU_SIGNALS))
    kept = correct_drive(smoothed(vouched, 3.0))
    assert set(IMU_SIGNALS) <= set(kept.signals)


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="whole drives take minutes uncompiled")
def test_means_over_a_tenth_of_a_second_weigh_a_truck():
    """Means at 10 Hz, as trackers send them, are as good as the raw sensor."""
    known, loaded = (
        simulate_car(replace(make_scenario(name, payload=kg, seed=seed), duration=900.0))
        for name, kg, seed in (("truck-calibration", 2000.0, 61), ("truck", 11_000.0, 62))
    )
    papers = Known(kind="truck", tare=9000.0, gross=18_000.0, torque="percent")
    slow = (tenths(d.drive) for d in (known, loaded))
    truck = wb.calibrate([next(slow)], [known.drive.info.mass], vehicle=describe(papers).vehicle)
    w = wb.weigh(next(slow), truck)
    true = loaded.drive.info.mass
    assert w.mass == pytest.approx(true, rel=0.03)
    assert w.interval(0.95)[0] < true < w.interval(0.95)[1]
    assert any(p.id == "mass.above_permitted" and p.values["gross"] == 18000.0 for p in w.problems)


def tenths(drive):
    """Means of the inertial sensor over 0.1 s."""
    signals = []
    for name in IMU_SIGNALS:
        s = drive.signals[name]
        bins = np.floor(s.time / 0.1)
        _, at, count = np.unique(bins, return_index=True, return_counts=True)
        means = [np.add.reduceat(x, at) / count for x in (s.time, s.values)]
        signals.append(Signal(name, *means))
    return drive.with_signals(*signals)
