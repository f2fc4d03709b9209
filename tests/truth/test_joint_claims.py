"""What the joint estimator must stand: other loggers, a wrong start, a cruise."""

from dataclasses import replace
from functools import cache
from importlib import import_module

import numpy as np
import pytest

import weighbridge as wb
from weighbridge import Signal, Status, Vehicle
from weighbridge.balance import force_balance
from weighbridge.estimators import ESTIMATORS
from weighbridge.navigation import find_motion
from weighbridge.simulation import (
    ELECTRIC,
    MIDSIZE,
    Polling,
    Scenario,
    Sensors,
    flat_route,
    mixed_route,
    simulate_car,
)
from weighbridge.vehicle import Driveline, RoadLoad, Timing, TorqueModel

DRIVES = 5
MOST_MOVED = 0.003
"""What another logger, or another start, may move the mean by [-]."""


def town(seed, payload, *, length=1.0, rate=4.0, noise=0.02, roughness=1.0):
    """Ten minutes of town and hills, or more, recorded by some logger."""
    made = Scenario(
        name=f"town {seed}",
        car=MIDSIZE,
        route=mixed_route(
            seed,
            out=[("city", 1500 * length), ("hills", 1800 * length)],
            back=[("hills", 1800 * length), ("city", 1500 * length)],
        ),
        payload=payload,
        seed=seed,
        wind_speed=4.0,
        sensors=Sensors(imu_rate=50.0),
    )
    sizes = dict.fromkeys(("imu_noise", "imu_vibration", "roughness"), roughness)
    return replace(
        made,
        polling=replace(made.polling, rate=rate, torque_noise=noise),
        effects=replace(made.effects, **sizes),
    )


@cache
def recorded(k, **logger):
    return simulate_car(town(3200 + k, 80.0 * k, length=3.0, **logger))


def mean_mass(made):
    return float(np.mean(made.truth.mass))


def ratio(car, k, **logger):
    """Mass of a drive over the true one, by some logger."""
    made = recorded(k, **logger)
    weighing = wb.weigh(made.drive, car)
    assert weighing.method == "joint"
    return weighing.mass / mean_mass(made)


def calibrated(**logger):
    known = [
        simulate_car(town(3100 + k, load, length=3.0, **logger))
        for k, load in enumerate((0.0, 300.0))
    ]
    return wb.calibrate([made.drive for made in known], mass=[mean_mass(made) for made in known])


@pytest.fixture(scope="module")
def car():
    return calibrated()


@pytest.fixture(scope="module")
def usual(car):
    """Mass of a drive over the true one, by the logger that recorded the calibration."""
    return cache(lambda k: ratio(car, k))


def moved(car, usual, drives, **logger):
    """What another logger changes, drive by drive (n,) [-]."""
    return np.array([ratio(car, k, **logger) / usual(k) - 1.0 for k in range(drives)])


def assert_still(off, most, least_chance):
    """The mean stays, and the drives scatter so little that it would show if it did not."""
    chance = 2.0 * off.std(ddof=1) / np.sqrt(off.size)
    assert chance < least_chance
    assert abs(off.mean()) < most + chance


@pytest.mark.parametrize(
    ("logger", "drives", "most", "chance"),
    [
        ({"rate": 10.0}, DRIVES, MOST_MOVED, 0.005),
        ({"rate": 2.0}, DRIVES, MOST_MOVED, 0.011),
        ({"roughness": 2.0}, 3, MOST_MOVED, 0.003),
        # A load is clipped at zero: over fourteen drives this noise moves the mean by 0.42 %.
        ({"noise": 0.04}, DRIVES, 0.005, 0.004),
    ],
    ids=["10 Hz", "2 Hz", "rough", "noisy"],
)
def test_another_logger_does_not_move_the_mean(car, usual, logger, drives, most, chance):
    assert_still(moved(car, usual, drives, **logger), most, chance)


def test_another_logger_with_its_own_file_does_not_move_the_mean(usual):
    rough = {"roughness": 2.0}
    assert_still(moved(calibrated(**rough), usual, DRIVES, **rough), MOST_MOVED, 0.003)


def test_noise_of_a_measured_torque_does_not_move_the_mean():
    """One file, the same drives, torque four times as noisy: drawn again and again."""
    full = max(ELECTRIC.curve_torque)
    electric = Vehicle(
        tare=ELECTRIC.mass,
        driveline=Driveline(
            gearings=(ELECTRIC.final_drive / ELECTRIC.wheel_radius,),
            engine_inertia=ELECTRIC.engine_inertia,
            wheel_inertia=ELECTRIC.wheel_inertia,
            wheel_radius=ELECTRIC.wheel_radius,
            efficiency=1.0,
        ),
        road_load=RoadLoad(
            drag_area=ELECTRIC.drag_area, rolling_coefficient=ELECTRIC.rolling_coefficient
        ),
        torque=TorqueModel(source="measured", noise=0.02 * full),
        timing=Timing(torque_delay=0.1),
    )
    polling = Polling(fast=("vehicle_speed", "engine_speed", "engine_torque"))
    rng = np.random.default_rng(3400)
    moved = []
    for k in range(2):
        made = simulate_car(
            replace(town(3400 + k, 100.0 * k, length=1.5), car=ELECTRIC, polling=polling)
        )
        motion, torque = find_motion(made.drive), made.drive.signals["engine_torque"]
        for _ in range(9):
            drawn = full * rng.standard_normal(torque.values.size)
            little, much = (
                made.drive.with_signals(
                    Signal(torque.name, torque.time, torque.values + noise * drawn)
                )
                for noise in (0.01, 0.04)
            )
            a, b = (
                ESTIMATORS["joint"].track(force_balance(d, electric, motion), electric).mass
                for d in (little, much)
            )
            moved.append(b / a - 1.0)
    chance = 2.0 * np.std(moved, ddof=1) / np.sqrt(len(moved))
    assert chance < 0.006
    assert abs(np.mean(moved)) < MOST_MOVED + chance


@pytest.mark.parametrize("factor", [1.0 / 3.0, 3.0])
def test_a_start_three_times_off_costs_no_accuracy(car, usual, factor, monkeypatch):
    batch = import_module(ESTIMATORS["joint"].estimate.__module__)
    guess = batch.first_guess
    before = [usual(k) for k in range(2)]
    monkeypatch.setattr(batch, "first_guess", lambda phi, y: factor * guess(phi, y))
    after = [ratio(car, k) for k in range(2)]
    assert np.max(np.abs(np.divide(after, before) - 1.0)) < MOST_MOVED


def cruise(seed, speed_step):
    """Drive off and go on at 50 km/h, in a gear of the town, for twenty minutes on the flat."""
    made = Scenario(
        name="cruise",
        car=MIDSIZE,
        route=flat_route(20_000.0, limit=50.0 / 3.6),
        payload=150.0,
        seed=seed,
        duration=1350.0,
    )
    return simulate_car(
        replace(
            made,
            effects=made.effects.without("traffic"),
            polling=replace(made.polling, speed_step=speed_step),
        )
    )


@pytest.mark.parametrize("begin", [0.0, 150.0], ids=["launched", "cruising"])
@pytest.mark.parametrize("speed_step", [1.0 / 256.0, 1.0])
def test_a_cruise_is_never_a_confident_wrong_mass(car, speed_step, begin):
    made = cruise(3301, speed_step)
    weighing = wb.weigh(made.drive.between(begin, 1350.0), car)
    if weighing.status is not Status.NOT_EXCITED:
        low, high = weighing.interval(0.95)
        assert low <= mean_mass(made) <= high
