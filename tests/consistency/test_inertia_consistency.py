"""Innovations and errors of the ride's filter are as large as it says."""

import numpy as np
import pytest
from scipy.stats import chi2

from weighbridge import InertiaSettings
from weighbridge.inertia import estimate, ride_samples
from weighbridge.papers.nguyen2024 import suspension_of
from weighbridge.simulation import TRUCK, RideScenario, RideSensors, simulate_ride

RUNS = 25


@pytest.fixture(scope="module")
def rides():
    """Return normalised errors (runs, 3), mean squared innovations, and samples in each run."""
    rng = np.random.default_rng(21)
    errors, innovations, count = [], [], 0
    sensors = RideSensors(rate=400.0)
    ride = suspension_of(TRUCK, sensors)
    # What does not change is told not to change: then the bounds are sharp.
    settings = InertiaSettings(drift=0.0, offset_drift=0.0)
    for _ in range(RUNS):
        made = simulate_ride(
            RideScenario(
                vehicle=TRUCK.loaded(rng.uniform(0.7, 1.6)),
                road_class=str(rng.choice(list("BCD"))),
                speed=rng.uniform(8.0, 25.0),
                duration=6.0,
                zero_mass=TRUCK.sprung_mass,
                sensors=sensors,
                seed=int(rng.integers(1_000_000)),
            )
        )
        track = estimate(ride_samples(made.drive), ride, settings=settings)
        true = track.reference / made.inertias[-1]
        errors.append((track.alpha[-1] - true) / track.alpha_std[-1])
        late = track.time > 2.0
        innovations.append(np.mean((track.innovation**2 / track.innovation_var)[late], axis=0))
        count = int(np.count_nonzero(late))
    return np.array(errors), np.array(innovations), count


def test_errors_have_the_spread_they_are_said_to_have(rides):
    errors, _, _ = rides
    low, high = chi2.ppf((0.001, 0.999), errors.size)
    assert low < np.sum(errors**2) < high


def test_innovations_have_the_spread_they_are_said_to_have(rides):
    _, innovations, count = rides
    number = innovations.size * count
    low, high = chi2.ppf((0.001, 0.999), number) / number
    # The chord's doubt counts as noise though it is none: a percent of room below.
    assert low - 0.01 < np.mean(innovations) < high
