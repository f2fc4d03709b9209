"""Accuracy of the estimators on simulated drives whose seeds and vehicles no tuning saw.

Run from the checkout: ``python studies/accuracy.py``, which writes ``accuracy.md``;
``--part wind`` prints one part alone, ``--seed 92000`` takes other drives for the table.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from accuracy_claims import PARTS, Part, Rows, run_parts
from accuracy_drives import (
    FULL,
    KINDS,
    calibrated,
    final_mass,
    known_drives,
    mean_mass,
    scenario,
)

from weighbridge.balance import force_balance
from weighbridge.estimators import ESTIMATORS
from weighbridge.estimators.squat import of_vehicle
from weighbridge.navigation.select import find_motion
from weighbridge.papers.jensen2022_drives import without_weather
from weighbridge.signals import Drive
from weighbridge.simulation import SimulatedDrive, random_vehicle, simulate_car

HERE = Path(__file__).parent
DRIVES = 10
CALIBRATIONS = 3
FIRST_SEED = 201_000
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


def first_minutes(made: SimulatedDrive, drive: Drive) -> Drive:
    """Cut the drive off after `EARLY` seconds of moving: nothing later is known to anything."""
    truth = made.truth
    moving = np.cumsum((truth.speed > 0.5) * np.gradient(truth.time))
    return drive.between(drive.start, float(truth.time[np.searchsorted(moving, EARLY)]))


def weigh_all(job: tuple[int, int]) -> list[Outcome]:
    """Calibrate one vehicle on ordinary drives and weigh it on others."""
    seed, number = job
    kind = KINDS[number]
    rng = np.random.default_rng(seed + 10 * number)
    car = random_vehicle(rng, kind)
    known = known_drives(car, rng, seed + 1000 * number, count=CALIBRATIONS)
    published = calibrated(car, known, method="rls")
    vehicles = {
        **dict.fromkeys(("rls", "robust-rls", "ekf", "hybrid"), published),
        "joint, one calibration drive": calibrated(car, known[:1]),
        "joint": calibrated(car, known),
    }
    outcomes = []
    for k in range(DRIVES):
        load = float(rng.uniform(0.0, FULL[car.kind] * car.mass))
        made = simulate_car(scenario(car, rng, load=load, seed=seed + 1000 * number + 100 + k))
        drive = without_weather(made.drive)
        begun = first_minutes(made, drive)
        found = (find_motion(d, vehicles["joint"]) for d in (drive, begun))
        motion, begun_motion = (of_vehicle(m, vehicles["joint"]) for m in found)
        for method, vehicle in vehicles.items():
            name = method.split(",")[0]
            estimator = ESTIMATORS[name].track
            mass = final_mass(made) if name == "joint" else mean_mass(made)
            track = estimator(force_balance(drive, vehicle, motion), vehicle)
            early = estimator(force_balance(begun, vehicle, begun_motion), vehicle)
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


def write_methods(done: Rows) -> str:
    return table([outcome for _, part in done for outcome in part])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", choices=("table", *PARTS), help="print this part alone")
    parser.add_argument("--seed", type=int, default=FIRST_SEED, help="of the table of methods")
    given = parser.parse_args()
    methods = Part(
        tuple((given.seed, n) for n in range(len(KINDS))), weigh_all, write_methods, filed=False
    )
    parts = {"table": methods, **PARTS}
    if given.part:
        parts = {given.part: parts[given.part]}
    page = (HERE / "accuracy.template.md").read_text(encoding="utf-8")
    for name, text in run_parts(parts).items():
        print(f"{name}\n\n{text}\n", flush=True)
        page = page.replace(f"<!-- {name} -->", text)
    if len(parts) > 1 and given.seed == FIRST_SEED:
        (HERE / "accuracy.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
