"""Accuracy of the estimators on simulated drives whose seeds and vehicles no tuning saw.

Run from the checkout: ``python studies/accuracy.py [FIRST_SEED]``.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from weighbridge.balance import ForceBalance, force_balance
from weighbridge.estimators import ESTIMATORS
from weighbridge.navigation.select import find_motion
from weighbridge.papers.jensen2022 import without_weather
from weighbridge.pipeline.calibrating import CalibrationSettings, run_calibration
from weighbridge.simulation import Scenario, random_vehicle, simulate_car, usual_polling
from weighbridge.simulation.route import jensen_route
from weighbridge.vehicle.model import Driveline, Vehicle

HERE = Path(__file__).parent
KINDS = ("petrol_manual", "petrol_dct", "diesel_automatic", "electric", "van", "truck")
DRIVES = 10
CALIBRATIONS = 3
FULL = {"car": 0.3, "van": 0.65, "truck": 0.85}
EARLY = 300.0
METHODS = ("rls", "robust-rls", "ekf", "hybrid", "joint, one calibration drive", "joint")


@dataclass(frozen=True)
class Outcome:
    """One drive weighed by one method."""

    car: str
    method: str
    error: float
    std: float
    early: float
    early_std: float


def scenario(car, rng: np.random.Generator, *, load: float, seed: int) -> Scenario:
    """Draw one ordinary drive."""
    made = Scenario(
        name=f"drive {seed}",
        car=car,
        route=jensen_route(int(rng.integers(1000, 2000))),
        payload=load,
        seed=seed,
        polling=usual_polling(car),
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


def first_minutes(balance: ForceBalance) -> ForceBalance:
    """Keep what was known after `EARLY` seconds of moving; the motion stays as it was found."""
    view = balance.merged
    moving = np.cumsum(np.nan_to_num(view.speed) > 0.5) * float(np.median(np.diff(view.time)))
    end = int(np.searchsorted(moving, EARLY))

    def cut(rows):
        parts = {
            name: getattr(rows, name)[:end]
            for name in rows.__dataclass_fields__
            if np.shape(getattr(rows, name))[:1] == view.time.shape
        }
        return replace(rows, **parts)

    return replace(balance, merged=cut(view), force=cut(balance.force))


def calibrated(car, rng: np.random.Generator, seed: int) -> dict[str, Vehicle]:
    """Vehicle files made from ordinary drives of known mass: empty, half loaded, nearly full."""
    known = [
        simulate_car(scenario(car, rng, load=part * FULL[car.kind] * car.mass, seed=seed + k))
        for k, part in enumerate((0.0, 0.5, 0.9)[:CALIBRATIONS])
    ]
    drives = [without_weather(made.drive) for made in known]
    masses = [float(np.mean(made.truth.mass)) for made in known]
    base = Vehicle(kind=car.kind, driveline=Driveline(wheel_radius=car.wheel_radius))

    def fitted(method: str, count: int) -> Vehicle:
        settings = CalibrationSettings(method=method)
        return run_calibration(drives[:count], masses[:count], vehicle=base,
                               settings=settings).vehicle  # fmt: skip

    published = fitted("rls", CALIBRATIONS)
    return {
        **dict.fromkeys(("rls", "robust-rls", "ekf", "hybrid"), published),
        "joint, one calibration drive": fitted("joint", 1),
        "joint": fitted("joint", CALIBRATIONS),
    }


def weigh_all(seed: int) -> list[Outcome]:
    """Calibrate each vehicle on ordinary drives and weigh it on others."""
    outcomes = []
    for number, kind in enumerate(KINDS):
        rng = np.random.default_rng(seed + 10 * number)
        car = random_vehicle(rng, kind)
        vehicles = calibrated(car, rng, seed + 1000 * number)
        for k in range(DRIVES):
            load = float(rng.uniform(0.0, FULL[car.kind] * car.mass))
            made = simulate_car(scenario(car, rng, load=load, seed=seed + 1000 * number + 100 + k))
            mass = float(np.mean(made.truth.mass))
            drive = without_weather(made.drive)
            motion = find_motion(drive, vehicles["joint"])
            for method, vehicle in vehicles.items():
                balance = force_balance(drive, vehicle, motion)
                estimator = ESTIMATORS[method.split(",")[0]]
                track = estimator(balance, vehicle)
                early = estimator(first_minutes(balance), vehicle)
                outcomes.append(
                    Outcome(
                        kind,
                        method,
                        track.mass / mass - 1.0,
                        track.std / mass,
                        early.mass / mass - 1.0,
                        early.std / mass,
                    )
                )
        for method in METHODS[-2:]:
            done = [o for o in outcomes if o.car == kind and o.method == method]
            print(kind, method, " ".join(f"{100 * o.error:+.2f}" for o in done), flush=True)
    return outcomes


def table(outcomes: list[Outcome]) -> str:
    """Write the figures asked for, method by method."""
    lines = [
        "| method | drives | RMS % | mean % | 95th percentile % | worst % | after 5 min, 95th % "
        "| intervals that hold | (error / std)², mean |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for method in METHODS:
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
    lines += ["", "| vehicle, RMS % | " + " | ".join(METHODS) + " | joint: mean % | worst % |"]
    lines.append("|---" * (len(METHODS) + 3) + "|")
    for name in KINDS:
        by = {
            m: 100.0 * np.array([o.error for o in outcomes if o.car == name and o.method == m])
            for m in METHODS
        }
        cells = [f"{np.sqrt(np.mean(by[m] ** 2)):.2f}" for m in METHODS]
        joint = by["joint"]
        cells += [f"{joint.mean():+.2f}", f"{np.max(np.abs(joint)):.2f}"]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
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
