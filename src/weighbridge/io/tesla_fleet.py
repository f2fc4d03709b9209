"""Tesla Fleet Telemetry as JSON: one record a line, or a list of them.

Both forms are those of Tesla's own server (github.com/teslamotors/fleet-telemetry): the payload
as protobuf writes JSON, ``{"data": [{"key", "value"}], "createdAt", "vin"}``, and the lines of its
logger, ``{"data": {"VehicleSpeed": …, "CreatedAt"}, …}``. The protocol states no units, so fields
are named by a mapping; the position alone is known.
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
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.table import MOST_COLUMNS
from weighbridge.io.understood import Lines, text_of
from weighbridge.messages import Problem
from weighbridge.signals import Floats

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
    for record in records_of(path):
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


def records_of(path: Path) -> Iterator[Any]:
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
