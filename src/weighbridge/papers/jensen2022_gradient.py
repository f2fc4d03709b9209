"""The road of sec. 7.2 of Jensen et al. 2022: 600 m with two inclines and two turns, three runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.calibration.printed import PrintedCar
from weighbridge.navigation import Motion, find_motion, printed_motion
from weighbridge.papers.claims import Found
from weighbridge.papers.jensen2022_drives import CONDITIONS, Conditions, without_weather
from weighbridge.papers.jensen2022_printed import PrintedSettings
from weighbridge.report.style import BLUE, GREEN, GREY, VERMILLION, Panel, blank, line
from weighbridge.signals import Floats, from_si, scalar_from_si, scalar_to_si
from weighbridge.simulation import MIDSIZE, Braking, Route, Scenario, flat_route, simulate_car
from weighbridge.vehicle import Vehicle

LENGTH: Final = 600.0
"""Of the road [m] (sec. 7.2)."""

INCLINES: Final = ((120.0, 200.0, 0.06), (430.0, 520.0, -0.05))
"""Where each begins and ends [m], and its slope [rad]: chosen, the paper draws them."""

TURNS: Final = ((260.0, 0.5 * math.pi), (395.0, -0.5 * math.pi))
"""Middle [m] and angle [rad]; the second incline lies after a turn."""

RADIUS: Final = 15.0
"""Of the turns, chosen [m]."""

LIMIT: Final = scalar_to_si(35.0, "kmh")
"""Speed held on the straight parts, chosen."""

BRAKINGS: Final = tuple(Braking(time=t, duration=2.0, decel=2.0) for t in (45.0, 58.0, 71.0, 84.0))
"""Of run 2, which accelerates and brakes again and again; the drive begins after 25 s at rest."""

RUNS: Final = (1, 2, 3)

_MOVING: Final = 1.5
"""Slower, angles are not judged [m/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GradientRun:
    """One run over the road.

    Attributes
    ----------
    run : 1 to 3
    distance : (n,) where the motion is given [m]
    true : (n,) slope of the road [rad]
    printed, ours : (n,) by the paper's rules, whose pitch is taken for the slope, and by ours [rad]
    largest : largest errors of both while moving [rad]
    """

    run: int
    distance: Floats
    true: Floats
    printed: Floats
    ours: Floats
    largest: tuple[float, float]


def gradient_road() -> Route:
    """Return the road; what the paper does not state of it is chosen."""
    road = flat_route(LENGTH, limit=LIMIT)
    at = np.arange(road.grade.size, dtype=np.float64)
    grade, curvature = np.zeros(at.size), np.zeros(at.size)
    for begin, end, slope in INCLINES:
        # A ramp of 15 m: no wheel meets a kink.
        rise = np.clip((at - begin) / 15.0, 0.0, 1.0) * np.clip((end - at) / 15.0, 0.0, 1.0)
        grade += slope * rise
    for middle, angle in TURNS:
        length = 2.0 * abs(angle) * RADIUS
        inside = np.abs(at - middle) < 0.5 * length
        shape = np.where(inside, np.cos(math.pi * (at - middle) / length) ** 2, 0.0)
        curvature += angle * shape / shape.sum()
    return replace(road, name="600 m, two inclines", grade=grade, heading=np.cumsum(curvature))


def gradient_scenario(run: int, seed: int, conditions: Conditions = CONDITIONS) -> Scenario:
    """Make one of the three runs: 1 and 3 almost at constant speed, 2 with strong accelerations."""
    made = Scenario(name=f"slope, run {run}", car=MIDSIZE, route=gradient_road(), seed=seed)
    calm = replace(made, effects=made.effects.without("traffic"))
    if run != 2:
        return conditions.of(replace(calm, aggressiveness=0.5))
    return conditions.of(replace(calm, aggressiveness=1.5, brakings=BRAKINGS))


def gradient_runs(
    seed: int,
    car: Vehicle,
    printed: PrintedCar,
    settings: PrintedSettings,
    conditions: Conditions = CONDITIONS,
) -> tuple[GradientRun, ...]:
    """Drive the three runs and find the slope both ways.

    Parameters
    ----------
    seed : of the first run; the others count on from it
    car : ours, calibrated
    printed, settings : by the paper's rules
    conditions : of the drives
    """
    return tuple(
        _run(gradient_scenario(run, seed + k, conditions), run, car, printed, settings)
        for k, run in enumerate(RUNS)
    )


def _run(
    scenario: Scenario, run: int, car: Vehicle, printed: PrintedCar, settings: PrintedSettings
) -> GradientRun:
    made = simulate_car(scenario)
    drive, truth = without_weather(made.drive), made.truth
    by_print = printed_motion(drive, printed.mounting, settings.filter)
    own = find_motion(drive, car)
    time = by_print.time[by_print.speed > _MOVING]
    true = np.interp(time, truth.time, truth.grade)
    found = [_slope(motion, time) for motion in (by_print, own)]
    largest = [float(np.max(np.abs(slope - true))) for slope in found]
    return GradientRun(
        run=run,
        distance=np.interp(time, truth.time, truth.distance),
        true=true,
        printed=found[0],
        ours=found[1],
        largest=(largest[0], largest[1]),
    )


def _slope(motion: Motion, time: Floats) -> Floats:
    return np.asarray(np.interp(time, motion.time, motion.grade))


def gradient_figures(runs: Sequence[GradientRun]) -> dict[str, Found]:
    """Largest errors of each run, both ways."""
    found = {}
    for k, way in enumerate(("printed", "ours")):
        each = " / ".join(f"{scalar_from_si(r.largest[k], 'deg'):.2f}" for r in runs)
        below = all(r.largest[k] < scalar_to_si(1.0, "deg") for r in runs)
        found[f"gradient {way}"] = Found(f"{each}° in runs 1 / 2 / 3", below)
    return found


def gradient_panel(runs: Sequence[GradientRun]) -> Panel:
    """Draw slopes over distance (fig. 5)."""
    title = "Fig. 5, the paper's own rules: slope of the 600 m road"
    if not runs:
        return Panel(title=title, absent="fig. 5: these runs were not asked for.")
    figure = blank("Distance [m]", "Slope [°]", height=380)
    for r, colour in zip(runs, (BLUE, VERMILLION, GREEN), strict=True):
        line(figure, r.distance, from_si(r.printed, "deg"), f"run {r.run}", colour, line_width=1.3)
    line(figure, runs[0].distance, from_si(runs[0].true, "deg"), "road", GREY, dash="dash")
    return Panel(
        title=title,
        caption="Run 2 accelerates and brakes again and again; the body leans by it.",
        figure=figure,
    )
