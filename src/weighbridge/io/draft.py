"""A mapping drafted from a log: how its text is written, its time, what its columns are.

Nothing is asked and nothing is guessed silently: what is questionable is reported with the draft.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.columns import (
    UNKNOWN_UNIT,
    dimension_of,
    stated_unit,
    unit_refused,
)
from weighbridge.io.draft_column import (
    Columns,
    DraftColumn,
    checked,
    is_calculated,
    measured,
    usual_rate,
)
from weighbridge.io.draft_text import text_format
from weighbridge.io.draft_time import DraftTime, by_motion, find_times, is_number, swings
from weighbridge.io.draft_unit import Values, plausible_unit, unit_in_name
from weighbridge.io.draft_values import FOUND, judged
from weighbridge.io.naming import LEAST, Named, bare_quantities, recognise_all, words_of
from weighbridge.io.parquet import read_parquet
from weighbridge.io.table import (
    RawTable,
    TextFormat,
    column_list,
    head,
    read_text,
)
from weighbridge.signals import QUANTITIES, UNITS, Floats, find_restarts, spread_rows, to_si
from weighbridge.vehicle.torque_sources import TORQUE_SOURCES

_STRANGE_UNIT: Final = re.compile(
    r"[\[(]\s*([^\])\s]*[/•*·][^\])]*?|[kK]?Hz|rps|kgf?[ .]?m|lsb|LSB|counts?)\s*[\])]\s*$"
)
"""A unit at the end of a name that is not known: one of two, such as lb/min, or Hz and the like."""

_BESIDE: Final = frozenset(("engine_speed", "vehicle_speed", "gnss_speed"))
"""Signals of a torque source that show no torque by themselves."""

_TELLING: Final = {UNITS[QUANTITIES[quantity].suffix].dimension for quantity in FOUND}
"""Dimensions of columns of any name that are held against others."""

_FASTEST: Final = 400.0
"""A speed without a unit that is larger is that of something that turns [km/h]."""

_AXES: Final = (("x",), ("y",), ("z",))
"""Names of columns that show an axis and no more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """What one file seems to be.

    Attributes
    ----------
    path : the file
    text : how it is written
    time : name of the time column; empty where the format has a clock of its own
    time_unit : suffix of a time in numbers; empty for a text
    time_format : "clock", "iso" or a `strptime` format; empty for numbers
    duration : from the first to the last row [s]
    columns : all but the time
    questions : of the file and its time, one sentence each
    alike : other files that it is of, for they read alike
    row_rate : rows per second of a time that counts rows [Hz], NaN where nobody knows; None for
        a clock
    rows : of a table
    times : columns of a table that can be its time, the one taken first
    read_anyway : quantities that the log is known to show without a mapping
    """

    path: Path
    text: TextFormat = field(default_factory=TextFormat)
    time: str
    time_unit: str
    time_format: str
    duration: float
    columns: Columns
    questions: tuple[str, ...] = ()
    alike: tuple[Path, ...] = ()
    row_rate: float | None = None
    rows: int = 0
    times: tuple[DraftTime, ...] = ()
    read_anyway: frozenset[str] = frozenset()

    @property
    def files(self) -> int:
        """How many files it is of."""
        return 1 + len(self.alike)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its files, each once."""
        return tuple(dict.fromkeys(path.name for path in (self.path, *self.alike)))

    @property
    def rate_unknown(self) -> bool:
        """Whether its time counts rows of which nobody knows how many there are per second."""
        return self.row_rate is not None and not self.row_rate > 0.0

    @property
    def known(self) -> Columns:
        """Columns that are some quantity."""
        return tuple(c for c in self.columns if c.quantity)

    @property
    def all_questions(self) -> tuple[str, ...]:
        """Questions of the file and of its columns."""
        return (*self.questions, *(f"{c.name!r}: {c.question}" for c in self.columns if c.question))


class UnknownColumnsError(DriveError):
    """None of a table's columns is known by its name; a person may know them.

    Attributes
    ----------
    found : the draft so far, whose columns are no quantity
    """

    def __init__(self, text: str, found: Draft) -> None:
        super().__init__(text)
        self.found = found


def draft_table(path: Path, names: Sequence[str] = ()) -> Draft:
    """Look at a table and draft how it is to be read.

    Parameters
    ----------
    path : CSV or other separated text, or Parquet
    names : of the columns of a text without a header, in their order; "-" for one of no use

    Raises
    ------
    UnknownColumnsError
        None of its columns is known.
    DriveError
        It is no table.
    """
    units: dict[str, str] = {}
    if path.suffix.lower() in (".parquet", ".pq"):
        if names:
            raise DriveError(f"{path} names its columns itself; leave out --columns")
        text, raw = TextFormat(), read_parquet(path)
    else:
        text, units = text_format(path, names)
        raw = read_text(path, text)
    if raw.rows == 0:
        raise DriveError(f"{path} has a header and no rows; its columns cannot be recognised")
    in_cells = {n: raw.cell_unit(k) for k, n in enumerate(raw.names) if n not in units}
    units |= {n: stated for n, u in in_cells.items() if (stated := stated_unit(u)) is not None}
    above = head(path, text.skip_rows) if text.skip_rows else []
    times = find_times(raw, units, above)
    time = times[0]
    others = [n for k, n in enumerate(raw.names) if k != time.index]
    # Of a bare axis the name of the file says what is measured.
    reported = [f"{path.stem} {n}" if words_of(n) in _AXES else n for n in others]
    named = recognise_all(reported, [units.get(n) for n in others], misfits=True)
    columns = tuple(
        _column(raw, name, found, stated=units.get(name))
        for name, found in zip(others, named, strict=True)
    )
    columns = checked(_once(columns))
    times = by_motion(times, _swings(raw, columns))
    time = times[0]
    if time.row_rate is None:
        columns = judged(columns, _reported(raw, time, units, columns))
    found = Draft(
        path=path,
        text=text,
        time="",
        time_unit="",
        time_format="",
        duration=float("nan"),
        columns=columns,
        rows=raw.rows,
        times=tuple(times),
    )
    if not tells_torque(found):
        # A person may know which of the others does, by its values.
        found = replace(found, columns=tuple(_numbers(raw, c) for c in columns))
    if not found.known:
        raise UnknownColumnsError(_unknown(found, raw.names), timed(found, time))
    return timed(found, time)


def _once(columns: Columns) -> Columns:
    """Take no column for a quantity by its size that another one is by its name."""
    surest = {c.quantity: c for c in sorted(columns, key=lambda c: not c.unsure) if c.quantity}
    return tuple(
        c if not c.quantity or surest[c.quantity] is c else _nothing(c.name, "") for c in columns
    )


def _reported(
    raw: RawTable, time: DraftTime, units: Mapping[str, str], columns: Sequence[DraftColumn]
) -> dict[str, Values]:
    """Give the columns of a table that are numbers, with its clock."""
    found = {}
    wanted = {c.name for c in columns if c.quantity}
    for index, name in enumerate(raw.names):
        unit = unit_in_name(name, units.get(name))
        by_unit = unit in UNITS and UNITS[unit].dimension in _TELLING
        if name in wanted or by_unit or bare_quantities(name):
            with suppress(DriveError):
                found[name] = Values(time.seconds, raw.numbers(index)[0], unit)
    return found


def _swings(raw: RawTable, columns: Sequence[DraftColumn]) -> float:
    """Sum of the changes of a table's speed [m/s]; 0 where it has none."""
    for quantity in ("vehicle_speed", "gnss_speed"):
        for column in columns:
            if column.quantity == quantity and column.unit:
                values, _ = raw.numbers(raw.names.index(column.name))
                return swings(to_si(values, column.unit))
    return 0.0


def known_quantities(drafts: Sequence[Draft]) -> frozenset[str]:
    """Quantities that the logs of some drafts have, by a mapping or without one."""
    return frozenset().union(*({c.quantity for c in d.known} | d.read_anyway for d in drafts))


def tells_torque(*drafts: Draft) -> bool:
    """Whether what is known of the logs holds a torque, a load or what does instead."""
    known = known_quantities(drafts)
    sets = (s for source in TORQUE_SOURCES.values() for s in (source.signals, *source.others))
    return any(set(signals) - _BESIDE <= known for signals in sets)


def _unknown(found: Draft, names: Sequence[str]) -> str:
    """Say that none of a table's columns can be taken, and what helps."""
    if questions := [f"{c.name!r} is {c.question}" for c in found.columns if c.question]:
        return f"{found.path}: none of its columns can be taken: {'; '.join(questions[:3])}"
    counted = found.times[0].row_rate is not None
    timeless = "no column that can be its time, and " if counted else ""
    return (
        f"{found.path} has {timeless}no column that is known by its name; it has "
        f"{column_list(names)}: --ask asks what they are, or write [time] and [signals] of a "
        "mapping by hand"
    )


def _numbers(raw: RawTable, column: DraftColumn) -> DraftColumn:
    """Give a column that is not known its values, by which a person may know it."""
    if column.quantity:
        return column
    try:
        values, _ = raw.numbers(raw.names.index(column.name))
    except DriveError:
        return column
    return replace(column, **measured(values)) if np.isfinite(values).any() else column


def timed(found: Draft, time: DraftTime) -> Draft:
    """Give the draft of a table its time: what it says of rate and length goes by it."""
    known = time.seconds[np.isfinite(time.seconds)]
    step = np.diff(known)
    questions = list(time.questions)
    if step.size and np.mean(step == 0.0) > 0.2:
        questions.append(
            "several rows share one time stamp; they are spread over the step in reading"
        )
    per_second = 1.0 if time.row_rate is None else time.row_rate
    if restarts := find_restarts(time.seconds / per_second):
        questions.append(
            f"the clock begins anew: read alone, this file is {len(restarts)} recordings, each "
            "weighed as a drive of its own"
        )
    elif np.any(step < 0.0):
        questions.append("the time goes back in places; rows there are left out in reading")
    others = (c for c in found.columns if c.name != time.column)
    return replace(
        found,
        time=time.column,
        time_unit=time.unit,
        time_format=time.format,
        duration=float(known.max() - known.min()) / per_second if known.size else float("nan"),
        questions=tuple(questions),
        row_rate=time.row_rate,
        columns=tuple(_rated(c, time.seconds / per_second) for c in others),
    )


def _rated(column: DraftColumn, time: Floats) -> DraftColumn:
    """Give a column of a table its values per second, stamps that rows share spread as in reading.

    Parameters
    ----------
    column
    time : (n,) of the rows of the table; NaN where it is not known [s]
    """
    spread = spread_rows(time)
    stamps = spread[0] if spread is not None else time
    at = stamps[column.rows] if column.rows is not None else stamps[:0]
    return replace(column, rate=usual_rate(at))


def _column(raw: RawTable, name: str, found: Named, *, stated: str | None) -> DraftColumn:
    if not found.quantity:
        return _nothing(name, found.misfit)
    index = raw.names.index(name)
    try:
        values, _ = raw.numbers(index)
    except DriveError:
        cell = next((c for c in raw.column(index).drop_nulls().to_list() if not _number(c)), "")
        return _nothing(
            name, f"not taken for {found.quantity}: its cells are no numbers, such as {cell!r:.30}"
        )
    return draft_column(name, found, values, stated)


def _number(cell: object) -> bool:
    return not str(cell).strip() or is_number(str(cell).strip())


def _nothing(name: str, question: str) -> DraftColumn:
    return DraftColumn(name, "", "", False, question=question)


def draft_column(name: str, found: Named, values: Floats, stated: str | None) -> DraftColumn:
    """Say what a column is taken for, by its name and its values.

    Parameters
    ----------
    name : as it is in the log
    found : what the name says
    values : (n,) in the log's unit; NaN where there is none
    stated : suffix of the unit that the log states elsewhere than in the name
    """
    if not found.quantity:
        return _nothing(name, found.misfit)
    if is_calculated(name, found.quantity):
        return _nothing(
            name, f"not taken for {found.quantity}: it was calculated, from a speed or a position"
        )
    known = values[np.isfinite(values)]
    if known.size == 0:
        return _nothing(name, f"not taken for {found.quantity}: it has no values")
    turns = found.quantity == "vehicle_speed" and found.unit is None and stated is None
    if turns and float(np.quantile(known, 0.995)) > _FASTEST:
        found = replace(found, quantity="engine_speed", score=LEAST)
    quantity = QUANTITIES[found.quantity]
    reported = stated if stated is not None and not stated.startswith(UNKNOWN_UNIT) else None
    unit, question, by_log = reported or found.unit, "", True
    strange = _STRANGE_UNIT.search(name)
    if quantity.suffix and unit is None and strange is not None:
        return _nothing(name, unit_refused(quantity, strange.group(1)))
    if not quantity.suffix:
        unit = ""
    elif unit is not None and UNITS[unit].dimension == dimension_of(quantity):
        question = _beyond(found.quantity, unit, known)
    else:
        by_log = False
        unit, question = plausible_unit(name, found.quantity, known)
        if not unit:
            return _nothing(name, question)
    unsure = found.score < 1.0 or (bool(question) and by_log)
    column = DraftColumn(name, found.quantity, unit, by_log, question=question, unsure=unsure)
    return replace(column, **measured(values))


def _beyond(quantity: str, unit: str, values: Floats) -> str:
    q = QUANTITIES[quantity]
    si = to_si(values, unit)
    outside = np.mean((si < q.low) | (si > q.high))
    if outside <= 0.01:
        return ""
    return f"{100.0 * outside:.0f} % of its values are impossible in {unit}; check its unit"
