"""JSON lines: one object a line, or all in one list; a value with its name or a row of values.

OpenXC writes ``{"timestamp", "name", "value"}`` (openxcplatform.com, *Open Vehicle Data Trace
File*), telemetry-obd ``{"command_name", "obd_response_value", "iso_ts_pre", "iso_ts_post"}`` with
the unit behind the value. Objects in objects are parted by dots.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from weighbridge.errors import DriveError
from weighbridge.io.channels import Recording
from weighbridge.io.draft_time import DraftTime, find_times
from weighbridge.io.long_csv import LOOKED_AT, are_long, recording_of
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.table import MOST_COLUMNS, RawTable, column_list
from weighbridge.io.tesla_fleet import records_of
from weighbridge.io.understood import Lines

_LIST: Final = re.compile(rb"\s*\[\s*\{")
"""Begins a list of records."""

_DEEPEST: Final = 6
"""Objects within objects."""


def is_json_lines(head: bytes) -> bool:
    """Return whether a text has an object on each of its first lines, or is a list of objects."""
    text = head.removeprefix(b"\xef\xbb\xbf")
    if _LIST.match(text):
        return True
    lines = text.splitlines()
    if len(lines) < 2 or not lines[0].lstrip().startswith(b"{"):
        return False
    try:
        first = json.loads(lines[0])
    except (ValueError, RecursionError):
        return False
    return isinstance(first, dict) and lines[1].lstrip().startswith(b"{")


def open_json_lines(path: Path, time: TimeColumn) -> Recording:
    """Read JSON lines; see `weighbridge.io.channels.Opener`.

    Raises
    ------
    DriveError
        No record with a time and a number in it.
    """
    lines = Lines()
    rows = list(_rows(path, lines))
    lines.refuse(path)
    names = list(dict.fromkeys(name for row in rows for name in row))
    if not rows or len(names) > MOST_COLUMNS:
        raise DriveError(
            f"{path} holds no record, or more than {MOST_COLUMNS} names; write one object per "
            "line, with a time and its values"
        )
    frame = pl.DataFrame(
        {str(k): [row.get(name, "") for row in rows] for k, name in enumerate(names)},
        schema={str(k): pl.String for k in range(len(names))},
    )
    raw = RawTable(path, tuple(names), frame, notes=lines.problems("file.lines_left_out", path))
    sample = [[row.get(name, "") for name in names] for row in rows[:LOOKED_AT]]
    return recording_of(raw, time) if are_long(names, sample) else _wide(raw, time)


def _rows(path: Path, lines: Lines) -> Iterator[dict[str, str]]:
    """Records of a file as texts by name; lines that are none are counted."""
    for record in records_of(path):
        strange = not isinstance(record, dict)
        lines.add(b"\n", 1, strange, int(strange))
        if not strange:
            yield dict(_flat(record, "", 0))


def _flat(record: Mapping[str, Any], prefix: str, depth: int) -> Iterator[tuple[str, str]]:
    """Texts of a record and of the records in it, by name."""
    for key, value in record.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict) and depth < _DEEPEST:
            yield from _flat(value, f"{name}.", depth + 1)
        elif isinstance(value, bool):
            yield name, str(int(value))
        elif isinstance(value, int | float | str):
            yield name, str(value)


def _wide(raw: RawTable, time: TimeColumn) -> Recording:
    """Channels of records that each hold a row of values."""
    clock = _clock(raw, time)
    found = Recording([], time=clock.column, notes=[*raw.notes])
    shown = TimeColumn(unit=clock.unit or None, format=clock.format or None)
    seconds = found.clock(raw, clock.index, clock.column, shown)
    for k, name in enumerate(raw.names):
        if k != clock.index:
            found.add(raw, k, seconds, name, raw.cell_unit(k))
    return found


def _clock(raw: RawTable, time: TimeColumn) -> DraftTime:
    """Column that is the time, as a mapping names it or as it looks."""
    if time.column is not None:
        index = raw.index(time.column)
        if index is not None:
            seconds = np.zeros(raw.rows)
            return DraftTime(raw.names[index], index, time.unit or "", time.format or "", seconds)
    found = find_times(raw, {}, ())[0]
    if time.column is not None or time.rate is not None or found.row_rate is not None:
        raise DriveError(
            f"{raw.path} holds no record with a time {time.column or 'that is known'!r}; it has "
            f"{column_list(raw.names)}: name it as column in [time] of a mapping"
        )
    return found
