"""Write a drive as a canonical folder, and tables beside it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
import polars as pl

from weighbridge.errors import DriveError
from weighbridge.io.info import FILE_NAME as INFO_NAME
from weighbridge.io.info import write_info
from weighbridge.signals import QUANTITIES, Drive, DriveInfo, Floats, Signal
from weighbridge.signals.catalogue import TABLES, TIME_COLUMN
from weighbridge.signals.units import from_si

TableFormat = Literal["csv", "parquet"]


def write_drive(
    drive: Drive,
    folder: str | Path,
    table_format: TableFormat = "csv",
    truth: Mapping[str, Floats] | None = None,
) -> None:
    """Write the canonical tables of a drive, each on its own clock.

    Parameters
    ----------
    drive : what to write
    folder : made where it is not there
    table_format : "csv" or "parquet"
    truth : columns of a ``truth`` table, with unit suffixes, as they are

    Raises
    ------
    DriveError
        The folder cannot be written to.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise DriveError(f"{folder} cannot be made: {e.strerror or e}") from None
    for table in TABLES:
        signals = [s for s in drive.signals.values() if QUANTITIES[s.name].table == table]
        if signals:
            write_table(_columns(signals), folder / f"{table}.{table_format}")
    if truth is not None:
        write_table(truth, folder / f"truth.{table_format}")
    if drive.info != DriveInfo():
        write_info(drive.info, folder / INFO_NAME)


def write_table(columns: Mapping[str, Floats], path: str | Path) -> None:
    """Write a table as CSV or Parquet, by suffix; NaN becomes an empty cell.

    Raises
    ------
    DriveError
        The suffix is another one, or the file cannot be written.
    """
    path = Path(path)
    frame = pl.DataFrame({k: np.asarray(v) for k, v in columns.items()}, nan_to_null=True)
    try:
        match path.suffix.lower():
            case ".csv":
                frame.write_csv(path)
            case ".parquet" | ".pq":
                frame.write_parquet(path)
            case other:
                raise DriveError(f"{path}: tables are written as .csv or .parquet, not {other!r}")
    except OSError as e:
        raise DriveError(f"{path} cannot be written: {e.strerror or e}") from None


def _columns(signals: list[Signal]) -> dict[str, Floats]:
    """Columns of one table; rows are the union of the signals' stamps."""
    clocks = {id(s.time): s.time for s in signals}
    time = (
        next(iter(clocks.values()))
        if len(clocks) == 1
        else np.unique(np.concatenate(list(clocks.values())))
    )
    columns = {TIME_COLUMN: time}
    for s in signals:
        q = QUANTITIES[s.name]
        values = from_si(s.values, q.suffix) if q.suffix else s.values
        if s.time is not time:
            placed = np.full(time.size, np.nan)
            placed[np.searchsorted(time, s.time)] = values
            values = placed
        columns[q.column] = values
    return columns
