"""Logs of named channels, each on a clock of its own: from channels to signals and to a draft.

A format of this kind needs one function that hands over its `Recording`.
"""

from __future__ import annotations

import difflib
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.columns import (
    UnitlessColumnError,
    parse_column,
    stated_unit,
    unit_suffix,
)
from weighbridge.io.draft import Draft, draft_column
from weighbridge.io.draft_column import DraftColumn, checked, usual_rate
from weighbridge.io.draft_time import guessed_time_unit, text_time_format
from weighbridge.io.draft_unit import Values, unit_in_name
from weighbridge.io.draft_values import judged
from weighbridge.io.frames import Frames
from weighbridge.io.log import Log, Reader
from weighbridge.io.mapping import (
    MappedSignal,
    TableMapping,
    TimeColumn,
    UnnamedError,
    in_si,
    lacking,
    resolved_unit,
)
from weighbridge.io.naming import recognise_all, unit_of
from weighbridge.io.table import RawTable, column_list, time_seconds, unwrapped
from weighbridge.signals import UNITS, Floats, Problem
from weighbridge.signals.tomlfile import Faults

# Last parts of a name that say nothing of the quantity without the part before.
_EMPTY_NAMES: Final = frozenset(
    ("data", "value", "values", "val", "signal", "y", "x", "z", "ch", "channel", "0")
)
# A mark within brackets is that of a unit.
_PARTS: Final = re.compile(r"[/.](?![^\[(]*[\])])")

# Bytes that a file may unpack to: 1 GB, or so many times its own size where that is more.
_MOST_UNPACKED: Final = 1 << 30
_MOST_TIMES: Final = 4


@dataclass(frozen=True, slots=True)
class Channel:
    """One quantity of a log as it is written there.

    Attributes
    ----------
    name : what the log calls it; parts of a place in it are parted by ``/`` or ``.``
    time : (n,) when [s]; channels with one clock share the array
    values : (n,) in ``unit``; NaN where there is none
    unit : as the log writes it; empty where it states none
    quantity : canonical name, where the format itself says what it is; ``unit`` is a suffix then
    load : takes a channel that is left in the file out of it, for a quantity, and says what is odd;
        its ``time`` is until then no more than as long. ``values`` are empty where they are no
        numbers. None where the channel holds its values
    """

    name: str
    time: Floats
    values: Floats
    unit: str = ""
    quantity: str = ""
    load: Callable[[str], tuple[Channel, list[Problem]]] | None = None


@dataclass(slots=True)
class Recording:
    """What a log of channels holds.

    Attributes
    ----------
    channels : in the order of the log
    absolute : whether their time counts from 1970
    start : where it begins [s since 1970], if it does not count from there and the log shows
    of_day : its clock counts from midnight, of a day that the log does not show
    time : what a mapping has to call the time; empty where the format has a clock of its own
    time_unit : suffix of that time's unit, where the log does not state it
    time_format : how that time is written, as a mapping shows it; empty for numbers
    notes : what was left out or is not sure; a reader of another package may give sentences
    frames : raw bus traffic beside the channels
    paths : whether names are places in the log, the last part of which may be canonical
    """

    channels: list[Channel]
    absolute: bool = False
    start: float | None = None
    of_day: bool = False
    time: str = ""
    time_unit: str = ""
    time_format: str = ""
    notes: list[Problem | str] = field(default_factory=list)
    frames: Frames | None = None
    paths: bool = True

    def add(
        self, raw: RawTable, place: int, seconds: Floats, name: str, unit: str, factor: float = 1.0
    ) -> None:
        """Add a column of a table where it holds numbers.

        Parameters
        ----------
        raw, place : the table, and where the column stands
        seconds : (n,) of its rows [s]; NaN where the time is not known
        name, unit : of the channel
        factor : value of one count, in that unit
        """
        try:
            values, notes = raw.numbers(place)
        except DriveError:
            return
        there = np.isfinite(values) & np.isfinite(seconds)
        if there.any():
            self.notes += notes
            self.channels.append(Channel(name, seconds[there], factor * values[there], unit))

    def clock(
        self, raw: RawTable, place: int, name: str, time: TimeColumn, stated: str | None = "s"
    ) -> Floats:
        """Read a column of a table as a clock, as a mapping shows it or as it looks [s].

        Parameters
        ----------
        raw, place, name : the table, where the column stands, and what it is called
        time : what a mapping says of it
        stated : suffix of the unit where neither mapping nor name state one of time; None to judge
            it by the values
        """
        form = time.format or ""
        if not form:
            form, doubts = text_time_format(raw.sample(place))
            self.notes += [d for d in doubts if d not in self.notes]
        units = (time.unit, unit_of(name)[0], stated)
        unit = next((u for u in units if u in UNITS and UNITS[u].dimension == "s"), "s")
        if not form and not any(units):
            values = raw.numbers(place)[0]
            unit, _ = guessed_time_unit(name, values[np.isfinite(values)])
        if self.time:
            self.time_unit, self.time_format = ("" if form else unit), form
        seconds, self.absolute, notes = time_seconds(raw, place, UNITS[unit].factor, form or None)
        self.notes += [n for n in notes if n not in self.notes]
        return seconds if self.absolute else unwrapped(seconds)


Opener = Callable[[Path, TimeColumn], Recording]
"""Reads a file, given what a mapping says of its time."""

_Wanted = dict[str, tuple[Channel, str, MappedSignal | None]]


def _noted(note: Problem | str) -> Problem:
    return note if isinstance(note, Problem) else Problem.of("plugin.note", note=note)


def check_unpacked(path: Path, size: int) -> None:
    """Refuse a file whose packed content is out of proportion, before it is unpacked.

    Parameters
    ----------
    path : the file
    size : what it unpacks to [bytes]

    Raises
    ------
    DriveError
        It is more than 1 GB, and more than four times the file.
    """
    if size > most_unpacked(path):
        raise DriveError(
            f"{path} has {path.stat().st_size} bytes and unpacks to {size}, more than 1 GB; write "
            "the signals of the drive alone, or split it"
        )


def most_unpacked(path: Path) -> int:
    """Bytes that a file may unpack to: 1 GB, or four times its size where that is more."""
    return max(_MOST_UNPACKED, _MOST_TIMES * path.stat().st_size)


def reader(opener: Opener) -> Reader:
    """Make the reader of a format of channels."""

    def read(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
        time = mapping.time if mapping is not None else TimeColumn()
        return log_of(path, opener(path, time), table, mapping)

    return read


def drafter(opener: Opener) -> Callable[[Path], Draft]:
    """Make what drafts the mapping of a format of channels."""
    return lambda path: draft_of(path, opener(path, TimeColumn()))


def log_of(path: Path, found: Recording, table: str | None, mapping: TableMapping | None) -> Log:
    """Take the channels that a mapping names, and those that the format or a canonical name shows.

    Parameters
    ----------
    path : the file
    found : what it holds
    table : canonical table it is; None where one file holds all
    mapping : goes before what is known otherwise; None for canonical names

    Raises
    ------
    DriveError
        No channel is known and there are no frames.
    ConfigError
        A mapped channel has no unit, or one that it cannot be in.
    """
    log = Log(
        path,
        absolute=found.absolute,
        start=found.start,
        of_day=found.of_day,
        frames=found.frames,
    )
    log.problems += [_noted(note).at(path.name) for note in found.notes]
    wanted = _mapped(log, found, mapping) if mapping is not None and mapping.signals else {}
    # What a mapping names and is no channel may be a signal of the frames.
    named = {s.name for s in mapping.signals} if mapping and found.frames is not None else set()
    taken = {channel.name for channel, _, _ in wanted.values()}
    for name, entry in _known(log, found, table, taken).items():
        if name not in named:
            wanted.setdefault(name, entry)
    if not wanted and (found.frames is None or not len(found.frames)):
        names = column_list({c.name: c for c in found.channels}) or "no channels"
        source = f"that {mapping.source} names" if mapping and mapping.signals else "that is known"
        why = "".join(f"; {p.text}" for p in log.problems if p.id == "file.no_unit")
        raise UnnamedError(f"{path} has no channel {source}; it has {names}{why}", path)
    offset = mapping.time.offset if mapping is not None else 0.0
    clocks: dict[int, tuple[Floats, list[tuple[str, Floats]]]] = {}
    for name, (channel, suffix, signal) in wanted.items():
        if (count := sum(c.name == channel.name for c in found.channels)) > 1:
            log.problems.append(
                Problem.of("file.channel_twice", file=path.name, name=channel.name, count=count)
            )
        if channel.load is not None:
            channel, odd = channel.load(name)
            log.problems += odd
        values = channel.values
        if values.size < channel.time.size:
            log.problems.append(Problem.of("file.no_number", name, file=path.name))
            continue
        time, columns = clocks.setdefault(id(channel.time), (channel.time, []))
        columns.append((name, in_si(values, suffix, signal)))
        log.units[name] = suffix
    for time, columns in clocks.values():
        if time.size == 0:
            names = ", ".join(n for n, _ in columns)
            log.problems.append(Problem.of("file.no_samples", file=path.name, names=names))
            continue
        log.take(time + offset if offset else time, columns)
    return log


def _mapped(log: Log, found: Recording, mapping: TableMapping) -> _Wanted:
    wanted: _Wanted = {}
    faults = Faults()
    for s in mapping.signals:
        channel = channel_named(found.channels, s.column)
        if channel is not None:
            stated = unit_suffix(channel.unit)
            with faults.gathered():
                wanted[s.name] = (channel, resolved_unit(s, stated, mapping.source), s)
        elif not s.optional and found.frames is None:
            near = difflib.get_close_matches(s.column, [c.name for c in found.channels], n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            log.lacking.append(lacking(f"{log.path.name}: channel", s, mapping.source, hint))
    faults.refuse()
    return wanted


def channel_named(channels: list[Channel], name: str) -> Channel | None:
    """Find a channel by its name, in any case, or by the end of it where that is unambiguous.

    Of several with one name the longest.
    """
    plain = name.strip().casefold()
    alike = [c for c in channels if c.name == name]
    alike = alike or [c for c in channels if c.name.strip().casefold() == plain]
    if not alike:
        ends = [c for c in channels if c.name.casefold().endswith((f"/{plain}", f".{plain}"))]
        alike = ends if len({c.name for c in ends}) == 1 else []
    return max(alike, key=lambda c: c.time.size, default=None)


def _known(log: Log, found: Recording, table: str | None, taken: set[str]) -> _Wanted:
    """Channels that the format or a canonical name states; others not mapped are reported."""
    wanted: _Wanted = {}
    unknown: list[str] = []
    longest: dict[str, Channel] = {}
    for channel in found.channels:
        if channel.quantity:
            wanted.setdefault(channel.quantity, (channel, channel.unit, None))
        elif channel.name not in longest or channel.time.size > longest[channel.name].time.size:
            longest[channel.name] = channel
    for channel in longest.values():
        name = _last(channel.name) if found.paths else channel.name
        try:
            column = parse_column(name, table, unit_suffix(channel.unit))
        except UnitlessColumnError as e:
            if channel.name not in taken:
                log.problems.append(
                    Problem.of("file.no_unit", file=log.path.name, name=channel.name, why=str(e))
                )
            continue
        if column is not None:
            wanted.setdefault(column[0].name, (channel, column[1], None))
        elif channel.name not in taken:
            unknown.append(channel.name)
    if wanted and unknown:
        log.problems.append(
            Problem.of("file.unknown", file=log.path.name, columns=column_list(unknown, 6))
        )
    return wanted


def _last(name: str) -> str:
    return _PARTS.split(name)[-1]


def _reported(name: str) -> str:
    """What of a name shows the quantity: its last part, or two where that says nothing."""
    parts = _PARTS.split(name)
    if len(parts) > 1 and parts[-1].lower() in _EMPTY_NAMES:
        return f"{parts[-2]} {parts[-1]}"
    return parts[-1]


def draft_of(path: Path, found: Recording) -> Draft:
    """Draft the mapping of a log of channels.

    Raises
    ------
    DriveError
        It has no channels, none is known by its name, or none needs a mapping.
    """
    counted = Counter(c.name for c in found.channels)
    channels = [c for c in found.channels if c.time.size]
    channels = [c for c in channels if channel_named(found.channels, c.name) is c]
    if not channels:
        raise DriveError(f"{path} has no channel with samples; record it again")
    known = {c.quantity for c in channels if c.quantity}
    unnamed = [c for c in channels if not c.quantity]
    units = [stated_unit(c.unit) for c in unnamed]
    named = recognise_all([_reported(c.name) for c in unnamed], units, misfits=True)
    loaded = {
        c.name: c.load(n.quantity)[0]
        for c, n in zip(unnamed, named, strict=True)
        if c.load is not None and n.quantity
    }
    unnamed = [loaded.get(c.name, c) for c in unnamed]
    columns = checked(
        tuple(
            replace(draft_column(c.name, n, c.values, u), rate=usual_rate(c.time))
            for c, n, u in zip(unnamed, named, units, strict=True)
            if n.quantity not in known
        )
    )
    # Channels that are left in the file have neither instants nor values.
    channels = [c for c in (loaded.get(c.name, c) for c in channels) if c.load is None]
    reported = {c.name: Values(c.time, c.values, unit_in_name(c.name, c.unit)) for c in channels}
    # What the format itself knows is compared too.
    beside = tuple(
        DraftColumn(c.name, c.quantity, c.unit, True, count=c.values.size)
        for c in channels
        if c.quantity
    )
    columns = judged((*columns, *beside), reported)[: len(columns)]
    if known and not any(c.quantity for c in columns):
        raise DriveError(f"{path}: what is known of it is read as it is; it needs no mapping")
    if not any(c.quantity for c in columns):
        raise DriveError(
            f"{path}: none of its channels is known by its name; it has {column_list(counted)}: "
            "write [signals] of a mapping by hand"
        )
    filled = [c for c in channels if c.quantity or np.isfinite(c.values).any()] or channels
    ends = [(float(np.nanmin(c.time)), float(np.nanmax(c.time))) for c in filled]
    doubts = [_noted(note).text for note in found.notes]
    doubts += [
        f"{n!r} is there {k} times; the longest is taken" for n, k in counted.items() if k > 1
    ]
    return Draft(
        path=path,
        time=found.time,
        time_unit=found.time_unit,
        time_format=found.time_format,
        duration=max(b for _, b in ends) - min(a for a, _ in ends),
        columns=columns,
        questions=tuple(doubts),
        read_anyway=frozenset(known),
    )
