"""What a paper says, where it is in the code, and our figure beside the printed one."""

from __future__ import annotations

import string
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from weighbridge.errors import ConfigError
from weighbridge.report.table import Table

COLUMNS: Final = ("paper", "where", "as printed", "departure and why", "printed", "ours")
"""Heads of the table of `items_table`."""

NOT_REPRODUCED: Final = "not run"
"""Stands for a figure that this run did not make."""


@dataclass(frozen=True, slots=True)
class Item:
    """One equation, table or figure of a paper.

    Attributes
    ----------
    paper_item : as the paper numbers it: "eq. 5", "fig. 13, λ = 0.998"
    where : place in the code or in the report
    as_printed : the code does what is printed
    departure : what differs and why; empty where nothing does
    printed : the paper's figure; empty where it has none
    ours : ours; ``{name}`` stands for the figure of that name in `Reproduced.figures`
    like_for_like : ours was made under the conditions of the printed figure, as far as a
        simulated drive can be; others are shown apart
    """

    paper_item: str
    where: str
    as_printed: bool
    departure: str
    printed: str
    ours: str
    like_for_like: bool

    def __post_init__(self) -> None:
        if not self.as_printed and not self.departure:
            raise ConfigError(f"{self.paper_item}: say what departs from print, and why")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the reproduced figures that ``ours`` asks for."""
        return tuple(name for _, name, _, _ in string.Formatter().parse(self.ours) if name)

    def filled(self, figures: Mapping[str, str]) -> str:
        """Return ``ours`` with today's figures; `NOT_REPRODUCED` for those that are missing."""
        known = {name: figures.get(name, NOT_REPRODUCED) for name in self.names}
        return self.ours.format_map(known)


def items_table(
    title: str, items: Iterable[Item], figures: Mapping[str, str], *, like_for_like: bool
) -> Table:
    """Return the items under like conditions, or those under others, in their order.

    Parameters
    ----------
    title : above the table
    items : of one paper
    figures : today's, by name
    like_for_like : which of the two kinds
    """
    rows = tuple(
        (
            item.paper_item,
            item.where,
            "yes" if item.as_printed else "no",
            item.departure,
            item.printed,
            item.filled(figures),
        )
        for item in items
        if item.like_for_like is like_for_like
    )
    return Table(title, COLUMNS, rows)


def tables(title: str, items: Sequence[Item], figures: Mapping[str, str]) -> tuple[Table, ...]:
    """Return the table of like conditions first, then that of others, where there are such."""
    both = (
        items_table(f"{title}: conditions of the paper", items, figures, like_for_like=True),
        items_table(f"{title}: other conditions", items, figures, like_for_like=False),
    )
    return tuple(table for table in both if table.rows)


def markdown(table: Table) -> str:
    """Write a table as Markdown, its title as a heading of the third level."""
    lines = [f"### {table.title}", ""]
    lines.append(_line(table.columns))
    lines.append(_line(("---",) * len(table.columns)))
    lines += [_line(row) for row in table.rows]
    return "\n".join(lines) + "\n"


def _line(cells: Iterable[str]) -> str:
    """Write one row; bars within a cell would end it."""
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """The items of one paper with the figures of a run.

    Attributes
    ----------
    title : of the paper
    note : on which seeds, and what they are apart from
    items : of the paper
    figures : today's, by name
    """

    title: str
    note: str
    items: tuple[Item, ...]
    figures: Mapping[str, str]

    @property
    def tables(self) -> tuple[Table, ...]:
        """Like conditions first, others apart."""
        return tables(self.title, self.items, self.figures)

    def markdown(self) -> str:
        """Its note and tables."""
        return "\n".join([f"{self.note}\n", *map(markdown, self.tables)])


def document(sections: Iterable[Section]) -> str:
    """Write a page of Markdown with the items of several papers."""
    parts = [
        "# The papers, item by item\n",
        "Written by `weighbridge reproduce all --report docs/papers.md`; the figures are of that "
        "run. A paper's\nconditions come first: drives and inputs like its own, though simulated. "
        "There, rows of *ours* are\nanother method. What was measured under other conditions "
        "stands in a table of its own.\n",
    ]
    for section in sections:
        parts += [f"## {section.title}\n", section.markdown()]
    return "\n".join(parts)
