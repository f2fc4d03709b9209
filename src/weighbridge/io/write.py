"""Write a drive as a canonical folder, and tables beside it."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import numpy as np
import polars as pl

from weighbridge.errors import DriveError, MissingExtraError
from weighbridge.io.info import FILE_NAME as INFO_NAME
from weighbridge.io.info import MDF_INFO_MARK, info_text, write_info
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


def write_mdf(drive: Drive, path: str | Path) -> None:
    """Write a drive as one MF4, one channel group per clock, compressed.

    Channels have canonical names with unit suffixes; what is known beside the
    signals stands in the file's comment.

    Parameters
    ----------
    drive : what to write
    path : the file; replaced where it is there

    Raises
    ------
    DriveError
        The file cannot be written.
    MissingExtraError
        asammdf is not installed.
    """
    path = Path(path)
    try:
        from asammdf import MDF
        from asammdf import Signal as Channel
    except ImportError:
        raise MissingExtraError("asammdf", "mdf", f"writing {path.name}") from None
    clocks: dict[int, list[Signal]] = {}
    for s in drive.signals.values():
        clocks.setdefault(id(s.time), []).append(s)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with MDF(version="4.10") as file:
            # The clock of a drive counts from its own zero.
            file.header.start_time = datetime.fromtimestamp(0.0, UTC)
            if drive.info != DriveInfo():
                file.header.description = MDF_INFO_MARK + info_text(drive.info)
            for group in clocks.values():
                channels = []
                for s in group:
                    suffix = QUANTITIES[s.name].suffix
                    values = from_si(s.values, suffix) if suffix else s.values
                    name = f"{s.name}_{suffix}" if suffix else s.name
                    channels.append(Channel(values, s.time, name=name, unit=suffix))
                file.append(channels)
            try:
                file.save(path, overwrite=True, compression=2)
            except OSError as e:
                raise DriveError(f"{path} cannot be written: {e.strerror or e}") from None


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
