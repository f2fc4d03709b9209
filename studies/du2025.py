"""Figures of studies/du2025.md: robust least squares, EKF and their blend on more drives.

Run from the checkout: ``python studies/du2025.py``. Recorded drives lie in
``../shared/data`` and are not part of the project; without them their table says so.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import weighbridge as wb
from weighbridge.calibration.run import run_calibration
from weighbridge.estimators import ESTIMATORS
from weighbridge.estimators.robust_rls import RobustRlsSettings
from weighbridge.estimators.robust_rls import estimate as robust_rls
from weighbridge.papers import du2025 as paper
from weighbridge.papers.jensen2022 import without_weather
from weighbridge.simulation import make_scenario, simulate_car

HERE = Path(__file__).parent
DATA = HERE.parents[1] / "shared" / "data"
EXAMPLE = HERE.parent / "examples" / "bmw-i3"
SEED, DRIVES = 90_000, 20
METHODS = (*paper.METHODS, "rls", "joint")


def bus_table(done: paper.Reproduction) -> str:
    lines = [
        "| load, method | paper RMSE kg | as in the paper, mean kg | worst kg | below the paper's "
        "| below half | largest error % | all effects, mean kg | worst kg | below the paper's "
        "| below half | largest error % | 95 % interval holds % |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for load, theirs in paper.PAPER_RMSE.items():
        for method, rmse in zip(paper.METHODS, theirs, strict=True):
            row = f"| {load}, {method} | {rmse:.0f} "
            for drives in (done.drives, done.road):
                every = paper.cell(drives, load, method, "late_rmse")
                worst = paper.cell(drives, load, method, "worst").max()
                row += (
                    f"| {every.mean():.0f} | {every.max():.0f} | {np.sum(every < rmse)} "
                    f"| {np.sum(every < 0.5 * rmse)} | {100 * worst:.1f} "
                )
            held = paper.cell(done.road, load, method, "held").mean()
            lines.append(row + f"| {100 * held:.0f} |")
    return "\n".join(lines)


def urban_table(vehicle: wb.Vehicle, axis: plt.Axes) -> str:
    """Errors of the running mass before each change of load."""
    errors = {m: [] for m in paper.METHODS}
    held = {m: [] for m in paper.METHODS}
    for seed in range(SEED + 500, SEED + 503):
        made = simulate_car(make_scenario("bus-urban", payload=1400.0, seed=seed))
        truth = made.truth
        result = wb.weigh(made.drive, vehicle, method="hybrid").result
        changes = np.flatnonzero(np.abs(np.diff(truth.mass)) > 0.05)
        # A change of load takes many steps of the truth: its first one ends a stretch.
        ends = changes[np.concatenate(([True], np.diff(changes) > 20))]
        for method in paper.METHODS:
            track = ESTIMATORS[method].track(result.balance, vehicle)
            at = np.searchsorted(track.time, truth.time[ends])
            off = track.running_mass[at] / truth.mass[ends] - 1.0
            half = 1.96 * track.running_std[at] / truth.mass[ends]
            told = np.isfinite(off)
            errors[method].append(off[told])
            held[method].append((np.abs(off) < half)[told])
            if seed == SEED + 500:
                rows = slice(None, None, 200)
                axis.plot(track.time[rows], track.running_mass[rows], label=method, lw=1)
        if seed == SEED + 500:
            axis.plot(truth.time, truth.mass, "k--", lw=1, label="true")
    axis.set_title("bus in a city")
    lines = [
        "| method | stretches | mean error % | RMS % | 95 % of them within % | worst % "
        "| 95 % interval holds % |",
        "|---|---|---|---|---|---|---|",
    ]
    for method, parts in errors.items():
        off = 100.0 * np.concatenate(parts)
        lines.append(
            f"| {method} | {off.size} | {off.mean():+.1f} | {np.sqrt(np.mean(off**2)):.1f} "
            f"| {np.percentile(np.abs(off), 95):.1f} | {np.abs(off).max():.1f} "
            f"| {100.0 * np.mean(np.concatenate(held[method])):.0f} |"
        )
    return "\n".join(lines)


def car_table(axis: plt.Axes) -> str:
    known = simulate_car(make_scenario("car-calibration", seed=SEED + 600))
    mass = float(np.mean(known.truth.mass))
    vehicle = run_calibration(without_weather(known.drive), mass).vehicle
    lines = [
        "| drive, true kg | " + " | ".join(f"{m} %" for m in METHODS) + " | robust-rls twice % |",
        "|---|" + "---|" * (len(METHODS) + 1),
    ]
    for k in range(4):
        made = simulate_car(make_scenario("car", payload=80.0 * k, seed=SEED + 601 + k))
        mass = float(np.mean(made.truth.mass))
        balance = wb.weigh(without_weather(made.drive), vehicle, method="rls").result.balance
        tracks = {m: ESTIMATORS[m].track(balance, vehicle) for m in METHODS}
        twice = robust_rls(balance, vehicle, RobustRlsSettings(count_grade_twice=True))
        off = [100.0 * (t.mass / mass - 1.0) for t in (*tracks.values(), twice)]
        lines.append(f"| {k + 1}, {mass:.0f} | " + " | ".join(f"{x:+.1f}" for x in off) + " |")
        if k == 0:
            for m in paper.METHODS:
                axis.plot(tracks[m].time, tracks[m].running_mass, label=m, lw=1)
            axis.axhline(mass, color="k", ls="--", lw=1)
            axis.set_ylim(0.8 * mass, 1.2 * mass)
            axis.set_title("simulated car")
    return "\n".join(lines)


def bmw_table(axis: plt.Axes) -> str:
    trips = sorted((DATA / "bmw-i3").glob("Trip*.csv"))
    if not trips:
        return "The recorded drives are not here."
    vehicle = wb.Vehicle.load(EXAMPLE / "vehicle.toml")
    masses, wander = {m: [] for m in METHODS}, {m: [] for m in METHODS}
    for path in trips:
        drive = wb.read_drive(path, EXAMPLE / "mapping.toml")
        weighed = wb.weigh(drive, vehicle, method="rls")
        if weighed.result is None:
            continue
        for method in METHODS:
            track = ESTIMATORS[method].track(weighed.result.balance, vehicle)
            if track.status == "converged":
                masses[method].append(track.mass)
            late = track.running_mass[track.time > track.time[0] + 300.0]
            if np.isfinite(late).any():
                wander[method].append(float(np.nanstd(late)))
            if path == trips[0] and method in paper.METHODS:
                axis.plot(track.time, track.running_mass, label=method, lw=1)
    axis.set_title(f"recorded BMW i3, {trips[0].stem}")
    axis.set_ylim(1200, 2000)
    lines = [
        "| method | trips weighed | median kg | a third % | wander kg |",
        "|---|---|---|---|---|",
    ]
    for method, found in masses.items():
        mass = np.sort(found)
        third = int(np.ceil(mass.size / 3))
        widths = mass[third - 1 :] - mass[: mass.size - third + 1]
        best = int(np.argmin(widths))
        share = 100.0 * widths[best] / np.median(mass[best : best + third])
        lines.append(
            f"| {method} | {mass.size} of {len(trips)} | {np.median(mass):.0f} | {share:.1f} "
            f"| {np.median(wander[method]):.0f} |"
        )
    return "\n".join(lines)


def main() -> None:
    figure, axes = plt.subplots(2, 2, figsize=(10, 7), constrained_layout=True)
    done = paper.reproduce(seed=SEED, drives=DRIVES)
    half = next(d for d in done.road if d.load == "half-load")
    for method in paper.METHODS:
        track = half.tracks[method]
        axes[0, 0].plot(track.time[::20], track.running_mass[::20], label=method, lw=1)
    axes[0, 0].axhline(half.true_mass, color="k", ls="--", lw=1)
    axes[0, 0].set_ylim(0.85 * half.true_mass, 1.15 * half.true_mass)
    axes[0, 0].set_title("bus on a straight road, half-load, all effects")
    axes[0, 0].legend()
    text = (HERE / "du2025.template.md").read_text(encoding="utf-8")
    for name, table in (
        ("bus", bus_table(done)),
        ("urban", urban_table(done.vehicle, axes[0, 1])),
        ("car", car_table(axes[1, 0])),
        ("bmw", bmw_table(axes[1, 1])),
    ):
        print(table, flush=True)
        text = text.replace(f"<!-- {name} -->", table)
    for axis in axes.flat:
        axis.set_xlabel("time s")
        axis.set_ylabel("mass kg")
        axis.grid(alpha=0.3)
    (HERE / "figures").mkdir(exist_ok=True)
    figure.savefig(HERE / "figures" / "du2025.png", dpi=110)
    (HERE / "du2025.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
