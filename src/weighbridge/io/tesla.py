"""Tesla Track Mode: the ``telemetry-v1-….csv`` that a car writes to its USB drive.

The columns are those of files that owners published (github.com/adrianco/r-tesla-telemetry). The
elapsed time is that of the lap and begins anew with each. Acceleration is left out: its signs,
and whether gravity is in it, are not documented; power and brake pressure are none of the
quantities of a drive.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.io.table import TextFormat, column_list, read_text
from weighbridge.signals import Floats
from weighbridge.signals.cleaning import clean_columns
from weighbridge.signals.units import to_si

_LAP: Final = "Lap"
_TIME: Final = "Elapsed Time (ms)"
_KNOWN: Final = {
    "speed (mph)": ("vehicle_speed", "mph"),
    "speed (kph)": ("vehicle_speed", "kmh"),
    "speed (km/h)": ("vehicle_speed", "kmh"),
    "latitude (decimal)": ("latitude", "deg"),
    "longitude (decimal)": ("longitude", "deg"),
    "throttle position (%)": ("accelerator_pedal", "pct"),
}


def is_track_mode(head: bytes) -> bool:
    """Return whether a CSV begins as Tesla's Track Mode writes it."""
    begin = f"{_LAP},{_TIME},Speed (".encode()
    return head.removeprefix(b"\xef\xbb\xbf").startswith(begin)


def read_track_mode(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read a Track Mode CSV; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        None of its columns is known.
    """
    raw = read_text(path, TextFormat(separator=","))
    log = Log(path)
    log.problems += [note.at(path.name) for note in raw.notes]
    columns: list[tuple[str, Floats]] = []
    for k, name in enumerate(raw.names):
        known = _KNOWN.get(name.strip().lower())
        if known is None:
            continue
        values, notes = raw.numbers(k)
        log.problems += [note.at(path.name, known[0]) for note in notes]
        columns.append((known[0], to_si(values, known[1])))
    if not columns:
        raise DriveError(f"{path} has no column that is known; it has {column_list(raw.names)}")
    position = dict(columns)
    if "latitude" in position and "longitude" in position:
        # A place at the crossing of equator and zero meridian is none.
        nowhere = (position["latitude"] == 0.0) & (position["longitude"] == 0.0)
        for name in ("latitude", "longitude"):
            position[name] = np.where(nowhere, np.nan, position[name])
    laps, _ = raw.numbers(raw.names.index(_LAP))
    elapsed, _ = raw.numbers(raw.names.index(_TIME))
    time = session_time(laps, elapsed * 1e-3)
    log.signals, problems = clean_columns(time, list(position.items()), path.name)
    log.problems += problems
    return log


def session_time(laps: Floats, elapsed: Floats) -> Floats:
    """Count on over laps whose time begins anew.

    Parameters
    ----------
    laps : (n,) number of the lap
    elapsed : (n,) time since the lap began [s]

    Returns
    -------
    (n,) time since the first row's lap began [s]; between two laps lies the usual step
    """
    step = np.diff(elapsed)
    rising = step[step > 0.0]
    usual = float(np.median(rising)) if rising.size else 0.0
    turns = np.flatnonzero((np.diff(laps) != 0.0) & (step < 0.0))
    shift = np.zeros(elapsed.size)
    shift[turns + 1] = usual - step[turns]
    return elapsed + np.cumsum(shift)
