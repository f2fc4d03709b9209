"""What every reproduction answers: tables, its rows beside the paper's, a report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from weighbridge.papers.claims import Row, Section, Verdict
from weighbridge.report.table import Table
from weighbridge.signals import Floats

Progress = Callable[[int, int], None]
"""Called with steps done and steps in all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduced:
    """A published system on our drives, against its own tables.

    Attributes
    ----------
    title : of the paper
    note : which drives, and what they are apart from
    tables : of single drives or parameters
    rows : its equations, tables and figures, judged
    write_page : write a page of the given tables and the paper's figures from our data
    """

    title: str
    note: str
    tables: tuple[Table, ...]
    rows: tuple[Row, ...]
    write_page: Callable[[Sequence[Table], Path], None]

    @property
    def comparison(self) -> Table:
        """The rows in which something is compared, for a terminal."""
        return Table(
            f"{self.title}, {self.note}",
            ("paper", "what", "conditions", "printed", "ours", "verdict"),
            tuple(
                (r.item, r.what, r.conditions, r.printed, r.ours, r.verdict)
                for r in self.rows
                if r.verdict is not Verdict.NOT_REPRODUCIBLE
            ),
        )

    @property
    def section(self) -> Section:
        """The rows as a list of items has them."""
        return Section(title=self.title, note=self.note, rows=self.rows)

    def write_report(self, path: Path) -> None:
        """Write a page that begins with what the paper has and what we have.

        Raises
        ------
        ConfigError
            The file cannot be written.
        """
        self.write_page((self.section.table, *self.tables), path)

    @property
    def unaccounted(self) -> tuple[str, ...]:
        """Names of the rows that differ without a reason that a reader can check."""
        return tuple(r.name for r in self.rows if not r.accounted)


def rms(values: Floats) -> float:
    """Root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if np.size(values) else float("nan")
