"""Write a drive as a canonical folder, and tables beside it."""

from __future__ import annotations

import contextlib
import io
import logging
import warnings
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, Literal

import numpy as np
import polars as pl

from weighbridge.arguments import check_type
from weighbridge.errors import DriveError, MissingExtraError, WeighbridgeError
from weighbridge.io.info import FILE_NAME as INFO_NAME
from weighbridge.io.info import MDF_INFO_MARK, info_text
from weighbridge.io.parts import SUFFIX as PARTS
from weighbridge.io.quiet import first_line
from weighbridge.signals import QUANTITIES, Drive, DriveInfo, Floats, Signal
from weighbridge.signals.catalogue import TABLES, TIME_COLUMN
from weighbridge.signals.units import from_si
from weighbridge.whole import whole_file, whole_folder

TableFormat = Literal["csv", "parquet"]

_PARQUET: Final = (".parquet", ".pq")

DRIVE_FILES: Final = frozenset(
    f"{table}{suffix}" for table in (*TABLES, "truth") for suffix in (".csv", *_PARQUET, PARTS)
) | {INFO_NAME}
"""Files that a drive written as a folder may have: those of another drive would be read with it."""


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
    folder : made where it is not there; a drive in it is replaced, other files stay
    table_format : "csv" or "parquet"
    truth : columns of a ``truth`` table, with unit suffixes, as they are

    Raises
    ------
    DriveError
        The folder cannot be written to.
    """
    with whole_folder(folder, DRIVE_FILES, DriveError) as part:
        for table, frame in to_frames(drive).items():
            _write_frame(frame, part / f"{table}.{table_format}")
        if truth is not None:
            _write_frame(_frame(truth), part / f"truth.{table_format}")
        if drive.info != DriveInfo():
            (part / INFO_NAME).write_text(info_text(drive.info), encoding="utf-8")


def to_frames(drive: Drive) -> dict[str, pl.DataFrame]:
    """Return the tables of a drive: canonical columns with units, one row per time stamp.

    Parameters
    ----------
    drive : what to lay out

    Returns
    -------
    By table (``imu``, ``obd``, …), as `write_drive` writes them; ``.to_pandas()`` of one is a data
    frame of pandas
    """
    check_type("drive", drive, Drive, "a drive, as read_drive returns it")
    every = {
        table: [s for s in drive.signals.values() if QUANTITIES[s.name].table == table]
        for table in TABLES
    }
    return {table: _frame(_columns(signals)) for table, signals in every.items() if signals}


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
    with warnings.catch_warnings(), whole_file(path, DriveError) as part:
        warnings.simplefilter("ignore")
        # The library tells of a full disk with a traceback of its own, beside raising.
        logging.getLogger("asammdf").setLevel(logging.CRITICAL)
        with contextlib.redirect_stdout(io.StringIO()), MDF(version="4.10") as file:
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
            saved = Path(file.save(part, overwrite=True, compression=2))
        if saved != part:
            saved.replace(part)


def write_table(columns: Mapping[str, Floats], path: str | Path) -> None:
    """Write a table as CSV or Parquet, by suffix; NaN becomes an empty cell.

    Raises
    ------
    DriveError
        The suffix is another one, or the file cannot be written.
    """
    write_frame(_frame(columns), path)


def write_frame(
    frame: pl.DataFrame, path: str | Path, error: type[WeighbridgeError] = DriveError
) -> None:
    """Write a table whole or not at all, as CSV or Parquet, by suffix.

    Raises
    ------
    WeighbridgeError
        Of the type given: the suffix is another one, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in (".csv", *_PARQUET):
        raise error(f"{path}: tables are written as .csv or .parquet, not {path.suffix!r}")
    with whole_file(path, error) as part:
        _write_frame(frame, part)


def _frame(columns: Mapping[str, Floats]) -> pl.DataFrame:
    return pl.DataFrame({k: np.asarray(v) for k, v in columns.items()}, nan_to_null=True)


def _write_frame(frame: pl.DataFrame, path: Path) -> None:
    # An open file: polars takes no path that is not UTF-8.
    try:
        with path.open("wb") as file:
            if path.suffix.lower() in _PARQUET:
                frame.write_parquet(file)
            else:
                frame.write_csv(file)
    except pl.exceptions.PolarsError as e:
        # A full disk, told behind words of the library's own.
        raise OSError(first_line(e).rpartition("IO error: ")[2]) from None


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
