"""Sensor Logger (Kelvin Choi): a phone's acceleration, rotation and location, one CSV each.

Names, units and signs are those of the app's own reference pages (UNITS.md and
COORDINATES.md of tszheichoi/awesome-sensor-logger): ``time`` in nanoseconds
since 1970, m/s², rad/s, negative speed, bearing and accuracy meaning invalid.
Acceleration with gravity is ``TotalAcceleration.csv``, of Android alone; on
iOS the sign of acceleration depends on a setting, so it is left out.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.io.table import TextFormat, read_text
from weighbridge.signals import Problem
from weighbridge.signals.cleaning import clean_columns
from weighbridge.signals.units import to_si

# By file: column, quantity, unit, and whether negative values are invalid.
_FILES: Final = {
    "totalacceleration": tuple((a, f"accel_{a}", "mps2", False) for a in "xyz"),
    "gyroscope": tuple((a, f"gyro_{a}", "radps", False) for a in "xyz"),
    "location": (
        ("latitude", "latitude", "deg", False),
        ("longitude", "longitude", "deg", False),
        ("altitude", "altitude", "m", False),
        ("speed", "gnss_speed", "mps", True),
        ("bearing", "gnss_course", "deg", True),
        ("horizontalAccuracy", "gnss_accuracy", "m", True),
    ),
}

_METADATA: Final = b"version,device name,"


def is_sensor_logger(head: bytes) -> bool:
    """Return whether a file begins as Sensor Logger's do."""
    plain = head.removeprefix(b"\xef\xbb\xbf").replace(b'"', b"")
    return plain.startswith((b"time,seconds_elapsed,", _METADATA))


def read_sensor_logger(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read one file of a Sensor Logger recording; see `weighbridge.io.log.Reader`.

    Files of other sensors give no signals and a note.
    """
    log = Log(path, absolute=True)
    known = _FILES.get(path.stem.lower())
    if known is None:
        if path.stem.lower() == "accelerometer":
            log.problems.append(Problem.of("file.no_gravity", file=path.name))
        return log
    raw = read_text(path, TextFormat(separator=","))
    log.problems += [note.at(path.name) for note in raw.notes]
    time, _ = raw.numbers(0)
    columns = []
    for column, quantity, unit, positive in known:
        index = raw.index(column)
        if index is None:
            continue
        values, notes = raw.numbers(index)
        log.problems += [note.at(path.name, quantity) for note in notes]
        if positive:
            values = np.where(values < 0.0, np.nan, values)
        if np.isfinite(values).any():
            columns.append((quantity, to_si(values, unit)))
    log.signals, problems = clean_columns(time * 1e-9, columns, path.name)
    log.problems += problems
    return log
