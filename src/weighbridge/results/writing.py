"""How results are written: numbers for JSON, tables for files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from weighbridge.arguments import check_number, check_path
from weighbridge.errors import ConfigError

if TYPE_CHECKING:
    import polars as pl


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


def write_track(table: pl.DataFrame, path: str | Path) -> None:
    """Write a track as CSV or Parquet, by the suffix of ``path``.

    Raises
    ------
    ConfigError
        The suffix is neither, or the file cannot be written.
    """
    from weighbridge.io.write import write_frame

    check_path("path", path)
    if Path(path).suffix.lower() not in (".csv", ".parquet"):
        raise ConfigError(f"{path}: a track is written as .csv or .parquet")
    write_frame(table, path, ConfigError)
