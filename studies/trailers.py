"""How many trailers that nobody announced does a fleet find, and by what? Run me.

    python studies/trailers.py --seed 9301 --trucks 10 --days 3 --rows rows.parquet

Trucks of `weighbridge simulate fleet` draw a trailer on a quarter of their drives. Each drive is
weighed with a vehicle file made from papers; what `weighbridge fleet` keeps of it goes through the
same law as in a report. Printed are the legs that are reported, by kind of trailer and by the least
probability, and how well each single sign parts trailers from loads. With --rows the drives are
kept, and are read again when the file is there.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

import weighbridge as wb
from weighbridge.fleet.facts import row_of
from weighbridge.fleet.legs import legs
from weighbridge.fleet.schema import DRIVES, SEGMENTS
from weighbridge.simulation.fleet import FleetSettings, PlannedDay, plan_fleet, simulate_day
from weighbridge.simulation.fleet_files import vehicle_file
from weighbridge.simulation.simulate import SimulatedDrive

SHARE: Final = 0.25  # of the drives with a trailer [-]
LIMITS: Final = (0.5, 0.8, 0.9, 0.95)
EARLIER: Final = 1.25  # multiple of the permitted mass that was the rule before [-]
TRUTH: Final = {"trailer": pl.String(), "trailer_kg": pl.Float64(), "first_kg": pl.Float64(),
                "last_kg": pl.Float64(), "segments": pl.List(pl.Struct(
                    {name: column.type for name, column in SEGMENTS.items()}))}  # fmt: skip


def weighed(seed: int, trucks: int, days: int, share: float) -> pl.DataFrame:
    """Simulate and weigh the drives of a fleet's trucks: rows of `DRIVES` and `TRUTH`."""
    # Two of five vehicles are trucks.
    count = -(-5 * trucks // 2)
    _, planned = plan_fleet(FleetSettings(vehicles=count, days=days, seed=seed, trailers=share))
    rows = []
    for day in planned:
        if day.vehicle.kind == "truck":
            for number, made in enumerate(simulate_day(day)):
                rows.append(row(day, number, made))
            print(f"{day.vehicle.id}: {len(rows)} drives", flush=True)
    schema = {name: column.type for name, column in DRIVES.items()} | TRUTH
    return pl.DataFrame(rows, schema=schema, orient="row")


def row(day: PlannedDay, number: int, made: SimulatedDrive) -> dict[str, Any]:
    """Weigh one drive as a fleet does."""
    info = replace(
        made.drive.info, mass=None, wind_speed=None, wind_from=None, ambient_temperature=None,
        barometric_pressure=None, notes=None,
    )  # fmt: skip
    found = row_of(wb.weigh(replace(made.drive, info=info), vehicle_file(day.vehicle)))
    trailer, mass = day.trailers[number], made.truth.mass
    key = f"{day.vehicle.id} {day.starts[number]:%m-%d %H:%M}"
    own = {"key": key, "part": 0, "vehicle_id": day.vehicle.id, "source": key}
    return (
        dict.fromkeys((*DRIVES, *TRUTH))
        | found
        | own
        | {
            "outcome": "weighed",
            "vehicle_digest": "",
            "vehicle_file": day.vehicle.id,
            "trailer": trailer.kind if trailer else "",
            "trailer_kg": trailer.mass if trailer else 0.0,
            "first_kg": float(mass[0]),
            "last_kg": float(mass[-1]),
            "segments": [dict.fromkeys(SEGMENTS) | s | own for s in found["segments"]],
        }
    )


def judged(rows: pl.DataFrame) -> pl.DataFrame:
    """Return the legs with a mass, as a report has them, and what was so."""
    inner = {name: column.type for name, column in SEGMENTS.items()}
    parts = pl.DataFrame(
        [segment for own in rows["segments"] for segment in own], schema=inner, orient="row"
    )
    of = rows.select("key", pl.col("trailer").alias("kind"), "trailer_kg", "drag_area_m2", "slip")
    found = legs(rows.select(list(DRIVES)), parts).join(of, on="key")
    return found.filter(pl.col("mass_kg").is_not_null())


def report(found: pl.DataFrame) -> None:
    """Print how many legs of each kind are reported, and by the rule before."""
    for kind, name in (("", "without a trailer"), ("box", "box"), ("flat", "flat")):
        own = found.filter(kind=kind)
        at = ", ".join(
            f"{own.filter(pl.col('trailer_probability') >= p).height} from {p:g}" for p in LIMITS
        )
        before = own.filter(pl.col("mass_kg") > EARLIER * pl.col("gross_kg")).height
        print(f"{name}: {own.height} legs; reported {at}; by the mass alone {before}")


def signs(found: pl.DataFrame) -> None:
    """Print the chance that a leg with a trailer shows more of a sign than one without."""
    bare = found.filter(kind="").group_by("vehicle_id").agg(
        pl.col("drag_area_m2").mean().alias("area"), pl.col("slip").mean().alias("usual")
    )  # fmt: skip
    rows = found.join(bare, on="vehicle_id")
    for name, sign in (
        ("mass over the permitted one", pl.col("mass_kg") / pl.col("gross_kg")),
        ("drag area over the vehicle's own", pl.col("drag_area_m2") - pl.col("area")),
        ("slip over the vehicle's own", pl.col("slip") / pl.col("usual")),
        ("all", pl.col("trailer_probability")),
    ):
        values = rows.select("kind", sign.alias("sign")).drop_nulls()
        alone = values.filter(kind="")["sign"].to_numpy()
        for kind in ("box", "flat"):
            towed = values.filter(kind=kind)["sign"].to_numpy()
            if towed.size:
                print(f"{name}, {kind}: {np.mean(towed[:, None] > alone):.2f}")


def main() -> None:
    """Simulate, weigh and judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--trucks", type=int, default=10)
    parser.add_argument("--days", type=int, default=3)
    parser.add_argument("--share", type=float, default=SHARE)
    parser.add_argument("--rows", type=Path)
    given = parser.parse_args()
    if given.rows is not None and given.rows.exists():
        rows = pl.read_parquet(given.rows)
    else:
        rows = weighed(given.seed, given.trucks, given.days, given.share)
        if given.rows is not None:
            rows.write_parquet(given.rows)
    found = judged(rows)
    report(found)
    signs(found)


if __name__ == "__main__":
    main()
