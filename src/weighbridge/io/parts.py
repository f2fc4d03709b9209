"""Tables in parts, as a recording leaves them that a power cut ended."""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import Final

import polars as pl

from weighbridge.errors import DriveError
from weighbridge.io.log import Log
from weighbridge.io.quiet import PARSE_ERRORS, first_line, quietly
from weighbridge.io.table import RawTable
from weighbridge.io.tabular import read_canonical
from weighbridge.signals import Problem
from weighbridge.signals.catalogue import TABLES, TIME_COLUMN
from weighbridge.whole import whole_file

SUFFIX: Final = ".parts"
"""Ends the name of the folder of one table's parts, as in ``imu.parts``."""

_JOINED: Final = (".parquet", ".pq", ".csv")

# Rows of a group in a joined table: some seconds' work to read, 8 MB of an inertial sensor.
_GROUP_ROWS: Final = 150_000


def part_folders(drive: Path) -> dict[str, Path]:
    """Find the tables of a drive that are there in parts.

    Parameters
    ----------
    drive : its folder

    Returns
    -------
    Folder by table; without tables that were joined already, and folders without a part
    """
    found = {table: drive / f"{table}{SUFFIX}" for table in TABLES}
    return {
        table: folder
        for table, folder in found.items()
        if not any((drive / f"{table}{s}").exists() for s in _JOINED) and part_files(folder)
    }


def part_files(folder: Path) -> list[Path]:
    """List the parts in a folder, oldest first; none where there is no such folder."""
    if not folder.is_dir():
        return []
    return sorted(f for f in folder.glob("*.parquet") if f.stem.isdigit() and f.is_file())


def part_path(drive: Path, table: str, number: int) -> Path:
    """Where a part of a table goes."""
    return drive / f"{table}{SUFFIX}" / f"{number:06d}.parquet"


def read_parts(folder: Path, table: str) -> Log:
    """Read a table that is there in parts.

    Parameters
    ----------
    folder : of the parts
    table : canonical table

    Raises
    ------
    DriveError
        No part is readable.
    """
    frames, problems = [], []
    for path in part_files(folder):
        try:
            with quietly():
                frames.append(_read(path))
        except (*PARSE_ERRORS, OSError) as error:
            reported = Problem.of(
                "file.part_damaged", file=folder.name, part=path.name, error=first_line(error)
            )
            problems.append(reported)
    if not frames:
        raise DriveError(f"{folder}: no part of the table is readable; remove the folder")
    frame = in_order(frames)
    names = tuple(frame.columns)
    frame.columns = [str(k) for k in range(len(names))]
    log = read_canonical(RawTable(folder, names, frame), table)
    text = Problem.of("file.recording_cut", file=folder.name)
    log.problems += [*problems, text]
    return log


def _read(path: Path, columns: list[str] | None = None) -> pl.DataFrame:
    return pl.read_parquet(_bytes(path), columns=columns)


def _bytes(path: Path) -> BytesIO:
    """Read a file: a path would be taken for a pattern."""
    return BytesIO(path.read_bytes())


def in_order(frames: Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Join parts of a table into one whose stamps rise; cells of one stamp stand in one row."""
    joined = pl.concat(list(frames), how="diagonal").sort(TIME_COLUMN, maintain_order=True)
    if not joined[TIME_COLUMN].is_duplicated().any():
        return joined
    cells = pl.exclude(TIME_COLUMN).drop_nulls().last()
    return joined.group_by(TIME_COLUMN, maintain_order=True).agg(cells)


def join_parts(drive: Path, table: str) -> None:
    """Write the parts of a table as one file and remove them; memory is that of a few parts.

    Parameters
    ----------
    drive : folder of the drive
    table : canonical table

    Raises
    ------
    DriveError
        The disk is full or gone. The parts stay and can be read.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    folder = drive / f"{table}{SUFFIX}"
    files = part_files(folder)
    if not files:
        return
    # What a later part may still add to: everything from its first stamp on.
    begins = [float(_read(f, [TIME_COLUMN])[TIME_COLUMN].to_numpy().min()) for f in files]
    names = list(dict.fromkeys(n for f in files for n in pl.read_parquet_schema(_bytes(f))))
    schema = pa.schema([(name, pa.float64()) for name in names])
    with (
        whole_file(drive / f"{table}.parquet", DriveError) as path,
        path.open("wb") as file,
        pq.ParquetWriter(file, schema, compression="zstd") as writer,
    ):
        held = pl.DataFrame(schema=dict.fromkeys(names, pl.Float64))
        ready: list[pl.DataFrame] = []
        for k, part in enumerate(files):
            held = in_order([held, _read(part)])
            done = held[TIME_COLUMN] < min(begins[k + 1 :], default=float("inf"))
            ready.append(held.filter(done))
            held = held.filter(~done)
            if sum(f.height for f in ready) >= _GROUP_ROWS or k == len(files) - 1:
                writer.write_table(pl.concat(ready).select(names).to_arrow().cast(schema))
                ready.clear()
    for part in files:
        part.unlink()
    folder.rmdir()
