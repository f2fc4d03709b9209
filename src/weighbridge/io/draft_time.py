"""The time of a table: which column it is and how it is written."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
import polars as pl

from weighbridge.errors import DriveError
from weighbridge.io.naming import is_time, unit_of, words_of
from weighbridge.io.table import RawTable, column_list, since_1970, time_seconds
from weighbridge.io.vocabulary import COUNTERS, TIME_WORDS
from weighbridge.messages import Problem
from weighbridge.signals import UNITS, Floats

RISES: Final = 0.7
"""Part of the steps of a time that do not fall [-]."""

DATE_FORMATS: Final = (
    "%d.%m.%Y %H:%M:%S%.f",
    "%d/%m/%Y %H:%M:%S%.f",
    "%m/%d/%Y %H:%M:%S%.f",
    "%m/%d/%Y %I:%M:%S%.f %p",
    "%d-%b-%Y %H:%M:%S%.f",
    "%Y/%m/%d %H:%M:%S%.f",
    "%Y-%m-%d %H:%M:%S:%3f",
    "%d.%m.%Y %H:%M:%S,%3f",
    "%d/%m/%Y %H:%M:%S,%3f",
    "%Y-%m-%d %H-%M-%S%.f",
    "%Y-%m-%d %H-%M-%S_%3f",
    "%Y%m%d %H%M%S%.f",
)
"""Dates that loggers write beside ISO 8601; day before month where both would fit."""

_EPOCHS: Final = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"), (1e8, "s"))
"""Least number of a clock that counts from 1970, and its unit."""

_NUMBER: Final = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?$")
_CLOCK: Final = re.compile(r"\d{1,2}:\d{2}:\d{2}([.,]\d+)?$")
_ISO: Final = re.compile(r"\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}:\d{2}")

_USUAL_STEP: Final = (1e-3, 20.0)
"""Time between rows of loggers [s]."""

_STATED_RATE: Final = re.compile(
    r"\b(?:sampl\w*|logging|log|recording|data|abtast)[ _-]*(?:rate|freq\w*|frequenz)"
    r"[^\w.]{1,8}(?P<rate>\d+(?:[.,]\d+)?)\W{0,4}(?:hz\b|$)",
    re.IGNORECASE,
)
"""A rate that a line above the header shows."""

_ONE_BY_ONE: Final = 0.9
"""Part of the rows whose number follows that of the row before [-]."""

_MINUTES: Final = re.compile(r"\b(run ?time|time|minutes|min)\b.*\b(cleared|clear|clr|mil)\b")
"""Names of PID 4D and 4E, as `words_of` cuts them: whole minutes with the malfunction lamp on, and
since trouble codes were cleared."""

_TORN: Final = 0.05
"""Part of the cells of a column that torn lines may have made something else [-]."""

FASTEST: Final = 4.0
"""Mean of the size of a vehicle's acceleration, at most: tyres carry some 10, hardly ever used for
long [m/s^2]."""

_SWING: Final = 2.0
"""Change of speed that is no rounding and no noise [m/s]."""

_EVEN: Final = 0.05
"""Part by which a clock may differ from another one within a minute [-]."""


@dataclass(slots=True)
class DraftTime:
    """A column that can be the time of a table.

    Attributes
    ----------
    column : its name; empty where rows are counted and no column does it
    index : its place; -1 where no column is the time
    unit : suffix of its unit; empty for a text and for a number of rows
    format : "clock", "iso" or a `strptime` format; empty for numbers
    seconds : (n,) the time [s]; of rows that are counted, their number
    questions : what is not sure, one sentence each
    row_rate : rows per second of a time that counts rows [Hz], NaN where it is not known; None
        for a clock
    guessed : whether the log does not state its unit
    """

    column: str
    index: int
    unit: str
    format: str
    seconds: Floats
    questions: list[str] = field(default_factory=list)
    row_rate: float | None = None
    guessed: bool = False


def is_number(cell: str) -> bool:
    """Return whether a cell is a number, with a point or a comma."""
    return _NUMBER.match(cell) is not None


def is_clock(cell: str) -> bool:
    """Return whether a cell is a time of day, such as 08:14:02.610."""
    return _CLOCK.match(cell) is not None


def find_times(raw: RawTable, units: Mapping[str, str], above: Sequence[str]) -> list[DraftTime]:
    """Find the columns that can be the time, the likeliest first.

    Parameters
    ----------
    raw : the table
    units : suffixes that a row of the file states, by column
    above : lines above the header, which may show a rate

    Returns
    -------
    At least one: where no column is a clock, rows are counted, by a column that does or by
    their place.
    """
    places = [k for k, name in enumerate(raw.names) if is_time(name)]
    places += [
        k for k in range(len(raw.names)) if raw.column(k).dtype.is_temporal() and k not in places
    ]
    found = [t for k in places if (t := _as_time(raw, k, units)) is not None]
    found = found or [
        t for k in range(len(raw.names)) if (t := _likely_time(raw, k, units)) is not None
    ]
    if not found:
        return [_counted(raw, _stated_rate(above))]
    minutes = [t for t in found if counts_minutes(t.column)]
    if len(minutes) == len(found) and (other := _beside_minutes(raw, minutes[0])) is not None:
        found.append(other)
    # The finer of several clocks; where they are alike, one that other files can share, a date.
    found.sort(
        key=lambda t: (
            counts_minutes(t.column),
            -round(_resolution(t.seconds), 3),
            not since_1970(t.seconds),
            t.index,
        )
    )
    return found


def counts_minutes(name: str) -> bool:
    """Whether a name is that of a counter of minutes of OBD-II."""
    return _MINUTES.search(" ".join(words_of(name))) is not None


def minutes_problem(source: str, name: str) -> Problem:
    """Say that a mapping names a counter of minutes as the clock of a file."""
    return Problem.of("clock.minutes_named", serious=True, source=source, name=name)


def _beside_minutes(raw: RawTable, minutes: DraftTime) -> DraftTime | None:
    """Find a clock of any name by a counter of minutes: in each minute it goes on by one."""
    turns = np.flatnonzero(np.diff(minutes.seconds) > 0.0) + 1
    if turns.size < 3:
        return None
    passed = np.diff(minutes.seconds[turns])
    for index, name in enumerate(raw.names):
        if index == minutes.index or (found := _as_time(raw, index, {})) is None:
            continue
        for unit in ("s", "ms", "us"):
            factor = UNITS[unit].factor / (UNITS[found.unit].factor if found.unit else 1.0)
            seconds = found.seconds * factor
            steps = np.diff(seconds)
            finest = float(np.median(steps[steps > 0.0]))
            off = np.abs(np.diff(seconds[turns]) - passed)
            if np.all(steps >= 0.0) and np.all(off <= 2.0 * finest + _EVEN * passed):
                question = f"{name!r} is taken for the time: it goes on with {minutes.column!r}"
                return DraftTime(name, index, unit, "", seconds, [question], guessed=True)
    return None


def swings(speed: Floats) -> float:
    """Sum of all changes of a speed, up and down, those below rounding and noise left out [m/s].

    Parameters
    ----------
    speed : (n,) in the order of time; NaN where there is none [m/s]
    """
    total = 0.0
    known = speed[np.isfinite(speed)]
    low = high = float(known[0]) if known.size else 0.0
    for value in known.tolist():
        low, high = min(low, value), max(high, value)
        if value - low > _SWING or high - value > _SWING:
            total += max(value - low, high - value)
            low = high = value
    return total


def by_motion(times: list[DraftTime], swing: float) -> list[DraftTime]:
    """Judge clocks by what moves in them: a vehicle's speed changes as tyres allow.

    Parameters
    ----------
    times : those that can be the time of a table, the likeliest first
    swing : sum of all changes of its speed, of `swings` [m/s]

    Returns
    -------
    Those in which the vehicle moves as one can first. A guessed unit may turn into minutes.
    """

    def hurry(time: DraftTime, factor: float = 1.0) -> float:
        known = time.seconds[np.isfinite(time.seconds)]
        length = factor * float(known.max() - known.min()) if known.size else 0.0
        return swing / length if length > 0.0 else 0.0

    judged = []
    for time in times:
        if time.row_rate is not None or hurry(time) <= FASTEST:
            judged.append(time)
            continue
        question = (
            f"by {time.column!r} in {time.unit or 'seconds'} the speed changes by "
            f"{hurry(time):.0f} m/s^2 in the mean, as no vehicle's does"
        )
        if time.guessed and time.unit == "s" and hurry(time, 60.0) <= FASTEST:
            question += "; taken as minutes"
            time = replace(time, unit="min", seconds=60.0 * time.seconds)
        judged.append(replace(time, questions=[*time.questions, question]))
    fit = [t for t in judged if t.row_rate is not None or hurry(t) <= FASTEST]
    best, *others = fit + [t for t in judged if not any(t is f for f in fit)]
    if others:
        names = column_list(t.column for t in others)
        best.questions.append(f"{best.column!r} is taken for the time, not {names}")
    return [best, *others]


def _counted(raw: RawTable, rate: float) -> DraftTime:
    """Take the number of the row for the time: a column's, else its place.

    Parameters
    ----------
    raw : the table
    rate : rows per second [Hz]; NaN where it is not known
    """
    named = (k for k, n in enumerate(raw.names) if " ".join(words_of(n)) in COUNTERS)
    index = next((k for k in named if _counts(raw, k)), -1)
    name = raw.names[index] if index >= 0 else ""
    rows = raw.numbers(index)[0] if index >= 0 else np.arange(raw.rows, dtype=np.float64)
    what = f"{name!r} counts rows" if name else "no column can be its time"
    question = (
        f"{what}, and the log does not state how many there are per second: state rate_hz in [time]"
        if np.isnan(rate)
        else f"{what}; {rate:g} per second, as a line above the header states"
    )
    question += "" if name else ", where its rows are even, else the time's column"
    return DraftTime(name, index, "", "", rows, [question], rate)


def _counts(raw: RawTable, index: int) -> bool:
    """Whether a column counts rows one by one, a few lost ones apart."""
    try:
        values, _ = raw.numbers(index)
    except DriveError:
        return False
    if values.size < 2 or not np.all(np.isfinite(values)):
        return False
    steps = np.diff(values)
    return bool(np.all(steps >= 1.0) and np.mean(steps == 1.0) > _ONE_BY_ONE)


def _stated_rate(above: Sequence[str]) -> float:
    """Rate that a line above the header shows [Hz]; NaN where none does."""
    for line in above:
        found = _STATED_RATE.search(line.strip().strip(",;\t"))
        if found is not None and (rate := float(found["rate"].replace(",", "."))) > 0.0:
            return rate
    return float("nan")


def _likely_time(raw: RawTable, index: int, units: Mapping[str, str]) -> DraftTime | None:
    """Read a column that rises as a time where part of its name, its size or its text says so."""
    unit, _ = unit_of(raw.names[index])
    named = bool(TIME_WORDS & set(words_of(raw.names[index])))
    named = named or (unit is not None and UNITS[unit].dimension == "s")
    found = _as_time(raw, index, units)
    if found is None or not (named or since_1970(found.seconds) or found.format == "clock"):
        return None
    known = found.seconds[np.isfinite(found.seconds)]
    if known.size < 2 or known[-1] <= known[0] or np.mean(np.diff(known) >= 0.0) < RISES:
        return None
    found.questions.append(f"{found.column!r} is taken for the time, for it rises as one")
    return found


def _resolution(seconds: Floats) -> float:
    """Part of the rows that have a stamp of their own."""
    known = seconds[np.isfinite(seconds)]
    return np.unique(known).size / max(seconds.size, 1)


def _as_time(raw: RawTable, index: int, units: Mapping[str, str]) -> DraftTime | None:
    """Read a column as a time; None where it cannot be one."""
    series, name = raw.column(index), raw.names[index]
    if series.dtype.is_temporal():
        seconds, _, _ = time_seconds(raw, index, 1.0, None)
        return DraftTime(name, index, "", "", seconds)
    texts = raw.sample(index)
    if sum(map(is_number, texts)) < 0.5 * len(texts):
        return _text_time(raw, index, texts)
    try:
        values, _ = raw.numbers(index)
    except DriveError:
        return None
    known = values[np.isfinite(values)]
    if known.size < 2 or known[-1] <= known[0]:
        return None
    questions = []
    guessed = False
    stated, _ = unit_of(name)
    if stated is None and name in units:
        stated, _ = unit_of(f"{name} [{units[name]}]")
    if stated is not None and UNITS[stated].dimension == "s":
        unit = stated
    elif counts_minutes(name):
        unit = "min"
    else:
        unit, question = guessed_time_unit(name, known)
        questions += [question.text] if question is not None else []
        guessed = question is not None
    if counts_minutes(name):
        questions.append(
            f"{name!r} counts whole minutes, and is no clock of the rows: record a time with each "
            "row, or state rate_hz in [time] where the rows are even"
        )
    seconds = values * UNITS[unit].factor
    return DraftTime(name, index, unit, "", seconds, questions, guessed=guessed)


def guessed_time_unit(name: str, values: Floats) -> tuple[str, Problem | None]:
    """Unit of a time in numbers, by its size and its steps, and a question."""
    usual = float(np.median(np.abs(values)))
    for least, unit in _EPOCHS:
        if usual >= least:
            return unit, None
    step = np.diff(values)
    step = step[step > 0.0]
    usual_step = float(np.median(step)) if step.size else 1.0
    whole = bool(np.all(values == np.round(values)))
    if whole and usual_step >= 5.0:
        for unit in ("ms", "us", "ns"):
            low, high = _USUAL_STEP
            if low <= usual_step * UNITS[unit].factor <= high:
                return unit, Problem.of(
                    "clock.unit_by_steps", name=name, steps=usual_step, unit=unit
                )
    return "s", Problem.of("clock.unit_unknown", name=name, steps=usual_step)


def _text_time(raw: RawTable, index: int, texts: Sequence[str]) -> DraftTime | None:
    name = raw.names[index]
    form, questions = text_time_format(texts)
    if not form:
        return None
    try:
        seconds, _, _ = time_seconds(raw, index, 1.0, form)
    except DriveError:
        return None
    return DraftTime(name, index, "", form, seconds, [question.text for question in questions])


def text_time_format(texts: Sequence[str]) -> tuple[str, list[Problem]]:
    """Find how times are written, as ``format`` of a mapping names it.

    Parameters
    ----------
    texts : some of them, without blanks around

    Returns
    -------
    format : empty where they are no times, or numbers
    questions : what is not sure
    """
    if not texts:
        return "", []
    if _most(map(is_clock, texts)):
        return "clock", []
    if _most(_ISO.match(t) is not None for t in texts):
        return "iso", []
    fits = [f for f in DATE_FORMATS if _fits(texts, f)]
    questions = []
    if len(fits) > 1 and {f[:5] for f in fits} >= {"%d/%m", "%m/%d"}:
        questions.append(Problem.of("clock.day_first", time=texts[0]))
    return (fits[0] if fits else ""), questions


def _most(fits: Iterable[bool]) -> bool:
    """Whether all fit but for the few that torn lines leave."""
    fitting = list(fits)
    return sum(fitting) >= (1.0 - _TORN) * len(fitting)


def _fits(texts: Sequence[str], form: str) -> bool:
    parsed = pl.Series(texts).str.to_datetime(form, strict=False, time_unit="us")
    return _most(parsed.is_not_null())
