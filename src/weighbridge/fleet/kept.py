"""The table of legs in a folder of results: made anew for each day whose drives changed."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Final

import polars as pl

from weighbridge.fleet.learnt import LEARNT, read_learnt
from weighbridge.fleet.legs import legs
from weighbridge.fleet.schema import DRIVES, SEGMENTS, Column
from weighbridge.fleet.store import Results, read_table, write_table

TABLE: Final = "legs"


def keep_legs(results: Results) -> None:
    """Bring the table of legs in line with the tables of drives and segments, day by day.

    A day is made anew where one of its files, or what was learnt, is not older than its legs. Legs
    and drives of a day are of the same drives, so no other day is read. The probability of a
    trailer is that by the legs of the day.

    Parameters
    ----------
    results : gathered and settled

    Raises
    ------
    ConfigError
        The folder cannot be written to, or a table is damaged.
    """
    drives, segments = (_by_day(results, name) for name in ("drives", "segments"))
    learnt = read_learnt(results.folder)
    factors = [path for path in [results.folder / LEARNT] if path.exists()]
    for day in _by_day(results, TABLE).keys() - drives.keys():
        shutil.rmtree(results.folder / TABLE / day, ignore_errors=True)
    for day, files in drives.items():
        reported = segments.get(day, [])
        target = results.folder / TABLE / day / f"{TABLE}-0000.parquet"
        if target.exists() and _newest([*files, *reported, *factors]) < _newest([target]):
            continue
        rows = legs(_read(files, DRIVES), _read(reported, SEGMENTS), learnt=learnt)
        target.parent.mkdir(parents=True, exist_ok=True)
        write_table(target, rows)


def _by_day(results: Results, table: str) -> dict[str, list[Path]]:
    found: dict[str, list[Path]] = {}
    for path in results.table_files(table):
        found.setdefault(path.parent.name, []).append(path)
    return found


def _newest(paths: list[Path]) -> int:
    return max(path.stat().st_mtime_ns for path in paths)


def _read(paths: list[Path], columns: dict[str, Column]) -> pl.DataFrame:
    empty = pl.DataFrame(schema={name: column.type for name, column in columns.items()})
    return pl.concat([empty, *(read_table(path, list(columns)) for path in paths)])
