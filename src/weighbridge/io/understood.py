"""How much of a text a reader understood: what it did not is counted, and too much is refused."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any, Final

import numpy as np

from weighbridge.messages import Problem
from weighbridge.signals.words import counted

MOST_STRANGE: Final = 0.5
"""Part of a text's lines that a reader may not understand: above it is of another form [-]."""


# Lines with more cells than names of which it is looked at what stands in them.
_LOOKED_AT: Final = 1000


class Lines:
    """Lines that a reader has seen, and those that it did not understand.

    Attributes
    ----------
    total, strange : lines seen, and those of them that were not understood
    first : number of the first of these in the file; 0 where it is not known
    """

    def __init__(self) -> None:
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
            "lines": counted(self.total, "line"),
            "example": _example(path, self.first),
        }


def strange_rows(data: bytes, columns: int, separator: str) -> tuple[int, int, int]:
    """Count rows of a table that have values beyond its last column, or no separator at all.

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
    if columns < 2 or not data:
        return 0, 0, 0
    text = np.frombuffer(data if data.endswith(b"\n") else data + b"\n", np.uint8)
    free = np.ones(text.size, dtype=bool)
    if b'"' in data and data.count(b'"') % 2 == 0:
        free = np.cumsum(text == ord('"')) % 2 == 0
    ends = np.flatnonzero((text == ord("\n")) & free)
    starts = np.concatenate([[0], ends[:-1] + 1])
    marks = np.concatenate([[0], np.cumsum((text == ord(separator)) & free)])
    parts = marks[ends] - marks[starts]
    blank = (ends == starts) | ((ends - starts == 1) & (text[starts] == ord("\r")))
    lone = (parts == 0) & ~blank
    long = np.flatnonzero(parts >= columns)
    looked = long[:_LOOKED_AT]
    beyond = [
        any(c.strip() for c in _cells(bytes(text[starts[k] : ends[k]]), separator)[columns:])
        for k in looked.tolist()
    ]
    share = np.count_nonzero(beyond) / max(len(beyond), 1)
    strange = np.flatnonzero(lone).tolist() + looked[np.array(beyond, dtype=bool)].tolist()
    total = int(np.count_nonzero(~blank))
    return total, int(lone.sum()) + round(share * long.size), min(strange, default=-1) + 1


def _cells(line: bytes, separator: str) -> list[str]:
    """Cells of a line."""
    return next(csv.reader([line.decode("utf-8", "replace")], delimiter=separator), [])


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
