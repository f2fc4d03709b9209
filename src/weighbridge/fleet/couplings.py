"""When trailers were coupled, as the fleet knows it, and the legs driven with them."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

import polars as pl

from weighbridge.errors import ConfigError
from weighbridge.fleet.tickets import POSSIBLE, instant_of, rows_of

COLUMNS: Final = ("vehicle", "start", "end", "permitted_kg")
"""Columns of a table of couplings: id of the vehicle, when its trailer was coupled and uncoupled
(UTC where no zone is named; an empty end is none yet), permitted mass of vehicle and trailer."""

_TIME: Final = pl.Datetime("us", "UTC")
_NEVER: Final = datetime(9999, 1, 1, tzinfo=UTC)


class Coupling(NamedTuple):
    """A trailer behind a vehicle: from when to when, permitted mass of both [kg]."""

    vehicle: str
    start: datetime
    end: datetime
    permitted: float


def read_couplings(path: Path) -> list[Coupling]:
    """Read a table of couplings, CSV or Parquet, see `COLUMNS`.

    Raises
    ------
    ConfigError
        It cannot be read, lacks a column, or a row is impossible.
    """
    return [_coupling(cells, where) for where, cells in rows_of(path, COLUMNS)]


def _coupling(cells: tuple[Any, ...], where: str) -> Coupling:
    vehicle, start, end, permitted = cells
    try:
        begun, ended = instant_of(start), _NEVER if end in (None, "") else instant_of(end)
        mass = float(permitted)
    except (TypeError, ValueError):
        raise ConfigError(
            f"{where}: start {start!r}, end {end!r} and permitted_kg {permitted!r} must be dates "
            "and times such as 2026-05-01T06:30:00Z and kilograms"
        ) from None
    if not begun < ended:
        raise ConfigError(f"{where}: end {end!r} is not after start {start!r}")
    if vehicle is None or not POSSIBLE[0] <= mass <= POSSIBLE[1]:
        raise ConfigError(f"{where}: vehicle {vehicle!r} with {mass:g} kg is no permitted mass")
    return Coupling(str(vehicle), begun, ended, mass)


def with_couplings(legs: pl.DataFrame, couplings: Sequence[Coupling]) -> pl.DataFrame:
    """Add the permitted mass of each leg, and whether a trailer was coupled at its middle.

    A trailer that the vehicle reports is coupled, too. Without a row of the table nobody knows what
    both may have.

    Parameters
    ----------
    legs : with the columns ``vehicle_id``, ``start``, ``end`` [UTC], ``gross_kg`` and
        ``trailer_connected``
    couplings : of a vehicle, the one that began last counts

    Returns
    -------
    The legs, in their order, with ``permitted_kg`` and ``coupled``
    """
    known = pl.DataFrame(
        couplings,
        schema={
            "vehicle_id": pl.String,
            "_start": _TIME,
            "_end": _TIME,
            "_permitted": pl.Float64,
        },
        orient="row",
    ).sort("_start")
    reported = pl.col("trailer_connected").fill_null(value=False)
    middle = pl.col("start") + (pl.col("end") - pl.col("start")) / 2
    rows = legs.with_row_index("_row").with_columns(_middle=middle)
    found = (
        rows.drop_nulls(["_middle", "vehicle_id"])
        .select("_row", "vehicle_id", "_middle")
        .sort("_middle")
        .join_asof(
            known, left_on="_middle", right_on="_start", by="vehicle_id", check_sortedness=False
        )
        .filter(pl.col("_middle") < pl.col("_end"))
        .select("_row", "_permitted")
    )
    return (
        rows.join(found, on="_row", how="left", maintain_order="left")
        .with_columns(
            permitted_kg=pl.when(reported & pl.col("_permitted").is_null())
            .then(None)
            .otherwise(pl.coalesce("_permitted", "gross_kg")),
            coupled=pl.col("_permitted").is_not_null() | reported,
        )
        .drop("_row", "_middle", "_permitted")
    )
