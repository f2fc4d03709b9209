"""A table of drives: which files belong to which vehicle."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

import polars as pl

from weighbridge.errors import DriveError
from weighbridge.fleet.remote import is_url
from weighbridge.io import PARSE_ERRORS, first_line, quietly

FILES: Final = "files"
"""Column that makes a table one of drives."""

COLUMNS: Final = (FILES, "vehicle", "class", "start")
"""Columns that are read: files of one drive (a list, or a text with ``;`` between), id of the
vehicle, its class, and the begin as date and time (UTC where it names no zone). All but the first
may be missing or empty; others are left alone."""


class Row(NamedTuple):
    """One drive of a table; see `COLUMNS`."""

    files: tuple[str, ...]
    vehicle: str | None
    kind: str | None
    start: str | None


def is_table(path: Path) -> bool:
    """Say whether a file is a table of drives, by its column ``files``."""
    suffix = path.suffix.lower()
    try:
        if suffix in (".parquet", ".pq"):
            with path.open("rb") as file, quietly():
                return FILES in pl.read_parquet_schema(file)
        if suffix == ".csv":
            with path.open(encoding="utf-8", errors="replace") as file:
                head = file.readline(65_536)
            names = [name.strip().strip('"') for name in head.lstrip("\ufeff").split(",")]
            return FILES in names
    except (*PARSE_ERRORS, OSError):
        return False
    return False


def rows(path: Path) -> Iterator[Row]:
    """Read a table of drives.

    Parameters
    ----------
    path : CSV or Parquet; files that it names are looked for beside it

    Raises
    ------
    DriveError
        It cannot be read, or a row names no file or an impossible begin.
    """
    try:
        with path.open("rb") as file, quietly():
            if path.suffix.lower() == ".csv":
                frame = pl.read_csv(file, infer_schema=False)
            else:
                frame = pl.read_parquet(file)
    except (*PARSE_ERRORS, OSError) as error:
        raise DriveError(f"{path} cannot be read ({first_line(error)})") from None
    kept = frame.select(name for name in COLUMNS if name in frame.columns)
    for number, cells in enumerate(kept.iter_rows(named=True), start=2):
        where = f"{path} row {number}"
        files = _files(cells[FILES])
        if not files:
            raise DriveError(f"{where}: names no file in the column {FILES}")
        yield Row(
            files=tuple(f if is_url(f) else str(path.parent / f) for f in files),
            vehicle=_text(cells.get("vehicle")),
            kind=_text(cells.get("class")),
            start=_start(cells.get("start"), where),
        )


def _files(cell: Any) -> list[str]:
    if cell is None:
        return []
    parts = cell if isinstance(cell, list) else str(cell).split(";")
    return [part.strip() for part in parts if part and part.strip()]


def _text(cell: Any) -> str | None:
    text = "" if cell is None else str(cell).strip()
    return text or None


def _start(cell: Any, where: str) -> str | None:
    if isinstance(cell, datetime):
        found = cell
    elif isinstance(cell, date):
        found = datetime(cell.year, cell.month, cell.day)
    elif (text := _text(cell)) is None:
        return None
    else:
        try:
            found = datetime.fromisoformat(text)
        except ValueError:
            raise DriveError(
                f"{where}: start {text!r} is no date and time such as 2026-05-01T06:30:00Z"
            ) from None
    return (found if found.tzinfo is not None else found.replace(tzinfo=UTC)).isoformat()
