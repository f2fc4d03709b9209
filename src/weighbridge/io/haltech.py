"""Haltech NSP data logs exported as CSV: the channels are listed above rows of raw numbers.

Each channel has a type that says what its whole numbers count: 0.1 km/h, 0.1 K. The types are those
that several public programs agree on, and agree with the ranges in the header; Haltech publishes
no specification. Channels of other types have numbers without a unit.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from weighbridge.errors import DriveError
from weighbridge.io.channels import Recording
from weighbridge.io.draft_time import is_clock
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.table import TextFormat, head, read_text, time_seconds
from weighbridge.io.understood import plain_head

_HEAD_LINES: Final = 20_000

_TYPES: Final = {
    "EngineSpeed": (1.0, "rpm"),
    "Percentage": (0.1, "%"),
    "Pressure": (0.1, "kPa"),
    "AbsPressure": (0.1, "kPa"),
    "Temperature": (0.1, "k"),
    "BatteryVoltage": (1e-3, "V"),
    "Speed": (0.1, "km/h"),
    "AFR": (1e-3, ""),
    "Acceleration": (1e-3, "g"),
    "AngularVelocity": (0.1, "deg/s"),
    "Angle": (0.1, "deg"),
    "Ratio": (1e-3, ""),
}
"""Value of one count of a type, and its unit."""


def is_haltech(begin: bytes) -> bool:
    """Return whether a text begins as Haltech's logs do."""
    return plain_head(begin).startswith("%DataLog%")


def open_haltech(path: Path, time: TimeColumn) -> Recording:
    """Read a data log of Haltech; see `weighbridge.io.channels.Opener`.

    Raises
    ------
    DriveError
        It lists no channel, or has no row.
    """
    names: list[str] = []
    types: list[str] = []
    skip = -1
    for k, line in enumerate(head(path, _HEAD_LINES)):
        key, _, value = line.partition(" : ")
        if key.strip() == "Channel":
            names.append(value.strip())
            types.append("")
        elif key.strip() == "Type" and types:
            types[-1] = value.strip()
        elif names and is_clock(line.partition(",")[0]):
            skip = k
            break
    if skip < 0:
        raise DriveError(
            f"{path} lists no channel with rows below; export it again as CSV from NSP"
        )
    columns = tuple(f"{k}" for k in range(1 + len(names)))
    text = TextFormat(separator=",", skip_rows=skip, columns=columns)
    raw = read_text(path, text, whole=True)
    seconds, _, notes = time_seconds(raw, 0, 1.0, "clock")
    found = Recording([], of_day=True, notes=[*raw.notes, *notes])
    for k, (name, kind) in enumerate(zip(names, types, strict=True), start=1):
        factor, unit = _TYPES.get(kind, (1.0, ""))
        found.add(raw, k, seconds, name, unit, factor)
    return found
