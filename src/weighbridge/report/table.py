"""A table of texts, for terminal and page alike."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Table:
    """Heads and rows of text.

    Attributes
    ----------
    title : above it
    columns : heads; the first column is aligned left, the others right
    rows : one text per column each
    marked : indices of rows that contradict the rest
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    marked: tuple[int, ...] = ()
