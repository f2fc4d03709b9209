"""Drives from data frames, and back: pandas or polars, without a file between."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import polars as pl

from weighbridge.errors import ConfigError
from weighbridge.io.mapping import MappingSource, load_mapping, mapping_for
from weighbridge.io.quiet import PARSE_ERRORS
from weighbridge.io.read import joined_drive
from weighbridge.io.table import RawTable, column_list
from weighbridge.io.tabular import read_canonical, read_mapped
from weighbridge.signals import Drive, DriveInfo
from weighbridge.signals.catalogue import TABLES, TIME_COLUMN
from weighbridge.signals.shown import type_name

if TYPE_CHECKING:
    import pandas

Frame: TypeAlias = "pl.DataFrame | pandas.DataFrame"


def is_frame(given: object) -> bool:
    """Tell whether something is a data frame of pandas or polars."""
    home = type(given).__module__.partition(".")[0]
    return home in ("pandas", "polars") and type(given).__name__ == "DataFrame"


def read_frame(
    frame: Frame | Mapping[str, Frame],
    mapping: MappingSource | None = None,
    *,
    name: str = "frame",
) -> Drive:
    """Make a drive of one data frame, or of several on clocks of their own.

    Parameters
    ----------
    frame : of pandas or polars, with the columns of a table on disk: canonical names with units
        (``time_s``, ``vehicle_speed_kmh``, …) or those of ``mapping``. An index of pandas that has
        a name is a column as well; one of dates is the time. Several: by names such as
        ``imu``, ``obd`` and ``gnss``, for which a mapping's ``files`` are patterns
    mapping : mapping TOML, or a dictionary of the same form
    name : of the drive

    Raises
    ------
    ConfigError
        It is no data frame, or the mapping cannot be used.
    DriveError
        There is no time, or no column that is known.
    """
    frames = dict(frame) if isinstance(frame, Mapping) else {name: frame}
    mappings = load_mapping(mapping) if mapping is not None else ()
    logs = []
    for table, one in frames.items():
        raw = _raw(str(table), one, mapped=bool(mappings))
        found = mapping_for(raw.path, mappings)
        if found is not None and found.signals:
            logs.append(read_mapped(raw, found))
        else:
            logs.append(read_canonical(raw, str(table) if table in TABLES else None))
    return joined_drive(name, logs, DriveInfo(), mappings, ())


def _raw(name: str, frame: Any, *, mapped: bool) -> RawTable:
    """Lay a data frame out as a table that was read."""
    if not is_frame(frame):
        raise ConfigError(
            f"{name}: a data frame of pandas or polars is expected, got {type_name(frame)}"
        )
    notes: list[str] = []
    if not isinstance(frame, pl.DataFrame):
        dates = frame.index.dtype.kind == "M"
        if dates or frame.index.name is not None:
            own = frame.index.name if mapped or not dates else None
            index = str(own or TIME_COLUMN)
            if index in map(str, frame.columns):
                raise ConfigError(
                    f"{name}: index and column would both be {index!r}; drop one or rename it"
                )
            frame = frame.reset_index(names=index)
        frame = frame.set_axis([str(column) for column in frame.columns], axis=1)
        repeated = sorted({c for c in frame.columns if list(frame.columns).count(c) > 1})
        if repeated:
            raise ConfigError(f"{name}: two columns are called {repeated[0]!r}; rename one")
        frame, left_out = _converted(frame)
        notes += [f"columns of no plain numbers, left out: {column_list(left_out)}"] * bool(
            left_out
        )
    names = tuple(frame.columns)
    places = {column: str(k) for k, column in enumerate(names)}
    return RawTable(Path(name), names, frame.rename(places), notes=notes)


def _converted(frame: pandas.DataFrame) -> tuple[pl.DataFrame, list[str]]:
    """Columns of pandas as those of polars, and the names of those that cannot be."""
    columns: list[pl.Series] = []
    left_out: list[str] = []
    for name in frame.columns:
        try:
            columns += pl.from_pandas(frame[[name]], nan_to_null=True).get_columns()
        # Of numbers and texts mixed, complex numbers and objects; Arrow's errors are of these.
        except (TypeError, ValueError, NotImplementedError, *PARSE_ERRORS):
            left_out.append(name)
    return pl.DataFrame(columns), left_out
