"""What fleets ask, from the rows of the results: per vehicle and in all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Final

import polars as pl

from weighbridge.errors import ConfigError
from weighbridge.fleet.schema import PERIOD

SPEEDS: Final = (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0)
"""Lower edges of average speed [km/h]; the last has no upper one."""

MASSES: Final = (0.0, 3.5, 7.5, 12.0, 18.0, 26.0, 32.0, 40.0)
"""Lower edges of average total mass [t]; the last has no upper one."""


def per_vehicle(legs: pl.DataFrame, changes: pl.DataFrame) -> pl.DataFrame:
    """Return one row per vehicle.

    Parameters
    ----------
    legs, changes : as of `weighbridge.fleet.legs`

    Returns
    -------
    polars.DataFrame
        ``vehicle_id``, ``vehicle_class``, ``type``, ``has_file``, ``tare_kg``, ``gross_kg``,
        ``drives``, ``legs``, ``distance_km``, ``known_km`` (with a mass), ``known_share``, ``tkm``,
        ``tkm_std``, ``tkm_shared`` (part of it that its class or type shares), ``payload_km``
        (with a payload), ``mean_payload_kg`` (by distance), ``mean_payload_std_kg``,
        ``empty_km``, ``empty_share``, ``warnings``,
        ``alarms`` (legs), ``worst_overload``, ``trailer_legs``, ``changes``, ``last_kg``,
        ``last_std_kg``, ``last_time``.
    """
    known = pl.col("mass_kg").is_not_null()
    paid = pl.col("payload_kg").is_not_null()
    way = pl.col("distance_km").fill_null(0.0)
    own = (pl.col("std_kg").pow(2) - pl.col("shared_kg").fill_null(0.0).pow(2)).clip(0.0)
    tonnes = 1e-3 * way
    shared = (tonnes * pl.col("shared_kg").fill_null(0.0)).filter(paid).sum()
    common = (tonnes * pl.col("common_kg").fill_null(0.0)).filter(paid).sum()
    alone = (tonnes.pow(2) * own).filter(paid).sum()
    last = pl.col("mass_kg", "std_kg", "start").filter(known).last()
    found = legs.group_by("vehicle_id", maintain_order=True).agg(
        pl.col("vehicle_class", "type").drop_nulls().last(),
        pl.col("vehicle_file").is_not_null().any().alias("has_file"),
        pl.col("tare_kg", "gross_kg").drop_nulls().last(),
        pl.struct("key", "part").n_unique().cast(pl.Int64).alias("drives"),
        pl.len().cast(pl.Int64).alias("legs"),
        way.sum(),
        way.filter(known).sum().alias("known_km"),
        # The sum of no payloads is not known, and is not nothing.
        pl.when(paid.any()).then(pl.col("tkm").sum()).alias("tkm"),
        pl.when(paid.any()).then((shared.pow(2) + alone).sqrt()).alias("tkm_std"),
        pl.when(paid.any()).then(common).alias("tkm_shared"),
        way.filter(paid).sum().alias("payload_km"),
        (pl.col("payload_kg") * way).filter(paid).sum().alias("load_km"),
        way.filter(pl.col("empty").fill_null(value=False)).sum().alias("empty_km"),
        way.filter(pl.col("empty").is_not_null()).sum().alias("judged_km"),
        (pl.col("level") == "warn").sum().cast(pl.Int64).alias("warnings"),
        (pl.col("level") == "alarm").sum().cast(pl.Int64).alias("alarms"),
        pl.col("overload").max().alias("worst_overload"),
        pl.col("trailer").fill_null(value=False).sum().cast(pl.Int64).alias("trailer_legs"),
        last.name.map(lambda name: f"last_{name}"),
    )
    count = changes.group_by("vehicle_id").agg(pl.len().cast(pl.Int64).alias("changes"))
    return (
        found.join(count, on="vehicle_id", how="left", nulls_equal=True)
        .with_columns(
            pl.col("changes").fill_null(0),
            known_share=_ratio("known_km", "distance_km"),
            mean_payload_kg=_ratio("load_km", "payload_km"),
            mean_payload_std_kg=1e3 * _ratio("tkm_std", "payload_km"),
            empty_share=_ratio("empty_km", "judged_km"),
        )
        .rename(
            {"last_mass_kg": "last_kg", "last_start": "last_time"},
        )
        .drop("load_km")
    )


def totals(vehicles: pl.DataFrame) -> dict[str, Any]:
    """Return the sums over all vehicles.

    What vehicles share of their errors adds up as it is: those of a class all that a data sheet
    leaves, those of a type its error where the fleet showed their scales. Classes, types, and all
    other errors, add up by their squares.

    Parameters
    ----------
    vehicles : as of `per_vehicle`
    """
    counted = ("drives", "legs", "warnings", "alarms", "trailer_legs", "changes")
    summed = ("distance_km", "known_km", "tkm", "payload_km", "empty_km", "judged_km")
    found: dict[str, Any] = {"vehicles": vehicles.height}
    found |= {name: int(vehicles[name].sum()) for name in counted}
    found |= {name: float(vehicles[name].sum()) for name in summed}
    shared = vehicles.group_by("vehicle_class", "type").agg(pl.col("tkm_shared").sum())[
        "tkm_shared"
    ]
    alone = vehicles["tkm_std"] ** 2 - vehicles["tkm_shared"] ** 2
    found["tkm_std"] = math.sqrt(float((shared**2).sum()) + float(alone.sum()))
    for name, part, whole in (
        ("known_share", "known_km", "distance_km"),
        ("empty_share", "empty_km", "judged_km"),
    ):
        found[name] = found[part] / found[whole] if found[whole] > 0.0 else None
    found["without_file"] = int((~vehicles["has_file"]).sum())
    return found


def quality(drives: pl.DataFrame) -> pl.DataFrame:
    """Return what is wrong with the data, by vehicle: most frequent first.

    Sentences that differ in numbers alone are one problem.

    Parameters
    ----------
    drives : as of `read_drives`, collected

    Returns
    -------
    polars.DataFrame
        ``vehicle_id``, ``kind`` (unread, failed, no mass, warning), ``example`` (a sentence),
        ``drives`` (how many have it), ``share`` (of the vehicle's), ``last`` (start).
    """
    bad = drives.filter(pl.col("mass_kg").is_null()).select(
        "vehicle_id",
        "start",
        pl.when(pl.col("outcome") == "weighed").then(pl.lit("no mass"))
        .otherwise(pl.col("outcome")).alias("kind"),
        pl.col("reason").alias("example"),
    )  # fmt: skip
    warned = (
        drives.select("vehicle_id", "start", pl.lit("warning").alias("kind"),
                      pl.col("warnings").alias("example"))
        .explode("example").drop_nulls("example")
    )  # fmt: skip
    sentence = pl.col("example").str.replace_all(r"[-+−]?\d[\d.,:]*", "…")
    of = drives.group_by("vehicle_id").agg(pl.len().alias("of"))
    rank = {"failed": 0, "unread": 1, "no mass": 2, "warning": 3}
    return (
        pl.concat([bad, warned])
        .group_by("vehicle_id", "kind", sentence.alias("sentence"), maintain_order=True)
        .agg(
            pl.col("example").last(),
            pl.len().cast(pl.Int64).alias("drives"),
            pl.col("start").max().alias("last"),
        )
        .join(of, on="vehicle_id", how="left", nulls_equal=True)
        .with_columns(share=pl.col("drives") / pl.col("of"))
        .sort(
            pl.col("kind").replace_strict(rank, default=9),
            "drives",
            "vehicle_id",
            descending=[False, True, False],
        )
        .drop("sentence", "of")
    )


def rfms(legs: pl.DataFrame) -> pl.DataFrame:
    """Return the last mass of each vehicle under the name that rFMS has for it.

    ``grossCombinationVehicleWeight`` is a whole number of kilograms in the vehicle status of the
    remote FMS standard (rFMS, from version 2 on).

    Parameters
    ----------
    legs : as of `weighbridge.fleet.legs.legs`

    Returns
    -------
    polars.DataFrame
        ``vehicle_id``, ``createdDateTime`` (ISO 8601, UTC), ``grossCombinationVehicleWeight``.
    """
    known = legs.filter(pl.col("mass_kg").is_not_null() & pl.col("end").is_not_null())
    return (
        known.sort("end")
        .group_by("vehicle_id")
        .last()
        .sort("vehicle_id")
        .select(
            "vehicle_id",
            pl.col("end").dt.strftime("%Y-%m-%dT%H:%M:%SZ").alias("createdDateTime"),
            pl.col("mass_kg").round().cast(pl.Int64).alias("grossCombinationVehicleWeight"),
        )
    )


def speed_mass(
    drives: pl.DataFrame,
    segments: pl.DataFrame,
    *,
    by_vehicle: bool = False,
    speeds: Sequence[float] = SPEEDS,
    masses: Sequence[float] = MASSES,
) -> pl.DataFrame:
    """Return distance and time by average speed and average total mass of periods of 5 min.

    Such a table is what Regulation (EU) 2025/2161, article 1, points 12 to 14, has a vehicle
    accumulate: each period of a trip is indexed by its average speed and total mass.

    Parameters
    ----------
    drives, segments : as of `read_drives` and `read_segments`, collected
    by_vehicle : a table for each vehicle
    speeds, masses : lower edges, rising from 0 [km/h], [t]

    Returns
    -------
    polars.DataFrame
        ``vehicle_id`` where asked for, ``speed_kmh`` and ``mass_t`` (lower edges; null where the
        mass is not known), ``distance_km``, ``hours``.

    Raises
    ------
    ConfigError
        Edges do not rise from 0.
    """
    for name, edges in (("speeds", speeds), ("masses", masses)):
        rising = all(a < b for a, b in pairwise(edges))
        if not edges or edges[0] != 0.0 or not rising:
            raise ConfigError(f"{name} must rise from 0, got {list(edges)}")
    of = drives.select(
        "key", "part", "vehicle_id", "load_changed", pl.col("mass_kg").alias("drive_mass")
    )
    numbered = pl.int_ranges(pl.col("period_km").list.len()).alias("number")
    periods = (
        segments.drop("vehicle_id", strict=False)
        .join(of, on=["key", "part"])
        .with_columns(numbered)
        .explode("period_km", "number")
        .drop_nulls("period_km")
        .with_columns(
            seconds=(pl.col("to_s") - pl.col("from_s") - PERIOD * pl.col("number"))
            .clip(upper_bound=PERIOD),
            tonnes=1e-3
            * pl.when(pl.col("load_changed") | pl.col("start_s").is_null())
            .then("mass_kg").otherwise("drive_mass"),
        )
        .filter(pl.col("seconds") > 0.0)
    )  # fmt: skip
    pace = 3600.0 * pl.col("period_km") / pl.col("seconds")
    keys = ["vehicle_id"] if by_vehicle else []
    return (
        periods.with_columns(
            speed_kmh=_lower(pace, speeds), mass_t=_lower(pl.col("tonnes"), masses)
        )
        .group_by(*keys, "speed_kmh", "mass_t")
        .agg(
            pl.col("period_km").sum().alias("distance_km"),
            (pl.col("seconds").sum() / 3600.0).alias("hours"),
        )
        .sort(*keys, "mass_t", "speed_kmh", nulls_last=True)
    )


def _lower(value: pl.Expr, edges: Sequence[float]) -> pl.Expr:
    """Lower edge of the range that a value is in."""
    found = pl.lit(None, pl.Float64)
    for edge in edges:
        found = pl.when(value >= edge).then(pl.lit(edge)).otherwise(found)
    return found


def _ratio(part: str, whole: str) -> pl.Expr:
    return pl.when(pl.col(whole) > 0.0).then(pl.col(part) / pl.col(whole))
