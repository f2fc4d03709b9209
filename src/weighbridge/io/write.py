"""Write a drive as a canonical folder or as MF4, and tables beside it."""

from __future__ import annotations

import contextlib
import heapq
import importlib.util
import io
import json
import logging
import math
import warnings
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from operator import itemgetter
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import polars as pl

from weighbridge.arguments import check_type
from weighbridge.errors import DriveError, MissingExtraError, WeighbridgeError
from weighbridge.io.info import FILE_NAME as INFO_NAME
from weighbridge.io.info import MDF_INFO_MARK, info_text
from weighbridge.io.parts import SUFFIX as PARTS
from weighbridge.io.quiet import first_line
from weighbridge.signals import QUANTITIES, UNITS, Drive, DriveInfo, Floats, Signal, from_si
from weighbridge.signals.catalogue import TABLES, TIME_COLUMN
from weighbridge.version import VERSION
from weighbridge.whole import whole_file, whole_folder

TableFormat = Literal["csv", "parquet"]

# Package and extra, by suffix.
_WRITTEN_BY: Final = {".mf4": ("asammdf", "mdf"), ".mcap": ("mcap", "ros")}

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


def require_writer(path: Path) -> None:
    """Raise where the package that writes a file of this suffix is not installed.

    Raises
    ------
    MissingExtraError
        It names the extra to install.
    """
    package, extra = _WRITTEN_BY.get(path.suffix.lower(), ("", ""))
    if package and importlib.util.find_spec(package) is None:
        raise MissingExtraError(package, extra, f"writing {path.name}")


def write_mdf(
    drive: Drive, path: str | Path, beside: Mapping[str, pl.DataFrame] | None = None
) -> None:
    """Write a drive as one MF4, one channel group per clock, compressed.

    Channels have canonical names with unit suffixes; what is known beside the
    signals is in the file's comment.

    Parameters
    ----------
    drive : what to write
    path : the file; replaced where it is there
    beside : further tables with ``time_s``, by name: a channel group each, with channels such as
        ``track.mass_kg``

    Raises
    ------
    DriveError
        The file cannot be written.
    MissingExtraError
        asammdf is not installed.
    """
    path = Path(path)
    require_writer(path.with_suffix(".mf4"))
    from asammdf import MDF
    from asammdf import Signal as Channel

    clocks: dict[int, list[Signal]] = {}
    for s in drive.signals.values():
        clocks.setdefault(id(s.time), []).append(s)
    with warnings.catch_warnings(), whole_file(path, DriveError) as part:
        warnings.simplefilter("ignore")
        # The library reports a full disk with a traceback of its own, beside raising.
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
            for table, frame in (beside or {}).items():
                time = frame[TIME_COLUMN].to_numpy()
                channels = []
                for column in frame.drop(TIME_COLUMN):
                    suffix = column.name.rpartition("_")[2]
                    channels.append(
                        Channel(
                            _channel_values(column),
                            time,
                            name=f"{table}.{column.name}",
                            unit=suffix if suffix in UNITS else "",
                            encoding="utf-8" if column.dtype == pl.String else None,
                        )
                    )
                file.append(channels, acq_name=table)
            saved = Path(file.save(part, overwrite=True, compression=2))
        if saved != part:
            saved.replace(part)


def _channel_values(column: pl.Series) -> np.ndarray:
    """Values of a column as MDF holds them: numbers, or bytes of a text."""
    if column.dtype == pl.String:
        return np.array([(text or "").encode() for text in column], dtype=np.bytes_)
    if column.dtype == pl.Boolean:
        return column.cast(pl.UInt8).to_numpy()
    return column.to_numpy()


def write_mcap(topics: Mapping[str, pl.DataFrame], path: str | Path) -> None:
    """Write tables as one MCAP with JSON messages, which PlotJuggler and Foxglove read.

    A topic has one message per row, with the cells that are not empty: of a table of a drive
    (see `to_frames`) the signals that were sampled then, so that each keeps its own clock.
    Times of messages are those of ``time_s``, moved by whole seconds where they begin below zero,
    for MCAP counts from zero.

    Parameters
    ----------
    topics : tables with ``time_s``, by name of the topic, such as ``/drive/obd``
    path : the file; replaced where it is there

    Raises
    ------
    DriveError
        The file cannot be written.
    MissingExtraError
        mcap is not installed.
    """
    path = Path(path)
    require_writer(path)
    from mcap.writer import Writer

    starts = [float(frame[TIME_COLUMN][0]) for frame in topics.values() if frame.height]
    zero = math.floor(min([0.0, *starts]))
    with whole_file(path, DriveError) as part, part.open("wb") as file:
        writer: Any = Writer(file)
        writer.start(library=f"weighbridge {VERSION}")
        messages = [
            _messages(frame, _registered(writer, topic, frame), zero)
            for topic, frame in topics.items()
        ]
        for stamp, channel, data in heapq.merge(*messages, key=itemgetter(0)):
            writer.add_message(channel, log_time=stamp, publish_time=stamp, data=data)
        writer.finish()


def _registered(writer: Any, topic: str, frame: pl.DataFrame) -> int:
    """Announce a topic of an MCAP with the schema of its messages; return its channel."""
    kinds = {"String": "string", "Boolean": "boolean"}
    fields = {k: {"type": kinds.get(str(kind), "number")} for k, kind in frame.schema.items()}
    schema = writer.register_schema(
        name=f"weighbridge{topic.replace('/', '.')}",
        encoding="jsonschema",
        data=json.dumps({"type": "object", "properties": fields}).encode(),
    )
    return int(writer.register_channel(topic=topic, message_encoding="json", schema_id=schema))


def _messages(frame: pl.DataFrame, channel: int, zero: float) -> Iterator[tuple[int, int, bytes]]:
    """Time of each row [ns], its channel, and what it holds as JSON; empty cells are left out."""
    for row in frame.iter_rows(named=True):
        held = {
            k: v
            for k, v in row.items()
            if v is not None and (not isinstance(v, float) or math.isfinite(v))
        }
        yield round((row[TIME_COLUMN] - zero) * 1e9), channel, json.dumps(held).encode()


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
        # A full disk, reported behind words of the library's own.
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
