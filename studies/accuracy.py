"""Accuracy of the estimators on simulated drives whose seeds and vehicles no tuning saw.

Run from the checkout: ``python studies/accuracy.py [FIRST_SEED]``.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from weighbridge.balance import force_balance
from weighbridge.estimators import ESTIMATORS
from weighbridge.navigation.select import find_motion
from weighbridge.papers.jensen2022 import without_weather
from weighbridge.pipeline.calibrating import CalibrationSettings, run_calibration
from weighbridge.simulation import (
    COMPACT,
    ELECTRIC,
    MIDSIZE,
    make_scenario,
    random_car,
    simulate_car,
)
from weighbridge.simulation.route import jensen_route

HERE = Path(__file__).parent
DRIVES = 10


@dataclass(frozen=True)
class Outcome:
    """One drive weighed by one method."""

    car: str
    method: str
    error: float
    std: float
    early: float


def cars(seed: int) -> dict[str, tuple[str, object]]:
    """Name, scenario and car of each vehicle."""
    drawn = {f"petrol {k}": ("car", random_car(np.random.default_rng(seed + k))) for k in (1, 2, 3)}
    fixed = {
        "midsize": ("car", MIDSIZE),
        "small manual": ("compact", COMPACT),
        "electric": ("electric", ELECTRIC),
    }
    return {**fixed, **drawn}


def scenario(kind: str, car, rng: np.random.Generator, *, load: float, seed: int):
    """Draw one ordinary drive."""
    made = make_scenario(kind, payload=load, seed=seed)
    outages = ()
    if rng.random() < 0.3:
        begin = float(rng.uniform(300.0, 1200.0))
        outages = ((begin, begin + float(rng.uniform(30.0, 180.0))),)
    return replace(
        made,
        car=car,
        route=jensen_route(int(rng.integers(1000, 2000))),
        wind_speed=float(rng.uniform(0.0, 10.0)),
        wind_from=float(rng.uniform(0.0, 2.0 * math.pi)),
        ambient_temperature=float(rng.uniform(268.0, 303.0)),
        aggressiveness=float(rng.uniform(0.8, 1.25)),
        effects=replace(made.effects, warm_up=float(rng.uniform(0.0, 1.0))),
        sensors=replace(made.sensors, gnss_outages=outages),
    )


def weigh_all(seed: int) -> list[Outcome]:
    """Calibrate each car on one ordinary drive and weigh it on others."""
    outcomes = []
    for number, (name, (kind, car)) in enumerate(cars(seed).items()):
        rng = np.random.default_rng(seed + 10 * number)
        first = simulate_car(scenario(kind, car, rng, load=0.0, seed=seed + 100 * number))
        known = float(np.mean(first.truth.mass))
        vehicles = {
            method: run_calibration(
                without_weather(first.drive), known, settings=CalibrationSettings(method=method)
            ).vehicle
            for method in ("rls", "joint")
        }
        for k in range(1, DRIVES + 1):
            load = float(rng.uniform(0.0, 0.25 * car.mass))
            made = simulate_car(scenario(kind, car, rng, load=load, seed=seed + 100 * number + k))
            mass = float(np.mean(made.truth.mass))
            drive = without_weather(made.drive)
            motion = find_motion(drive, vehicles["joint"])
            for method, vehicle in vehicles.items():
                track = ESTIMATORS[method](force_balance(drive, vehicle, motion), vehicle)
                moving = np.cumsum(np.nan_to_num(track.balance.merged.speed) > 0.5) * np.median(
                    np.diff(track.time)
                )
                at = int(np.searchsorted(moving, 300.0))
                early = track.running_mass[min(at, track.time.size - 1)] / mass - 1.0
                outcomes.append(
                    Outcome(name, method, track.mass / mass - 1.0, track.std / mass, early)
                )
        done = [o for o in outcomes if o.car == name and o.method == "joint"]
        print(name, " ".join(f"{100 * o.error:+.2f}" for o in done), flush=True)
    return outcomes


def table(outcomes: list[Outcome]) -> str:
    """Write the figures asked for, method by method."""
    lines = [
        "| method | drives | RMS % | mean % | 95th percentile % | worst % | after 5 min, 95th % "
        "| intervals that hold | (error / std)², mean |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for method in ("rls", "joint"):
        chosen = [o for o in outcomes if o.method == method]
        error = 100.0 * np.array([o.error for o in chosen])
        scaled = np.array([o.error / o.std for o in chosen])
        early = 100.0 * np.abs([o.early for o in chosen])
        lines.append(
            f"| {method} | {error.size} | {np.sqrt(np.mean(error**2)):.2f} | {error.mean():+.2f} "
            f"| {np.percentile(np.abs(error), 95):.2f} | {np.max(np.abs(error)):.2f} "
            f"| {np.nanpercentile(early, 95):.1f} | {np.mean(np.abs(scaled) < 1.96):.0%} "
            f"| {np.mean(scaled**2):.2f} |"
        )
    lines += [
        "",
        "| car | rls RMS % | joint RMS % | joint mean % | joint worst % |",
        "|---|---|---|---|---|",
    ]
    for name in dict.fromkeys(o.car for o in outcomes):
        by = {
            m: 100.0 * np.array([o.error for o in outcomes if o.car == name and o.method == m])
            for m in ("rls", "joint")
        }
        lines.append(
            f"| {name} | {np.sqrt(np.mean(by['rls'] ** 2)):.2f} "
            f"| {np.sqrt(np.mean(by['joint'] ** 2)):.2f} | {by['joint'].mean():+.2f} "
            f"| {np.max(np.abs(by['joint'])):.2f} |"
        )
    return "\n".join(lines)


def main() -> None:
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 70_000
    text = table(weigh_all(seed))
    print(text)
    template = HERE / "accuracy.template.md"
    if len(sys.argv) == 1 and template.is_file():
        page = template.read_text(encoding="utf-8").replace("<!-- table -->", text)
        (HERE / "accuracy.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
