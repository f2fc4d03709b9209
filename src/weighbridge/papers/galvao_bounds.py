"""What speed alone does say of the paper's car: a bound of its mass, and drag over mass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.balance.law import STANDARD_DENSITY, rotating_mass
from weighbridge.constants import GRAVITY
from weighbridge.papers.galvao_drives import CAR, with_grade
from weighbridge.pipeline.speed_bounds import CoastDown, coast_down, mass_bound
from weighbridge.report.table import Table
from weighbridge.signals import Drive, Floats, Signal, from_si, to_si
from weighbridge.simulation import SimulatedDrive
from weighbridge.vehicle import Driveline, RoadLoad, Vehicle

FULL_POWER: Final = float(np.max(np.multiply(CAR.curve_speed, CAR.curve_torque)))
"""Of the engine by its data sheet; what is lost on the way makes the bound higher [W]."""

SHEET: Final = Vehicle(
    name=CAR.name,
    tare=CAR.mass,
    driveline=Driveline(wheel_radius=CAR.wheel_radius, wheel_inertia=CAR.wheel_inertia),
    road_load=RoadLoad(
        drag_area=CAR.drag_area,
        drag_area_std=0.03,
        rolling_coefficient=CAR.rolling_coefficient,
        rolling_coefficient_std=0.001,
    ),
)
"""The car as its papers have it."""

COASTS: Final = 3
"""Coast-downs in each direction."""

FAST, SLOW, STEP, PERIOD = 30.0, 10.0, 0.01, 0.25
"""First and last speed of a coast-down [m/s]; steps of the motion and of the record [s]."""

WIND, WIND_STD = 3.0, 0.5
"""Along the road, and how it differs from one coast-down to the next [m/s]."""

Spans = list[tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedSays:
    """What speed and grade show without a torque.

    Attributes
    ----------
    bounds : highest mass that each of the tests allows [kg]
    coast : of coasting in both directions, wind along the road
    drag_over_mass : true [m^2/kg]
    """

    bounds: Floats
    coast: CoastDown
    drag_over_mass: float


def speed_says(tests: Sequence[SimulatedDrive], seed: int) -> SpeedSays:
    """Bound the mass of the tests by the engine's full power, and coast the same car down."""
    bounds = [mass_bound(with_grade(made), SHEET, FULL_POWER).mass for made in tests]
    return SpeedSays(
        bounds=np.array(bounds),
        coast=coast_down(*coasting(seed), vehicle=SHEET),
        drag_over_mass=CAR.drag_area / CAR.mass,
    )


def coasting(seed: int) -> tuple[Drive, Spans, Spans]:
    """Coast down there and back on a level road; the speed is read in whole km/h at 4 Hz.

    Parameters
    ----------
    seed : of the wind

    Returns
    -------
    drive : with speed and grade
    there, back : spans out of gear [s]
    """
    parts: list[Floats] = []
    spans: tuple[Spans, Spans] = ([], [])
    now = 0.0
    winds = np.random.default_rng(seed).normal(WIND, WIND_STD, 2 * COASTS)
    for run, wind in enumerate(winds):
        back = run % 2
        course = coasting_speed(-wind if back else wind)
        spans[back].append((now + 2.0, now + STEP * course.size - 2.0))
        up = np.linspace(SLOW, FAST, round(15.0 / STEP))
        parts += [course, up]
        now += STEP * (course.size + up.size)
    speed = np.concatenate(parts)[:: round(PERIOD / STEP)]
    time = PERIOD * np.arange(speed.size, dtype=np.float64)
    read = to_si(np.round(from_si(speed, "kmh")), "kmh")
    level = np.zeros(speed.size)
    signals = (
        Signal("vehicle_speed", time, read),
        Signal("grade", time, level),
        Signal("altitude", time, level),
    )
    return Drive(name="coast-down", signals={s.name: s for s in signals}), *spans


def coasting_speed(head_wind: float) -> Floats:
    """Speeds (n,) of one coast-down on the level, every `STEP` from `FAST` to `SLOW` [m/s].

    By the longitudinal law of the package with nothing driving. Rolling resistance is constant and
    drag grows with the square of the air speed, which stays positive: in closed form the air speed
    is a tangent of time.
    """
    rolling = SHEET.road.rolling_coefficient.value * GRAVITY * CAR.mass
    drag = 0.5 * STANDARD_DENSITY * SHEET.road.drag_area.value
    inertia = CAR.mass + float(rotating_mass(SHEET, 0.0))
    balanced = math.sqrt(rolling / drag)  # air speed at which both are equal
    first, last = (math.atan((speed + head_wind) / balanced) for speed in (FAST, SLOW))
    fall = drag * balanced / inertia
    time = STEP * np.arange(math.ceil((first - last) / (fall * STEP)) + 1)
    return np.asarray(balanced * np.tan(first - fall * time) - head_wind)


def speed_table(said: SpeedSays) -> Table:
    """What speed alone does show: an upper bound of the mass, and the drag area over it."""
    low, high = said.coast.interval()
    bounds = " / ".join(f"{x:.0f}" for x in said.bounds)
    return Table(
        "What speed alone shows, which is not a weighing",
        ("what", "found", "truly"),
        (
            ("mass at most, 95 %, three tests, engine's full power, grade of a map, kg", bounds,
             f"{CAR.mass:.0f}"),
            ("C_d A over the mass, three coast-downs each way, wind of 3 ± 0.5 m/s, m²/t",
             f"{1e3 * said.coast.drag_over_mass:.3f} ({1e3 * low:.3f} to {1e3 * high:.3f})",
             f"{1e3 * said.drag_over_mass:.3f}"),
        ),
    )  # fmt: skip
