"""What a long drive takes of the memory, and that its stretches are as the whole."""

import tracemalloc
from dataclasses import replace

from weighbridge.navigation.inertial import inertial_motion
from weighbridge.simulation import make_scenario, simulate_car


def bytes_per_sample(duration):
    """Bytes that navigation takes at most for each inertial sample of a drive [B]."""
    scenario = make_scenario("car", seed=5)
    drive = simulate_car(replace(scenario, duration=duration)).drive
    tracemalloc.start()
    try:
        inertial_motion(drive)
        return tracemalloc.get_traced_memory()[1] / len(drive.signals["accel_x"])
    finally:
        tracemalloc.stop()


def test_memory_grows_with_the_samples_and_slowly():
    # What is compiled and imported on the way is no part of it.
    bytes_per_sample(200.0)
    # Columns of doubles: the inertial signals themselves are seven, beside these.
    long = bytes_per_sample(2000.0)
    assert long < 8 * 10
    assert long < 1.05 * bytes_per_sample(1000.0)
