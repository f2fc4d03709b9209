"""Vehicles and undamaged drives that the study of faults damages."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from accuracy_drives import FULL, bare, calibrated, scenario, shared_out

from weighbridge.papers.jensen2022_drives import without_weather
from weighbridge.pipeline.weighing import Weighing, weigh
from weighbridge.signals import Drive
from weighbridge.simulation import (
    Polling,
    SimulatedCar,
    SimulatedDrive,
    random_vehicle,
    simulate_car,
    usual_polling,
)
from weighbridge.vehicle.model import Vehicle

METHODS: Final = ("joint", "rls", "robust-rls", "ekf", "hybrid")
"""Methods that give a mass; ``speed-ekf`` gives none."""

KINDS: Final = {"car": "petrol_dct", "van": "van", "electric": "electric", "truck": "truck"}
"""Kind of each vehicle; ``long`` is the car over its whole route."""

DURATION: Final = 1500.0
IMU_RATE: Final = 100.0

_VAN_POLLING: Final = Polling(
    fast=("vehicle_speed", "engine_speed", "engine_torque_fraction"),
    slow=("reference_torque", "ambient_temperature", "barometric_pressure"),
    rate=5.0,
)


@dataclass(frozen=True)
class Subject:
    """One vehicle, calibrated undamaged, with one drive to damage.

    Attributes
    ----------
    mean, final : mass over the drive, and at its end [kg]
    known, masses : drives of the calibration and what they weighed [kg]
    known_of : what was known of the vehicle before, tare and gross mass among it; ``vehicle``
        has neither, so that no fault is found by the luck of its mass alone
    other : drive of another vehicle of the kind
    undamaged : mass of the undamaged drive by method [kg]; NaN where there is none
    stds : its standard deviation by method [kg]
    warnings : of the undamaged drive, without their numbers
    """

    name: str
    vehicle: Vehicle
    drive: Drive
    mean: float
    final: float
    known: tuple[Drive, ...]
    masses: tuple[float, ...]
    known_of: Vehicle
    other: Drive
    undamaged: dict[str, float]
    stds: dict[str, float]
    warnings: frozenset[str]

    def truth(self, method: str) -> float:
        """Mass that a method is judged by: joint reckons with the fuel [kg]."""
        return self.final if method == "joint" else self.mean

    def error(self, method: str) -> float:
        """Error of the undamaged drive [-]; 0 where it was not weighed."""
        mass = self.undamaged[method]
        return mass / self.truth(method) - 1.0 if np.isfinite(mass) else 0.0


def polling(car: SimulatedCar) -> Polling:
    """What is asked of a vehicle: the van tells torque percent (PID 62), the others the usual."""
    if car.kind == "van":
        return _VAN_POLLING
    return replace(usual_polling(car), rate=5.0) if car.electric else usual_polling(car)


def without_numbers(text: str) -> str:
    """Put one mark in place of each number, so that sentences can be told apart by kind."""
    return re.sub(r"[-+]?\d[\d.,]*(e[-+]?\d+)?", "#", text)


def weigh_by_all(drive: Drive, vehicle: Vehicle) -> tuple[Weighing, ...]:
    """Weigh by every method of `METHODS`, navigation shared."""
    found = {w.method: w for w in weigh(drive, vehicle).compare()}
    return tuple(found[method] for method in METHODS)


def build(
    name: str, seed: int, with_long: bool = False, duration: float = DURATION
) -> list[Subject]:
    """Simulate and calibrate one vehicle; return what can be damaged of it."""
    kind = KINDS[name]
    rng = np.random.default_rng([seed, list(KINDS).index(name)])
    car, another = random_vehicle(rng, kind), random_vehicle(rng, kind)
    first = 1000 * seed + 100 * list(KINDS).index(name)

    def drive(
        part: float, number: int, car: SimulatedCar = car, duration: float | None = duration
    ) -> SimulatedDrive:
        load = part * FULL[car.kind] * car.mass
        drawn = scenario(car, rng, load=load, seed=first + number, polling=polling(car))
        # Outages of the fixes are faults here, and so are put in by themselves.
        sensors = replace(drawn.sensors, imu_rate=IMU_RATE, gnss_outages=())
        return simulate_car(replace(drawn, duration=duration, sensors=sensors))

    known = [drive(part, k) for k, part in enumerate((0.0, 0.5, 0.9))]
    heaviest = 1.05 * (1.0 + FULL[car.kind]) * car.mass
    limits = {"tare": car.mass, "gross": heaviest}
    vehicle = calibrated(car, known)
    known_of = replace(bare(car), **limits)
    made = {name: drive(float(rng.uniform(0.1, 0.8)), 10)}
    other = drive(float(rng.uniform(0.1, 0.8)), 11, another)
    if with_long:
        made["long"] = drive(float(rng.uniform(0.1, 0.8)), 12, duration=None)
    subjects = []
    for subject, simulated in made.items():
        cleared = without_weather(simulated.drive)
        damaged = replace(cleared, info=replace(cleared.info, mass=None, vehicle=None))
        weighed = weigh_by_all(damaged, vehicle)
        subjects.append(
            Subject(
                name=subject,
                vehicle=vehicle,
                drive=damaged,
                mean=float(np.mean(simulated.truth.mass)),
                final=float(simulated.truth.mass[-1]),
                known=tuple(without_weather(k.drive) for k in known),
                masses=tuple(float(k.truth.mass[0]) for k in known),
                known_of=known_of,
                other=without_weather(other.drive),
                undamaged={w.method: w.mass for w in weighed},
                stds={w.method: w.std for w in weighed},
                warnings=frozenset(without_numbers(t) for w in weighed for t in w.warnings),
            )
        )
    return subjects


def build_all(names: Sequence[str], seed: int) -> dict[str, Subject]:
    """Build the subjects of these names."""
    wanted = [n for n in KINDS if n in names or (n == "car" and "long" in names)]
    jobs = [(build, (n, seed, n == "car" and "long" in names)) for n in wanted]
    return {s.name: s for part in shared_out(jobs) for s in part}
