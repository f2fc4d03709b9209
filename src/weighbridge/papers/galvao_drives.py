"""The small car of Galvão et al., and its simulated drives."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.calibration.speed_fit import Nominal
from weighbridge.signals import Drive, Signal
from weighbridge.simulation import (
    COMPACT,
    Effects,
    Polling,
    Route,
    Scenario,
    Sensors,
    mixed_route,
)

if TYPE_CHECKING:
    from weighbridge.simulation import SimulatedCar, SimulatedDrive

DRAG_AREA: Final = 0.35 * 2.15
"""Drag coefficient times frontal area [m^2] (sec. 2.1)."""

CAR: Final = replace(
    COMPACT, name="compact car of 1092 kg", mass=1092.0, wheel_radius=0.29, drag_area=DRAG_AREA
)
"""A small petrol car with the paper's mass, driver included, wheel radius and drag area;
engine and gearbox, which the paper does not give, are those of our small car."""

NOMINAL: Final = Nominal(
    force_gain=6.39 * 0.90 / 0.29,
    drag=1.22 * DRAG_AREA,
    rolling_coefficient=0.01,
    rotating_mass=71.0,
)
"""Constants of the model (sec. 2.1)."""

DURATION: Final = 1200.0
"""Of a test, about [s] (sec. 5.1)."""


def easy_route(seed: int) -> Route:
    """Return a country road with few bends, low grades and no stops."""
    long = ("country", 30_000.0)
    made = mixed_route(seed, out=[long], back=[long], name="country road, few bends, low grades")  # type: ignore[list-item]
    return replace(
        made,
        grade=0.35 * made.grade,
        heading=0.3 * made.heading,
        stop_chance=0.0 * made.stop_chance,
    )


def scenario(
    seed: int,
    route: Route,
    *,
    car: SimulatedCar = CAR,
    payload: float = 0.0,
    traffic: bool = False,
) -> Scenario:
    """Make a drive of which nothing but the vehicle speed is recorded, at 4 Hz in km/h."""
    effects = Effects() if traffic else Effects().without("traffic")
    return Scenario(
        name=f"speed-{seed}",
        car=car,
        route=route,
        payload=payload,
        seed=seed,
        effects=effects,
        sensors=Sensors(imu_rate=0.0, gnss_rate=0.0),
        polling=Polling(fast=("vehicle_speed",), slow=(), speed_scale=1.0),
        start_rest=5.0,
        duration=DURATION,
    )


def with_grade(made: SimulatedDrive) -> Drive:
    """Add the reference inclination that a calibration needs."""
    return made.drive.with_signals(Signal("grade", made.truth.time, made.truth.grade))


def mass_of(made: SimulatedDrive) -> float:
    """Return the true mean mass of a drive [kg]."""
    return float(np.mean(made.truth.mass))
