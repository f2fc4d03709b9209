"""What ``weighbridge map --ask`` asks: about what is not sure, and about nothing else."""

from __future__ import annotations

import difflib
from dataclasses import replace
from typing import TYPE_CHECKING

import typer

from weighbridge.cli.terminal import complain, shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from weighbridge.io import Draft
    from weighbridge.io.draft_column import DraftColumn
    from weighbridge.io.draft_time import DraftTime

_NONE = "none"
"""Answer that leaves a column out."""


def asked(found: Draft, *, torque: bool = True) -> Draft:
    """Ask about a draft: its time, then each column whose meaning or unit is not sure.

    Where no column is known by its name, or none of the log shows a torque, each is asked about.

    Where nobody answers, what was drafted stays, with its questions.

    Parameters
    ----------
    found
    torque : some column of the log shows one
    """
    from weighbridge.io.draft import timed

    try:
        if found.times:
            time = _asked_time(found)
            found = found if time is found.times[0] else timed(found, time)
        nameless = not found.known or not torque
        for name in [c.name for c in found.columns]:
            columns = {c.name: c for c in found.columns}
            taken = {c.quantity for c in found.known if c.name != name}
            if nameless:
                columns[name] = _asked_meaning(columns[name], taken)
            columns[name] = _asked_unit(_asked_quantity(columns[name], taken))
            found = replace(found, columns=tuple(columns.values()))
    except typer.Abort:
        pass
    return found


def _asked_time(found: Draft) -> DraftTime:
    """Ask which column is the time, and its unit or rate, where the log leaves that open."""
    time = found.times[0]
    if len(found.times) > 1:
        names = [t.column for t in found.times]
        name = _answer(f"which column is the time ({_listed(names)})", names, time.column)
        if name != time.column:
            time = next(t for t in found.times if t.column == name)
    if time.guessed:
        units = ["s", "ms", "us", "ns", "min"]
        unit = _answer(f"unit of {shown(time.column)} ({_listed(units)})", units, time.unit)
        time = _in_unit(time, unit)
    if time.row_rate is not None and not time.row_rate > 0.0:
        time = _asked_rate(time)
    return time


def _in_unit(time: DraftTime, unit: str) -> DraftTime:
    from weighbridge.signals import UNITS

    seconds = time.seconds * (UNITS[unit].factor / UNITS[time.unit].factor)
    return replace(time, unit=unit, seconds=seconds, questions=[], guessed=False)


def _asked_rate(time: DraftTime) -> DraftTime:
    what = f"{shown(time.column)} counts rows" if time.column else "no column is a time"
    while True:
        reported = _prompt(f"{what}; how many rows per second (0 if you do not know)", "0")
        try:
            rate = float(reported.replace(",", "."))
        except ValueError:
            complain(f"{reported!r} is no number")
            continue
        if rate == 0.0:
            return time
        if 0.0 < rate < float("inf"):
            return replace(time, row_rate=rate, questions=[])
        complain(f"{reported!r} is no rate")


def _asked_meaning(column: DraftColumn, taken: set[str]) -> DraftColumn:
    """Ask what a column is where no name of the log shows any."""
    from weighbridge.signals import QUANTITIES

    if column.quantity or not column.count:
        return column
    reported = _answer(
        f"{shown(column.name)}, {column.low:.4g} to {column.high:.4g}; what is it (a quantity of "
        f"docs/files.md such as vehicle_speed, or {_NONE})",
        [*(q for q in QUANTITIES if q not in taken), _NONE],
        _NONE,
    )
    if reported == _NONE:
        return column
    return replace(column, quantity=reported, unit=QUANTITIES[reported].suffix, question="")


def _asked_quantity(column: DraftColumn, taken: set[str]) -> DraftColumn:
    """Ask what a column is, where its name or its values leave that open."""
    from weighbridge.io.columns import suffixes_of
    from weighbridge.signals import QUANTITIES

    if not column.quantity or not column.unsure:
        return column
    free = [q for q in QUANTITIES if q not in taken]
    why = f" ({shown(column.question)})" if column.question else ""
    reported = _answer(
        f"{shown(column.name)}, {column.low:.4g} to {column.high:.4g} {column.unit}, is taken for "
        f"{column.quantity}{why}; what is it (a quantity of docs/files.md, or {_NONE})",
        [*free, _NONE],
        column.quantity,
    )
    if reported == _NONE:
        return replace(column, quantity="", question="")
    if reported == column.quantity:
        # The unit is another question.
        return replace(column, unsure=False, question="" if column.stated else column.question)
    allowed = suffixes_of(QUANTITIES[reported])
    unit = column.unit if column.unit in allowed else QUANTITIES[reported].suffix
    stated = column.stated and column.unit in allowed
    return replace(column, quantity=reported, unit=unit, stated=stated, question="", unsure=False)


def _asked_unit(column: DraftColumn) -> DraftColumn:
    """Ask for the unit of a column whose log states none."""
    from weighbridge.io.columns import suffixes_of
    from weighbridge.signals import QUANTITIES

    if not column.quantity or column.stated or not column.unit:
        return column
    allowed = suffixes_of(QUANTITIES[column.quantity])
    reported = _answer(
        f"{shown(column.name)} is {column.quantity}, {column.low:.4g} to {column.high:.4g};"
        f" unit ({_listed(allowed)}, or {_NONE} to leave it out)",
        [*allowed, _NONE],
        column.unit,
    )
    if reported == _NONE:
        return replace(column, quantity="", question="")
    return replace(column, unit=reported, stated=True, question="")


def _listed(words: Sequence[str]) -> str:
    return ", ".join(map(shown, words))


def _answer(question: str, allowed: Sequence[str], usual: str) -> str:
    """Ask until the answer is one of those allowed."""
    while True:
        reported = _prompt(question, usual)
        if reported in allowed:
            return reported
        near = difflib.get_close_matches(reported, allowed, n=1)
        complain(f"{reported!r} is none of them" + (f"; did you mean {near[0]!r}?" if near else ""))


def _prompt(question: str, usual: str) -> str:
    return str(typer.prompt(question, default=usual, err=True)).strip()
