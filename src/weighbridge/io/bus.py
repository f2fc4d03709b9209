"""From raw bus traffic to signals: DBC by mapping, OBD-II, J1939; what is left is counted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.errors import ConfigError
from weighbridge.io.columns import UnitlessColumnError, parse_column, unit_suffix
from weighbridge.io.dbc import (
    Carried,
    Database,
    Found,
    find_signal,
    is_readable,
    message_frames,
    physical,
)
from weighbridge.io.frames import Frames
from weighbridge.io.j1939 import decode_j1939, is_j1939
from weighbridge.io.mapping import MappedSignal, TableMapping, lacking, resolved_unit
from weighbridge.io.obd import decode_obd
from weighbridge.messages import phrase
from weighbridge.signals import Bools, Floats, Problem, Signal, clean_columns, to_si
from weighbridge.signals.tomlfile import Faults
from weighbridge.signals.words import counted

# Identifiers named one by one; the others are counted.
_NAMED: Final = 8


@dataclass(slots=True)
class Decoded:
    """What bus traffic said.

    Attributes
    ----------
    signals : by canonical name, in SI
    problems : what was left out
    lacking : what the mapping names, not as optional, and no frame carries
    contents : what was found, decoded and ignored, with counts, for people
    units : suffixes of the units that the databases or the mapping declare, by signal
    """

    signals: dict[str, Signal] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    lacking: list[Problem] = field(default_factory=list)
    contents: list[str] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)


def decode(
    frames: Frames, name: str, mapping: TableMapping | None, databases: Sequence[Database]
) -> Decoded:
    """Decode raw traffic.

    What the mapping names is taken from the databases; what it does not name
    from OBD-II or J1939, whichever says it more often.

    Parameters
    ----------
    frames : all traffic of a drive, in the order of time
    name : of the log, for messages
    mapping : names the databases' signals; None for canonical names
    databases : as of `load_dbcs`

    Raises
    ------
    ConfigError
        The mapping names a signal that several messages have, or states no unit.
    DriveError
        Nothing in the traffic is known.
    """
    done = Decoded()
    used = np.zeros(len(frames), dtype=bool)
    span = float(frames.time[-1] - frames.time[0]) if len(frames) else 0.0
    buses = np.unique(frames.channel).tolist()
    done.contents.append(
        f"{name}: {counted(len(frames), 'CAN frame')} over {span:.0f} s on "
        f"{'bus' if len(buses) == 1 else 'buses'} {', '.join(map(str, buses))}"
    )
    if databases:
        used |= _databases(frames, name, mapping, databases, done)
    elif mapping is not None:
        hint = phrase("without_dbc")
        done.lacking += [
            lacking(f"{name}: in its frames", s, mapping.source, hint)
            for s in mapping.signals
            if not s.optional
        ]
    obd = decode_obd(frames, name)
    used |= obd.used
    done.contents += obd.contents
    settled = frozenset(done.signals)
    _add(obd.signals, obd.problems, "OBD-II", name, done, settled)
    rest = frames.select(frames.extended & ~obd.used)
    if is_j1939(rest):
        truck = decode_j1939(rest, name)
        groups = truck.summary.decoded
        ignored = truck.summary.ignored
        reported = ", ".join(f"{g} ({n})" for g, n in groups.items())
        done.contents.append(
            f"J1939: {reported}; not used: {counted(len(ignored), 'other parameter group')} "
            f"({counted(sum(ignored.values()), 'frame')})"
        )
        _add(truck.signals, truck.summary.problems, "J1939", name, done, settled)
        used |= frames.extended & ~obd.used
    if not used.all():
        done.contents.append(f"not known: {_counts(frames, ~used)}")
    if not done.signals:
        raise _nothing(frames, name, mapping, databases, done, obd.contents).error()
    return done


def _add(
    signals: Sequence[Signal],
    problems: Sequence[Problem],
    kind: str,
    name: str,
    done: Decoded,
    settled: frozenset[str],
) -> None:
    """Add signals of one protocol; of two that say the same the fuller one stays.

    What is ``settled`` by the databases stays whatever its rate: a person named it.
    """
    done.problems += [p for p in problems if p.signal not in settled]
    for s in signals:
        other = done.signals.get(s.name)
        if s.name in settled:
            continue
        if other is None or len(other) < len(s):
            done.signals[s.name] = s
        if other is not None:
            few, many = sorted((len(s), len(other)))
            done.problems.append(
                Problem.of("bus.twice", s.name, file=name, kind=kind, few=few, many=many)
            )


def _counts(frames: Frames, which: Bools | None = None) -> str:
    """Identifiers with how often each was seen, the commonest first."""
    counts = sorted(frames.counts(which).items(), key=lambda item: -item[1])
    total = sum(n for _, n in counts)
    shown = ", ".join(f"CAN {c} {i:X} ({n})" for (c, i, _), n in counts[:_NAMED])
    more = (
        phrase("more_identifiers", more=counted(len(counts) - _NAMED, "more identifier"))
        if len(counts) > _NAMED
        else ""
    )
    return f"{counted(total, 'frame')}: {shown}{more}"


def _nothing(
    frames: Frames,
    name: str,
    mapping: TableMapping | None,
    databases: Sequence[Database],
    done: Decoded,
    diagnosis: Sequence[str],
) -> Problem:
    """Say why the traffic gave no signal; ``diagnosis`` is what OBD-II reported nevertheless."""
    if not len(frames):
        return Problem.of("bus.no_frames", file=name)
    about: dict[str, Any] = {"file": name, "frames": _counts(frames)}
    if not databases:
        if diagnosis:
            return Problem.of("bus.diagnosis_only", **about, diagnosis=diagnosis[0])
        return Problem.of("bus.unknown" if mapping is None else "bus.needs_dbc", **about)
    if mapping is not None and (why := [*done.problems, *done.lacking]):
        return Problem.of("bus.nothing_mapped", **about, why=why[0].text)
    names = " and ".join(d.path.name for d in databases)
    return Problem.of("bus.no_signal", **about, databases=names)


def _databases(
    frames: Frames,
    name: str,
    mapping: TableMapping | None,
    databases: Sequence[Database],
    done: Decoded,
) -> Bools:
    """Decode what the mapping names, or what has canonical names; mark the frames used."""
    used = np.zeros(len(frames), dtype=bool)
    carried = [message_frames(frames, d) for d in databases]
    done.problems += [note for d in databases for note in d.notes]
    done.problems += [
        Problem.of("bus.absent", file=name, why=_absent(frames, d))
        for d, found in zip(databases, carried, strict=True)
        if not found
    ]
    wanted = (
        mapped_signals(frames, name, mapping, databases, carried, done)
        if mapping is not None
        else canonical_signals(databases, carried)
    )
    columns: dict[bytes, tuple[NDArray[np.intp], list[tuple[str, Floats]]]] = {}
    taken: dict[str, list[str]] = {}
    for quantity, (found_signal, suffix, mapped) in wanted.items():
        found_signal = _one_bus(frames, name, found_signal, done)
        values, at = physical(frames, found_signal)
        if none := int(np.count_nonzero(np.isnan(values))):
            done.problems.append(
                Problem.of(
                    "file.sentinels",
                    quantity,
                    file=name,
                    count=none,
                    values=values.size,
                    name=f"{found_signal.message.name}.{found_signal.signal.name}",
                )
            )
        if found_signal.message.protocol == "j1939":
            values, at = _one_sender(frames, name, found_signal, values, at, done)
        elif (
            short := found_signal.frames.size - at.size
        ) and found_signal.signal.multiplexer_ids is None:
            done.problems.append(
                Problem.of(
                    "bus.short_frames",
                    quantity,
                    file=name,
                    count=short,
                    frames=found_signal.frames.size,
                    message=found_signal.message.name,
                )
            )
        if mapped is not None:
            values = values * mapped.factor + mapped.offset
            values, at = valid_values(frames, name, found_signal, mapped, values, at, done)
        used[found_signal.frames] = True
        taken.setdefault(found_signal.message.name, []).append(quantity)
        if at.size == 0:
            done.problems.append(
                Problem.of("bus.no_value", quantity, file=name, name=found_signal.signal.name)
            )
            continue
        values = to_si(values, suffix) if suffix else values
        done.units[quantity] = suffix
        columns.setdefault(at.tobytes(), (at, []))[1].append((quantity, values))
    for at, group in columns.values():
        signals, problems = clean_columns(frames.time[at], group, name)
        done.problems += problems
        done.signals.update({s.name: s for s in signals})
    _tell_contents(databases, carried, taken, used, done)
    if mapping is None and any(carried) and not wanted:
        done.problems.append(
            Problem.of(
                "bus.no_names", file=name, databases=" and ".join(d.path.name for d in databases)
            )
        )
    return used


def _tell_contents(
    databases: Sequence[Database],
    carried: Carried,
    taken: dict[str, list[str]],
    used: Bools,
    done: Decoded,
) -> None:
    """Say which messages were read and which not; mark the frames of these used."""
    for d, found in zip(databases, carried, strict=True):
        read = [f"{m} ({at.size}): {', '.join(taken[m])}" for m, at in found.items() if m in taken]
        skipped = [m for m in found if m not in taken]
        if read:
            done.contents.append(f"{d.path.name}: {'; '.join(read)}")
        if skipped:
            named = {m.name: ", ".join(s.name for s in m.signals[:_NAMED]) for m in d.messages}
            reported = "; ".join(f"{m} ({found[m].size}): {named[m]}" for m in skipped[:_NAMED])
            more = f" and {len(skipped) - _NAMED} more" if len(skipped) > _NAMED else ""
            done.contents.append(f"{d.path.name}, not used: {reported}{more}")
            for m in skipped:
                used[found[m]] = True


def _absent(frames: Frames, database: Database) -> str:
    """Say that no frame is a message of a database; name the buses that carry them."""
    known = counted(len(database.messages), "message")
    none = phrase("none_in_log", messages=known, database=database.path.name)
    if database.channel is None:
        return phrase("of_another_vehicle", none=none)
    anywhere = message_frames(frames, replace(database, channel=None))
    buses = {int(c) for at in anywhere.values() for c in np.unique(frames.channel[at])}
    if not buses:
        return phrase("of_another_vehicle", none=none)
    remedy = " or ".join(f"{b}:{database.path.name}" for b in sorted(buses))
    return phrase("on_other_bus", none=none, bus=database.channel, remedy=remedy)


def _why_absent(frames: Frames, signal: MappedSignal, databases: Sequence[Database]) -> str:
    """Say why no frame has a signal: its message is not in the log, or no DBC has it."""
    for d in databases:
        everything = {m.name: np.zeros(0, np.intp) for m in d.messages}
        known = find_signal(signal.column, [d], [everything])
        if known:
            why = (
                phrase("message_not_in_log", message=known[0].message.name, database=d.path.name)
                if message_frames(frames, d)
                else _absent(frames, d)
            )
            return f" ({why})"
    return phrase("check_dbc_name")


Wanted = dict[str, tuple[Found, str, MappedSignal | None]]
"""By quantity: where it is, the suffix of its unit, and how the mapping names it, if it does."""


def mapped_signals(
    frames: Frames,
    name: str,
    mapping: TableMapping,
    databases: Sequence[Database],
    carried: Carried,
    done: Decoded,
) -> Wanted:
    """Find what a mapping names in databases, of the messages that are carried."""
    wanted: Wanted = {}
    faults = Faults()
    for s in mapping.signals:
        found = find_signal(s.column, databases, carried)
        if not found:
            if not s.optional:
                hint = _why_absent(frames, s, databases)
                done.lacking.append(lacking(f"{name}: in its frames", s, mapping.source, hint))
            continue
        if len(found) > 1:
            names = ", ".join(f"{f.message.name}.{f.signal.name}" for f in found)
            raise ConfigError(
                f"{mapping.source}: signals.{s.name} column {s.column!r} is in several messages; "
                f"name one of {names}"
            )
        stated = unit_suffix(found[0].signal.unit or "")
        with faults.gathered():
            wanted[s.name] = (found[0], resolved_unit(s, stated, mapping.source), s)
    faults.refuse()
    return wanted


def canonical_signals(databases: Sequence[Database], carried: Carried) -> Wanted:
    """Find what has a canonical name in databases, of the messages that are carried."""
    wanted: Wanted = {}
    for database, frames in zip(databases, carried, strict=True):
        for message in database.messages:
            if message.name not in frames:
                continue
            for signal in message.signals:
                try:
                    known = parse_column(signal.name, None, unit_suffix(signal.unit or ""))
                except UnitlessColumnError:
                    continue
                if known is not None and known[0].name not in wanted and is_readable(signal):
                    place = Found(message, signal, frames[message.name])
                    wanted[known[0].name] = (place, known[1], None)
    return wanted


def _one_bus(frames: Frames, name: str, found: Found, done: Decoded) -> Found:
    """Keep the frames of one bus, the one that carries most of them."""
    buses, counts = np.unique(frames.channel[found.frames], return_counts=True)
    if buses.size < 2:
        return found
    best = int(buses[np.argmax(counts)])
    several = Problem.of(
        "bus.several_buses",
        file=name,
        message=found.message.name,
        buses=", ".join(map(str, buses.tolist())),
        bus=best,
    )
    if several not in done.problems:
        done.problems.append(several)
    return Found(found.message, found.signal, found.frames[frames.channel[found.frames] == best])


def _one_sender(
    frames: Frames,
    name: str,
    found: Found,
    values: Floats,
    at: NDArray[np.intp],
    done: Decoded,
) -> tuple[Floats, NDArray[np.intp]]:
    """Keep the values of one sender of a J1939 group, the one that has most of them."""
    senders, counts = np.unique(frames.id[at], return_counts=True)
    if senders.size < 2:
        return values, at
    best = senders[np.argmax(counts)]
    done.problems.append(
        Problem.of(
            "bus.several_senders",
            file=name,
            senders=senders.size,
            name=found.signal.name,
            sender=best,
            values=counts.max(),
        )
    )
    mine = frames.id[at] == best
    return values[mine], at[mine]


def valid_values(
    frames: Frames,
    name: str,
    found: Found,
    mapped: MappedSignal,
    values: Floats,
    at: NDArray[np.intp],
    done: Decoded,
) -> tuple[Floats, NDArray[np.intp]]:
    """Leave out values that a signal of the same message says do not count."""
    if mapped.valid is None:
        return values, at
    flag = next((s for s in found.message.signals if s.name == mapped.valid), None)
    if flag is None:
        raise ConfigError(
            f"signals.{mapped.name} valid = {mapped.valid!r}: message {found.message.name} has no "
            f"such signal; it has {', '.join(s.name for s in found.message.signals)}"
        )
    raw, where = physical(frames, Found(found.message, flag, at))
    good = np.isin(at, where[np.nan_to_num(raw) != 0.0])
    lost = int(at.size - np.count_nonzero(good))
    if lost:
        left_out = Problem.of(
            "bus.invalid",
            file=name,
            count=lost,
            frames=at.size,
            message=found.message.name,
            valid=mapped.valid,
        )
        if left_out not in done.problems:
            done.problems.append(left_out)
    return values[good], at[good]
