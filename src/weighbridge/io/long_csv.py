"""Long tables of text: one row for each value, with its time, its name and often its unit.

Car Scanner ELM OBD2 writes ``"SECONDS";"PID";"VALUE";"UNITS";"LATITUDE";"LONGTITUDE";``: seconds
of the day, and the phone's position, 0 while there is none, repeated in every row. The form is
that of exports which public programs read; no specification is published.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl

from weighbridge.errors import DriveError
from weighbridge.io.channels import Channel, Recording
from weighbridge.io.columns import time_unit, unit_suffix
from weighbridge.io.draft_time import counts_minutes, is_number, minutes_problem, text_time_format
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.naming import is_time, recognise, words_of
from weighbridge.io.table import (
    MOST_COLUMNS,
    SEPARATORS,
    RawTable,
    column_list,
    numbers_with_units,
    read_text,
)
from weighbridge.io.understood import cells, plain_head
from weighbridge.io.vocabulary import words_in
from weighbridge.messages import Problem, refused
from weighbridge.signals import UNITS, Floats, from_si, to_si

_COLUMNS: Final = words_in("long tables")
_PLACES: Final = {quantity: _COLUMNS[quantity] for quantity in ("latitude", "longitude")}

# Numbers with commas in them, and those whose commas can part thousands.
_WITH_COMMA: Final = r"^[-+]?[\d.]*,[\d.,]*$"
_THOUSANDS: Final = r"^[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?$"

# Columns of a table that is long: what a row says is in a few.
_MOST: Final = 12


_DAMAGED: Final = 0.005
"""Part of the rows that a word is in at most which a torn line left [-]."""

# Rows by which it is known what a column of texts names, and part of the names that are known.
LOOKED_AT: Final = 200
_KNOWN: Final = 0.5


def _plain(name: str) -> str:
    return " ".join(words_of(name.strip().strip('"').replace("_", " ")))


def _place(names: list[str], among: Sequence[str]) -> int | None:
    return next((k for k, name in enumerate(names) if _plain(name) in among), None)


def _places(names: list[str], rows: Sequence[Sequence[str]]) -> tuple[int | None, int | None]:
    """Columns of names and of values: by what they are called, else by what is in them."""
    named, valued = (_place(names, _COLUMNS[key]) for key in ("names", "values"))
    reported = [row for row in rows if len(row) == len(names)]
    if named is None and reported:
        named = next((k for k in range(len(names)) if _names_quantities(reported, k)), None)
    if valued is None and named is not None and reported:
        timed = _time_place(names, rows)
        places = [k for w in _PLACES.values() if (k := _place(names, w)) is not None]
        free = (k for k in range(len(names)) if k not in (named, timed, *places))
        numeric = [k for k in free if all(is_number(row[k]) for row in reported)]
        valued = numeric[0] if len(numeric) == 1 else None
    return named, valued


def _names_quantities(rows: Sequence[Sequence[str]], column: int) -> bool:
    """Whether a column says again and again what a row is about."""
    kinds = {row[column] for row in rows}
    if not 2 <= len(kinds) <= 0.5 * len(rows) or any(map(is_number, kinds)):
        return False
    known = [kind for kind in kinds if recognise(kind).quantity]
    return len(known) >= 2 and len(known) >= _KNOWN * len(kinds)


def _time_place(names: list[str], rows: Sequence[Sequence[str]] = ()) -> int | None:
    """Column of the time: by its name, else the first whose cells are times."""
    named = (k for k, n in enumerate(names) if is_time(n) or time_unit(n) is not None)
    place = next(named, None)
    if place is not None or not rows:
        return place
    reported = [row for row in rows if len(row) == len(names)]
    columns = ([row[k] for row in reported if row[k]] for k in range(len(names)))
    return next((k for k, cells in enumerate(columns) if text_time_format(cells)[0]), None)


def is_long(head: bytes) -> bool:
    """Return whether a text begins with the header of a long table."""
    lines = plain_head(head).split("\n")
    separator = max(SEPARATORS, key=lines[0].count)
    # The last line may be cut off.
    rows = [cells(line.strip("\r "), separator) for line in lines[:-1] if line.strip()]
    return bool(rows) and are_long(rows[0], rows[1:])


def are_long(names: list[str], rows: Sequence[Sequence[str]] = ()) -> bool:
    """Return whether columns are those of a long table.

    Parameters
    ----------
    names : of the columns
    rows : some, by which columns are known that are called otherwise
    """
    return (
        3 <= len(names) <= _MOST
        and _time_place(names, rows) is not None
        and None not in _places(names, rows)
    )


def open_long(path: Path, time: TimeColumn) -> Recording:
    """Read a long table, one channel for each name; see `weighbridge.io.channels.Opener`.

    Raises
    ------
    DriveError
        It has no rows, no time that can be read, too many names, or a name whose units do not
        convert into one another.
    """
    return recording_of(read_text(path, whole=True), time)


def names_in(raw: RawTable) -> tuple[str, ...]:
    """Names that the rows of a long table have."""
    named, _ = _places(list(raw.names), _some(raw))
    if named is None:
        return ()
    texts = raw.column(named).cast(pl.String).str.strip_chars()
    return tuple(texts.drop_nulls().unique(maintain_order=True))


def recording_of(raw: RawTable, time: TimeColumn) -> Recording:
    """Turn a long table that was read, as `open_long` does; errors are its."""
    path = raw.path
    names = list(raw.names)
    named, valued = _places(names, _some(raw))
    if named is None or valued is None:
        raise DriveError(f"{path} has no columns of names and values; it has {column_list(names)}")
    if raw.rows == 0:
        raise DriveError(f"{path} has a header and no rows; record it again")
    of_one = _of_one_vehicle(raw, names)
    found = Recording([], notes=list(raw.notes))
    seconds = _seconds(raw, names, time, found)
    united = _place(names, _COLUMNS["units"])
    numeric = [valued, *(k for k in map(partial(_place, names), _PLACES.values()) if k is not None)]
    thousands = _have_thousands([raw.column(k) for k in numeric])
    if thousands:
        found.notes.append(Problem.of("file.thousands"))
    texts = raw.column(valued)
    in_cells = numbers_with_units(texts) if united is None else None
    table = pl.DataFrame(
        {
            "time": seconds,
            "name": raw.column(named).cast(pl.String).str.strip_chars(),
            "value": _numbers(texts, thousands) if in_cells is None else in_cells[0],
            "unit": raw.column(united).cast(pl.String)
            if united is not None
            else in_cells[1]
            if in_cells is not None
            else pl.repeat("", raw.rows, eager=True),
        }
    )
    known = table if of_one is None else table.filter(of_one)
    known = known.drop_nulls(["name", "value"]).filter(pl.col("time").is_finite())
    if known.height == 0:
        raise DriveError(f"{path} has no row with a time, a name and a number; record it again")
    if (lost := table.height - known.height) > 0:
        found.notes.append(Problem.of("file.rows_left_out", count=lost, rows=table.height))
    if known["name"].n_unique() > MOST_COLUMNS:
        raise DriveError(f"{path} has {known['name'].n_unique()} names, {MOST_COLUMNS} at most")
    for (name,), rows in known.partition_by("name", as_dict=True, maintain_order=True).items():
        found.channels.append(_channel(path, str(name), rows, found.notes))
    found.channels += _position(raw, names, seconds, thousands)
    return found


def _some(raw: RawTable) -> list[list[str]]:
    """Return the first rows of a table as texts."""
    columns = [
        raw.column(k).head(LOOKED_AT).cast(pl.String).fill_null("").str.strip_chars().to_list()
        for k in range(len(raw.names))
    ]
    return [list(row) for row in zip(*columns, strict=True)]


def _of_one_vehicle(raw: RawTable, names: list[str]) -> pl.Series | None:
    """Return which rows are of the one vehicle of a table; None where none is named.

    A name that is in hardly any row is damage.

    Raises
    ------
    DriveError
        There are several: a drive is of one.
    """
    place = _place(names, _COLUMNS["vehicles"])
    if place is None:
        return None
    reported = raw.column(place).cast(pl.String).str.strip_chars()
    counts = reported.drop_nulls().value_counts(sort=True)
    vehicles = [name for name, count in counts.rows() if not _is_damage(count, raw.rows)]
    if len(vehicles) > 1:
        raise refused(
            "file.several_vehicles",
            file=raw.path.name,
            count=len(vehicles),
            column=names[place],
            example=vehicles[0],
        )
    return (reported.is_null() | reported.is_in(vehicles)) if vehicles else None


def _is_damage(count: int, rows: int) -> bool:
    """Whether what is in so many of the rows is no word of the logger, but a torn one."""
    return count <= max(1.0, _DAMAGED * rows)


def _channel(path: Path, name: str, rows: pl.DataFrame, notes: list[Problem | str]) -> Channel:
    """Values of one name, all in the unit that most of its rows state.

    A unit that is in hardly any row and does not convert is damage; the row is left out.
    """
    stated = rows["unit"].fill_null("").str.strip_chars()
    units = (
        stated.filter(stated != "")
        .value_counts(sort=True)
        .sort("count", "unit", descending=[True, False])
    )
    unit = str(units["unit"][0]) if units.height else ""
    time = np.array(rows["time"].to_numpy(), dtype=np.float64)
    values = np.array(rows["value"].to_numpy(), dtype=np.float64)
    common = unit_suffix(unit)
    kept = np.ones(values.size, dtype=bool)
    for other, count in units.rows()[1:]:
        here = (stated == other).to_numpy()
        suffix = unit_suffix(other)
        if suffix and common and UNITS[suffix].dimension == UNITS[common].dimension:
            values[here] = from_si(to_si(values[here], suffix), common)
        elif _is_damage(count, rows.height):
            kept &= ~here
            notes.append(Problem.of("file.row_unit", name=name, unit=other))
        else:
            raise DriveError(
                f"{path}: {name!r} is in {unit!r} and in {other!r}, which do not convert into one "
                "another; split the file where the unit changes"
            )
    return Channel(name, time[kept], values[kept], unit)


def _seconds(raw: RawTable, names: list[str], time: TimeColumn, found: Recording) -> Floats:
    """Times of the rows [s], as a mapping shows or as they look."""
    if time.rate is not None:
        raise DriveError(
            f"{raw.path} has one row for each value, so that rate_hz in [time] of the mapping is "
            "no rate of a signal; name the time's column in its place"
        )
    index = _time_place(names, _some(raw)) if time.column is None else raw.index(time.column)
    if index is None:
        raise DriveError(
            f"{raw.path} has no time column {time.column or ''!r}; it has {column_list(names)}: "
            "name it as column in [time] of a mapping"
        )
    name = names[index]
    found.time = name
    if counts_minutes(name):
        found.notes.append(minutes_problem(raw.path.name, name))
    return found.clock(raw, index, name, time)


def _have_thousands(columns: list[pl.Series]) -> bool:
    """Whether commas part thousands: all that stand in numbers can, else they are decimals."""
    texts = [c.str.strip_chars() for c in columns if c.dtype == pl.String]
    found = [t.filter(t.str.contains(_WITH_COMMA).fill_null(False)) for t in texts]
    return any(t.len() for t in found) and all(t.str.contains(_THOUSANDS).all() for t in found)


def _numbers(values: pl.Series, thousands: bool) -> pl.Series:
    """Cells as numbers, with a point or a comma; null where one is none."""
    if values.dtype != pl.String:
        return values.cast(pl.Float64)
    text = values.str.strip_chars()
    if thousands:
        text = text.str.replace_all(",", "", literal=True)
    return text.str.replace(",", ".", literal=True).cast(pl.Float64, strict=False)


def _position(raw: RawTable, names: list[str], seconds: Floats, thousands: bool) -> list[Channel]:
    """Position of the rows where it is one and changes."""
    places = {q: _place(names, words) for q, words in _PLACES.items()}
    if None in places.values():
        return []
    columns = (_numbers(raw.column(k or 0), thousands) for k in places.values())
    values = [np.array(column.fill_null(np.nan)) for column in columns]
    fixed = np.isfinite(values[0]) & np.isfinite(values[1]) & np.isfinite(seconds)
    fixed &= (values[0] != 0.0) | (values[1] != 0.0)
    rows = np.flatnonzero(fixed)
    if rows.size == 0:
        return []
    changed = np.ones(rows.size, dtype=bool)
    changed[1:] = (np.diff(values[0][rows]) != 0.0) | (np.diff(values[1][rows]) != 0.0)
    rows = rows[changed]
    time = seconds[rows]
    return [Channel(q, time, v[rows], "deg", q) for q, v in zip(places, values, strict=True)]
