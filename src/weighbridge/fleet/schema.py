"""The tables of a fleet's results; `schema.toml` lists every column, its type and what it is.

A row of `DRIVES` is one drive, a row of `SEGMENTS` one segment of it, a row of `LEGS` one load.
They belong together by ``key`` and ``part``. Numbers are null where there is none.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import polars as pl

from weighbridge.data import toml_of

FORMAT_VERSION: Final = 7
"""Version of the tables; part of every key, so that another one weighs anew."""

READABLE: Final = (2, 3, 4, 5, 6, FORMAT_VERSION)
"""Versions that can be read. Before 7, rows lack what the vehicle reports of its load. Before 6,
they lack drag area and wheel slip. Before 5, they lack the digest of the vehicle file. Before 4, a
recording was known by its content alone and ``start`` was a text; tables of 2 lack ids of messages.
"""

DAY: Final = "day"
"""Name of the partitions: no column of the tables has it, so that no reader finds two types."""

UNKNOWN_DATE: Final = "unknown"
"""Partition of drives without a date. Hive's own name for null makes pandas fail."""


PERIOD: Final = 300.0
"""Length of the periods of a segment whose distances are kept [s]."""

CHECKS: Final = (900.0, 600.0)
"""The running mass is kept this long after the vehicle first moves, and again every so long [s]
(Regulation (EU) 2019/1213, Annex I, point 4.1)."""


class Column(NamedTuple):
    """One column: its type and what it is."""

    type: pl.DataType
    about: str


_TYPES: Final[dict[str, pl.DataType]] = {
    "text": pl.String(),
    "texts": pl.List(pl.String()),
    "number": pl.Float64(),
    "numbers": pl.List(pl.Float64()),
    "count": pl.Int32(),
    "truth": pl.Boolean(),
    "date": pl.Date(),
    "time": pl.Datetime("us", "UTC"),
}
_LISTED: Final = toml_of("fleet", "schema.toml")


def _columns(table: str) -> dict[str, Column]:
    return {name: Column(_TYPES[kind], about) for name, (kind, about) in _LISTED[table].items()}


DRIVES: Final = _columns("drives")
"""One row per drive."""

SEGMENTS: Final = _columns("segments")
"""One row per segment: the mass between stops at which load can change."""

LEGS: Final = _columns("legs")
"""One row per leg: a span with one load, its payload and its overload."""

TAUGHT: Final = _columns("learnt")
"""One row per vehicle of ``learnt.parquet``."""

WEIGHED: Final = "weighed"
UNREAD: Final = "unread"
FAILED: Final = "failed"
"""Outcomes: of a drive that `weigh` answers, of one that it refuses, of one tried in vain."""

_OF_DRIVE: Final = ("key", "part", "date", "vehicle_id")
_INNER: Final = tuple(name for name in SEGMENTS if name not in _OF_DRIVE)

SEEN: Final[dict[str, pl.DataType]] = {"held": pl.String(), "seen": pl.Int64()}
"""Columns of what a run need not read again: the key of a result with a digest of its place, and a
digest of its files as a run saw them and of how they were weighed."""

PART: Final[dict[str, pl.DataType]] = {
    **{name: column.type for name, column in DRIVES.items()},
    "seen": SEEN["seen"],
    "segments": pl.List(pl.Struct({name: SEGMENTS[name].type for name in _INNER})),
}
"""Columns of a part file, as workers write it: the drives of one recording, segments within."""


def drives_of(parts: pl.DataFrame) -> pl.DataFrame:
    """Return the rows of `DRIVES` that part files hold."""
    return parts.select(list(DRIVES))


def segments_of(parts: pl.DataFrame) -> pl.DataFrame:
    """Return the rows of `SEGMENTS` that part files hold."""
    rows = parts.select(*_OF_DRIVE, "segments").explode("segments")
    return rows.filter(pl.col("segments").is_not_null()).unnest("segments").select(list(SEGMENTS))
