"""Figures of studies/du2025.md: robust least squares, EKF and their blend on more drives.

Run from the checkout: ``python studies/du2025.py``, or with the names of some parts, whose tables
alone are made anew. Recorded drives lie in ``../shared/data`` and are not part of the project;
without them their table says so.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import du2025_bus
import du2025_imm
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from du2025_bus import Curves, Part

import weighbridge as wb
from weighbridge.calibration.run import run_calibration
from weighbridge.estimators import ESTIMATORS
from weighbridge.estimators.robust_rls import RobustRlsSettings
from weighbridge.estimators.robust_rls import estimate as robust_rls
from weighbridge.papers import du2025_methods as paper
from weighbridge.papers.jensen2022_drives import without_weather
from weighbridge.simulation import make_scenario, simulate_car

HERE = Path(__file__).parent
DATA = HERE.parents[1] / "shared" / "data"
EXAMPLE = HERE.parent / "examples" / "bmw-i3"
SEED = 90_000
METHODS = (*paper.METHODS, "rls", "joint")


def car() -> Part:
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
            curves = Curves.of("simulated car", tracks, mass)
    return Part({"car": "\n".join(lines)}, curves)


def bmw() -> Part:
    trips = sorted((DATA / "bmw-i3").glob("Trip*.csv"))
    if not trips:
        return Part({"bmw": "The recorded drives are not here."})
    vehicle = wb.Vehicle.load(EXAMPLE / "vehicle.toml")
    masses, wander, shown = {m: [] for m in METHODS}, {m: [] for m in METHODS}, {}
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
            if path == trips[0]:
                shown[method] = track
    curves = Curves.of(f"recorded BMW i3, {trips[0].stem}", shown, 1600.0, drawn=False)
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
    return Part({"bmw": "\n".join(lines)}, curves)


PARTS = {
    "bus": du2025_bus.bus,
    "opposite": du2025_bus.opposite,
    "city": du2025_bus.city,
    "interacting": du2025_imm.interacting,
    "second": du2025_bus.second,
    "urban": du2025_bus.urban,
    "bends": du2025_bus.bends,
    "car": car,
    "bmw": bmw,
}
"""What each makes: tables by the name of their place in the template, and curves of one drive."""

SHOWN = ("bus", "urban", "car", "bmw")


def draw(curves: dict[str, Curves]) -> None:
    """Draw one drive of each kind."""
    figure, axes = plt.subplots(2, 2, figsize=(10, 7), constrained_layout=True)
    for axis, part in zip(axes.flat, SHOWN, strict=True):
        curves[part].draw(axis)
        axis.set_xlabel("time s")
        axis.set_ylabel("mass kg")
        axis.grid(alpha=0.3)
    axes[0, 0].legend()
    (HERE / "figures").mkdir(exist_ok=True)
    figure.savefig(HERE / "figures" / "du2025.png", dpi=110)


def tables_of(page: Path) -> dict[str, str]:
    """Tables that a page has already, by the marks before them."""
    if not page.exists():
        return {}
    found = {}
    for block in page.read_text(encoding="utf-8").split("\n\n"):
        first, _, rest = block.partition("\n")
        if first.startswith("<!-- ") and rest:
            found[first.removeprefix("<!-- ").removesuffix(" -->")] = rest.strip()
    return found


def main(names: list[str]) -> None:
    page = HERE / "du2025.md"
    tables = tables_of(page)
    curves = {}
    asked = names or list(PARTS)
    # Two at a time: each has a drive of 100 Hz in memory.
    with ProcessPoolExecutor(2) as pool:
        for name, running in [(n, pool.submit(PARTS[n])) for n in asked]:
            done = running.result()
            tables |= done.tables
            if done.curves is not None:
                curves[name] = done.curves
            for table in done.tables.values():
                print(table, flush=True)
            text = (HERE / "du2025.template.md").read_text(encoding="utf-8")
            for place, table in tables.items():
                text = text.replace(f"<!-- {place} -->", f"<!-- {place} -->\n{table}")
            page.write_text(text, encoding="utf-8")
    if set(SHOWN) <= set(curves):
        draw(curves)


if __name__ == "__main__":
    main(sys.argv[1:])
