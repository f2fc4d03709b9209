"""Drives and vehicles of the study of accuracy, and how its work is shared out."""

from __future__ import annotations

import math
import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import Any, Final

import numpy as np

from weighbridge.calibration.run import run_calibration
from weighbridge.calibration.settings import CalibrationSettings
from weighbridge.papers.jensen2022_drives import without_weather
from weighbridge.pipeline.weighing import weigh
from weighbridge.simulation import (
    Polling,
    Scenario,
    SimulatedCar,
    SimulatedDrive,
    jensen_route,
    random_habits,
    random_vehicle,
    short_route,
    simulate_car,
    usual_polling,
)
from weighbridge.vehicle.model import Driveline, Vehicle

KINDS: Final = ("petrol_manual", "petrol_dct", "diesel_automatic", "electric", "van", "truck")
FULL: Final = {"car": 0.3, "van": 0.65, "truck": 0.85}
"""Largest load over empty mass [-]."""

WORKERS: Final = 2


def scenario(
    car: SimulatedCar,
    rng: np.random.Generator,
    *,
    load: float,
    seed: int,
    polling: Polling | None = None,
) -> Scenario:
    """Draw one ordinary drive."""
    made = Scenario(
        name=f"drive {seed}",
        car=car,
        route=jensen_route(int(rng.integers(1000, 2000))),
        payload=load,
        seed=seed,
        # A generator of its own: wind, temperature and route stay what they are.
        habits=random_habits(np.random.default_rng([seed, 41])),
        polling=polling or usual_polling(car),
        wind_speed=float(rng.uniform(0.0, 10.0)),
        wind_from=float(rng.uniform(0.0, 2.0 * math.pi)),
        ambient_temperature=float(rng.uniform(268.0, 303.0)),
        aggressiveness=float(rng.uniform(0.8, 1.25)),
    )
    outages = ()
    if rng.random() < 0.3:
        begin = float(rng.uniform(300.0, 1200.0))
        outages = ((begin, begin + float(rng.uniform(30.0, 180.0))),)
    return replace(
        made,
        effects=replace(made.effects, warm_up=float(rng.uniform(0.0, 1.0))),
        sensors=replace(made.sensors, gnss_outages=outages),
    )


def bare(car: SimulatedCar) -> Vehicle:
    """Return what is known of a vehicle before its calibration: class and rolling radius."""
    return Vehicle(kind=car.kind, driveline=Driveline(wheel_radius=car.wheel_radius))


def mean_mass(made: SimulatedDrive) -> float:
    """Return the mean mass over the drive [kg], for methods that know one mass alone."""
    return float(np.mean(made.truth.mass))


def final_mass(made: SimulatedDrive) -> float:
    """Return the mass at the end of the drive [kg]: fuel has burnt."""
    return float(made.truth.mass[-1])


def calibrated(
    car: SimulatedCar, known: Sequence[SimulatedDrive], *, method: str = "joint"
) -> Vehicle:
    """Return the vehicle file that drives of known mass make.

    ``joint`` takes the mass with which a drive begins and reckons with the fuel; the others
    know one mass, and are given the mean.
    """
    return run_calibration(
        [without_weather(made.drive) for made in known],
        [float(made.truth.mass[0]) if method == "joint" else mean_mass(made) for made in known],
        vehicle=bare(car),
        settings=CalibrationSettings(method=method),
    ).vehicle


def known_drives(
    car: SimulatedCar, rng: np.random.Generator, seed: int, *, count: int = 3
) -> list[SimulatedDrive]:
    """Drive for a calibration: empty, half loaded, nearly full."""
    return [
        simulate_car(scenario(car, rng, load=part * FULL[car.kind] * car.mass, seed=seed + k))
        for k, part in enumerate((0.0, 0.5, 0.9)[:count])
    ]


def compile_all() -> None:
    """Run everything once, so that the workers inherit compiled kernels."""
    car = random_vehicle(np.random.default_rng(0), "petrol_dct")
    made = simulate_car(Scenario(name="first", car=car, route=short_route(), seed=0))
    weigh(made.drive, calibrated(car, [made]))


def _do(job: tuple[Callable[..., list[Any]], tuple[Any, ...]]) -> list[Any]:
    work, given = job
    return work(*given)


def shared_out(
    jobs: Sequence[tuple[Callable[..., list[Any]], tuple[Any, ...]]],
) -> list[list[Any]]:
    """Do the jobs, each a function and what it is given, in processes; in order."""
    if "fork" not in multiprocessing.get_all_start_methods():
        return [_do(job) for job in jobs]
    count = min(WORKERS, os.cpu_count() or 1)
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(count, mp_context=context) as pool:
        return list(pool.map(_do, jobs))
