"""RaceChrono CSV v3: position, speed and engine speed of a phone app.

No specification is published. The form is the one its exports of versions 9
and 10 have: a line that names the app, ``Format,3``, further ``key,value``
lines, then one row of names, one of units and one of sources (``100: gps``,
``200: obd``, ``calc``); times count from 1970. Acceleration and rotation of
the phone are left out: how their signs are meant is not documented.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from weighbridge.errors import DriveError
from weighbridge.io.columns import unit_suffix
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.io.table import TextFormat, column_list, read_text
from weighbridge.signals import QUANTITIES, Problem
from weighbridge.signals.cleaning import clean_columns
from weighbridge.signals.units import UNITS, to_si

_BANNER: Final = b"This file is created using RaceChrono"

# Name of the column, kind of source, quantity.
_KNOWN: Final = {
    ("latitude", "gps"): "latitude",
    ("longitude", "gps"): "longitude",
    ("altitude", "gps"): "altitude",
    ("speed", "gps"): "gnss_speed",
    ("bearing", "gps"): "gnss_course",
    ("accuracy", "gps"): "gnss_accuracy",
    ("speed", "obd"): "vehicle_speed",
    ("speed", "canbus"): "vehicle_speed",
    ("rpm", "obd"): "engine_speed",
    ("rpm", "canbus"): "engine_speed",
}


def is_racechrono(head: bytes) -> bool:
    """Return whether a file begins as RaceChrono's exports do."""
    return head.removeprefix(b"\xef\xbb\xbf").startswith(_BANNER)


def read_racechrono(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read a RaceChrono CSV; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        Another version of the format, or none of its columns is known.
    """
    lines = path.read_bytes().decode("utf-8", errors="replace").splitlines()
    version = next((x for line in lines[:20] if (x := re.match(r"Format,\"?(\d+)", line))), None)
    if version is not None and version.group(1) != "3":
        raise DriveError(
            f"{path} is RaceChrono CSV v{version.group(1)}; export the session as CSV v3"
        )
    top = next((k for k, line in enumerate(lines) if line.startswith("timestamp,")), None)
    if top is None or len(lines) < top + 3:
        raise DriveError(f"{path} has no row of names that begins with timestamp; export it again")
    units = [c.strip().strip('"') for c in lines[top + 1].split(",")]
    sources = [c.strip().strip('"') for c in lines[top + 2].split(",")]
    raw = read_text(path, TextFormat(separator=",", skip_rows=top, skip_after_header=2))
    log = Log(path, absolute=True)
    log.problems += [note.at(path.name) for note in raw.notes]
    time, _ = raw.numbers(0)
    columns, taken = [], set[str]()
    ignored = []
    for k, name in enumerate(raw.names[1:], start=1):
        kind = sources[k].rsplit(":", 1)[-1].strip().lower() if k < len(sources) else ""
        quantity = _KNOWN.get((name.lower(), kind))
        suffix = unit_suffix(units[k]) if k < len(units) else None
        if quantity is None or quantity in taken:
            ignored.append(f"{name} ({kind})" if kind else name)
            continue
        wanted = UNITS[QUANTITIES[quantity].suffix].dimension
        if suffix is None or UNITS[suffix].dimension != wanted:
            log.problems.append(
                Problem.of(
                    "file.unknown_unit",
                    quantity,
                    file=path.name,
                    name=name,
                    unit=units[k] if k < len(units) else "",
                )
            )
            continue
        values, notes = raw.numbers(k)
        log.problems += [note.at(path.name, quantity) for note in notes]
        taken.add(quantity)
        columns.append((quantity, to_si(values, suffix)))
    if not columns:
        raise DriveError(f"{path} has no column that is known; it has {column_list(raw.names)}")
    if ignored:
        log.problems.append(
            Problem.of("file.ignored", file=path.name, columns=column_list(ignored))
        )
    log.signals, problems = clean_columns(time, columns, path.name)
    log.problems += problems
    return log
