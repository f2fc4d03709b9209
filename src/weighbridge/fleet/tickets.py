"""Weighbridge tickets of a fleet, and the drives that they are of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final, NamedTuple

import polars as pl

from weighbridge.errors import ConfigError
from weighbridge.io import PARSE_ERRORS, first_line, quietly

COLUMNS: Final = ("vehicle", "time", "mass_kg")
"""Columns of a table of tickets: id of the vehicle, date and time (UTC where it names no zone), and
the mass."""

WITHIN: Final = timedelta(hours=1)
"""A ticket is of a drive or leg that ends so long before it, or begins so long after it, at
most."""

POSSIBLE: Final = (100.0, 200_000.0)
"""Masses that a vehicle can have, with its trailer [kg]."""

_TIME: Final = pl.Datetime("us", "UTC")


class Ticket(NamedTuple):
    """One weighing on a real weighbridge: vehicle, when, mass [kg]."""

    vehicle: str
    time: datetime
    mass: float


def read_tickets(path: Path) -> list[Ticket]:
    """Read a table of tickets, CSV or Parquet, see `COLUMNS`.

    Raises
    ------
    ConfigError
        It cannot be read, lacks a column, or a row is impossible.
    """
    return [_ticket(cells, where) for where, cells in rows_of(path, COLUMNS)]


def rows_of(path: Path, columns: Sequence[str]) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Yield each row of a table, CSV or Parquet, with the words for where it is.

    Raises
    ------
    ConfigError
        The table cannot be read, or lacks a column.
    """
    try:
        with path.open("rb") as file, quietly():
            csv = path.suffix.lower() == ".csv"
            frame = pl.read_csv(file, infer_schema=False) if csv else pl.read_parquet(file)
    except (*PARSE_ERRORS, OSError) as error:
        raise ConfigError(f"{path} cannot be read ({first_line(error)})") from None
    lacking = [name for name in columns if name not in frame.columns]
    if lacking:
        raise ConfigError(f"{path}: lacks the column {lacking[0]}; it needs {', '.join(columns)}")
    for number, cells in enumerate(frame.select(columns).iter_rows(), start=2):
        yield f"{path} row {number}", cells


def instant_of(cell: Any) -> datetime:
    """Return the instant of a cell in UTC, which it is in where it names no zone.

    Raises
    ------
    ValueError
        It is no date and time.
    """
    when = cell if isinstance(cell, datetime) else datetime.fromisoformat(str(cell))
    return (when if when.tzinfo else when.replace(tzinfo=UTC)).astimezone(UTC)


def _ticket(cells: tuple[Any, ...], where: str) -> Ticket:
    vehicle, time, mass = cells
    try:
        when = instant_of(time)
        weight = float(mass)
    except (TypeError, ValueError):
        raise ConfigError(
            f"{where}: time {time!r} and mass {mass!r} must be a date and time such as "
            "2026-05-01T06:30:00Z and kilograms"
        ) from None
    if vehicle is None or not POSSIBLE[0] <= weight <= POSSIBLE[1]:
        raise ConfigError(f"{where}: vehicle {vehicle!r} with {weight:g} kg is no vehicle's mass")
    return Ticket(str(vehicle), when, weight)


def with_tickets(spans: pl.DataFrame, tickets: Sequence[Ticket]) -> pl.DataFrame:
    """Return the spans whose mass a ticket gives.

    A ticket is of the span of its vehicle that is under way at its time, else of the nearest in
    time that ends or begins within `WITHIN`. Of several tickets of one span the nearest counts.

    Parameters
    ----------
    spans : drives or legs, with the columns ``vehicle_id``, ``start`` and ``end`` [UTC]
    tickets

    Returns
    -------
    Rows of ``spans`` with the column ``ticket_kg``, in their order
    """
    rows = spans.with_row_index("_row")
    known = pl.DataFrame(
        [(t.vehicle, t.time.astimezone(UTC), t.mass) for t in tickets],
        schema={"vehicle_id": pl.String, "_time": _TIME, "ticket_kg": pl.Float64},
        orient="row",
    )
    timed = rows.select("_row", "vehicle_id", "start", "end").drop_nulls().sort("start", "_row")
    same: dict[str, Any] = {"by": "vehicle_id", "check_sortedness": False, "coalesce": False}
    known = known.sort("_time")
    # The last span that began, and the next one.
    sides = (
        known.join_asof(timed, left_on="_time", right_on="start", strategy="backward", **same),
        known.join_asof(
            timed, left_on="_time", right_on="start", strategy="forward",
            allow_exact_matches=False, **same,
        ),
    )  # fmt: skip
    before, after = pl.col("start") - pl.col("_time"), pl.col("_time") - pl.col("end")
    away = pl.max_horizontal(before, after, pl.duration(seconds=0))
    found = pl.concat(sides).drop_nulls("_row").with_columns(_away=away)
    found = found.filter(pl.col("_away") <= WITHIN).sort("_away", "_time")
    found = found.unique(["vehicle_id", "_time"], keep="first", maintain_order=True)
    found = found.unique("_row", keep="first", maintain_order=True)
    joined = rows.join(found.select("_row", "ticket_kg"), on="_row", how="inner")
    return joined.sort("_row").drop("_row")


def ticketed(tickets: Sequence[Ticket], drives: pl.LazyFrame) -> pl.DataFrame:
    """Return the drives of known mass, see `with_tickets`.

    Drives in which the load changed, or was not weighed from a stop on, are left out, and those
    without a date.

    Parameters
    ----------
    tickets
    drives : as of `weighbridge.fleet.read_drives`

    Returns
    -------
    Rows of ``drives`` with the columns ``ticket_kg`` and ``begin``, by vehicle and time
    """
    rows = drives.with_columns(begin=pl.col("start")).collect()
    length = pl.duration(milliseconds=1e3 * pl.col("duration_s"))
    spans = rows.with_row_index("place").select(
        "place", "vehicle_id", start="begin", end=pl.col("begin") + length
    )
    found = with_tickets(spans, tickets).select("place", "ticket_kg")
    known = rows.with_row_index("place").join(found, on="place", how="inner").drop("place")
    # A ticket of a drive with several loads is of none of its neighbours.
    one = ~pl.col("load_changed").fill_null(value=False) & ~(pl.col("unweighed_s") > 0.0).fill_null(
        value=False
    )
    return known.filter(pl.col("outcome") == "weighed", one).sort("vehicle_id", "begin")
