"""From a raw table to signals, by canonical names or by a mapping."""

from __future__ import annotations

import difflib
import json
import re
import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.columns import (
    UnitlessColumnError,
    bracketed_unit,
    near_column,
    parse_column,
    time_unit,
)
from weighbridge.io.log import Log
from weighbridge.io.mapping import (
    MappedSignal,
    TableMapping,
    UnnamedError,
    in_si,
    lacking,
    resolved_unit,
)
from weighbridge.io.parquet import read_parquet
from weighbridge.io.table import (
    SEPARATORS,
    RawTable,
    column_list,
    read_text,
    time_seconds,
)
from weighbridge.signals import QUANTITIES, UNITS, Floats, Problem, find_restarts
from weighbridge.signals.catalogue import TIME_COLUMN
from weighbridge.signals.tomlfile import Faults

_PARTED: Final = re.compile(f"[{re.escape(''.join(SEPARATORS))}]")


def read_csv(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read separated text; see `weighbridge.io.log.Reader`."""
    raw = read_text(path, mapping.text if mapping else None)
    return read_mapped(raw, mapping) if mapping and mapping.signals else read_canonical(raw, table)


def read_pq(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read Parquet; see `weighbridge.io.log.Reader`."""
    raw = read_parquet(path)
    return read_mapped(raw, mapping) if mapping and mapping.signals else read_canonical(raw, table)


def read_canonical(raw: RawTable, table: str | None) -> Log:
    """Take the columns of a table whose names are canonical.

    Parameters
    ----------
    raw
    table : whose short names may be used; None to see it by the columns

    Raises
    ------
    DriveError
        There is no time, or no canonical column.
    """
    log = Log(raw.path)
    time_index = next((i for i, n in enumerate(raw.names) if time_unit(n)), None)
    wanted: dict[str, tuple[int, str, MappedSignal | None]] = {}
    unknown: list[str] = []
    for i, name in enumerate(raw.names):
        if i == time_index:
            continue
        try:
            found = parse_column(name, table or _table_of_all(raw))
        except UnitlessColumnError as e:
            raise DriveError(f"{raw.path}: column {name!r} {e}") from None
        if found is None:
            unknown.append(name)
        elif found[0].name in wanted:
            first = raw.names[wanted[found[0].name][0]]
            log.problems.append(
                Problem.of(
                    "file.column_twice", found[0].name, file=raw.path.name, name=name, first=first
                )
            )
        else:
            wanted[found[0].name] = (i, found[1], None)
    if time_index is None:
        raise _no_time(raw, bool(wanted))
    if not wanted:
        raise UnnamedError(
            f"{raw.path} has no column with a canonical name and unit (such as vehicle_speed_kmh); "
            f"it has {column_list(raw.names)}",
            raw.path,
        )
    if unknown:
        log.problems.append(
            Problem.of("file.unknown", file=raw.path.name, columns=_unknown_text(unknown))
        )
    unit = UNITS[time_unit(raw.names[time_index]) or "s"]
    time, log.absolute, notes = time_seconds(raw, time_index, unit.factor, None)
    log.problems += [note.at(raw.path.name) for note in notes]
    _finish(log, raw, time, taken(log, raw, wanted))
    return log


def taken(
    log: Log, raw: RawTable, wanted: Mapping[str, tuple[int, str, MappedSignal | None]]
) -> list[tuple[str, Floats]]:
    """Read columns of a table in SI; what is odd of the table and of them is reported.

    Parameters
    ----------
    log, raw : of the file
    wanted : by quantity: place of its column, suffix of its unit, and how a mapping scales it
    """
    log.problems[:0] = [note.at(raw.path.name) for note in raw.notes]
    columns = []
    places = [place for place, _, _ in wanted.values()]
    for name, (place, suffix, signal) in wanted.items():
        values, notes = raw.numbers(place)
        log.problems += [note.at(raw.path.name, name) for note in notes]
        columns.append((name, in_si(values, suffix, signal)))
        log.units[name] = suffix
        del values
        if places.count(place) == 1:
            raw.release(place)
    return columns


def _table_of_all(raw: RawTable) -> str | None:
    """A single file with positions may use the short names of the GNSS table."""
    return "gnss" if any(n.strip().lower().startswith("latitude_") for n in raw.names) else None


def read_mapped(raw: RawTable, mapping: TableMapping) -> Log:
    """Take the columns of a table that a mapping names.

    Raises
    ------
    DriveError
        None of them is there, or there is no time.
    ConfigError
        A unit is missing or impossible.
    """
    log = Log(raw.path)
    wanted: dict[str, tuple[int, str, MappedSignal | None]] = {}
    faults = Faults()
    for s in mapping.signals:
        index = raw.index(s.column)
        if index is not None:
            wanted[s.name] = (index, "", s)
            with faults.gathered():
                wanted[s.name] = (index, resolved_unit(s, None, mapping.source), s)
        elif not s.optional:
            log.lacking.append(
                lacking(f"{raw.path.name}: column", s, mapping.source, _near(s.column, raw))
            )
    if not wanted:
        raise DriveError(
            f"{raw.path}: none of the columns named in {mapping.source} is there; "
            f"the file has {column_list(raw.names)}{_named_hint(raw)}"
        )
    time, notes = _mapped_time(raw, mapping, log)
    if mapping.time.offset:
        time = time + mapping.time.offset
    log.problems += [note.at(raw.path.name) for note in notes]
    faults.refuse()
    _finish(log, raw, time, taken(log, raw, wanted))
    return log


def _mapped_time(raw: RawTable, mapping: TableMapping, log: Log) -> tuple[Floats, list[Problem]]:
    """Read the time that a mapping names [s], and what was odd; show the log of its kind.

    Raises
    ------
    DriveError
        There is no such column.
    """
    column, rate = mapping.time.column, mapping.time.rate
    if column is None and rate is not None:
        return np.arange(raw.rows) / rate, []
    if column is None:
        index = next((i for i, n in enumerate(raw.names) if time_unit(n)), None)
        if index is None:
            raise DriveError(
                f"{raw.path}: {mapping.source} names no time column; set column in [time] to one "
                f"of {column_list(raw.names)}, or rate_hz where the rows are even"
            )
    else:
        index = raw.index(column)
        if index is None:
            raise DriveError(
                f"{raw.path} has no time column {column!r} (from {mapping.source}); "
                f"it has {column_list(raw.names)}"
            )
    if rate is not None:
        rows, notes = raw.numbers(index)
        return rows / rate, notes
    from weighbridge.io.draft_time import counts_minutes, minutes_problem

    name = raw.names[index]
    if counts_minutes(name):
        log.problems.append(minutes_problem(raw.path.name, name))
    suffix = mapping.time.unit or time_unit(name) or bracketed_unit(name) or "s"
    factor = UNITS[suffix].factor if UNITS[suffix].dimension == "s" else 1.0
    time, log.absolute, notes = time_seconds(raw, index, factor, mapping.time.format)
    log.of_day = mapping.time.format == "clock"
    return time, notes


def _finish(log: Log, raw: RawTable, time: Floats, columns: list[tuple[str, Floats]]) -> None:
    if raw.rows == 0:
        log.problems.append(Problem.of("file.no_rows", file=raw.path.name))
        return
    for rows in find_restarts(time):
        piece = Log(raw.path, [], list(log.problems), list(log.lacking), log.absolute)
        piece.units = log.units
        piece.take(time[rows], [(name, values[rows]) for name, values in columns])
        log.pieces.append(piece)
    log.take(time, columns)


def _no_time(raw: RawTable, known: bool) -> DriveError:
    if known:
        return DriveError(
            f"{raw.path} has no time column; name it {TIME_COLUMN} (seconds on one clock), "
            f"or name it in [time] of a mapping file; it has {column_list(raw.names)}"
        )
    return UnnamedError(
        f"{raw.path} has no canonical columns ({TIME_COLUMN}, vehicle_speed_kmh …); "
        f"it has {column_list(raw.names)}",
        raw.path,
    )


def _named_hint(raw: RawTable) -> str:
    """What to do about a mapping whose columns are not there."""
    from weighbridge.io.draft_text import of_numbers

    parts = [cell.strip() for name in raw.names for cell in _PARTED.split(name) if cell.strip()]
    if raw.separator and parts and of_numbers(parts):
        names = json.dumps([TIME_COLUMN, "vehicle_speed_kmh", "-"])
        return (
            f": these are the values of its first line, and it has no header: name its "
            f"{len(raw.names)} columns in their order, as columns = {names} under csv there, or "
            f"draft another mapping: weighbridge map {shlex.quote(str(raw.path))} --columns NAMES"
        )
    other = _other_separator(raw)
    cells = [cell for name in raw.names for cell in name.split(other)] if other else raw.names
    if are_canonical(cells, None):
        return (
            ": these names need no mapping; leave out --mapping, or the line mapping of a vehicle "
            "file that names it"
        )
    return f"; set separator = {json.dumps(other)} there" if other else ""


def _other_separator(raw: RawTable) -> str:
    """Separator that is in the names of a table, where it is not the one given."""
    others = (s for s in SEPARATORS if raw.separator and s != raw.separator)
    return next((s for s in others if any(s in name for name in raw.names)), "")


def are_canonical(names: Sequence[str], table: str | None) -> bool:
    """Return whether names are a time's and a quantity's, so that they need no mapping."""
    if not any(map(time_unit, names)):
        return False
    for name in names:
        with suppress(UnitlessColumnError):
            if parse_column(name, table) is not None:
                return True
    return False


def _near(column: str, raw: RawTable) -> str:
    near = difflib.get_close_matches(column, raw.names, n=1, cutoff=0.7)
    return f"; did you mean {near[0]!r}?" if near else ""


def _column_named(name: str) -> str:
    """Canonical column that a logger's name means; empty where its name shows none surely."""
    from weighbridge.io.naming import recognise

    found = recognise(name)
    if not found.quantity or found.score < 1.0:
        return ""
    quantity = QUANTITIES[found.quantity]
    suffix = found.unit or quantity.suffix
    return f"{quantity.name}_{suffix}" if suffix else quantity.name


def _unknown_text(names: list[str]) -> str:
    parts = []
    for name in names[:6]:
        near = near_column(name) or _column_named(name)
        parts.append(f"{name!r} (did you mean {near}?)" if near else f"{name!r}")
    more = f" and {len(names) - 6} more" if len(names) > 6 else ""
    return f"{', '.join(parts)}{more}"
