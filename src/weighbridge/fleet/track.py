"""The track of a vehicle's masses: spans of time with one load, over drives and days."""

from __future__ import annotations

import polars as pl

from weighbridge.fleet.legs import Limits, load_changes


def track(legs: pl.DataFrame, limits: Limits | None = None) -> pl.DataFrame:
    """Return the spans with one load: legs of a vehicle between which no change of load was found.

    The masses of a span are pooled. Their own errors average out, by their squares; the error of
    the vehicle file is common to all and stays.

    Parameters
    ----------
    legs : as of `weighbridge.fleet.legs.legs`; those without a mass or a date are left out
    limits : by which a trailer and an empty vehicle are found

    Returns
    -------
    polars.DataFrame
        ``vehicle_id``, ``start``, ``end`` [UTC], ``legs``, ``distance_km``, ``mass_kg``,
        ``std_kg``, ``payload_kg``, ``state`` (empty, loaded, trailer; null where the vehicle's
        masses are not known), in order of vehicle and time.
    """
    limits = limits or Limits()
    known = legs.filter(pl.col("mass_kg").is_not_null() & pl.col("start").is_not_null())
    begun = load_changes(legs).select("vehicle_id", pl.col("time").alias("start"), changed=True)
    known = known.join(begun, on=["vehicle_id", "start"], how="left", nulls_equal=True)
    shared = pl.col("shared_kg").fill_null(0.0)
    # Less than a kilogram of its own error would make one leg all that counts.
    own = (pl.col("std_kg").pow(2) - shared.pow(2)).clip(lower_bound=1.0)
    # A trailer that is known to come or go begins a span, too.
    before = pl.col("coupled").shift(1).over("vehicle_id")
    hitched = (pl.col("coupled") != before).fill_null(value=False)
    spans = (
        known.sort("vehicle_id", "start")
        .with_columns(
            weight=own.pow(-1),
            scale=shared / pl.col("mass_kg"),
            span=(pl.col("changed").fill_null(value=False) | hitched).cum_sum().over("vehicle_id"),
        )
        .group_by("vehicle_id", "span", maintain_order=True)
        .agg(
            pl.col("start").first(),
            pl.col("end").last(),
            pl.len().cast(pl.Int64).alias("legs"),
            pl.col("distance_km").sum(),
            mass_kg=(pl.col("weight") * pl.col("mass_kg")).sum() / pl.col("weight").sum(),
            own=pl.col("weight").sum().pow(-1),
            scale=(pl.col("weight") * pl.col("scale")).sum() / pl.col("weight").sum(),
            tare=pl.col("tare_kg").drop_nulls().last(),
            gross=pl.col("gross_kg").drop_nulls().last(),
            towed=pl.col("trailer").any(),
        )
    )
    payload = pl.col("mass_kg") - pl.col("tare")
    state = (
        pl.when(pl.col("towed"))
        .then(pl.lit("trailer"))
        .when(payload < limits.empty * (pl.col("gross") - pl.col("tare")))
        .then(pl.lit("empty"))
        .when(payload.is_not_null() & pl.col("gross").is_not_null())
        .then(pl.lit("loaded"))
    )
    return spans.select(
        "vehicle_id",
        "start",
        "end",
        "legs",
        "distance_km",
        "mass_kg",
        std_kg=(pl.col("own") + (pl.col("scale") * pl.col("mass_kg")).pow(2)).sqrt(),
        payload_kg=payload,
        state=state,
    )
