"""Slopes of sec. 7.2 of Jensen et al. 2022: a road of 600 m, found both ways in three runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.calibration.printed import PrintedCar
from weighbridge.navigation import Motion, find_motion, printed_motion
from weighbridge.papers.claims import Found
from weighbridge.papers.jensen2022_drives import (
    CONDITIONS,
    Conditions,
    gradient_scenario,
    without_weather,
)
from weighbridge.papers.jensen2022_printed import PrintedSettings
from weighbridge.report.style import BLUE, GREEN, GREY, VERMILLION, Panel, blank, line
from weighbridge.signals import Floats, from_si, scalar_from_si, scalar_to_si
from weighbridge.simulation import Scenario, simulate_car
from weighbridge.vehicle import Vehicle

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
