"""What every reproduction answers: tables, its figures against the paper's, a report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from weighbridge.report.table import Table
from weighbridge.signals import Floats

Progress = Callable[[int, int], None]
"""Called with steps done and steps in all."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """One figure beside the paper's.

    Attributes
    ----------
    figure : what is compared
    theirs, ours : as printed; ``theirs`` is empty where the paper has none
    good : False where ours falls behind
    like_for_like : ours was made under the conditions of the printed figure, as far as a
        simulated drive can be; where it was not, it is never ahead
    claim : ``theirs`` is a sentence of the paper, which our figure bears out or not
    """

    figure: str
    theirs: str
    ours: str
    good: bool
    like_for_like: bool = True
    claim: bool = False

    @property
    def short(self) -> str:
        """What ours is where it is not ``good``."""
        return "not found" if self.claim else "behind"

    @property
    def verdict(self) -> str:
        """What stands beside the figures."""
        told = ((self.short, not self.good), ("other conditions", not self.like_for_like))
        return ", ".join(word for word, so in told if so)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduced:
    """A published system on our drives, against its own tables.

    Attributes
    ----------
    title : paper and what was done
    tables : of single drives or parameters
    comparisons : figures beside the paper's
    write_page : write a page of the given tables and the paper's figures from our data
    figures : values by name, that `weighbridge.papers.claims.Item.ours` may ask for
    """

    title: str
    tables: tuple[Table, ...]
    comparisons: tuple[Comparison, ...]
    write_page: Callable[[Sequence[Table], Path], None]
    figures: Mapping[str, str] = field(default_factory=dict)

    @property
    def comparison(self) -> Table:
        """The figures beside the paper's, those behind or of other conditions marked."""
        return Table(
            self.title,
            ("figure", "paper", "ours", ""),
            tuple((c.figure, c.theirs, c.ours, c.verdict) for c in self.comparisons),
        )

    def write_report(self, path: Path) -> None:
        """Write a page that begins with what the paper has and what we have.

        Raises
        ------
        ConfigError
            The file cannot be written.
        """
        self.write_page((self.comparison, *self.tables), path)

    @property
    def behind(self) -> tuple[str, ...]:
        """Names of the figures that fall behind, of claims that were not found, and how so."""
        return tuple(map(_told, (c for c in self.comparisons if not c.good)))


def _told(row: Comparison) -> str:
    """Name a row that falls behind, with what limits the word."""
    marks = (("other conditions", not row.like_for_like), (row.short, row.claim))
    said = ", ".join(word for word, so in marks if so)
    return f"{row.figure} ({said})" if said else row.figure


def rms(values: Floats) -> float:
    """Root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if np.size(values) else float("nan")
