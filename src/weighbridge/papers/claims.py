"""What a paper prints, what we find in its place, and whether both agree."""

from __future__ import annotations

import string
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from string import Template
from typing import Any, Final

import numpy as np

from weighbridge.data import toml_of
from weighbridge.errors import ConfigError
from weighbridge.report.table import Table
from weighbridge.report.text import capital
from weighbridge.signals import Floats

COLUMNS: Final = (
    "paper", "what", "conditions", "printed", "ours", "tolerance", "verdict", "reason and check",
    "where",
)  # fmt: skip
"""Heads of the table of `Section`."""

ROUNDING: Final = 1e-9
"""Largest relative difference of one equation computed in two ways [-]."""

EXACT: Final = "1e-9 of the value: rounding"
"""Tolerance of an equation, which both sides compute at the same numbers."""


class Conditions(StrEnum):
    """Whose rules a figure is made by: the paper's, or those of weighbridge."""

    PRINTED = "as printed"
    OURS = "ours"


class Verdict(StrEnum):
    """What a figure of ours says of the printed one."""

    AGREES = "agrees"
    DIFFERS = "differs"
    NOT_REPRODUCIBLE = "not reproducible"


@dataclass(frozen=True, slots=True)
class Found:
    """One figure of a run.

    Attributes
    ----------
    text : as it is written beside the printed one
    agrees : with the printed one, within the tolerance of its item
    printed : the printed one, where it is computed, as that of an equation is
    why, check : of a difference, where the run itself shows the reason: under what other settings
        it agrees, and the command with them
    """

    text: str
    agrees: bool
    printed: str = ""
    why: str = ""
    check: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One numbered equation, table or figure of a paper, or a sentence of its text.

    Attributes
    ----------
    item : as the paper numbers it: "eq. 5", "fig. 13", "sec. 4.2"
    what : of it: "λ = 0.998"; empty for all of it
    conditions : whose rules ours is made by
    where : place in the code or in the report
    printed : the paper's figure or claim; empty where that of the run is taken
    ours : ``{name}`` means the figure of that name; empty where nothing can be compared
    tolerance : up to what difference both agree, with its reason
    why : what departs from print; of a figure that differs the reason, of an item without
        ``ours`` why it is not reproducible
    check : command by which a reader sees the reason of a difference
    seen : row or table of that command's output that shows it; empty where this row agrees there
    """

    item: str
    what: str = ""
    conditions: Conditions = Conditions.PRINTED
    where: str
    printed: str = ""
    ours: str = ""
    tolerance: str = ""
    why: str = ""
    check: str = ""
    seen: str = ""

    def __post_init__(self) -> None:
        if not self.ours and not self.why:
            raise ConfigError(f"{self.item}: say why nothing is compared")
        if self.ours and not self.tolerance:
            raise ConfigError(f"{self.item}: say within what tolerance both agree, and why")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the figures that ``ours`` asks for."""
        return tuple(name for _, name, _, _ in string.Formatter().parse(self.ours) if name)

    def row(self, paper: str, figures: Mapping[str, Found]) -> Row:
        """Judge the item by the figures of a run."""
        asked = [figures[name] for name in self.names]
        verdict = Verdict.NOT_REPRODUCIBLE
        if asked:
            verdict = Verdict.AGREES if all(f.agrees for f in asked) else Verdict.DIFFERS
        return Row(
            paper=paper,
            item=self.item,
            what=self.what,
            conditions=self.conditions,
            printed=self.printed or "; ".join(f.printed for f in asked),
            ours=self.ours.format_map({n: figures[n].text for n in self.names}),
            tolerance=self.tolerance,
            verdict=verdict,
            why=listed(self.why, *(f.why for f in asked if not f.agrees)),
            check=next((f.check for f in asked if f.check and not f.agrees), self.check),
            seen=self.seen,
            where=self.where,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """An `Item` beside the figure of a run."""

    paper: str
    item: str
    what: str
    conditions: Conditions
    printed: str
    ours: str
    tolerance: str
    verdict: Verdict
    why: str
    check: str
    seen: str
    where: str

    @property
    def accounted(self) -> bool:
        """It agrees, or a reader can check why not."""
        if self.verdict is Verdict.DIFFERS:
            return bool(self.why and self.check)
        return self.verdict is Verdict.AGREES or bool(self.why)

    @property
    def name(self) -> str:
        """Item, what of it and by whose rules."""
        return ", ".join(filter(None, (self.item, self.what, self.conditions)))

    @property
    def label(self) -> str:
        """Item and what of it, marked where it is by our rules."""
        ours = " (ours)" if self.conditions is Conditions.OURS else ""
        return ", ".join(filter(None, (self.item, self.what))) + ours

    @property
    def figures(self) -> tuple[str, str]:
        """The printed figure and ours."""
        return self.printed, self.ours

    @property
    def reasons(self) -> tuple[str, ...]:
        """Each reason and the command that shows it, as often repeated in other rows."""
        seen = f": {self.seen}" if self.seen else ""
        return (*self.why.split("; "), *([f"`{self.check}`{seen}"] if self.check else ()))

    def record(self) -> dict[str, Any]:
        """Return the row as JSON has it."""
        return {key: str(value) for key, value in asdict(self).items()}

    @property
    def cells(self) -> tuple[str, ...]:
        """The row as tables have it, in the order of `COLUMNS`."""
        check = f"`{self.check}`" if self.check else ""
        return (
            self.item, self.what, self.conditions, self.printed, self.ours, self.tolerance,
            self.verdict, listed(self.why, check), self.where,
        )  # fmt: skip


def read_rows(paper: str, **values: str) -> dict[str, list[dict[str, str]]]:
    """Return the rows of a paper's table by its sections; the fields are those of `Item`.

    Parameters
    ----------
    paper : its table is ``PAPER.toml`` in this folder. ``$name`` in a text is one of its words; a
        row with several items is one for each
    values : further words
    """
    table = toml_of("papers", f"{paper}.toml")
    words = {"exact": EXACT, **values}
    for name, word in table.pop("words").items():
        words[name] = Template(word).substitute(words)
    found: dict[str, list[dict[str, str]]] = {section: [] for section in table}
    for section, rows in table.items():
        for row in rows:
            items = row.get("item")
            each = [row | {"item": item} for item in items] if isinstance(items, list) else [row]
            found[section] += [
                {key: Template(text).substitute(words) for key, text in one.items()} for one in each
            ]
    return found


def items_of(rows: Iterable[Mapping[str, str]]) -> tuple[Item, ...]:
    """Return the items of rows; an equation agrees to rounding with its figure, unless stated."""
    items = []
    for row in rows:
        fields: dict[str, Any] = dict(row)
        if row["item"].startswith("eq. "):
            figure = "{" + row["item"].replace(".", "") + "}"
            fields = {"ours": figure, "tolerance": EXACT} | fields
        conditions = Conditions(fields.pop("conditions", Conditions.PRINTED))
        items.append(Item(conditions=conditions, **fields))
    return tuple(items)


def same(
    printed: float | Sequence[float] | Floats,
    ours: float | Sequence[float] | Floats,
    unit: str = "",
) -> Found:
    """Compare an equation as it is printed with the code, both at the same numbers.

    Parameters
    ----------
    printed, ours : of one shape
    unit : for people
    """
    a, b = np.atleast_1d(np.asarray(printed, float)), np.atleast_1d(np.asarray(ours, float))
    close = a.shape == b.shape and bool(
        np.max(np.abs(a - b)) <= ROUNDING * max(float(np.max(np.abs(a))), 1e-300)
    )
    # One number is given for an array: the one that differs most, else the largest.
    apart = np.abs(a - b) if a.shape == b.shape and np.any(a != b) else np.abs(a)
    k = int(np.argmax(apart))
    text = [f"{x.flat[k]:.9g} {unit}".strip() for x in (b, a)]
    return Found(text[0], close, text[1])


def listed(*parts: str) -> str:
    """Write reasons one after another, those that are empty left out."""
    return "; ".join(filter(None, parts))


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """The rows of one paper.

    Attributes
    ----------
    title : of the paper
    note : on which seeds, and what they are apart from
    rows : of a run
    """

    title: str
    note: str
    rows: tuple[Row, ...]

    @property
    def table(self) -> Table:
        """All its rows."""
        return Table(f"{self.title}, row by row", COLUMNS, tuple(r.cells for r in self.rows))

    def markdown(self) -> str:
        """Its note, how many rows agree, and its rows: one line each, the same reason once.

        Equations that agree to rounding are named together; the rest of a row is in its record.
        """
        part = {v: [r for r in self.rows if r.verdict is v] for v in Verdict}
        said = ", ".join(f"{verdict} {len(rows)}" for verdict, rows in part.items())
        lines = [f"{capital(self.note)}: {said}.", ""]
        exact = [r.label for r in part[Verdict.AGREES] if r.tolerance == EXACT]
        if exact:
            lines += ["Agree to rounding:", "", *(f"- {item}" for item in _ranges(exact)), ""]
        agree = [r for r in part[Verdict.AGREES] if r.tolerance != EXACT]
        lines += _table(
            ("agrees", "printed", "ours"), _shared([(r.label, *r.figures) for r in agree])
        )
        differs = part[Verdict.DIFFERS]
        reasons = list(dict.fromkeys(part for r in differs for part in r.reasons))
        number = {reason: str(k) for k, reason in enumerate(reasons, 1)}
        lines += _table(
            ("differs", "printed", "ours", "why"),
            _shared(
                [(r.label, *r.figures, ",".join(number[x] for x in r.reasons)) for r in differs]
            ),
        )
        lines += [*(f"{number[reason]}. {reason}" for reason in reasons), *([""] * bool(reasons))]
        drawn: dict[str, list[str]] = {}
        for r in part[Verdict.NOT_REPRODUCIBLE]:
            drawn.setdefault(r.why, []).append(r.label)
        lines += _table(
            ("not reproducible", "why"), [(", ".join(of), why) for why, of in drawn.items()]
        )
        return "\n".join(lines).rstrip() + "\n"


def _ranges(labels: Sequence[str]) -> list[str]:
    """Write items that follow each other as one: "eq. 1–5"."""
    written: list[str] = []
    kind, last = "", -1
    for label in labels:
        name, _, number = label.rpartition(" ")
        follows = number.isdecimal() and name == kind and int(number) == last + 1
        if follows:
            written[-1] = f"{written[-1].partition('–')[0]}–{number}"
        else:
            written.append(label)
        kind, last = (name, int(number)) if number.isdecimal() else ("", -1)
    return written


def _shared(rows: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Write ″ for what a row shares with the one above: the first parts of a label, a cell."""
    short, above = [], ("",) * len(rows[0]) if rows else ()
    for row in rows:
        parts, before = row[0].split(", "), above[0].split(", ")
        same = next(
            (k for k, p in enumerate(parts[:-1]) if before[k : k + 1] != [p]), len(parts) - 1
        )
        label = f"″, {', '.join(parts[same:])}" if same else row[0]
        cells = (
            "″" if cell and cell == there else cell
            for cell, there in zip(row[1:], above[1:], strict=True)
        )
        short.append((label, *cells))
        above = row
    return short


def _table(heads: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Write a table; none without rows. Bars within a cell would end it."""
    if not rows:
        return []
    lines = (heads, ("---",) * len(heads), *rows)
    return [*("|" + "|".join(c.replace("|", "\\|") for c in line) + "|" for line in lines), ""]


def document(sections: Iterable[Section]) -> str:
    """Write a page of Markdown with the rows of several papers."""
    parts = [
        "# The papers, row by row\n",
        "`weighbridge reproduce all --report docs/papers.md` wrote this page. Rows follow the "
        "paper's own rules,\nor (ours) the methods of weighbridge, on the same simulated drives. "
        "A ″ repeats the row above. `--json FILE` writes each row in full:\n"
        "tolerance, reason, and place in the code.\n",
    ]
    for section in sections:
        parts += [f"## {section.title}\n", section.markdown()]
    return "\n".join(parts)
