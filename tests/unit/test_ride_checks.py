"""What is said of rides that cannot be put on one clock."""

import numpy as np
from tests.noted import error

from weighbridge import Drive, DriveError, Problem, Signal
from weighbridge.inertia import ride_samples
from weighbridge.simulation import RideScenario, simulate_ride


def test_a_clock_that_left_one_row_is_told_by_its_cause():
    made = simulate_ride(RideScenario(duration=3.0, seed=3)).drive
    signals = {name: Signal(name, np.zeros(1), np.zeros(1)) for name in made.signals}
    reversed_clock = Problem.of(
        "clock.backwards", source="ride.csv", back="1 s", at="2 s", lost=99, rows=100
    )
    drive = Drive(name="back", signals=signals, problems=(reversed_clock,))
    with error(DriveError, "back ride.csv 99 100") as told:
        ride_samples(drive)
    assert reversed_clock.text in str(told.value)
