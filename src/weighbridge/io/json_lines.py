"""JSON: one object a line, or all in one list; a value with its name, a row of values, or records.

OpenXC writes ``{"timestamp", "name", "value"}`` (openxcplatform.com, *Open Vehicle Data Trace
File*), telemetry-obd ``{"command_name", "obd_response_value", "iso_ts_pre", "iso_ts_post"}`` with
the unit behind the value. Objects in objects are parted by dots.

Records of Tesla Fleet Telemetry have the forms of Tesla's own server
(github.com/teslamotors/fleet-telemetry): the payload as protobuf writes JSON,
``{"data": [{"key", "value"}], "createdAt", "vin"}``, and the lines of its logger,
``{"data": {"VehicleSpeed": …, "CreatedAt"}, …}``. The protocol states no units, so fields are named
by a mapping; the position alone is known.
"""

from __future__ import annotations

import json
import re
from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from weighbridge.errors import DriveError
from weighbridge.io.channels import Channel, Recording
from weighbridge.io.draft_time import DraftTime, find_times
from weighbridge.io.long_csv import LOOKED_AT, are_long, recording_of
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.table import MOST_COLUMNS, RawTable, column_list
from weighbridge.io.understood import Lines, text_of
from weighbridge.messages import Problem
from weighbridge.signals import Floats

_LIST: Final = re.compile(rb"\s*\[\s*\{")
"""Begins a list of records."""

_DEEPEST: Final = 8
"""Objects within objects."""


def _records_of(path: Path) -> Iterator[Any]:
    """Records of a file, one a line or in one list; None for a line that is none.

    Raises
    ------
    DriveError
        It is a list that is cut off.
    """
    text = text_of(path.read_bytes())
    if text.lstrip().startswith("["):
        try:
            held = json.loads(text)
        except (ValueError, RecursionError):
            raise DriveError(
                f"{path} is no whole JSON list; it may have been cut off: copy it again"
            ) from None
        yield from held
        return
    for line in text.splitlines():
        if line.strip():
            try:
                yield json.loads(line)
            except (ValueError, RecursionError):
                yield None


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
    for record in _records_of(path):
        strange = not isinstance(record, dict)
        lines.add(b"\n", 1, strange, int(strange))
        if not strange:
            yield {
                name: str(int(value) if isinstance(value, bool) else value)
                for name, value in flat(record)
            }


def flat(value: Any, prefix: str = "", depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Numbers and texts of a record and of the records in it, by name."""
    if isinstance(value, dict) and depth < _DEEPEST:
        for key, below in value.items():
            yield from flat(below, f"{prefix}.{key}" if prefix else str(key), depth + 1)
    elif isinstance(value, bool | int | float | str):
        yield prefix, value


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


# Tesla Fleet Telemetry ----------------------------------------------------------------------------

_BEGIN: Final = re.compile(rb'(?:\xef\xbb\xbf)?\s*\[?\s*\{\s*"data"\s*:\s*\[\s*\{\s*"key"\s*:')
_LOGGED: Final = re.compile(rb'(?:\xef\xbb\xbf)?\s*\[?\s*\{.{0,4000}?"CreatedAt"\s*:', re.DOTALL)
_PLACE: Final = ("latitude", "longitude")
_PLACES: Final = {f"Location.{axis}": axis for axis in _PLACE}
_OTHERS: Final = frozenset(("Vin", "CreatedAt", "IsResend"))


def is_fleet_telemetry(head: bytes) -> bool:
    """Return whether a text holds records of Fleet Telemetry."""
    return bool(_BEGIN.match(head) or _LOGGED.match(head))


def open_fleet_telemetry(path: Path, time: TimeColumn) -> Recording:
    """Read records of Fleet Telemetry; see `weighbridge.io.channels.Opener`.

    Raises
    ------
    DriveError
        No record in it, or those of several vehicles.
    """
    stamps: list[str] = []
    rows: dict[str, array[float]] = {}
    cells: dict[str, array[float]] = {}
    vehicles: set[str] = set()
    found = Recording([], absolute=True)
    strange = 0
    lines = Lines()
    for record in _records_of(path):
        payload = _payload(record)
        lines.add(b"\n", 1, record is None, record is None)
        if payload is None:
            strange += 1
            continue
        stamp, vehicle, values = payload
        vehicles |= {vehicle} if vehicle else set()
        for name, value in values:
            if name not in rows and len(rows) >= MOST_COLUMNS:
                continue
            rows.setdefault(name, array("d")).append(len(stamps))
            cells.setdefault(name, array("d")).append(value)
        stamps.append(stamp)
    lines.refuse(path)
    if not rows:
        raise DriveError(f"{path} holds no record of Fleet Telemetry with numbers; export it again")
    if len(vehicles) > 1:
        raise DriveError(
            f"{path} holds records of {len(vehicles)} vehicles; a drive is of one: split it"
        )
    if strange:
        found.notes.append(Problem.of("file.records_left_out", count=strange))
    parsed = pl.Series(stamps).str.to_datetime(time_zone="UTC", time_unit="us", strict=False)
    seconds = np.array(parsed.cast(pl.Int64).cast(pl.Float64).fill_null(np.nan)) * 1e-6
    clocks: dict[bytes, Floats] = {}
    for name in rows:
        which = np.frombuffer(rows[name], dtype=np.float64).astype(np.intp)
        clock = clocks.setdefault(which.tobytes(), seconds[which])
        quantity = _PLACES.get(name, "")
        unit = "deg" if quantity else ""
        numbers = np.frombuffer(cells[name], dtype=np.float64)
        found.channels.append(Channel(name, clock, numbers, unit, quantity))
    return found


def _payload(record: Any) -> tuple[str, str, list[tuple[str, float]]] | None:
    """Time, vehicle and numbers of a record; None where it is none of vehicle data."""
    if not isinstance(record, dict):
        return None
    data = record.get("data")
    if isinstance(data, dict) and "CreatedAt" in data:
        values = [v for k, x in data.items() if k not in _OTHERS for v in _numbers(k, x)]
        return str(data["CreatedAt"]), str(data.get("Vin", "")), values
    if isinstance(data, list) and "createdAt" in record:
        pairs = [(d.get("key"), d.get("value")) for d in data if isinstance(d, dict)]
        values = [
            v
            for key, value in pairs
            if isinstance(value, dict) and not value.get("invalid")
            for x in value.values()
            for v in _numbers(str(key), x)
        ]
        return str(record["createdAt"]), str(record.get("vin", "")), values
    return None


def _numbers(name: str, value: Any) -> Iterator[tuple[str, float]]:
    if isinstance(value, dict) and not set(_PLACE) <= value.keys():
        # With types reported, the logger wraps each value.
        for below in value.values():
            yield from _numbers(name, below) if not isinstance(below, dict) else ()
    elif isinstance(value, dict):
        for axis in _PLACE:
            yield from _numbers(f"{name}.{axis}", value[axis])
    elif isinstance(value, bool | int | float | str):
        # Old firmware writes numbers as text.
        try:
            yield name, float(value)
        except (ValueError, OverflowError):
            return
