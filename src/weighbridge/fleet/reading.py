"""Results as lazy frames: the tables, and what is not gathered into them yet."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from weighbridge.arguments import check_path
from weighbridge.fleet.schema import DRIVES, SEGMENTS
from weighbridge.fleet.store import (
    HEAD,
    TABLES,
    Results,
    check_end,
    counted,
    read_found,
    read_parts,
    standing,
    timed,
)


def read_drives(results: str | Path) -> pl.LazyFrame:
    """Return one row per drive, as `weighbridge.fleet.schema.DRIVES` lists the columns.

    Each drive is there once for its vehicle, also while a run writes, and after a kill. Where a
    recording or its vehicle file was changed and weighed again, the last answer is there. That a
    recording was moved to another vehicle is known when the run has ended.

    Parameters
    ----------
    results : folder that ``weighbridge fleet`` wrote

    Raises
    ------
    ConfigError
        The folder holds no results, or a file of it was cut off.
    """
    check_path("results", results)
    opened = Results.opened(Path(results))
    rows = _rows(opened, "drives").select(list(DRIVES))
    heads = collected(rows.select(HEAD), results)
    return counted(rows, standing(heads, read_found(opened.folder)))


def read_segments(results: str | Path) -> pl.LazyFrame:
    """Return one row per segment of these drives, see `weighbridge.fleet.schema.SEGMENTS`.

    Parameters
    ----------
    results : folder that ``weighbridge fleet`` wrote

    Raises
    ------
    ConfigError
        The folder holds no results, or a file of it was cut off.
    """
    check_path("results", results)
    drives = read_drives(results).select("key", "part", _vehicle="vehicle_id")
    rows = _rows(Results.opened(Path(results)), "segments").select(list(SEGMENTS))
    rows = rows.join(drives, on=["key", "part"], how="inner", maintain_order="left")
    # Tables of version 3 lack it.
    own = pl.coalesce("vehicle_id", "_vehicle").alias("vehicle_id")
    return rows.with_columns(own).select(list(SEGMENTS))


def collected(rows: pl.LazyFrame, results: str | Path) -> pl.DataFrame:
    """Collect rows of the results.

    Parameters
    ----------
    rows : made of `read_drives` or `read_segments`
    results : their folder

    Raises
    ------
    ConfigError
        A file of the results is damaged.
    """
    try:
        return rows.collect()
    except (pl.exceptions.PolarsError, OSError):
        Results.opened(Path(results)).check()
        raise


def _rows(results: Results, table: str) -> pl.LazyFrame:
    """Rows of a table and of the parts, each once."""
    # Parts first: what is gathered in between is in both then, and never in none.
    loose = TABLES[table](read_parts(results.part_files()))
    files = results.table_files(table)
    for path in files:
        check_end(path)
    by: list[str] = [n for n in ("key", "part", "segment") if n in loose.columns]
    frames = [loose.lazy()]
    if files:
        gathered = timed(pl.scan_parquet(files, glob=False, hive_partitioning=False))
        if loose.height:
            gathered = gathered.join(loose.lazy().select(by), on=by, how="anti")
        frames.append(gathered)
    # Tables of earlier versions lack columns.
    return pl.concat(frames, how="diagonal")
