"""What was not judged, and why: legs or drives by what they lack, and how often."""

from __future__ import annotations

from typing import Final

import polars as pl

from weighbridge.messages import Problem

PREVENTED: Final = ("mass", "overload", "payload")
"""What may not be known of a leg, the worst first: each also prevents those behind it."""


def with_causes(rows: pl.DataFrame, permitted: str) -> pl.DataFrame:
    """Add what is not known of each row first of `PREVENTED`, and why.

    Parameters
    ----------
    rows : with ``mass_kg``, ``tare_kg``, ``gross_kg``, ``vehicle_file``, ``reason`` and
        ``reason_id``
    permitted : column of the permitted mass

    Returns
    -------
    polars.DataFrame
        The rows with ``prevents``, ``reason_id`` and ``reason``; null where all is known.
    """
    lacks = (
        ("mass", pl.col("mass_kg").is_null(), None),
        (
            "overload",
            pl.col(permitted).is_null() & pl.col("vehicle_file").is_null(),
            Problem.of("fleet.no_file"),
        ),
        (
            "overload",
            pl.col(permitted).is_null() & pl.col("gross_kg").is_not_null(),
            Problem.of("fleet.trailer_reported"),
        ),
        ("overload", pl.col(permitted).is_null(), Problem.of("fleet.no_permitted")),
        ("payload", pl.col("tare_kg").is_null(), Problem.of("fleet.no_tare")),
    )
    found = {name: pl.lit(None, pl.String) for name in ("prevents", "reason_id", "reason")}
    for what, lacking, problem in reversed(lacks):
        reported = {
            "prevents": pl.lit(what),
            "reason_id": pl.col("reason_id") if problem is None else pl.lit(problem.id),
            "reason": pl.col("reason") if problem is None else pl.lit(problem.text),
        }
        found = {n: pl.when(lacking).then(reported[n]).otherwise(found[n]) for n in found}
    return rows.with_columns(**found)


def unjudged(rows: pl.DataFrame) -> pl.DataFrame:
    """Return the causes for which legs or drives were not judged, ranked.

    Parameters
    ----------
    rows : as of `with_causes`, with ``vehicle_id`` and ``distance_km``

    Returns
    -------
    polars.DataFrame
        ``prevents`` (in the order of `PREVENTED`), ``reason_id``, ``example`` (a sentence),
        ``count`` (of rows; most frequent first), ``share`` (of all rows), ``distance_km``,
        ``vehicles`` (their ids).
    """
    rank = {name: number for number, name in enumerate(PREVENTED)}
    return (
        rows.filter(pl.col("prevents").is_not_null())
        .group_by("prevents", "reason_id")
        .agg(
            pl.col("reason").sort().first().alias("example"),
            pl.len().cast(pl.Int64).alias("count"),
            (pl.len() / max(rows.height, 1)).alias("share"),
            pl.col("distance_km").sum(),
            pl.col("vehicle_id").unique().sort().alias("vehicles"),
        )
        .sort(
            pl.col("prevents").replace_strict(rank, return_dtype=pl.Int32),
            "count",
            "reason_id",
            descending=[False, True, False],
        )
    )
