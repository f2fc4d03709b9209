"""Tables of text with several clocks side by side: each stamps the columns to its right.

VCDS asks for one group of values after the other and writes a stamp for each; other tools put
measurements of several rates into one sheet. The form is that of public logs; no specification
of VCDS's is published.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.channels import Recording, drafter, reader
from weighbridge.io.columns import stated_unit, unit_suffix
from weighbridge.io.draft_text import (
    HEAD_LINES,
    decimal_mark,
    laid_out,
    of_numbers,
    separator_of,
)
from weighbridge.io.draft_time import is_number, text_time_format
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping, TimeColumn
from weighbridge.io.naming import is_time, words_of
from weighbridge.io.table import TextFormat, column_list, head, read_text
from weighbridge.io.tabular import read_csv
from weighbridge.io.understood import plain_head
from weighbridge.signals import Floats

_STAMPS: Final = frozenset(("stamp", "marke", "marque", "marca", "merk"))
"""What VCDS calls a stamp in the languages of its releases, beside the names of times."""

_DEEPEST: Final = 5
"""Lines of a header at most: groups, places, names in two lines, units."""

_NUMBERED: Final = str.maketrans("", "", "0123456789'\"")


@dataclass(frozen=True, slots=True)
class _Header:
    """Header of such a table.

    Attributes
    ----------
    text : how it is written
    names, units : of its columns; the name of a clock is what it is called
    clocks : place of the clock of each column; -1 for none
    """

    text: TextFormat
    names: tuple[str, ...]
    units: tuple[str, ...]
    clocks: tuple[int, ...]


def is_grouped(begin: bytes) -> bool:
    """Return whether a text begins as a table with several clocks."""
    lines = plain_head(begin).splitlines()
    # The last line may be cut off.
    return _header(lines[:-1]) is not None


def read_grouped(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read a table with several clocks; see `weighbridge.io.log.Reader`.

    A mapping that says how the text is written takes it for a plain table with one clock.
    """
    if mapping is not None and mapping.text != TextFormat():
        return read_csv(path, table, mapping)
    return reader(open_grouped)(path, table, mapping)


def open_grouped(path: Path, time: TimeColumn) -> Recording:
    """Read a table with several clocks, one channel for each column; see `Opener`.

    Raises
    ------
    DriveError
        A mapping names a time that is not there, or the header cannot be read.
    """
    header = _header(head(path, HEAD_LINES))
    if header is None:
        raise DriveError(f"{path} has no header with several times; convert it to a plain table")
    called = {header.names[k] for k in header.clocks if k >= 0}
    if time.rate is not None or (time.column is not None and time.column not in called):
        raise DriveError(
            f"{path} has several times: [time] of the mapping names one of "
            f"{column_list(sorted(called))}, or leaves column and rate_hz out"
        )
    raw = read_text(path, header.text)
    # Clocks that are called otherwise are each read by their own name.
    found = Recording([], notes=list(raw.notes), time=called.pop() if len(called) == 1 else "")
    clocks: dict[int, Floats] = {}
    for k, clock in enumerate(header.clocks):
        if clock < 0 or clock == k:
            continue
        if clock not in clocks:
            name, unit = header.names[clock], stated_unit(header.units[clock])
            clocks[clock] = found.clock(raw, clock, name, time, unit)
        found.add(raw, k, clocks[clock], header.names[k], header.units[k])
    return found


draft_grouped = drafter(open_grouped)
"""Drafts the mapping of such a table."""


def _header(lines: Sequence[str]) -> _Header | None:
    """Find the header of a table with several clocks; None where it has one clock or none."""
    filled = [line for line in lines if line.strip()]
    if len(filled) < 3:
        return None
    separator = separator_of(filled)
    rows, width, begin = laid_out(filled, separator)
    if not 0 < begin < len(rows) - 1 or width < 4:
        return None
    at = [k for k, line in enumerate(lines) if line.strip()]
    top = begin - 1
    while (
        top > max(begin - _DEEPEST, 0)
        and at[top] - at[top - 1] == 1
        and abs(len(rows[top - 1]) - width) <= 1
        and not of_numbers(rows[top - 1])
    ):
        top -= 1
    above = [[*row, *[""] * width][:width] for row in rows[top:begin]]
    body = [[*row, *[""] * width][:width] for row in rows[begin:]]
    used = [any(row[k] for row in body) for k in range(width)]
    clocks, last = [], -1
    for k in range(width):
        if used[k] and any(_is_stamp(row[k]) for row in above) and _rises([r[k] for r in body]):
            last = k
        clocks.append(last if used[k] else -1)
    places = sorted(set(clocks) - {-1})
    stamped = [k for k in places if any(c == k != j for j, c in enumerate(clocks))]
    if len(stamped) < 2:
        return None
    called = {k: next(row[k] for row in reversed(above) if _is_stamp(row[k])) for k in places}
    # One logger calls all its clocks alike, but for their numbers.
    if len({words_of(called[k].translate(_NUMBERED)) for k in stamped}) > 1:
        return None
    units = _units(above, clocks)
    texts = [row for row in above if row is not units and _names(row, clocks)]
    names = tuple(
        called[k]
        if k in called
        else " ".join(row[k] for row in texts if row[k]).replace("- ", "") or f"column {k + 1}"
        for k in range(width)
    )
    text = TextFormat(
        separator=separator,
        decimal=decimal_mark(body, separator),
        skip_rows=at[begin],
        columns=tuple(f"{k}" for k in range(width)),
    )
    return _Header(text, names, tuple(units or [""] * width), tuple(clocks))


def _is_stamp(cell: str) -> bool:
    plain = cell.translate(_NUMBERED)
    if unit_suffix(plain) is not None:
        return False
    return is_time(plain) or bool(_STAMPS & set(words_of(plain)))


def _rises(column: Sequence[str]) -> bool:
    """Whether the values of a column are those of a clock: none falls, and most rise."""
    filled = [cell.replace(",", ".") for cell in column if cell]
    if len(filled) < 2 or not all(map(is_number, filled)):
        return bool(filled) and text_time_format(filled)[0] != ""
    steps = np.diff(np.array(filled, dtype=np.float64))
    return bool(np.all(steps >= 0.0)) and bool(np.mean(steps > 0.0) > 0.5)


def _units(above: Sequence[list[str]], clocks: Sequence[int]) -> list[str] | None:
    """Find the row of units among those of a header, the lowest where its cells are units."""
    said = [above[-1][k] for k, c in enumerate(clocks) if c not in (-1, k) and above[-1][k]]
    known = sum(unit_suffix(cell.strip("()[]")) is not None for cell in said)
    return above[-1] if len(above) > 1 and known > 0.3 * len(said) else None


def _names(row: Sequence[str], clocks: Sequence[int]) -> bool:
    """Whether a row of a header names columns, and does not number groups or places."""
    said = [row[k] for k, c in enumerate(clocks) if c not in (-1, k) and row[k]]
    kinds = {cell.translate(_NUMBERED) for cell in said}
    return bool(said) and (len(kinds) > 1 or len(said) == 1)
