"""Does the answer of a fleet fit what was so? Run me.

    weighbridge simulate fleet -o FLEET --vehicles 50 --days 5 --seed 183500
    weighbridge fleet FLEET/drives.csv --vehicles FLEET/vehicles -o RESULTS
    python studies/fleet.py FLEET RESULTS

The rows of the results are compared with FLEET/truth.csv leg by leg and stop by stop. A leg of the
results belongs to the leg of the truth that it overlaps most. A drive whose change of load was not
told has one mass for two loads: it is judged against the load that it overlaps most.
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path
from typing import Final

import polars as pl

import weighbridge as wb
from weighbridge.fleet.legs import SURE
from weighbridge.fleet.reporting import FleetReport

CHANGED: Final = 20.0  # a smaller difference of two true masses is fuel [kg]


def truth(folder: Path) -> pl.DataFrame:
    """Return the true legs, in order of vehicle and time."""
    rows = pl.read_csv(folder / "truth.csv", schema_overrides={"fault": pl.String})
    start = pl.col("start").str.to_datetime(time_zone="UTC")
    payload, room = pl.col("mass_kg") - pl.col("tare_kg"), pl.col("gross_kg") - pl.col("tare_kg")
    return rows.with_columns(
        pl.col("fault").fill_null(""),
        begin=start + pl.duration(milliseconds=1e3 * pl.col("start_s")),
        end=start + pl.duration(milliseconds=1e3 * pl.col("end_s")),
        over=pl.col("mass_kg") > pl.col("gross_kg"),
        towed=pl.col("trailer_kg") > 0.0,
        bare=payload < 0.1 * room,
    ).sort("vehicle", "begin")


def joined(found: FleetReport, true: pl.DataFrame) -> pl.DataFrame:
    """Return each told leg with the true leg that it overlaps most."""
    told = found.legs.with_row_index("row").with_columns(
        files=pl.col("source").str.extract(r"(drives/[^/]+/[^/]+)/?$")
    )
    pairs = told.join(true, on="files", how="left", suffix="_true", maintain_order="left")
    first, last = pl.max_horizontal("start", "begin"), pl.min_horizontal("end", "end_true")
    overlap = (last - first).dt.total_milliseconds().fill_null(0)
    return (
        pairs.with_columns(overlap=overlap)
        .sort("row", "overlap", descending=[False, True])
        .unique("row", keep="first", maintain_order=True)
        .with_columns(error=pl.col("mass_kg") / pl.col("mass_kg_true") - 1.0)
    )


def count(frame: pl.DataFrame, *conditions: pl.Expr) -> int:
    """Count the rows that meet all conditions."""
    return frame.filter(*conditions).height


def overloads(legs: pl.DataFrame) -> None:
    """Print who is told as overloaded, and who was."""
    judged = legs.filter(pl.col("overload").is_not_null())
    over = pl.col("over")
    for name, one in (("alarm", pl.col("level") == "alarm"), ("warn", pl.col("level") == "warn")):
        told = judged.filter(one)
        print(f"{name}: {told.height} legs, overloaded {count(told, over)}, of them with a trailer "
              f"{count(told, over, pl.col('towed'))}; not overloaded {count(told, ~over)}, sum of "
              f"probabilities {told['overload'].sum():.1f}")  # fmt: skip
    missed = judged.filter(over, pl.col("level") == "ok")
    print(f"overloaded and told as ok: {missed.height} of {count(judged, over)}")
    edges = [0.0, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 1.0001]
    for low, high in pairwise(edges):
        own = judged.filter(pl.col("overload") >= low, pl.col("overload") < high)
        print(f"  {low:.2f} to {min(high, 1.0):.2f}: {own.height} legs, expected "
              f"{own['overload'].sum():.1f}, overloaded {count(own, over)}")  # fmt: skip
    wrong = judged.filter(((pl.col("level") != "ok") & ~over) | ((pl.col("level") == "ok") & over))
    show(wrong, "wrongly told")
    without = legs.filter(pl.col("overload").is_null(), over)
    print(f"overloaded without an answer: {without.height}")
    show(without, "without an answer")


def show(rows: pl.DataFrame, name: str) -> None:
    """Print legs, one a line."""
    for r in rows.iter_rows(named=True):
        mass = "no mass" if r["mass_kg"] is None else f"{r['mass_kg']:.0f} ± {r['std_kg']:.0f} kg"
        likely = "" if r["overload"] is None else f"P {r['overload']:.3f}, "
        print(f"    {name}: {r['vehicle_id']} {r['start']:%m-%d %H:%M} leg {r['leg']}: {mass}, "
              f"true {r['mass_kg_true']:.0f} of {r['gross_kg_true']:.0f}, {likely}trailer "
              f"{r['trailer_kg']:.0f}, fault {r['fault']!r}; {r['reason'][:70]}")  # fmt: skip


def masses(legs: pl.DataFrame) -> None:
    """Print errors and intervals, by what was wrong with the drive."""
    for (fault,), own in legs.group_by("fault", maintain_order=True):
        have = own.filter(pl.col("mass_kg").is_not_null())
        if have.is_empty():
            print(f"fault {fault!r}: {own.height} legs, no mass")
            continue
        held = pl.col("mass_kg_true").is_between("low95_kg", "high95_kg")
        rms = 100.0 * (have["error"] ** 2).mean() ** 0.5
        std = 100.0 * (have["std_kg"] / have["mass_kg"]).median()
        worst = 100.0 * have["error"].abs().max()
        print(f"fault {fault!r}: {own.height} legs, {have.height} with a mass, RMS {rms:.1f} %, "
              f"worst {worst:.1f} %, told {std:.1f} %, held {count(have, held)}")  # fmt: skip
    clean = legs.filter(pl.col("fault") == "", pl.col("mass_kg").is_not_null())
    held = pl.col("mass_kg_true").is_between("low95_kg", "high95_kg")
    for name in ("vehicle_class", "towed", "has_file"):
        parts = clean.with_columns(has_file=pl.col("vehicle_file").is_not_null())
        for (value,), own in parts.group_by(name, maintain_order=True):
            rms = 100.0 * (own["error"] ** 2).mean() ** 0.5
            print(f"  {name} {value}: {own.height} legs, RMS {rms:.1f} %, held {count(own, held)}")
    show(clean.filter(~held), "out of its interval")


def changes(found: FleetReport, legs: pl.DataFrame, true: pl.DataFrame) -> None:
    """Print which changes of load were told, at the stops between two legs with a mass."""
    before = pl.col("mass_kg_true", "towed", "files", "leg_true").shift(1).over("vehicle_id")
    pairs = (
        legs.filter(pl.col("mass_kg").is_not_null())
        .sort("vehicle_id", "start")
        .with_columns(before.name.prefix("old_"))
        .filter(pl.col("old_files").is_not_null())
        .with_columns(
            change=pl.col("mass_kg_true") - pl.col("old_mass_kg_true"),
            within=pl.col("files") == pl.col("old_files"),
            hitched=pl.col("towed") != pl.col("old_towed"),
        )
    )
    told = found.changes.select(
        "vehicle_id", pl.col("time").alias("start"), "change_kg", "kind",
        pl.col("std_kg").alias("change_std"),
    )  # fmt: skip
    pairs = pairs.join(told, on=["vehicle_id", "start"], how="left")
    said, real = pl.col("change_kg").is_not_null(), pl.col("change").abs() > CHANGED
    split = pairs.filter(pl.col("within"))
    stops = true.group_by("files").agg(pl.len(), pl.col("mass_kg").diff().last().alias("change"))
    weighed = pairs.select("files").unique()
    stops = stops.filter(pl.col("len") > 1).join(weighed, on="files", how="semi")
    parted = split.filter(real).select("files").unique()
    missed = stops.join(parted, on="files", how="anti")
    print(f"changes within a drive with a mass: {stops.height} true, {parted.height} told, missed "
          f"{missed.height}; told where none was {count(split, ~real)}")  # fmt: skip
    for r in missed.iter_rows(named=True):
        print(f"    missed: {r['files']} {r['change']:+.0f} kg")
    for r in split.filter(~real).iter_rows(named=True):
        print(f"    false: {r['files']} {r['change_kg']:+.0f} ± {r['change_std']:.0f} kg")
    between = pairs.filter(~pl.col("within"))
    print(f"changes between drives: {count(between, real)} of {between.height} stops, told "
          f"{count(between, real, said)}; told where none was {count(between, ~real, said)} of "
          f"{count(between, ~real)}")  # fmt: skip
    size = pl.col("change").abs() / pl.col("mass_kg_true")
    for low, high in pairwise([0.0, 0.02, 0.05, 0.1, 0.2, 9.0]):
        own = between.filter(real, size >= low, size < high)
        print(f"  {100 * low:.0f} to {100 * high:.0f} %: {own.height}, told {count(own, said)}")
    heard = pairs.filter(said)
    wrong = (heard["change"].sign() != heard["change_kg"].sign()).sum()
    error = (pl.col("change_kg") - pl.col("change")).abs()
    print(f"  told changes: {heard.height}, of the wrong sign {wrong}, within 1.96 standard "
          f"deviations {count(heard, error < SURE * pl.col('change_std'))}")  # fmt: skip
    named = pairs.filter(pl.col("kind").str.starts_with("trailer"))
    print(f"trailer on or off: {count(pairs, pl.col('hitched'))} true; told {named.height}, right "
          f"{count(named, pl.col('hitched'))}")  # fmt: skip


def states(found: FleetReport, legs: pl.DataFrame) -> None:
    """Print trailers, empty runs and sums."""
    have = legs.filter(pl.col("mass_kg").is_not_null(), pl.col("gross_kg").is_not_null())
    for name, told, was in (("trailer", "trailer", "towed"), ("empty", "empty", "bare")):
        yes, true = pl.col(told).fill_null(value=False), pl.col(was)
        print(f"{name}: true {count(have, true)}, told {count(have, yes)}, right "
              f"{count(have, yes, true)}, missed {count(have, ~yes, true)}")  # fmt: skip
    carried = (pl.col("mass_kg_true") - pl.col("tare_kg_true")).clip(0.0) * pl.col("distance_km")
    real = 1e-3 * have.filter(pl.col("tkm").is_not_null()).select(carried.sum()).item()
    t = found.totals
    print(
        f"t km: told {t['tkm']:.0f} ± {SURE * t['tkm_std']:.0f}, true {real:.0f} of the same legs"
    )
    way = have.filter(pl.col("bare"))["distance_km"].sum() / have["distance_km"].sum()
    print(f"driven empty: told {100 * t['empty_share']:.1f} %, true {100 * way:.1f} %")


def spans(found: FleetReport, true: pl.DataFrame) -> None:
    """Print how well the track keeps loads apart."""
    legs = true.with_columns(middle=pl.col("begin") + (pl.col("end") - pl.col("begin")) / 2)
    pairs = found.track.with_row_index("span").join(
        legs, left_on="vehicle_id", right_on="vehicle", suffix="_true"
    )
    inside = pairs.filter(pl.col("middle").is_between("start", "end"))
    each = inside.group_by("span").agg(
        pl.col("mass_kg_true").max() - pl.col("mass_kg_true").min(),
        pl.len(), pl.col("mass_kg", "std_kg").first(),
        pl.col("mass_kg_true").mean().alias("mean"),
    )  # fmt: skip
    pure = each.filter(pl.col("mass_kg_true") <= CHANGED)
    error = (pl.col("mass_kg") - pl.col("mean")).abs()
    print(f"track: {found.track.height} spans; {each.height} hold the middle of a true leg, "
          f"of them {pure.height} of one load only; their mass is within 1.96 "
          f"standard deviations {count(pure, error < SURE * pl.col('std_kg'))} times")  # fmt: skip
    mixed = each.filter(pl.col("mass_kg_true") > CHANGED)
    share = mixed["mass_kg_true"] / mixed["mass_kg"]
    print(f"  the other {mixed.height} mix loads that differ by "
          f"{100 * (share.median() or 0):.0f} % in the median, "
          f"{100 * (share.max() or 0):.0f} % at most")  # fmt: skip


def main() -> None:
    """Compare the results of a simulated fleet with its truth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("fleet", type=Path)
    parser.add_argument("results", type=Path)
    given = parser.parse_args()
    true = truth(given.fleet)
    found = wb.fleet.report(given.results, tickets=given.fleet / "tickets.csv")
    drives = wb.fleet.read_drives(given.results).collect()
    print(f"{true['files'].n_unique()} drives, {drives.height} rows, "
          f"{drives['source'].n_unique()} of them of a drive of its own; "
          f"{drives['mass_kg'].is_not_null().sum()} masses")  # fmt: skip
    legs = joined(found, true)
    masses(legs)
    overloads(legs)
    changes(found, legs, true)
    states(found, legs)
    spans(found, true)


if __name__ == "__main__":
    main()
