"""Tables of numbers, and their reader for CSV and other separated text."""

from __future__ import annotations

import datetime as dt
import io
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl

from weighbridge.errors import DriveError
from weighbridge.io.quiet import PARSE_ERRORS, first_line, quietly
from weighbridge.io.understood import (
    LOOKED_AT,
    UTF_16,
    Lines,
    cells,
    strange_rows,
    text_of,
    without_open_quotes,
    without_strange_rows,
)
from weighbridge.messages import Problem
from weighbridge.signals import Floats

SEPARATORS: Final = (",", ";", "\t", "|")
MISSING: Final = ("", "na", "n/a", "nan", "null", "none", "-", "#n/a")
"""Cells that mean "no value", in any case."""

_COMMA_NUMBER: Final = re.compile(r"[-+]?\d+,\d+$")

MOST_COLUMNS: Final = 10_000
"""Columns of a table: ten times those of the widest bus databases."""

DATES: Final = (631_152_000.0, 4_102_444_800.0)
"""Numbers of seconds between these count from 1970: the years 1990 to 2100 [s]."""

DAY: Final = 86_400.0
"""Length of a day [s]."""

_LONGEST_NAME: Final = 60
"""Letters of a column's name that a message shows."""

_HEAD: Final = 1 << 18
"""Bytes at the beginning of a text that hold its header and its first rows."""

# Stamps before and after midnight that have to agree that it was there.
_AROUND: Final = 3

_NUMBER_UNIT: Final = (
    r"^(?P<number>[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?)\s+(?P<unit>[A-Za-z%°µ][^\d,;]{0,40})$"
)
"""A number with a unit behind it."""

# Part of the rows by which a unit in the cells is known that may have another one.
_FEW: Final = 0.02

# Above this part of cells that are not numbers, a column is text.
_TEXT_PART: Final = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class TextFormat:
    """How a text table is written.

    Attributes
    ----------
    separator : between cells; None to find it in the header
    encoding : None for UTF-8, or Latin-1 where the bytes are not UTF-8
    decimal : mark of the decimals, "." or ","
    skip_rows : lines before the header
    skip_after_header : lines between the header and the first row
    columns : names of the columns of a file without a header
    missing : further texts that mean "no value"
    """

    separator: str | None = None
    encoding: str | None = None
    decimal: str = "."
    skip_rows: int = 0
    skip_after_header: int = 0
    columns: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class RawTable:
    """A table as it is in the file.

    Attributes
    ----------
    path : the file
    names : all its columns
    frame : cells, columns named by their place "0", "1", …; text cells as text
    plain : columns of numbers that are not in ``frame``, by their place, and how many of their
        cells are not-a-number; NaN there and where a cell is empty
    notes : what was odd about the file itself
    separator : found or given; empty for Parquet
    missing : texts that mean "no value", lower case
    decimal : mark of the decimals
    """

    path: Path
    names: tuple[str, ...]
    frame: pl.DataFrame
    separator: str = ""
    missing: frozenset[str] = frozenset(MISSING)
    decimal: str = "."
    notes: list[Problem] = field(default_factory=list)
    plain: dict[int, tuple[Floats, int]] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return next((values.size for values, _ in self.plain.values()), self.frame.height)

    def index(self, name: str) -> int | None:
        """Place of a column; spaces and case do not count where that is unambiguous."""
        if name in self.names:
            return self.names.index(name)
        wanted = _plain(name)
        places = [i for i, n in enumerate(self.names) if _plain(n) == wanted]
        return places[0] if len(places) == 1 else None

    def column(self, index: int) -> pl.Series:
        """One column as it is in the file."""
        if index in self.plain:
            return pl.Series(str(index), self.plain[index][0])
        return self.frame[str(index)]

    def sample(self, index: int) -> list[str]:
        """Some cells of a column of texts, without blanks around; none of another."""
        if self.column(index).dtype != pl.String:
            return []
        cells = self.column(index).drop_nulls().head(200).to_list()
        return [cell.strip() for cell in cells if cell.strip()]

    def release(self, index: int) -> None:
        """Hold a column no longer that was read and is not the last one."""
        if len(self.plain) > 1:
            self.plain.pop(index, None)

    def numbers(self, index: int) -> tuple[Floats, list[Problem]]:
        """Read a column as numbers.

        Returns
        -------
        values : (n,) NaN where a cell is empty or no number
        notes : cells that were not numbers or not-a-number

        Raises
        ------
        DriveError
            Most of the column is text.
        """
        name = self.names[index]
        if index in self.plain:
            values, nans = self.plain[index]
            return values, _nan_notes(nans, values.size, name)
        series, notes = _plain_text(self.column(index)), list[Problem]()
        if series.dtype == pl.String:
            text = series.str.strip_chars()
            if self.decimal == ",":
                text = text.str.replace(",", ".", literal=True)
            numbers = text.cast(pl.Float64, strict=False)
            empty = text.is_null() | text.str.to_lowercase().is_in(sorted(self.missing))
            wrong = numbers.is_null() & ~empty
            if int(wrong.sum()) > _TEXT_PART * int((~empty).sum()):
                reported = _one_unit(text)
                numbers = reported[0] if reported is not None else numbers
                wrong = numbers.is_null() & ~empty
            if bad := int(wrong.sum()):
                example = text.filter(wrong)[0]
                row = int(wrong.arg_max() or 0) + 1
                filled = int((~empty).sum())
                if bad > _TEXT_PART * filled:
                    remedy = (
                        'set decimal = "," in [csv] of a mapping'
                        if _COMMA_NUMBER.match(example)
                        else "correct the file or map another column"
                    )
                    raise DriveError(
                        f"{self.path}: column {name!r} holds text such as {example!r} "
                        f"(row {row}), not numbers; {remedy}"
                    )
                notes.append(
                    Problem.of(
                        "file.cells_text",
                        count=bad,
                        filled=filled,
                        name=name,
                        example=example,
                        row=row,
                    )
                )
            series = numbers
        elif series.dtype.is_temporal() or series.dtype.is_nested() or series.dtype == pl.Binary:
            raise DriveError(
                f"{self.path}: column {name!r} holds {series.dtype}, not numbers; "
                "map another column"
            )
        elif series.dtype != pl.Float64:
            series = series.cast(pl.Float64, strict=False)
        notes += _nan_notes(int(series.is_nan().sum() or 0), series.len(), name)
        values = series.to_numpy()
        # Kernels are compiled for arrays that can be written to and lie in one piece.
        if not (values.flags.writeable and values.flags.c_contiguous):
            values = np.array(values, dtype=np.float64)
        return np.asarray(values, dtype=np.float64), notes

    def cell_unit(self, index: int) -> str:
        """Unit that is in the cells of a column, behind their numbers; empty for none."""
        if index in self.plain or self.column(index).dtype != pl.String:
            return ""
        reported = _one_unit(self.column(index).head(LOOKED_AT))
        return reported[1] if reported is not None else ""


def numbers_with_units(cells: pl.Series) -> tuple[pl.Series, pl.Series] | None:
    """Numbers and units of cells such as ``1165.0 revolutions_per_minute``.

    Parameters
    ----------
    cells : (n,)

    Returns
    -------
    numbers, units : (n,) null where a cell is of another form

    None where hardly any cell is of that form.
    """
    if cells.dtype != pl.String:
        return None
    text = cells.str.strip_chars()
    parts = text.str.extract_groups(_NUMBER_UNIT).struct.unnest()
    filled = int((text.is_not_null() & (text != "")).sum())
    if parts["unit"].len() - parts["unit"].null_count() < max(_TEXT_PART * filled, 1):
        return None
    return parts["number"].cast(pl.Float64, strict=False), parts["unit"]


def _one_unit(cells: pl.Series) -> tuple[pl.Series, str] | None:
    """Numbers of the cells of a column and the unit behind them; None where it has none or more."""
    reported = numbers_with_units(cells)
    if reported is None:
        return None
    units = reported[1].drop_nulls().value_counts(sort=True)
    if units.height > 1 and units["count"][1] > _FEW * cells.len():
        return None
    unit = str(units[reported[1].name][0])
    return pl.DataFrame({"n": reported[0], "u": reported[1]}).select(
        pl.when(pl.col("u") == unit).then(pl.col("n"))
    ).to_series(), unit


def _nan_notes(nans: int, cells: int, name: str) -> list[Problem]:
    return [Problem.of("file.cells_nan", count=nans, cells=cells, name=name)] if nans else []


def _plain_text(series: pl.Series) -> pl.Series:
    """Give categories, which some writers make of any text, as the text they stand for."""
    categories = isinstance(series.dtype, pl.Categorical | pl.Enum)
    return series.cast(pl.String) if categories else series


def _plain(name: str) -> str:
    return " ".join(name.split()).casefold()


def read_text(
    path: Path, text_format: TextFormat | None = None, *, whole: bool = False
) -> RawTable:
    """Read a CSV or other separated text table.

    Parameters
    ----------
    path : the file
    text_format : how it is written; None to find it
    whole : whether a row counts whole or not at all: one with other cells than the header names
        is left out, as the cells of two torn rows stand in it

    Raises
    ------
    DriveError
        No such file, not text in the encoding, or no header.
    """
    fmt = text_format or TextFormat()
    text, notes = _decode(path, fmt)
    lines = text.split("\n", fmt.skip_rows + 1)
    header = lines[fmt.skip_rows].rstrip("\r") if len(lines) > fmt.skip_rows else ""
    if not header.strip():
        raise DriveError(f"{path} is empty: it has no header line; remove it or record it again")
    separator = fmt.separator or _separator(path, header)
    columns = len(fmt.columns) or 1 + header.count(separator)
    if columns > MOST_COLUMNS:
        raise DriveError(
            f"{path}: its first line has {columns} columns, and a table may have {MOST_COLUMNS}; "
            "it is no table, or its separator is another one"
        )
    names = fmt.columns or tuple(cells(header, separator))
    skip = fmt.skip_rows + (0 if fmt.columns else 1 + fmt.skip_after_header)
    body = text if skip == 0 else _after_line(text, skip)
    if not body.strip():
        frame = pl.DataFrame({str(i): pl.Series([], dtype=pl.Float64) for i in range(len(names))})
    else:
        read = Lines()
        read.add(b"\n" * skip, 0, 0, 0)
        data = body.encode(errors="replace")
        if whole:
            rows, counts = without_strange_rows(data, len(names), separator)
            read.add(data, *counts)
            notes += read.problems("file.rows_cut", path)
            data = rows
        else:
            read.add(data, *strange_rows(data, len(names), separator))
            notes += read.problems("file.rows_strange", path)
        frame = _parse(path, data, len(names), separator, fmt.decimal, notes)
    missing = frozenset(MISSING) | {m.strip().lower() for m in fmt.missing}
    return RawTable(path, names, frame, separator, missing, fmt.decimal, notes)


def _decode(path: Path, fmt: TextFormat) -> tuple[str, list[Problem]]:
    return _decoded(path, path.read_bytes(), fmt)


def head(path: Path, count: int) -> list[str]:
    """Return the first lines of a text without their ends, as `read_text` decodes them.

    Raises
    ------
    DriveError
        Not a text.
    """
    with path.open("rb") as file:
        data = file.read(_HEAD)
    wide = data[:2] in UTF_16
    if len(data) == _HEAD and not wide:
        # The last line may end within a character.
        data = data[: data.rfind(b"\n") + 1] or data
    text, _ = _decoded(path, data, TextFormat())
    return [line.rstrip("\r") for line in text.split("\n", count)[:count]]


def _decoded(path: Path, data: bytes, fmt: TextFormat) -> tuple[str, list[Problem]]:
    if data[:4] in (b"PAR1", b"MDF ", b"UnFi"):
        raise DriveError(f"{path} is not a text table; give it its own suffix (.parquet, .mf4)")
    if fmt.encoding is not None:
        try:
            return data.decode(fmt.encoding).removeprefix("\ufeff"), []
        except UnicodeError as e:
            place = f" (byte {e.start})" if isinstance(e, UnicodeDecodeError) else ""
            raise DriveError(
                f"{path} is not {fmt.encoding}{place}: set encoding in [csv] of the mapping"
            ) from None
    zeros = 0 if data[:2] in UTF_16 else data.count(0)
    return text_of(data), [Problem.of("file.zero_bytes", count=zeros)] * bool(zeros)


def _separator(path: Path, header: str) -> str:
    if path.suffix.lower() == ".tsv":
        return "\t"
    return max(SEPARATORS, key=header.count)


def _after_line(text: str, count: int) -> str:
    at = 0
    for _ in range(count):
        at = text.find("\n", at) + 1
        if at == 0:
            return ""
    return text[at:]


def _parse(
    path: Path, body: bytes, columns: int, separator: str, decimal: str, notes: list[Problem]
) -> pl.DataFrame:
    names = [str(i) for i in range(columns)]
    # With a header of its own, the width does not hang on the first row.
    data = f"{separator.join(names)}\n".encode() + body
    # A quote that is never closed would swallow the rest of the file.
    if data.count(b'"') % 2 == 1:
        data, _ = without_open_quotes(data)
        notes.append(Problem.of("file.open_quote"))

    def parse(dtype: type[pl.DataType]) -> pl.DataFrame:
        with quietly():
            return pl.read_csv(
                io.BytesIO(data),
                separator=separator,
                decimal_comma=decimal == ",",
                schema=dict.fromkeys(names, dtype),
                null_values=None if dtype is pl.String else ["NA", "na", "N/A", "null", "-"],
                truncate_ragged_lines=True,
            )

    try:
        return parse(pl.Float64)
    except PARSE_ERRORS:
        # Some cell is no number: take all as text, and judge column by column.
        try:
            return parse(pl.String)
        except PARSE_ERRORS as e:
            raise DriveError(f"{path} is not a readable table: {first_line(e)}") from None


def time_seconds(
    table: RawTable, index: int, unit_factor: float, time_format: str | None
) -> tuple[Floats, bool, list[Problem]]:
    """Read the time column.

    Parameters
    ----------
    table : the table
    index : place of the time column
    unit_factor : seconds per unit, where it holds numbers
    time_format : None for numbers, "clock" for a time of day such as 17:58:02.288,
        "iso" for ISO 8601, otherwise a `strptime` format

    Returns
    -------
    time : (n,) [s]; NaN where it cannot be read
    absolute : whether it counts from 1970
    notes : what was odd

    Raises
    ------
    DriveError
        The column holds no times in that format.
    """
    if index not in table.plain and table.column(index).dtype.is_temporal():
        return (*seconds_of(table.column(index)), [])
    if time_format is None:
        values, notes = table.numbers(index)
        seconds = values * unit_factor if unit_factor != 1.0 else values
        return seconds, since_1970(seconds), notes
    text = table.column(index).cast(pl.String).str.strip_chars()
    if time_format == "clock":
        part = text.str.extract_groups(r"^(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d+)?)$").struct.unnest()
        hour, minute, second = (
            part[c].str.replace(",", ".", literal=True).cast(pl.Float64, strict=False).to_numpy()
            for c in part.columns
        )
        seconds, absolute = unwrapped(3600.0 * hour + 60.0 * minute + second), False
    else:
        try:
            with quietly():
                parsed = parsed_dates(text, time_format)
        except PARSE_ERRORS as e:
            raise DriveError(
                f"{table.path}: column {table.names[index]!r} cannot be read in the format "
                f"{time_format!r} ({first_line(e)}); set format in [time] of the mapping"
            ) from None
        seconds, absolute = seconds_of(parsed)
    present = text.is_not_null() & (text != "")
    lost = int(present.sum()) - int(np.count_nonzero(np.isfinite(seconds)))
    if lost > _TEXT_PART * max(int(present.sum()), 1):
        example = text.filter(present)[0]
        raise DriveError(
            f"{table.path}: time {example!r} in column {table.names[index]!r} is not in the "
            f"format {time_format!r}; set format in [time] of the mapping"
        )
    notes = [Problem.of("file.stamps_unreadable", count=lost)] if lost else []
    return seconds, absolute, notes


def since_1970(seconds: Floats) -> bool:
    """Whether numbers are a date: most of them lie in `DATES`."""
    known = seconds[np.isfinite(seconds)]
    return bool(known.size) and DATES[0] < float(np.median(known)) < DATES[1]


def parsed_dates(text: pl.Series, time_format: str) -> pl.Series:
    """Dates of texts, in a format as `time_seconds` takes it; null where one is none."""
    if time_format != "iso":
        return text.str.to_datetime(time_format, strict=False, time_unit="us")
    # One spelling for all: a blank as T, no zone but an offset applied below.
    plain = text.str.replace(" ", "T", literal=True).str.replace("Z$", "+00:00")
    if bool(plain.str.contains(r"[+-]\d{2}:?\d{2}$").any()):
        return plain.str.to_datetime("%Y-%m-%dT%H:%M:%S%.f%:z", strict=False, time_unit="us")
    return plain.str.to_datetime("%Y-%m-%dT%H:%M:%S%.f", strict=False, time_unit="us")


def seconds_of(series: pl.Series) -> tuple[Floats, bool]:
    """Dates, times of day or durations [s], and whether they count from 1970."""
    if series.dtype == pl.Time:
        return unwrapped(series.cast(pl.Int64).cast(pl.Float64).to_numpy() * 1e-9), False
    if isinstance(series.dtype, pl.Duration):
        return np.array(series.dt.total_microseconds().cast(pl.Float64).to_numpy()) * 1e-6, False
    us = series.cast(pl.Datetime("us")).cast(pl.Int64).cast(pl.Float64)
    return np.array(us.to_numpy()) * 1e-6, True


def unwrapped(seconds: Floats) -> Floats:
    """Carry a time of day over midnight; a stamp that alone falls by half a day is damaged."""
    finite = np.isfinite(seconds)
    present = seconds[finite]
    turns = np.zeros(present.size)
    falls = np.flatnonzero(np.diff(present) < -DAY / 2) + 1
    for k in falls.tolist():
        turns[k] = present[max(k - _AROUND, 0) : k].min() - present[k : k + _AROUND].max() > DAY / 2
    out = seconds.copy()
    out[finite] = present + DAY * np.cumsum(turns)
    return out


def start_text(seconds: float) -> str | None:
    """ISO 8601 text of a time counted from 1970; None of a year that no calendar has."""
    try:
        return dt.datetime.fromtimestamp(seconds, tz=dt.UTC).isoformat()
    except (ValueError, OverflowError, OSError):
        return None


def column_list(names: Iterable[str], limit: int = 12) -> str:
    """Name the columns found, the first of them where there are many, the begin of long ones."""
    names = list(names)
    short = (n if len(n) <= _LONGEST_NAME else f"{n[:_LONGEST_NAME]}…" for n in names[:limit])
    shown = ", ".join(map(repr, short))
    return f"{shown} and {len(names) - limit} more" if len(names) > limit else shown
