"""How much of a text a reader understood: what it did not is counted, and too much is refused."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.messages import Problem
from weighbridge.signals.signal import Bools
from weighbridge.signals.words import counted

MOST_STRANGE: Final = 0.5
"""Part of a text's lines that a reader may not understand: above it is of another form [-]."""


Ints = NDArray[np.intp]

_FEW: Final = 0.01
"""Part of the rows that end early, at most: above it the logger leaves last cells out [-]."""

# Rows of a table of which it is looked at what is in them.
LOOKED_AT: Final = 1000


UTF_16: Final = (b"\xff\xfe", b"\xfe\xff")
"""First bytes of a text in UTF-16."""


def text_of(data: bytes) -> str:
    """Text of a file in UTF-8 or UTF-16, else in Latin-1, without bytes of zero."""
    if data[:2] in UTF_16:
        return data.decode("utf-16", errors="replace")
    data = data.replace(b"\x00", b"")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def plain_head(begin: bytes) -> str:
    """First bytes of a file as text, without a mark of its encoding."""
    return begin.decode("utf-8", "replace").removeprefix("\ufeff")


def cells(line: str, separator: str) -> list[str]:
    """Split a line at its separators, quotes taken off where they are closed."""
    try:
        found = next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        found = line.split(separator)
    return [cell.strip() for cell in found]


class Lines:
    """Lines that a reader has seen, and those that it did not understand.

    Parameters
    ----------
    what : one of them is called

    Attributes
    ----------
    total, strange : lines seen, and those of them that were not understood
    first : number of the first of these in the file; 0 where it is not known
    """

    def __init__(self, what: str = "line") -> None:
        self._what = what
        self.total = 0
        self.strange = 0
        self.first = 0
        self._passed = 0

    def add(self, text: bytes, total: int, strange: int, first: int) -> None:
        """Count the lines of a part of the file, which follows the parts before.

        Parameters
        ----------
        text : the part
        total, strange : lines of it
        first : number within it of the first strange one; 0 where it is not known
        """
        if first and not self.first:
            self.first = self._passed + first
        self.total += total
        self.strange += strange
        self._passed += text.count(b"\n")

    def problems(self, id: str, path: Path) -> list[Problem]:
        """Say by a message of this id what was left out.

        Raises
        ------
        DriveError
            Most of the lines were not understood.
        """
        self.refuse(path)
        return [Problem.of(id, **self._values(path))] if self.strange else []

    def refuse(self, path: Path) -> None:
        """Refuse a file of which most lines were not understood.

        Raises
        ------
        DriveError
            It is one.
        """
        if self.strange > MOST_STRANGE * self.total:
            raise Problem.of("file.not_understood", serious=True, **self._values(path)).error()

    def _values(self, path: Path) -> dict[str, Any]:
        return {
            "file": path.name,
            "count": self.strange,
            "lines": counted(self.total, self._what),
            "example": _example(path, self.first),
        }


def strange_rows(data: bytes, columns: int, separator: str) -> tuple[int, int, int]:
    """Count rows of a table that have values beyond its last column, or no separator at all.

    A quote that is not closed makes no row strange: see `without_open_quotes`.

    Parameters
    ----------
    data : the rows
    columns : of the table
    separator : between cells; one within quotes parts nothing

    Returns
    -------
    total, strange, first : rows that are not blank, those of them that are strange, and the number
        of the first line among these, 0 for none
    """
    rows = _Rows(data, columns, separator)
    looked = rows.long[:LOOKED_AT]
    beyond = rows.beyond(looked)
    share = np.count_nonzero(beyond) / max(beyond.size, 1)
    strange = [*np.flatnonzero(rows.lone).tolist(), *looked[beyond].tolist()]
    return (
        rows.total,
        int(rows.lone.sum()) + round(share * rows.long.size),
        min(strange, default=-1) + 1,
    )


def without_strange_rows(
    data: bytes, columns: int, separator: str
) -> tuple[bytes, tuple[int, int, int]]:
    """Leave out the rows of a table that `strange_rows` counts.

    Rows that do not close a quote are left out as well, and the few that end before the others do.

    Parameters
    ----------
    data, columns, separator : of `strange_rows`

    Returns
    -------
    data : the other rows
    counts : as of `strange_rows`
    """
    data, opened = without_open_quotes(data)
    rows = _Rows(data, columns, separator)
    strange = rows.lone.copy()
    strange[rows.long[rows.beyond(rows.long)]] = True
    strange[opened] = True
    if rows.short.size <= max(1.0, _FEW * rows.total):
        strange[rows.short] = True
    places = np.flatnonzero(strange)
    counts = rows.total, places.size, int(places[0]) + 1 if places.size else 0
    if not places.size:
        return data, counts
    kept = (
        data[a : b + 1] for a, b in zip(rows.starts[~strange], rows.ends[~strange], strict=True)
    )
    return b"".join(kept), counts


class _Rows:
    """Rows of a table, by the separators in them.

    Attributes
    ----------
    starts, ends : (n,) places of their first byte and of the end of their line
    lone : (n,) which have no separator, though the table has
    long : places among them of those with more cells than columns
    short : of those with fewer cells than most
    total : how many are not blank
    """

    def __init__(self, data: bytes, columns: int, separator: str) -> None:
        self._data, self._columns, self._separator = data, columns, separator
        text = np.frombuffer(data if data.endswith(b"\n") else data + b"\n", np.uint8)
        ends, marks = text == ord("\n"), text == ord(separator)
        if b'"' in data and data.count(b'"') % 2 == 0:
            free = np.cumsum(text == ord('"')) % 2 == 0
            ends &= free
            marks &= free
        self.ends = np.flatnonzero(ends)
        self.starts = np.concatenate([[0], self.ends[:-1] + 1])
        parts = np.diff(np.searchsorted(np.flatnonzero(marks), self.ends), prepend=0)
        blank = self.ends == self.starts
        blank |= (self.ends - self.starts == 1) & (text[self.starts] == ord("\r"))
        self.lone = (parts == 0) & ~blank & (columns > 1)
        self.long = np.flatnonzero((parts >= columns) & (columns > 1))
        self.total = int(np.count_nonzero(~blank)) if columns > 1 else 0
        usual = np.median(parts[~blank]) if self.total else 0
        self.short = np.flatnonzero((parts < usual) & ~blank & ~self.lone)

    def beyond(self, places: Ints) -> Bools:
        """Which of these rows have a value beyond the last column."""
        found = [
            any(cells(line.decode("utf-8", "replace"), self._separator)[self._columns :])
            for k in places.tolist()
            for line in (self._data[self.starts[k] : self.ends[k]],)
        ]
        return np.array(found, dtype=bool)


def without_open_quotes(data: bytes) -> tuple[bytes, Ints]:
    """Take the quotes off lines that do not close one.

    Parameters
    ----------
    data : of a table whose cells hold no ends of lines

    Returns
    -------
    data : as long as before; blanks stand in place of those quotes
    lines : places of the lines that had one, from 0
    """
    text = np.frombuffer(data, np.uint8)
    quotes = np.flatnonzero(text == ord('"'))
    line = np.searchsorted(np.flatnonzero(text == ord("\n")), quotes)
    lines, place, count = np.unique(line, return_inverse=True, return_counts=True)
    opened = count % 2 == 1
    if not opened.any():
        return data, lines[:0]
    corrected = text.copy()
    corrected[quotes[opened[place]]] = ord(" ")
    return corrected.tobytes(), lines[opened]


def number_of(path: Path, text: str) -> int:
    """Number of the first line of a file that is a text, blanks around it apart; 0 for none."""
    with path.open("rb") as file:
        numbers = (k for k, line in enumerate(file, start=1) if line.strip() == text.encode())
        return next(numbers, 0)


def _example(path: Path, number: int) -> str:
    """Return a line of a file with its number, as a message shows it; empty for none."""
    with path.open("rb") as file:
        for k, line in enumerate(file, start=1):
            if k == number:
                return f", such as line {k}: {line[:60].decode('utf-8', 'replace').strip()!r}"
    return ""
