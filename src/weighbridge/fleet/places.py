"""Which results count: a place holds one recording, and a recording counts once for a vehicle.

A place is the path or URL of a recording. What was found there last is what it holds. A recording
that lies at two places of one vehicle is a copy; at places of two vehicles it counts for both, and
both say so. One that is gone from a place, and was found at another, was moved.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, Final

import polars as pl

from weighbridge.fleet import remote
from weighbridge.fleet.names import some
from weighbridge.fleet.schema import DRIVES, FAILED, SEEN
from weighbridge.messages import Problem

HEAD: Final = ("key", "source", "copies", "content", "vehicle_id", "outcome", "weighed_at")
"""Columns of the table of drives that decide which of its rows count."""

_STATE: Final = ("source", "copies", "also_vehicles")

FOUND: Final[dict[str, Any]] = {
    "key": pl.String(),
    "place": pl.String(),
    "at": DRIVES["weighed_at"].type,
    "seen": SEEN["seen"],
}
"""Columns of places at which a run found a recording that has its result already."""

COPIED: Final = "fleet.copied"
SHARED: Final = "fleet.shared"
_NOTES: Final = (SHARED, COPIED)


def is_there(place: str) -> bool:
    """Say whether something is at a place still; true where that cannot be found out."""
    if os.path.lexists(place):
        return True
    return all(
        remote.exists(path) if remote.is_url(path) else os.path.lexists(path)
        for path in place.split(";")
    )


def standing(
    heads: pl.DataFrame, found: pl.DataFrame, there: Callable[[str], bool] | None = None
) -> pl.DataFrame:
    """Return the results that count, and where their recordings are.

    Parameters
    ----------
    heads : rows of `HEAD`, any number for each key
    found : rows of `FOUND`
    there : says whether a place still has something; None to take all places as they are

    Returns
    -------
    polars.DataFrame
        A row for each key that counts: ``key``, ``source``, ``copies``, ``also_vehicles``,
        ``notes`` and ``note_ids``.
    """
    heads = heads.unique("key", keep="first", maintain_order=True)
    own = heads.select(
        "key",
        pl.concat_list("source", pl.col("copies").fill_null([])).alias("place"),
        pl.col("weighed_at").alias("at"),
    ).explode("place")
    about = heads.select("key", "content", "vehicle_id", "weighed_at", failed=_failed())
    places = pl.concat([own, found.select(own.columns)]).join(about, on="key")
    # A try that failed says nothing of what is there: an earlier result stays.
    good = ~pl.col("failed")
    places = (
        places.filter(good | ~good.any().over("place", "vehicle_id"))
        .sort("at", "key", nulls_last=False)
        .unique("place", keep="last", maintain_order=True)
    )
    if there is not None:
        places = places.filter(~_moved(places, there))
    # The last result of a recording is that of all its places within the vehicle.
    same = pl.coalesce("content", "key"), pl.col("vehicle_id")
    places = places.sort("weighed_at", "key", nulls_last=False).with_columns(
        key=pl.col("key").last().over(*same)
    )
    keys = (
        places.sort("place")
        .group_by("key", maintain_order=True)
        .agg(pl.col("place"), pl.col("content", "vehicle_id").first())
    )
    all_of = pl.col("vehicle_id").unique().over("content", mapping_strategy="join")
    also = pl.when(pl.col("content").is_not_null()).then(all_of)
    keys = keys.with_columns(
        source=pl.col("place").list.first(),
        copies=pl.col("place").list.slice(1),
        also_vehicles=also.fill_null([])
        .list.set_difference(pl.concat_list("vehicle_id"))
        .list.sort(),
    )
    return _noted(keys.select("key", *_STATE))


def counted(rows: pl.LazyFrame, stand: pl.DataFrame) -> pl.LazyFrame:
    """Return the rows of drives that count, with their places and the notes about these.

    Parameters
    ----------
    rows : of drives
    stand : as of `standing`
    """
    # Notes of before are first in their lists.
    old = pl.col("problem_ids").list.eval(pl.element().is_in(_NOTES)).list.sum().fill_null(0)
    noted = pl.col("notes").list.len() > 0
    kept = {
        name: pl.when(noted)
        .then(pl.concat_list(notes, pl.col(name).fill_null([]).list.slice(old)))
        .otherwise(pl.col(name).list.slice(old))
        for name, notes in (("warnings", "notes"), ("problem_ids", "note_ids"))
    }
    return (
        rows.drop(_STATE, strict=False)
        .join(stand.lazy(), on="key", how="inner", maintain_order="left")
        .with_columns(**kept)
        .select(list(DRIVES))
    )


def _failed() -> pl.Expr:
    return (pl.col("outcome") == FAILED).fill_null(value=False)


def _moved(places: pl.DataFrame, there: Callable[[str], bool]) -> pl.Series:
    """Return which places have lost their recording to another."""
    several = (pl.len().over("content") > 1) & pl.col("content").is_not_null()
    asked = places.select("place", "content", several=several)
    gone = [few and not there(place) for place, _, few in asked.iter_rows()]
    left = pl.Series("gone", gone, pl.Boolean)
    return asked.with_columns(gone=left).select(
        moved=pl.col("gone") & (~pl.col("gone")).any().over("content")
    )["moved"]


def _noted(keys: pl.DataFrame) -> pl.DataFrame:
    """Add the notes of recordings that lie at several places."""
    notes, ids = [], []
    for _, _, copies, also in keys.iter_rows():
        own = []
        if also:
            own.append(Problem.of(SHARED, vehicles=some(also)))
        if copies:
            own.append(Problem.of(COPIED, count=len(copies), places=some(copies)))
        notes.append([problem.text for problem in own])
        ids.append([problem.id for problem in own])
    texts = pl.List(pl.String())
    return keys.with_columns(pl.Series("notes", notes, texts), pl.Series("note_ids", ids, texts))
