"""Every method leaves open that an accelerometer's scale may be off where the drive doubts it."""

from dataclasses import replace

import numba
import pytest

import weighbridge as wb
from weighbridge import Signal
from weighbridge.simulation import Sensors, make_scenario, simulate_car

pytestmark = pytest.mark.skipif(
    numba.config.DISABLE_JIT, reason="whole drives take minutes without the compiler"
)


@pytest.fixture(scope="module")
def weighed():
    """Weigh a drive whose accelerometer reads 10 % too little along the vehicle, and as it was."""
    scenario = make_scenario("electric", payload=100.0, seed=977)
    made = simulate_car(replace(scenario, duration=900.0, sensors=Sensors(imu_rate=50.0)))
    car = wb.calibrate([made.drive], mass=float(made.truth.mass[0]))
    ahead = made.drive.signals["accel_x"]
    scaled = made.drive.with_signals(Signal(ahead.name, ahead.time, 0.9 * ahead.values))
    mass = float(made.truth.mass.mean())
    return mass, *(
        {w.method: w for w in wb.weigh(drive, car).compare()} for drive in (made.drive, scaled)
    )


@pytest.mark.parametrize("method", ["joint", "rls", "robust-rls", "ekf", "hybrid"])
def test_the_interval_holds_the_mass(weighed, method):
    mass, plain, scaled = weighed
    assert any(text.id == "imu.gain_unsure" for text in scaled["joint"].problems)
    low, high = scaled[method].interval(0.95)
    assert low <= mass <= high
    assert scaled[method].std > 1.5 * plain[method].std
