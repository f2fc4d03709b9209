"""Tables that apps, cars and control units write, by the names that they give to their columns.

RaceChrono CSV v3: a line that names the app, ``Format,3``, further ``key,value`` lines, then one
row of names, one of units and one of sources (``100: gps``, ``200: obd``, ``calc``); times count
from 1970. No specification is published; the form is that of exports of versions 9 and 10.

Torque Pro track logs, about one row a second: names as the app writes them in English, each with
its unit in the last brackets. The time is the phone's, in its zone.

Sensor Logger (Kelvin Choi), one CSV for each sensor of a phone: names, units and signs are those of
the app's own reference pages (UNITS.md and COORDINATES.md of tszheichoi/awesome-sensor-logger):
``time`` in nanoseconds since 1970, m/s², rad/s, negative speed, bearing and accuracy meaning
invalid. Acceleration with gravity is ``TotalAcceleration.csv``, of Android alone; on iOS the sign
of acceleration depends on a setting, so it is left out.

Tesla Track Mode, ``telemetry-v1-….csv`` on a car's USB drive: the columns are those of files that
owners published (github.com/adrianco/r-tesla-telemetry). The elapsed time is that of the lap and
begins anew with each. Power and brake pressure are none of the quantities of a drive.

Haltech NSP data logs exported as CSV: the channels are listed above rows of raw numbers. Each has a
type that says what its whole numbers count: 0.1 km/h, 0.1 K. The types are those that several
public programs agree on, and agree with the ranges in the header; Haltech publishes no
specification. Channels of other types have numbers without a unit.

Acceleration and rotation of RaceChrono, Torque Pro and Track Mode are left out: their signs, and
whether gravity is in them, are not documented.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

import numpy as np

from weighbridge.data import toml_of
from weighbridge.errors import DriveError
from weighbridge.io.channels import Recording
from weighbridge.io.columns import bracketed_unit, dimension_of, unit_suffix
from weighbridge.io.draft_time import is_clock
from weighbridge.io.log import Log
from weighbridge.io.mapping import MappedSignal, TableMapping, TimeColumn
from weighbridge.io.table import (
    RawTable,
    TextFormat,
    column_list,
    head,
    read_text,
    time_seconds,
)
from weighbridge.io.tabular import read_mapped, taken
from weighbridge.io.understood import plain_head, text_of
from weighbridge.signals import QUANTITIES, UNITS, Floats, Problem

_LISTED: Final = toml_of("io", "apps.toml")

_Column = tuple[int, str, MappedSignal | None]


def _unknown(raw: RawTable) -> DriveError:
    return DriveError(f"{raw.path} has no column that is known; it has {column_list(raw.names)}")


# RaceChrono ---------------------------------------------------------------------------------------


def is_racechrono(begin: bytes) -> bool:
    """Return whether a file begins as RaceChrono's exports do."""
    return plain_head(begin).startswith("This file is created using RaceChrono")


def read_racechrono(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read a RaceChrono CSV; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        Another version of the format, or none of its columns is known.
    """
    lines = text_of(path.read_bytes()).splitlines()
    version = next((x for line in lines[:20] if (x := re.match(r"Format,\"?(\d+)", line))), None)
    if version is not None and version.group(1) != "3":
        raise DriveError(
            f"{path} is RaceChrono CSV v{version.group(1)}; export the session as CSV v3"
        )
    top = next((k for k, line in enumerate(lines) if line.startswith("timestamp,")), None)
    if top is None or len(lines) < top + 3:
        raise DriveError(f"{path} has no row of names that begins with timestamp; export it again")
    raw = read_text(path, TextFormat(separator=",", skip_rows=top, skip_after_header=2))
    count = len(raw.names)
    units, sources = (
        [*(c.strip().strip('"') for c in lines[top + k].split(",")), *[""] * count] for k in (1, 2)
    )
    log = Log(path, absolute=True)
    wanted: dict[str, _Column] = {}
    ignored = []
    odd = []
    for k, name in enumerate(raw.names[1:], start=1):
        kind = sources[k].rsplit(":", 1)[-1].strip().lower()
        quantity = _LISTED["racechrono"].get(f"{name.lower()} {kind}", "")
        if not quantity or quantity in wanted:
            ignored.append(f"{name} ({kind})" if kind else name)
        elif (suffix := unit_suffix(units[k])) is not None and _fits(quantity, suffix):
            wanted[quantity] = (k, suffix, None)
        else:
            about: dict[str, Any] = {"file": path.name, "name": name, "unit": units[k]}
            odd.append(Problem.of("file.unknown_unit", quantity, **about))
    columns = taken(log, raw, wanted)
    if not columns:
        raise _unknown(raw)
    log.problems += odd
    if ignored:
        log.problems.append(
            Problem.of("file.ignored", file=path.name, columns=column_list(ignored))
        )
    log.take(raw.numbers(0)[0], columns)
    return log


def _fits(quantity: str, unit: str | None) -> bool:
    """Whether a quantity can be in a unit."""
    known = QUANTITIES[quantity]
    return not known.suffix or (unit in UNITS and UNITS[unit].dimension == dimension_of(known))


# Torque Pro ---------------------------------------------------------------------------------------


def is_torque_pro(begin: bytes) -> bool:
    """Return whether a file begins as Torque Pro's track logs do."""
    names = [c.strip().lower() for c in plain_head(begin).split("\n", 1)[0].split(",")]
    return names[:2] == ["gps time", "device time"]


def read_torque_pro(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read a Torque Pro track log; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No column is known, or the time is in another language or form.
    """
    text = TextFormat(separator=",", missing=("-", "∞"))
    raw = read_text(path, text)
    found: dict[str, MappedSignal] = {}
    for name in raw.names:
        plain = " ".join(name.lower().split())
        for start, (quantity, *units) in _LISTED["torque_pro"].items():
            rest = plain.removeprefix(start).strip()
            if not plain.startswith(start) or (rest and not rest.startswith("(")):
                continue
            stated = bracketed_unit(name) or next(iter(units), None)
            if stated is None:
                stated = unit_suffix(rest.strip("() "))
            if quantity not in found and _fits(quantity, stated):
                found[quantity] = MappedSignal(
                    name=quantity, column=name, unit=stated or None, optional=True
                )
    if not found:
        raise DriveError(
            f"{path} has no column of Torque Pro that is known; it has {column_list(raw.names)}: "
            "name them in a mapping file"
        )
    own = TableMapping(
        files="*",
        text=text,
        time=TimeColumn(column=raw.names[1], format="%d-%b-%Y %H:%M:%S%.f"),
        signals=tuple(found.values()),
        source="Torque Pro",
    )
    return read_mapped(raw, own)


# Sensor Logger ------------------------------------------------------------------------------------


def is_sensor_logger(begin: bytes) -> bool:
    """Return whether a file begins as Sensor Logger's do."""
    said = plain_head(begin).replace('"', "")
    return said.startswith(("time,seconds_elapsed,", "version,device name,"))


def read_sensor_logger(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read one file of a Sensor Logger recording; see `weighbridge.io.log.Reader`.

    Files of other sensors give no signals and a note.
    """
    log = Log(path, absolute=True)
    known = _LISTED["sensor_logger"].get(path.stem.lower())
    if known is None:
        if path.stem.lower() == "accelerometer":
            log.problems.append(Problem.of("file.no_gravity", file=path.name))
        return log
    raw = read_text(path, TextFormat(separator=","))
    places = ((quantity, raw.index(name), unit) for name, (quantity, unit, *_) in known.items())
    columns = taken(log, raw, {q: (k, unit, None) for q, k, unit in places if k is not None})
    signed = {quantity for quantity, _, *positive in known.values() if not positive}
    columns = [(q, v if q in signed else np.where(v < 0.0, np.nan, v)) for q, v in columns]
    log.take(raw.numbers(0)[0] * 1e-9, [(q, v) for q, v in columns if np.isfinite(v).any()])
    return log


# Tesla Track Mode ---------------------------------------------------------------------------------

_LAP: Final = "Lap"
_TIME: Final = "Elapsed Time (ms)"


def is_track_mode(begin: bytes) -> bool:
    """Return whether a CSV begins as Tesla's Track Mode writes it."""
    return plain_head(begin).startswith(f"{_LAP},{_TIME},Speed (")


def read_track_mode(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read a Track Mode CSV; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        None of its columns is known.
    """
    raw = read_text(path, TextFormat(separator=","))
    log = Log(path)
    known = (
        (_LISTED["track_mode"].get(name.strip().lower()), k) for k, name in enumerate(raw.names)
    )
    columns = dict(taken(log, raw, {e[0]: (k, e[1], None) for e, k in known if e}))
    if not columns:
        raise _unknown(raw)
    place = ("latitude", "longitude")
    if columns.keys() >= set(place):
        # A place at the crossing of equator and zero meridian is none.
        nowhere = (columns["latitude"] == 0.0) & (columns["longitude"] == 0.0)
        columns |= {name: np.where(nowhere, np.nan, columns[name]) for name in place}
    laps, elapsed = (raw.numbers(raw.names.index(name))[0] for name in (_LAP, _TIME))
    log.take(_session_time(laps, elapsed * 1e-3), list(columns.items()))
    return log


def _session_time(laps: Floats, elapsed: Floats) -> Floats:
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


# Haltech ------------------------------------------------------------------------------------------

_HEAD_LINES: Final = 20_000


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
        factor, unit = _LISTED["haltech"].get(kind, (1.0, ""))
        found.add(raw, k, seconds, name, unit, factor)
    return found
