"""An accelerometer that vibration shifts at some engine speeds is told, and nothing else is."""

from dataclasses import replace

import numpy as np
import pytest
from numba import config
from scipy.signal import lfilter

from weighbridge import Signal
from weighbridge.balance import shaken
from weighbridge.checks import correct_drive
from weighbridge.navigation import find_motion
from weighbridge.simulation import Sensors, make_scenario, simulate_car

pytestmark = pytest.mark.skipif(
    bool(config.DISABLE_JIT), reason="whole drives take minutes without the compiler"
)


@pytest.fixture(scope="module", params=[("car", 86), ("truck", 87)])
def drive(request):
    name, seed = request.param
    scenario = replace(make_scenario(name, seed=seed), sensors=Sensors(imu_rate=50.0))
    return simulate_car(replace(scenario, duration=1000.0)).drive


def told(drive):
    drive = correct_drive(drive)
    return shaken(drive, find_motion(drive))


def test_a_sound_sensor_is_not_doubted(drive):
    assert told(drive) is None


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_band_of_engine_speed_that_shifts_the_accelerometer_is_told(drive, sign):
    ahead = drive.signals["accel_x"]
    engine = drive.signals["engine_speed"]
    revs = np.interp(ahead.time, engine.time, engine.values)
    middle = np.percentile(revs, 70.0)
    shift = sign * 0.4 * np.exp(-(((revs - middle) / (0.08 * middle)) ** 2))
    found = told(drive.with_signals(Signal(ahead.name, ahead.time, ahead.values + shift)))
    assert found.id == "imu.shaken"
    assert found.values["rpm"] == pytest.approx(middle * 30.0 / np.pi, rel=0.25)


@pytest.mark.parametrize("lag", [1.0, 3.0])
def test_a_speed_that_is_late_is_none(drive, lag):
    speed = drive.signals["vehicle_speed"]
    share = min(speed.period / lag, 1.0)
    late, _ = lfilter([share], [1.0, share - 1.0], speed.values, zi=[0.0])
    assert told(drive.with_signals(Signal(speed.name, speed.time, late))) is None


def test_a_speed_in_steps_of_5_kmh_is_none(drive):
    speed = drive.signals["vehicle_speed"]
    coarse = np.floor(speed.values * 3.6 / 5.0) * 5.0 / 3.6
    assert told(drive.with_signals(Signal(speed.name, speed.time, coarse))) is None
