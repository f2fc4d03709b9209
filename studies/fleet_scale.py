"""Does a fleet find the scales of its vehicles without tickets? Run me.

    python studies/fleet_scale.py

Fleets of 40 vehicles of 5 types with 30 drives each are drawn as rows of results: masses, with the
error of scale of each vehicle and an own error of each drive. Operators, crews, loads and errors
are drawn by the laws below, which are none of those of ``weighbridge.fleet.scales``. Each fleet is
learnt from without a ticket, and with one ticket per type. Then a smaller fleet of simulated drives
goes through the command, with vehicle files whose torque is wrong by drawn amounts. It fills
``fleet_scale.template.md``.

``JUDGED`` and ``SIMULATED`` are the seeds of the page. ``TUNED``, and the fleet that
``weighbridge simulate fleet --vehicles 10 --days 2 --seed 450101`` makes, were looked at while the
method was made.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl
from pages import filled

import weighbridge as wb
from fleet import joined, truth
from weighbridge.fleet.learning import learn_scales
from weighbridge.fleet.schema import DRIVES
from weighbridge.fleet.store import Results, write_part
from weighbridge.fleet.vehicles import Vehicles
from weighbridge.vehicle.known import Known, describe

HERE: Final = Path(__file__).parent
TUNED: Final = tuple(range(4501, 4509))
JUDGED: Final = tuple(range(74501, 74521))
SIMULATED: Final = 845102
TYPES: Final = {
    "van": ("van", 2200.0, 3500.0, 60.0),
    "light truck": ("truck", 4200.0, 7500.0, 100.0),
    "truck": ("truck", 8900.0, 18000.0, 280.0),
    "semi-trailer": ("truck", 14600.0, 40000.0, 500.0),
    "bus": ("bus", 11200.0, 18500.0, 250.0),
}
"""Class, empty mass with driver and full tank, permitted mass, fuel of a full tank [kg]."""

VEHICLES: Final = 8
DRIVES_EACH: Final = 30
BEGIN: Final = datetime(2026, 5, 4, 6, tzinfo=UTC)


@dataclass(frozen=True)
class Drawn:
    """One vehicle: its registered mass, what is odd about it, and one row per drive."""

    name: str
    type: str
    tare: float
    odd: str
    rows: list[dict[str, Any]]


def loads(rng: np.random.Generator, count: int, empty: float) -> np.ndarray:
    """Draw loads over the largest one by the habits of an operator (count,) [-]."""
    habit = rng.choice(["full", "half", "any", "rounds", "one good"])
    if habit == "full":
        load = rng.normal(rng.uniform(0.85, 1.0), 0.05, count)
    elif habit == "half":
        load = rng.beta(4.0, 4.0, count)
    elif habit == "any":
        load = rng.beta(rng.uniform(0.8, 3.0), rng.uniform(0.8, 3.0), count)
    elif habit == "rounds":
        load = rng.choice([0.9, 0.65, 0.4, 0.15], count) + rng.normal(0.0, 0.04, count)
    else:
        load = rng.uniform(0.25, 0.7) + rng.normal(0.0, 0.03, count)
    load = np.where(rng.uniform(size=count) < 0.04, rng.uniform(1.02, 1.2, count), load)
    return np.where(rng.uniform(size=count) < empty, 0.0, np.clip(load, 0.02, None))


def draw_fleet(seed: int) -> list[Drawn]:
    """Draw a fleet."""
    rng = np.random.default_rng(seed)
    found = []
    for kind, (_, standard, gross, tank) in TYPES.items():
        common, spread = rng.uniform(-0.055, 0.055), rng.uniform(0.004, 0.02)
        for number in range(VEHICLES):
            empty = float(rng.choice([0.4, 0.25, 0.1, 0.0], p=[0.4, 0.3, 0.15, 0.15]))
            odd = str(rng.choice(["", "crane", "two in the crew", "wrong tare"],
                                 p=[0.72, 0.1, 0.1, 0.08]))  # fmt: skip
            bare = standard * (1.0 + rng.uniform(-0.01, 0.01))
            tare = bare * (1.0 + rng.choice([-0.05, 0.05])) if odd == "wrong tare" else bare
            always = rng.uniform(0.06, 0.15) * bare if odd == "crane" else 0.0
            count = DRIVES_EACH
            second = np.where(rng.uniform(size=count) < rng.choice([0.0, 0.2, 0.5]), 80.0, 0.0)
            second = np.full(count, 80.0) if odd == "two in the crew" else second
            beside = always + second - tank * rng.uniform(0.0, 0.9, count)
            room = gross - bare - always
            load = room * loads(rng, count, 0.0 if odd == "crane" else empty)
            mass = bare + beside + load
            scale = common + spread * rng.standard_t(6) / math.sqrt(1.5)
            tilt = rng.normal(0.0, 0.009) * (load / room - 0.5)
            own = rng.uniform(0.007, 0.012)  # as within vehicles of a simulated fleet, seed 450101
            error = own * rng.standard_t(5, count) / math.sqrt(5.0 / 3.0)
            error += np.where(rng.uniform(size=count) < 0.005, -0.06, 0.0)
            weighed = mass * np.exp(scale + tilt + error)
            stated, left = own * rng.uniform(0.9, 1.4), rng.uniform(0.045, 0.055)
            km = rng.gamma(2.0, 20.0, count)
            rows = [
                {
                    "known": mass[k], "load": load[k], "mass_kg": weighed[k], "distance_km": km[k],
                    "std_kg": weighed[k] * math.hypot(stated, left),
                    "systematic_std_kg": weighed[k] * left,
                    "start": BEGIN + timedelta(hours=5 * k),
                }
                for k in range(count)
            ]  # fmt: skip
            never = "" if empty > 0.0 or odd in ("crane",) else "never empty"
            name = f"{kind} {number}".replace(" ", "-")
            found.append(Drawn(name, kind, round(tare), odd or never, rows))
    return found


def write_fleet(home: Path, fleet: Iterable[Drawn]) -> tuple[Path, Vehicles]:
    """Write rows of results, and a file per vehicle; return the folder and the files."""
    results, cars = Results.begun(home / "results"), home / "vehicles"
    cars.mkdir()
    for one in fleet:
        kind, _, gross, _ = TYPES[one.type]
        known = Known(name=one.name, kind=kind, tare=one.tare, gross=gross, torque="percent")
        car = replace(describe(known).vehicle, type=one.type)
        car.save(cars / f"{one.name}.toml")
    shelf = Vehicles(cars)
    for one in fleet:
        kind, _, gross, _ = TYPES[one.type]
        for k, row in enumerate(one.rows):
            key = f"{one.name}-{k:03d}"
            low, high = (row["mass_kg"] + sign * 1.96 * row["std_kg"] for sign in (-1.0, 1.0))
            whole = dict.fromkeys(DRIVES) | {
                "key": key, "part": 0, "source": f"drives/{key}", "drive": key,
                "outcome": "weighed", "status": "converged", "reason": "",
                "vehicle_id": one.name, "vehicle_file": f"{one.name}.toml", "vehicle_class": kind,
                "vehicle_digest": shelf.of((), one.name).digest, "tare_kg": one.tare,
                "gross_kg": gross, "freedom": math.inf, "duration_s": 1800.0, "moving_s": 1700.0,
                "low95_kg": low, "high95_kg": high, "payload_kg": row["mass_kg"] - one.tare,
                "load_changed": False, "unweighed_s": 0.0, "warnings": [], "checked_kg": [],
                "checked_std_kg": [], "date": row["start"].date(),
            }  # fmt: skip
            whole |= {n: row[n] for n in row if n in DRIVES}
            write_part(results.folder, key, [whole | {"segments": []}])
    results.gather()
    return results.folder, shelf


def write_tickets(path: Path, fleet: Iterable[Drawn], seed: int) -> Path:
    """Write one ticket per type: of any drive of any of its vehicles."""
    rng = np.random.default_rng([seed, 1])
    rows = []
    for kind in TYPES:
        one = rng.choice(np.array([v for v in fleet if v.type == kind], dtype=object))
        row = one.rows[int(rng.integers(len(one.rows)))]
        when = row["start"] + timedelta(minutes=10)
        rows.append(f"{one.name},{when:%Y-%m-%dT%H:%M:%SZ},{round(row['known'] / 20.0) * 20}\n")
    path.write_text("vehicle,time,mass_kg\n" + "".join(rows), encoding="utf-8")
    return path


def judged(folder: Path, fleet: Iterable[Drawn]) -> pl.DataFrame:
    """Return one row per leg: its vehicle, true and shown mass, and whether the interval holds."""
    true = pl.DataFrame([
        {"vehicle_id": v.name, "type": v.type, "odd": v.odd, "key": f"{v.name}-{k:03d}",
         "known": row["known"], "load": row["load"]}
        for v in fleet for k, row in enumerate(v.rows)
    ])  # fmt: skip
    legs = wb.fleet.report(folder).legs.join(true, on=["key", "vehicle_id"])
    inside = pl.col("known").is_between("low95_kg", "high95_kg")
    return legs.with_columns(
        error=pl.col("mass_kg") / pl.col("known") - 1.0,
        raw=pl.col("weighed_kg") / pl.col("known") - 1.0,
        held=inside,
        moved=1e-3 * (pl.col("known") - pl.col("tare_kg")).clip(0.0) * pl.col("distance_km"),
    )


def of_seed(seed: int) -> dict[str, tuple[pl.DataFrame, pl.DataFrame, dict[str, Any]]]:
    """Learn one fleet without tickets, and with one per type."""
    fleet = draw_fleet(seed)
    found = {}
    with tempfile.TemporaryDirectory() as home:
        folder, shelf = write_fleet(Path(home), fleet)
        tickets = write_tickets(Path(home) / "tickets.csv", fleet, seed)
        for name, path in (("as weighed", None), ("no ticket", None), ("a ticket", tickets)):
            if name != "as weighed":
                learn_scales(folder, shelf, path)
            report = wb.fleet.report(folder)
            found[name] = judged(folder, fleet), report.learnt, report.totals
    return found


def of_drives(home: Path) -> tuple[pl.DataFrame, pl.DataFrame, int]:
    """Simulate a fleet, weigh it by the command with wrong torques, and compare it with the truth.

    Returns
    -------
    legs, as of `fleet.joined`; what was learnt; vehicles whose file is wrong
    """
    size = ("--vehicles", "10", "--days", "3", "--seed", str(SIMULATED))
    made, cars, results = home / "fleet", home / "fleet" / "vehicles", home / "results"
    command("simulate", "fleet", "-o", str(made), *size)
    rng = np.random.default_rng(SIMULATED)
    kinds = {kind: rng.uniform(-0.04, 0.04) for kind in ("bus", "car", "truck", "van")}
    for path in sorted(cars.glob("*.toml")):
        car = wb.Vehicle.load(path)
        scale = math.exp(kinds[car.kind] + 0.01 * rng.standard_normal())
        replace(car, torque=replace(car.torque, coefficients=(0.0, scale))).save(path)
    drives = str(made / "drives.csv"), "--vehicles", str(cars), "-o", str(results)
    command("fleet", *drives, "--workers", "1", "--learn", str(home / "learnt"))
    report = wb.fleet.report(results)
    legs = joined(report, truth(made)).filter(
        pl.col("mass_kg").is_not_null(), pl.col("fault") == ""
    )
    return legs, report.learnt, len(list(cars.glob("*.toml")))


def command(*words: str) -> None:
    """Run the command; a fleet ends with 1 where a drive has no mass, and 2 where one is broken."""
    done = subprocess.run([sys.executable, "-m", "weighbridge", *words], check=False)
    if done.returncode not in (0, 1, 2):
        raise SystemExit(done.returncode)


def sentences(legs: pl.DataFrame, learnt: pl.DataFrame, files: int) -> str:
    """Say how good the masses of simulated drives are, before and after."""
    own = legs.filter(pl.col("factor").is_not_null()).with_columns(
        raw=pl.col("weighed_kg") / pl.col("mass_kg_true") - 1.0,
        held=pl.col("mass_kg_true").is_between("low95_kg", "high95_kg"),
    )
    each = own.group_by("vehicle_id").agg(
        worse=(pl.col("error") ** 2).mean().sqrt() - (pl.col("raw") ** 2).mean().sqrt()
    )
    left = own.with_columns(rest=pl.col("raw") - pl.col("raw").mean().over("vehicle_id"))
    never = learnt.filter(pl.col("verdict") == "never empty").height
    worse, held = 100.0 * each["worse"], int(own["held"].sum())
    before, after, least = rms(own, "raw"), rms(own), rms(left, "rest")
    made = f"`weighbridge simulate fleet --vehicles 10 --days 3 --seed {SIMULATED}`"
    return (
        f"{made}, with the torque of {files} vehicle files wrong by up to 4 % for a class\nand 1 % "
        f"for a vehicle, through the command. The RMS error of {own.height} legs is {before:.1f} % "
        f"as weighed and {after:.1f} % after.\nWithout any error of scale it is {least:.1f} %. "
        f"{held} of {own.height} intervals hold. {(worse > 0.5).sum()} of {each.height} vehicles "
        f"get worse by more\nthan 0.5 %, by {worse.max():+.1f} % at worst. {never} of "
        f"{learnt.height} vehicles count as never empty."
    )


def rms(frame: pl.DataFrame, column: str = "error") -> float:
    """Root mean square in percent."""
    return 100.0 * float((frame[column] ** 2).mean()) ** 0.5


def figures(
    legs: list[pl.DataFrame], learnt: list[pl.DataFrame], totals: list[dict[str, Any]]
) -> str:
    """Cells of the table: errors, intervals, vehicles that got worse, transport."""
    rows = pl.concat([f.with_columns(fleet=pl.lit(k)) for k, f in enumerate(legs)])
    each = rows.group_by("fleet", "vehicle_id").agg(
        before=(pl.col("raw") ** 2).mean().sqrt(), after=(pl.col("error") ** 2).mean().sqrt()
    )
    worse = 100.0 * (each["after"] - each["before"])
    moved = rows.group_by("fleet", maintain_order=True).agg(pl.col("moved").sum())["moved"]
    found = np.array([t["tkm"] for t in totals])
    reach = np.array([1.96 * t["tkm_std"] for t in totals])
    off = found / moved.to_numpy() - 1.0
    return (
        f"{rms(rows):.2f} % | {max(rms(f) for f in legs):.2f} % | "
        f"{100.0 * rows['held'].mean():.1f} % | {(worse > 0.5).sum()} of {worse.len()} | "
        f"{worse.max():+.1f} % | {100.0 * np.sqrt(np.mean(off**2)):.1f} % | "
        f"± {100.0 * np.mean(reach / found):.1f} % | "
        f"{int((np.abs(found - moved.to_numpy()) < reach).sum())} of {len(found)}"
    )


def floor(legs: list[pl.DataFrame]) -> float:
    """RMS error of masses with no error of scale, in percent."""
    own = [f["raw"] - f.select(pl.col("raw").mean().over("vehicle_id"))["raw"] for f in legs]
    return 100.0 * float((pl.concat(own) ** 2).mean()) ** 0.5


def recognised(legs: list[pl.DataFrame], learnt: list[pl.DataFrame]) -> list[str]:
    """Rows of the table of odd vehicles: how often each reason was given, and the errors."""
    rows = pl.concat([
        f.group_by("vehicle_id").agg(
            pl.col("odd").first(), before=(pl.col("raw") ** 2).mean().sqrt(),
            after=(pl.col("error") ** 2).mean().sqrt(),
        ).join(n.select("vehicle_id", "factor_reason_id"), on="vehicle_id")
        for f, n in zip(legs, learnt, strict=True)
    ])  # fmt: skip
    made = []
    for odd in ("", "crane", "two in the crew", "wrong tare", "never empty"):
        own = rows.filter(pl.col("odd") == odd)
        counts = [
            int((own["factor_reason_id"] == f"fleet.scale_{name}").sum())
            for name in ("empty", "wrong", "never")
        ]
        made.append(
            f"| {odd or 'nothing odd'} | {own.height} | "
            + " | ".join(map(str, counts))
            + f" | {rms(own, 'before'):.1f} % | {rms(own, 'after'):.1f} % | "
            f"{100.0 * (own['after'] - own['before']).max():+.1f} % |"
        )
    return made


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tuned", action="store_true", help="print the fleets of the tuning")
    given = parser.parse_args()
    found = [of_seed(seed) for seed in (TUNED if given.tuned else JUDGED)]
    kinds = ("as weighed", "no ticket", "a ticket")
    lists = {name: [list(column) for column in zip(*(f[name] for f in found), strict=True)]
             for name in kinds}  # fmt: skip
    names = ("as weighed", "learnt without a ticket", "learnt with one ticket per type")
    values = {
        "rows": "\n".join(
            f"| {name} | {figures(*lists[kind])} |" for kind, name in zip(kinds, names, strict=True)
        ),
        "odd": "\n".join(recognised(*lists["no ticket"][:2])),
        "floor": f"{floor(lists['as weighed'][0]):.2f} %",
        "date": f"{datetime.now():%d %B %Y}".lstrip("0"),
    }
    if given.tuned:
        print("\n".join(values.values()))
        return
    with tempfile.TemporaryDirectory() as home:
        values["simulated"] = sentences(*of_drives(Path(home)))
    text = filled(HERE / "fleet_scale.template.md", values)
    (HERE / "fleet_scale.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
