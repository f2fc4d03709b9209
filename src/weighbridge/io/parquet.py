"""Parquet tables, a column at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl

from weighbridge.errors import DriveError
from weighbridge.io.quiet import PARSE_ERRORS, first_line, quietly
from weighbridge.io.table import MOST_COLUMNS, RawTable
from weighbridge.signals import Floats

_ROWS: Final = 1 << 20
"""Rows of a Parquet table read at a time."""


def read_parquet(path: Path) -> RawTable:
    """Read a Parquet table.

    Raises
    ------
    DriveError
        Not a Parquet file, or only the first part of one.
    """
    try:
        with path.open("rb") as file, quietly():
            # A path is no pattern, by which a file would be joined with its neighbours; one that
            # is no text cannot be handed over.
            source = path.absolute() if _is_text(path) else file
            table = pl.scan_parquet(source, glob=False, hive_partitioning=False)
            schema = table.collect_schema()
            names = tuple(schema.names())
            kinds = [kind == pl.Float64 for kind in schema.dtypes()]
            if len(names) <= MOST_COLUMNS:
                rows = int(table.select(pl.len()).collect().item())
                whole = table.collect() if rows <= _ROWS else None
                plain = {
                    k: _numbers(_parts(table, whole, names[k], rows), rows)
                    for k, there in enumerate(kinds)
                    if there
                }
                others = [
                    pl.col(names[k]).alias(str(k)) for k, there in enumerate(kinds) if not there
                ]
                frame = table.select(others).collect() if whole is None else whole.select(others)
    except (*PARSE_ERRORS, OSError) as e:
        raise DriveError(
            f"{path} is not a readable Parquet file ({first_line(e)}); "
            "it may have been cut off: copy or convert it again"
        ) from None
    if len(names) > MOST_COLUMNS:
        raise DriveError(f"{path} has {len(names)} columns, and a table may have {MOST_COLUMNS}")
    return RawTable(path, names, frame, plain=plain)


def _is_text(path: Path) -> bool:
    """Return whether a path can be written in UTF-8."""
    try:
        str(path.absolute()).encode()
    except UnicodeEncodeError:
        return False
    return True


def _parts(
    table: pl.LazyFrame, whole: pl.DataFrame | None, name: str, rows: int
) -> Iterator[pl.Series]:
    """Yield a column part by part; from the whole table where that was read."""
    if whole is not None:
        yield whole[name]
        return
    column = table.select(pl.col(name))
    for first in range(0, rows, _ROWS):
        yield column.slice(first, _ROWS).collect()[name]


def _numbers(parts: Iterable[pl.Series], rows: int) -> tuple[Floats, int]:
    """Put the parts of a column of numbers together, so that it is in the memory once.

    Returns
    -------
    values : (n,) NaN where a cell is empty
    nans : cells that are not-a-number
    """
    values = np.empty(rows)
    nans = first = 0
    for part in parts:
        values[first : first + part.len()] = part.to_numpy()
        first += part.len()
        nans -= part.null_count()
    nans += int(np.count_nonzero(np.isnan(values)))
    return values, nans
