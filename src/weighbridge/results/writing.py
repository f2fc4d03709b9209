"""How results are written: numbers for JSON, tables for files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

from weighbridge.arguments import check_number, check_path
from weighbridge.errors import ConfigError
from weighbridge.whole import write_whole

if TYPE_CHECKING:
    import polars as pl

    from weighbridge.signals import Drive


def number(value: float) -> float | None:
    """Round for JSON; None where there is no number."""
    return round(float(value), 6) if math.isfinite(value) else None


def check_level(level: float) -> None:
    """Raise where ``level`` is not the probability of an interval.

    Raises
    ------
    ConfigError
        The level is not between 0 and 1.
    """
    check_number("level", level)
    if not 0.0 < level < 1.0:
        raise ConfigError(f"level must be between 0 and 1, got {level}")


TABLES: Final = (".csv", ".parquet")
"""Suffixes of a track that is a table alone."""

RECORDINGS: Final = (".mcap", ".mf4")
"""Suffixes of a track beside the signals of its drive."""


def write_track(table: pl.DataFrame, path: str | Path, drive: Drive | None = None) -> None:
    """Write a track as a table or, beside the signals of its drive, as a recording.

    Parameters
    ----------
    table : with ``time_s``
    path : its suffix, one of `TABLES` or, where a drive is given, `RECORDINGS`, says the format
    drive : whose signals are written too, each on its own clock; then a layout of PlotJuggler
        is written beside a file that it reads, see `weighbridge.results.plotjuggler`

    Raises
    ------
    ConfigError
        The suffix is another one, or the file cannot be written.
    DriveError
        A recording cannot be written.
    MissingExtraError
        The package that writes a recording is not installed.
    """
    from weighbridge.io.write import to_frames, write_frame, write_mcap, write_mdf
    from weighbridge.results.plotjuggler import layout, layout_of

    check_path("path", path)
    path = Path(path)
    suffix = path.suffix.lower()
    known = TABLES if drive is None else (*TABLES, *RECORDINGS)
    if suffix not in known:
        raise ConfigError(f"{path}: a track is written as {' or '.join(known)}")
    topics: dict[str, pl.DataFrame] = {}
    if suffix == ".mcap" and drive is not None:
        topics = {f"/drive/{name}": frame for name, frame in to_frames(drive).items()}
        topics["/track"] = table
        write_mcap(topics, path)
    elif suffix == ".mf4" and drive is not None:
        write_mdf(drive, path, beside={"track": table})
    else:
        write_frame(table, path, ConfigError)
    beside = layout_of(path)
    if drive is not None and beside is not None:
        write_whole(beside, layout(path, table, tuple(topics)))
