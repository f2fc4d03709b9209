"""How a text table is written: its separator, its header, its decimal mark."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.columns import UNKNOWN_UNIT, stated_unit, unit_suffix
from weighbridge.io.draft_time import is_clock, is_number
from weighbridge.io.naming import is_time, recognise
from weighbridge.io.table import SEPARATORS, TextFormat, head
from weighbridge.io.understood import cells

HEAD_LINES: Final = 60
"""Lines at the beginning that show how a text is written."""

_LONG_HEAD: Final = 600
"""Lines of a text whose first ones hold no values: a long preamble."""

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
    lines = [line for line in found if _filled(line)]
    if not lines:
        raise DriveError(f"{path} is empty; record it again")
    if any("\r" in line for line in lines):
        raise DriveError(
            f"{path}: its lines end in carriage returns alone, as of an old Macintosh; save it "
            "again with other line ends"
        )
    separator = separator_of(lines)
    rows, width, begin = laid_out(lines, separator)
    if begin == len(rows) and len(found) >= HEAD_LINES and not columns:
        longer = head(path, _LONG_HEAD)
        more = [line for line in longer if _filled(line)]
        parted = separator_of(longer[HEAD_LINES:]) if len(longer) > HEAD_LINES else separator
        wide = laid_out(more, parted)
        if wide[2] < len(more):
            found, lines, separator, (rows, width, begin) = longer, more, parted, wide
    first = next((k for k, r in enumerate(rows) if abs(len(r) - width) <= 1 and width > 1), None)
    if first is None:
        raise DriveError(f"{path} is no table: its lines have no common separator")
    if columns:
        return _named_by_hand(path, columns, found, lines, rows, width, separator), {}
    named = _names_above(rows, begin, width, found, lines)
    if named:
        best = max(named, key=lambda k: (_known_names(rows[k]), -k))
        if first not in named or _known_names(rows[best]) > _known_names(rows[first]) + 1:
            first = best
    # Numbers of the channels may stand above their names.
    if of_numbers(rows[first]) and first + 1 < len(rows):
        below = rows[first + 1]
        first += abs(len(below) - width) <= 1 and not any(map(is_number, below))
    if of_numbers(rows[first]):
        raise DriveError(
            f"{path} has no header line: its first row is {lines[first][:60]!r}; name its "
            f"{len(rows[first])} columns in their order, with - for those of no use: "
            f"weighbridge map {path} --columns {_EXAMPLE} -o map.toml"
        )
    header, units = rows[first], {}
    if first + 1 < len(rows) and not any(map(is_number, rows[first + 1])):
        below = rows[first + 1]
        stated = {n: stated_unit(c) for n, c in zip(header, below, strict=False) if n}
        units = {n: u for n, u in stated.items() if u is not None}
        known = sum(not u.startswith(UNKNOWN_UNIT) for u in units.values())
        units = units if known >= 0.3 * sum(map(bool, below)) else {}
    skipped = found.index(lines[first])
    beside = bool(units) or (bool(named) and first + 1 in named)
    after = _until_rows(found[skipped + 1 :], separator, width) if beside else 0
    decimal = decimal_mark(rows[first + 1 + bool(units) :], separator)
    text = TextFormat(
        separator=separator, decimal=decimal, skip_rows=skipped, skip_after_header=after
    )
    return text, units


def _filled(line: str) -> bool:
    """Whether a line has a cell; spreadsheets write separators alone for a blank one."""
    return bool(line.strip(f"{''.join(SEPARATORS)} \t"))


def laid_out(lines: Sequence[str], separator: str) -> tuple[list[list[str]], int, int]:
    """Part lines into cells.

    Returns
    -------
    rows : cells of each line
    width : cells of the rows of the lower half
    begin : place of the first of the rows of values that go on to the end, lines of another form
        between them apart; the end where there are none
    """
    rows = [cells(line, separator) for line in lines]
    width = int(np.median([len(r) for r in rows[-max(len(rows) // 2, 1) :]]))
    begin = len(rows)
    for k in range(len(rows) - 1, -1, -1):
        fits = abs(len(rows[k]) - width) <= 1 and width > 1
        if fits and of_numbers(rows[k]):
            begin = k
        elif fits and sum(map(bool, rows[k])) > 0.5 * width:
            break
    return rows, width, begin


def _names_above(
    rows: Sequence[Sequence[str]],
    begin: int,
    width: int,
    found: Sequence[str],
    lines: Sequence[str],
) -> range:
    """Rows of text directly above the values, which a blank line parts from a preamble."""
    if not 0 < begin < len(rows):
        return range(0)
    at = [k for k, line in enumerate(found) if _filled(line)]
    top = begin
    while top > 0:
        row = rows[top - 1]
        filled = [cell for cell in row if cell]
        units = [cell for cell in filled if unit_suffix(cell.strip("()[]")) is not None]
        parted = top < begin and at[top] - at[top - 1] > 1
        texts = 2 * len(filled) >= width - 1 or 2 * len(units) > len(filled)
        if parted or not texts or abs(len(row) - width) > 1 or of_numbers(row):
            break
        top -= 1
    return range(top, begin)


def _known_names(row: Sequence[str]) -> int:
    """How many cells of a row are names of times or of quantities."""
    return sum(is_time(cell) or bool(recognise(cell).quantity) for cell in row)


def decimal_mark(rows: Sequence[Sequence[str]], separator: str) -> str:
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
        raise DriveError(f"{path} has no row of numbers; its columns cannot be recognised")
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
        decimal=decimal_mark(rows[first:], separator),
        skip_rows=found.index(lines[first]),
        columns=names,
    )


def of_numbers(row: Sequence[str]) -> bool:
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


def separator_of(lines: Sequence[str]) -> str:
    """Separator that cuts most lines into equally many cells.

    A comma comes last: between semicolons or tabs it is a decimal mark.
    """
    for separator in sorted(SEPARATORS, key=lambda s: s == ","):
        counts = np.array([line.count(separator) for line in lines])
        usual = int(np.median(counts))
        if usual > 0 and np.mean(counts == usual) >= EVEN:
            return separator
    return max(SEPARATORS, key=lambda s: sum(line.count(s) for line in lines))
