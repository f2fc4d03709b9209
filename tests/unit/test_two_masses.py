"""Masses of one drive with the inertial sensor and without it, and their mean."""

from dataclasses import replace

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.navigation import without_accelerometer
from weighbridge.pipeline.weighing import ALIKE
from weighbridge.simulation import Sensors, make_scenario, simulate_car


def made(name, seed, **changes):
    scenario = replace(make_scenario(name, seed=seed), sensors=Sensors(imu_rate=10.0))
    return simulate_car(replace(scenario, duration=1200.0, **changes))


@pytest.fixture(scope="module")
def slow():
    """A drive whose inertial sensor is slow and noisy, its mass, and a file from a quieter one."""
    known, weighed = made("car-calibration", 61), made("car", 62, payload=250.0)
    file = wb.calibrate([known.drive], float(known.truth.mass[0]))
    rng, drive = np.random.default_rng(5), weighed.drive
    for name in ("accel_x", "accel_y", "accel_z"):
        values = drive.signals[name].values
        noisy = values + rng.normal(0.0, 0.6, values.size)
        drive = drive.with_signals(replace(drive.signals[name], values=noisy))
    return drive, float(weighed.truth.mass[-1]), replace(file, gross=2600.0)


@pytest.fixture(scope="module")
def apart(slow):
    """Both masses, each alone."""
    drive, _, file = slow
    own = wb.weigh(drive, replace(file, without_accelerometer=None)).result
    return own, wb.weigh(without_accelerometer(drive), file).result


def test_the_mass_is_the_mean_of_both(slow, apart):
    drive, mass, file = slow
    (own, without), weighed = apart, wb.weigh(drive, file)
    assert weighed.mass == own.joined(without, ALIKE).mass
    assert min(own.mass, without.mass) < weighed.mass < max(own.mass, without.mass)
    assert weighed.std == min(own.std, without.std)
    assert abs(weighed.mass - mass) < 1.96 * weighed.std
    (told,) = [p for p in weighed.problems if p.id == "imu.weighed_twice"]
    assert f"{without.mass:.0f} kg" in told.text


def test_what_is_unlikely_of_a_mass_is_said_of_the_mean(slow, apart):
    drive, _, file = slow
    own, without = apart
    mean = own.joined(without, ALIKE).mass
    for gross, above in ((mean + 1.0, False), (mean - 1.0, True)):
        found = wb.weigh(drive, replace(file, gross=gross)).problems
        assert any(p.id == "mass.above_permitted" for p in found) == above


def test_published_methods_weigh_as_they_are(slow):
    drive, _, file = slow
    assert wb.weigh(drive, file, "rls").reason_id == "imu.too_noisy"


def test_weights_are_those_of_least_variance(apart):
    track = apart[0]
    first, second = (
        replace(track, mass=m, std=s, doubt=0.0) for m, s in ((1000.0, 30.0), (1080.0, 40.0))
    )
    joined = first.joined(second, 0.5)
    # 900 - 600 over 900 + 1600 - 1200.
    assert joined.mass == pytest.approx(1000.0 + 80.0 * 300.0 / 1300.0)
    assert second.joined(first, 0.5).mass == pytest.approx(joined.mass)
    assert joined.std == 30.0
    assert joined.running_mass[-1] / track.running_mass[-1] == pytest.approx(joined.mass / 1000.0)


def test_a_doubt_of_the_drive_does_not_change_the_weights(apart):
    first, second = (
        replace(apart[0], mass=m, std=s, doubt=0.0) for m, s in ((1000.0, 30.0), (1050.0, 40.0))
    )
    mean = first.joined(second, 0.5)
    doubted = first.doubted(0.05).joined(second.doubted(0.05), 0.5)
    assert 1000.0 < mean.mass < 1020.0
    assert doubted.mass == pytest.approx(mean.mass)
    assert doubted.std == pytest.approx(np.hypot(30.0, 50.0))


@pytest.mark.parametrize(
    ("mass", "std", "correlation"),
    [
        (1300.0, 40.0, 0.5),  # they contradict each other
        (1010.0, 70.0, 0.5),  # no weight beside a surer one
        (1010.0, 40.0, 1.0),  # the same errors
        (1000.0, 30.0, 1.0),
    ],
)
def test_the_surer_one_counts_alone(apart, mass, std, correlation):
    sure = replace(apart[0], mass=1000.0, std=30.0, doubt=0.0)
    other = replace(sure, mass=mass, std=std)
    assert sure.joined(other, correlation) is sure
    if std > 30.0:
        assert other.joined(sure, correlation) is sure
