"""Drives from data frames, and back: pandas or polars, without a file between."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import polars as pl

from weighbridge.arguments import check_text, is_frame, type_name
from weighbridge.errors import ConfigError
from weighbridge.io.channels import log_of
from weighbridge.io.columns import time_unit
from weighbridge.io.log import Log
from weighbridge.io.long_csv import are_long, names_in, recording_of
from weighbridge.io.mapping import (
    MappedSignal,
    MappingSource,
    TableMapping,
    TimeColumn,
    load_mapping,
    mapping_for,
)
from weighbridge.io.quiet import PARSE_ERRORS
from weighbridge.io.read import joined_drive
from weighbridge.io.table import RawTable, column_list
from weighbridge.io.tabular import are_canonical, read_canonical, read_mapped
from weighbridge.messages import Problem
from weighbridge.signals import Drive, DriveInfo
from weighbridge.signals.catalogue import TABLES, TIME_COLUMN

if TYPE_CHECKING:
    import pandas

Frame: TypeAlias = "pl.DataFrame | pandas.DataFrame"

ASAMMDF_INDEX: Final = "timestamps"
"""Name of the index, in seconds, of frames that asammdf makes of MF4 files."""


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
        a name is a column as well; one of dates, and asammdf's ``timestamps``, is the time.
        Several: by names such as ``imu``, ``obd`` and ``gnss``, for which a mapping's ``files``
        are patterns; where none fits a name, as with a mapping made from files, the table is
        taken that names most of the frame's columns. A mapping without ``files`` is for all, and
        each signal is looked for in every frame. One with a row for each value (time, name, value
        and perhaps unit) is turned, as such a file is
    mapping : mapping TOML, or a dictionary of the same form
    name : of the drive

    Raises
    ------
    ConfigError
        It is no data frame, or the mapping cannot be used.
    DriveError
        There is no time, or no column that is known.
    """
    check_text("name", name)
    frames = dict(frame) if isinstance(frame, Mapping) else {name: frame}
    mappings = load_mapping(mapping) if mapping is not None else ()
    raws = [_raw(str(table), one, mapped=bool(mappings)) for table, one in frames.items()]
    return joined_drive(name, _read(raws, mappings), DriveInfo(), mappings, ())


def _read(raws: list[RawTable], mappings: tuple[TableMapping, ...]) -> list[Log]:
    """Read each table by the mapping that is for it, else by canonical names."""
    known = [_mapping_of(raw, mappings) for raw in raws]
    logs = []
    for raw, mapping in zip(raws, known, strict=True):
        own = raw.path.name if raw.path.name in TABLES else None
        if _is_long(raw, mapping):
            time = mapping.time if mapping is not None else TimeColumn()
            logs.append(log_of(raw.path, recording_of(raw, time), own, mapping))
            continue
        named = mapping is not None and any(_has(raw, s) for s in mapping.signals)
        if mapping is None or not mapping.signals or (not named and are_canonical(raw.names, own)):
            logs.append(read_canonical(raw, own))
            continue
        alike = [r for r, m in zip(raws, known, strict=True) if m is mapping]
        logs.append(read_mapped(raw, _part_of(mapping, raw, alike) if named else mapping))
    return logs


def _mapping_of(raw: RawTable, mappings: tuple[TableMapping, ...]) -> TableMapping | None:
    """The mapping whose pattern fits a frame's name, else the one with most of its columns."""
    named = mapping_for(raw.path, mappings)
    if named is not None or not mappings:
        return named
    if are_long(list(raw.names)):
        rows = set(names_in(raw))
        held = [sum(s.column in rows for s in mapping.signals) for mapping in mappings]
    else:
        held = [sum(_has(raw, signal) for signal in mapping.signals) for mapping in mappings]
    most = max(held)
    return mappings[held.index(most)] if most else None


def _part_of(mapping: TableMapping, raw: RawTable, alike: list[RawTable]) -> TableMapping:
    """What of a mapping is for one of the tables that it is for.

    That is what the table has; for the first also what none has, to be reported once.
    """
    first = next(r for r in alike if any(_has(r, s) for s in mapping.signals))
    taken = (
        s
        for s in mapping.signals
        if _has(raw, s) or (raw is first and not any(_has(r, s) for r in alike))
    )
    return replace(mapping, signals=tuple(taken))


def _is_long(raw: RawTable, mapping: TableMapping | None) -> bool:
    """Return whether a table has a row for each value, and no mapping names its columns."""
    named = mapping is not None and any(_has(raw, signal) for signal in mapping.signals)
    return not named and are_long(list(raw.names))


def _has(raw: RawTable, signal: MappedSignal) -> bool:
    return raw.index(signal.column) is not None


def _raw(name: str, frame: Any, *, mapped: bool) -> RawTable:
    """Lay a data frame out as a table that was read."""
    if not is_frame(frame):
        raise ConfigError(
            f"{name}: a data frame of pandas or polars is expected, got {type_name(frame)}"
        )
    notes: list[Problem] = []
    if not isinstance(frame, pl.DataFrame):
        dates = frame.index.dtype.kind == "M"
        if dates or frame.index.name is not None:
            own = frame.index.name if mapped or not dates else None
            if own == ASAMMDF_INDEX and not any(map(time_unit, map(str, frame.columns))):
                own = None
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
        notes += [Problem.of("file.no_plain_numbers", columns=column_list(left_out))] * bool(
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
