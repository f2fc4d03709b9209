"""An accelerometer that was smoothed does not shake as a road shakes it."""

from dataclasses import replace

import numpy as np
import pytest

from weighbridge.checks.smoothed_imu import check_smoothed
from weighbridge.signals import Signal
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.simulation import make_scenario, simulate_car


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
    assert not list(check_smoothed(drive, None))
    assert not list(check_smoothed(smoothed(drive, 0.3), None))


@pytest.mark.parametrize("seconds", [2.0, 3.0])
def test_long_means_are_refused(drive, seconds):
    (found,) = check_smoothed(smoothed(drive, seconds), None)
    assert found.serious
    assert "it was smoothed, and quick changes of the motion are lost" in found.text


def test_a_part_is_enough_and_named(drive):
    (found,) = check_smoothed(smoothed(drive, 3.0, since=300.0), None)
    assert "from 300 to 600 s" in found.text


def test_a_sensor_of_few_samples_cannot_tell(drive):
    slow = (
        Signal(n, drive.signals[n].time[::100], drive.signals[n].values[::100]) for n in IMU_SIGNALS
    )
    assert not list(check_smoothed(drive.with_signals(*slow), None))
    standing = replace(drive.signals["vehicle_speed"], values=0.0 * drive.speed.values)
    assert not list(check_smoothed(smoothed(drive.with_signals(standing), 3.0), None))
