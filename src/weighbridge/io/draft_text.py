"""How a text table is written: its separator, its header, its decimal mark."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.columns import UNKNOWN_UNIT, stated_unit
from weighbridge.io.draft_time import is_clock, is_number
from weighbridge.io.table import SEPARATORS, TextFormat, cells, head

HEAD_LINES: Final = 60
"""Lines at the beginning that tell how a text is written."""

EVEN: Final = 0.7
"""Part of the lines that a separator cuts alike [-]."""

_COMMA: Final = re.compile(r"[-+]?\d+,\d+$")

_EXAMPLE: Final = "time_s,vehicle_speed_kmh,-"
"""Names of columns, as a user may give them."""


def text_format(path: Path, columns: Sequence[str] = ()) -> tuple[TextFormat, dict[str, str]]:
    """Find separator, header, unit row and decimal mark of a text.

    Parameters
    ----------
    path : the text
    columns : names of its columns in their order, of a text without a header; those of others
        go in place of the header

    Returns
    -------
    text
    units : suffixes that a row below the header states, by column

    Raises
    ------
    DriveError
        It is no table, has no header, or other columns than those named.
    """
    found = head(path, HEAD_LINES)
    lines = [line for line in found if line]
    if not lines:
        raise DriveError(f"{path} is empty; record it again")
    if any("\r" in line for line in lines):
        raise DriveError(
            f"{path}: its lines end in carriage returns alone, as of an old Macintosh; save it "
            "again with other line ends"
        )
    separator = _separator(lines)
    rows = [cells(line, separator) for line in lines]
    width = int(np.median([len(r) for r in rows[-max(len(rows) // 2, 1) :]]))
    first = next((k for k, r in enumerate(rows) if abs(len(r) - width) <= 1 and width > 1), None)
    if first is None:
        raise DriveError(f"{path} is no table: its lines have no common separator")
    if columns:
        return _named_by_hand(path, columns, found, lines, rows, width, separator), {}
    # Numbers of the channels may stand above their names.
    if _of_numbers(rows[first]) and first + 1 < len(rows):
        below = rows[first + 1]
        first += abs(len(below) - width) <= 1 and not any(map(is_number, below))
    if _of_numbers(rows[first]):
        raise DriveError(
            f"{path} has no header line: its first row is {lines[first][:60]!r}; name its "
            f"{len(rows[first])} columns in their order, with - for those of no use: "
            f"weighbridge map {path} --columns {_EXAMPLE} -o map.toml"
        )
    header, units = rows[first], {}
    if first + 1 < len(rows) and not any(map(is_number, rows[first + 1])):
        below = rows[first + 1]
        stated = {n: stated_unit(c) for n, c in zip(header, below, strict=False)}
        units = {n: u for n, u in stated.items() if u is not None}
        known = sum(not u.startswith(UNKNOWN_UNIT) for u in units.values())
        units = units if known >= 0.3 * len(header) else {}
    skipped = found.index(lines[first])
    after = _until_rows(found[skipped + 1 :], separator, width) if units else 0
    decimal = _decimal(rows[first + 1 + bool(units) :], separator)
    text = TextFormat(
        separator=separator, decimal=decimal, skip_rows=skipped, skip_after_header=after
    )
    return text, units


def _decimal(rows: Sequence[Sequence[str]], separator: str) -> str:
    """Mark of the decimals in rows of numbers."""
    body = [c for r in rows for c in r if c]
    commas = sum(_COMMA.match(c) is not None for c in body)
    return "," if separator != "," and commas > 0.2 * max(len(body), 1) else "."


def _named_by_hand(
    path: Path,
    columns: Sequence[str],
    found: Sequence[str],
    lines: Sequence[str],
    rows: Sequence[Sequence[str]],
    width: int,
    separator: str,
) -> TextFormat:
    """Give a text names of columns: its rows begin with the first of numbers."""
    at = (k for k, row in enumerate(rows) if len(row) == width and any(map(is_number, row)))
    first = next(at, None)
    if first is None:
        raise DriveError(f"{path} has no row of numbers; nothing can be told of its columns")
    if len(columns) != width:
        raise DriveError(
            f"{path}: {len(columns)} columns are named and its rows have {width}, such as "
            f"{lines[first][:60]!r}; name each in its order, with - for those of no use"
        )
    names = tuple(n if n not in ("", "-") else f"column {k}" for k, n in enumerate(columns, 1))
    repeated = sorted({n for n in names if names.count(n) > 1})
    if repeated:
        raise DriveError(f"{path}: two columns are called {repeated[0]!r}; rename one")
    return TextFormat(
        separator=separator,
        decimal=_decimal(rows[first:], separator),
        skip_rows=found.index(lines[first]),
        columns=names,
    )


def _of_numbers(row: Sequence[str]) -> bool:
    """Whether a row holds values and no names: numbers, times of day, empty cells."""
    filled = [cell for cell in row if cell]
    clocks = sum(map(is_clock, filled))
    if sum(map(is_number, filled)) + clocks == len(filled) and clocks:
        return True
    return sum(map(is_number, row)) > 0.5 * len(row)


def _until_rows(lines: Sequence[str], separator: str, width: int) -> int:
    """Lines from the header to the first row with a number: of units, blank ones and marks."""
    for k, line in enumerate(lines):
        row = cells(line, separator)
        if abs(len(row) - width) <= 1 and any(map(is_number, row)):
            return k
    return 1


def _separator(lines: Sequence[str]) -> str:
    """Separator that cuts most lines into equally many cells.

    A comma comes last: between semicolons or tabs it is a decimal mark.
    """
    for separator in sorted(SEPARATORS, key=lambda s: s == ","):
        counts = np.array([line.count(separator) for line in lines])
        usual = int(np.median(counts))
        if usual > 0 and np.mean(counts == usual) >= EVEN:
            return separator
    return max(SEPARATORS, key=lambda s: sum(line.count(s) for line in lines))
