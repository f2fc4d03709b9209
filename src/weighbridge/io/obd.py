"""OBD-II: the answers to requests for current data, out of raw CAN traffic.

Answers of service 01 (SAE J1979) come from 0x7E8 to 0x7EF, or from 18DAF1xx with
29 bits (ISO 15765-4), in ISO-TP messages that may hold several parameters.
Requests are not needed: an answer says what it answers, and when.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.data import rows_of
from weighbridge.io.frames import Frames, bits
from weighbridge.io.isotp import Messages, join_messages
from weighbridge.signals import (
    Bools,
    Floats,
    Problem,
    Signal,
    clean_signal,
    scalar_from_si,
    scalar_to_si,
    to_si,
)
from weighbridge.signals.words import counted

SOURCE: Final = "SAE J1979"
"""Where the facts of `PIDS` and `LENGTHS` are laid down."""


@dataclass(frozen=True, slots=True)
class Pid:
    """One value in the answer to a parameter: ``value = scale * raw + offset`` in ``unit``.

    Attributes
    ----------
    number : parameter identifier (PID) of service 01
    name : canonical quantity
    first, count : which bytes of the value hold it, counted from 0; big-endian
    scale, offset : of the scaling
    unit : suffix as in `weighbridge.signals.units`; empty for counts
    shift : bits to drop at the low end
    needs : bits of the value's first byte that say it is supported; 0 if none do
    """

    number: int
    name: str
    first: int
    count: int
    scale: float
    offset: float
    unit: str
    shift: int = 0
    needs: int = 0


def _pid(number: str, name: str, scale: str, offset: str, unit: str, **counts: str) -> Pid:
    """Parameter of a row of `obd.csv`: its number is hexadecimal, its scale a fraction."""
    whole = {key: int(count) for key, count in counts.items()}
    factor = float(Fraction(scale))
    return Pid(int(number, 16), name, scale=factor, offset=float(offset), unit=unit, **whole)


PIDS: Final = tuple(_pid(**row) for row in rows_of("io", "obd.csv"))
"""The parameters that are decoded; facts of SAE J1979."""

# How many bytes of value follow each parameter's number in an answer (SAE J1979). An answer
# of several parameters can only be read on where the length of each is known.
_LENGTHS: Final[dict[int, str]] = {
    1: "04-0B 0D-0F 11-13 1C-1E 2C-30 33 45-4C 51-52 5A-5C 5F 61 62 7D 7E 84 8D 8E A9",
    2: "02 03 0C 10 14-1B 1F 21-23 31 32 3C-3F 42-44 4D 4E 53-59 5D 5E 63 65 92 9E A2",
    3: "67 6F 90 93",
    4: "00 01 20 24-2B 34-3B 40 41 4F 50 60 80 9B 9D A0 A4-A8 C0",
    5: "64 66 6A-6C 72-74 77 86 87 91",
    6: "71 9A",
    7: "68 69 75 76 7A 7B 8B 8F",
    9: "6E 78 79 7C 83 98 99 9F A1 A3",
    10: "70 85",
    11: "6D",
    12: "94",
    13: "7F 88",
    17: "8C 9C",
    41: "81 82 89 8A",
}


def _spread(text: str) -> range:
    low, _, high = text.partition("-")
    return range(int(low, 16), int(high or low, 16) + 1)


LENGTHS: Final[dict[int, int]] = {
    pid: size for size, text in _LENGTHS.items() for part in text.split() for pid in _spread(part)
}
"""Bytes of value by parameter identifier."""

# Full scales of other parameters by byte of the value: 0 for those of `PIDS`.
_FULL_SCALES: Final[dict[tuple[int, int], str]] = {
    (0x4F, 0): "lambda_1",
    (0x4F, 3): "intake_pressure",
    (0x50, 0): "mass_air_flow",
}

CURRENT_DATA: Final = 0x41
"""First byte of an answer of service 01."""

_VEHICLE_INFORMATION: Final = 0x49
_VIN: Final = 0x02
_REFUSED: Final = 0x7F
# An answer with speed, engine speed and four more is 25 bytes long; the longest value has 41.
_MOST_PARAMETERS: Final = 8


def parameters_of(answer: bytes) -> dict[int, bytes]:
    """Bytes of each parameter in one answer of service 01; empty where it is none.

    What is cut off, or follows a parameter of unknown length, is left out.
    """
    found: dict[int, bytes] = {}
    if not answer or answer[0] != CURRENT_DATA:
        return found
    at = 1
    while at < len(answer):
        size = LENGTHS.get(answer[at], 0)
        raw = answer[at + 1 : at + 1 + size]
        if size == 0 or len(raw) < size:
            break
        found[answer[at]] = raw
        at += 1 + size
    return found


def values_of(number: int, raw: bytes) -> dict[str, float]:
    """Values [SI] by canonical name of one parameter's bytes; those not supported are left out."""
    found = {}
    for p in PIDS:
        if p.number == number and raw[0] & p.needs == p.needs:
            value = (int.from_bytes(raw[p.first : p.first + p.count]) >> p.shift) * p.scale
            value += p.offset
            found[p.name] = scalar_to_si(value, p.unit) if p.unit else value
    return found


def bytes_of(number: int, values: Mapping[str, float]) -> bytes:
    """Bytes of one parameter that say what is nearest to some values [SI]; `values_of` reads them.

    Parameters
    ----------
    number : parameter identifier (PID) of service 01
    values : by canonical name; those that the parameter has not are passed over
    """
    raw = bytearray(LENGTHS[number])
    for p in PIDS:
        if p.number == number and p.name in values:
            value = scalar_from_si(values[p.name], p.unit) if p.unit else values[p.name]
            most = (1 << 8 * p.count - p.shift) - 1
            count = min(max(round((value - p.offset) / p.scale), 0), most) << p.shift
            raw[p.first : p.first + p.count] = count.to_bytes(p.count)
            raw[0] |= p.needs
    return bytes(raw)


@dataclass(frozen=True, slots=True)
class Obd:
    """What OBD-II traffic said.

    Attributes
    ----------
    signals : cleaned
    problems : what was left out
    contents : what was found, for people
    used : (n,) bool, frames that belong to OBD-II traffic
    """

    signals: list[Signal]
    problems: list[Problem]
    contents: list[str]
    used: Bools


@dataclass(slots=True)
class _Sender:
    """What one control unit answered."""

    name: str
    values: dict[str, tuple[Floats, Floats]] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    other: int = 0
    cut: int = 0
    refused: int = 0
    vins: set[bytes] = field(default_factory=set)
    supported: int = 1
    rescaled: list[str] = field(default_factory=list)


def decode_obd(frames: Frames, name: str = "OBD-II") -> Obd:
    """Decode the answers of service 01 in raw traffic.

    Where several control units answer the same parameter, the one that
    answers it most often is taken, and of equals the engine's (the lowest).
    Where that one is silent for long, as after a change from 11 to 29 bits, the
    others fill in.

    Parameters
    ----------
    frames : all traffic, in the order of time
    name : of the log, for the problems' text

    Returns
    -------
    Obd
        Empty where there is no OBD-II traffic. Vehicle identification numbers
        are counted, not kept.
    """
    standard = ~frames.extended & (frames.id >= 0x7E8) & (frames.id <= 0x7EF)
    physical = frames.extended & ((frames.id & 0x1FFFFF00) == 0x18DAF100)
    answers = standard | physical
    found = Obd([], [], [], np.zeros(len(frames), dtype=bool))
    if not answers.any():
        return found
    senders = []
    for channel, identifier, extended in frames.counts(answers):
        which = (
            answers
            & (frames.channel == channel)
            & (frames.id == identifier)
            & (frames.extended == extended)
        )
        messages = join_messages(frames.select(which))
        sender = _Sender(f"CAN {channel} {identifier:X}")
        _read_messages(messages, sender)
        if messages.broken:
            found.problems.append(
                Problem.of(
                    "bus.answers_lost",
                    file=name,
                    answers=counted(messages.broken, "answer"),
                    sender=sender.name,
                )
            )
        if sender.counts or sender.refused or sender.other:
            senders.append(sender)
            found.used[which] = True
    if not any(s.counts for s in senders):
        found.used[:] = False
        found.contents.extend(
            f"{s.name}: {counted(s.other, 'answer')} of other services than 01, "
            f"{counted(s.refused, 'request')} declined"
            for s in senders
        )
        return found
    found.used[_requests(frames)] = True
    _tell(senders, name, found)
    _choose(senders, name, found, float(frames.time[0]))
    return found


def _requests(frames: Frames) -> Bools:
    """Mark requests and flow control to the control units."""
    standard = ~frames.extended & (
        (frames.id == 0x7DF) | ((frames.id >= 0x7E0) & (frames.id <= 0x7E7))
    )
    extended = frames.extended & (
        (frames.id == 0x18DB33F1) | ((frames.id & 0x1FFF00FF) == 0x18DA00F1)
    )
    return np.asarray(standard | extended)


def _read_messages(messages: Messages, sender: _Sender) -> None:
    """Take the values out of all messages of one control unit."""
    if messages.length.size == 0:
        return
    data, length = messages.data, messages.length
    service = data[:, 0]
    sender.refused = int(np.count_nonzero(service == _REFUSED))
    vin = (service == _VEHICLE_INFORMATION) & (data[:, 1 % data.shape[1]] == _VIN)
    sender.vins = {row.tobytes() for row in np.unique(data[vin][:, 2:], axis=0)}
    current = service == CURRENT_DATA
    sender.other = int(np.count_nonzero(~current & (service != _REFUSED)))
    data, length, time = data[current], length[current], messages.time[current]
    table = np.zeros(256, np.int64)
    table[list(LENGTHS)] = list(LENGTHS.values())
    parts: dict[int, list[tuple[Floats, NDArray[np.uint8]]]] = {}
    at = np.ones(length.size, np.int64)
    rows = np.flatnonzero(at < length)
    for _ in range(_MOST_PARAMETERS):
        if rows.size == 0:
            break
        pid = data[rows, at[rows]]
        size = table[pid]
        whole = (size > 0) & (at[rows] + 1 + size <= length[rows])
        sender.cut += int(np.count_nonzero(~whole))
        rows, pid, size = rows[whole], pid[whole], size[whole]
        for number in np.unique(pid):
            these = rows[pid == number]
            columns = at[these, None] + 1 + np.arange(table[number])
            parts.setdefault(int(number), []).append((time[these], data[these[:, None], columns]))
        at[rows] += 1 + size
        rows = rows[at[rows] < length[rows]]
    for number, pieces in parts.items():
        sender.counts[number] = sum(t.size for t, _ in pieces)
        if number % 0x20 == 0:
            # Which parameters a control unit supports is fixed.
            lists = np.unique(np.concatenate([raw for _, raw in pieces]), axis=0)
            sender.supported = max(sender.supported, len(lists))
    for (number, byte), quantity in _FULL_SCALES.items():
        if any(raw[:, byte].any() for _, raw in parts.get(number, [])):
            sender.rescaled.append(quantity)
    for p in PIDS:
        if p.number in parts:
            times = np.concatenate([t for t, _ in parts[p.number]])
            values = np.concatenate([_value(p, raw) for _, raw in parts[p.number]])
            order = np.argsort(times, kind="stable")
            known = np.isfinite(values[order])
            if known.any():
                sender.values[p.name] = (times[order][known], values[order][known])


def _value(pid: Pid, raw: NDArray[np.uint8]) -> Floats:
    """Physical values [SI] of one parameter's bytes; NaN where not supported."""
    number = bits(raw, 8 * pid.first, 8 * pid.count - pid.shift, big_endian=True)
    values = np.asarray(number * pid.scale + pid.offset, dtype=np.float64)
    values = to_si(values, pid.unit) if pid.unit else values
    return np.where(raw[:, 0] & pid.needs == pid.needs, values, np.nan)


def _in_silence(signal: Signal, time: Floats) -> Bools:
    """Mark stamps between which a signal has stopped, or before or after it."""
    first, last = min(signal.time[0], time[0]), max(signal.time[-1], time[-1])
    seen = np.concatenate([[first], signal.time, [last]])
    after = np.clip(np.searchsorted(seen, time), 1, seen.size - 1)
    pause = seen[after] - seen[after - 1]
    return np.asarray(pause > np.fmax(_SILENT, 5.0 * signal.period))


def _differ(signal: Signal, time: Floats, values: Floats, limit: float) -> bool:
    """Return whether another source of a signal says something else at the same time."""
    gap = np.abs(signal.at(time) - values)
    gap = gap[np.isfinite(gap) & (signal.age(time) < 2.0)]
    return gap.size >= 10 and float(np.median(gap)) > limit


def _tell(senders: list[_Sender], name: str, found: Obd) -> None:
    """Say what each control unit answered, and what was not read."""
    wanted = {p.number for p in PIDS}
    for s in senders:
        known = ", ".join(f"{n:02X} ({c})" for n, c in sorted(s.counts.items()) if n in wanted)
        skipped = ", ".join(
            f"{n:02X} ({c})" for n, c in sorted(s.counts.items()) if n not in wanted
        )
        parts = [f"PIDs {known}"] if known else []
        if skipped:
            parts.append(f"not used: PIDs {skipped}")
        if s.other:
            parts.append(f"{counted(s.other, 'answer')} of other services, not used")
        if s.refused:
            parts.append(f"{counted(s.refused, 'request')} it declined")
        found.contents.append(f"{s.name}, OBD-II answers: {'; '.join(parts)}")
        if s.cut:
            found.problems.append(
                Problem.of(
                    "bus.answers_cut", file=name, answers=counted(s.cut, "answer"), sender=s.name
                )
            )
        if rescaled := [q for q in s.rescaled if q in s.values]:
            found.problems.append(
                Problem.of("bus.full_scales", file=name, sender=s.name, names=", ".join(rescaled))
            )
        if s.supported > 1:
            found.problems.append(
                Problem.of("bus.two_lists", file=name, sender=s.name, ways=s.supported)
            )
    vins = set().union(*(s.vins for s in senders))
    if len(vins) > 1:
        found.problems.append(
            Problem.of("vehicle.several_vins", serious=True, file=name, vehicles=len(vins))
        )


# Speeds of one vehicle agree far better than this [SI]; clocks and polling are in it.
_APART: Final = {"vehicle_speed": 4.0, "engine_speed": 60.0}

# Who is silent longer, and for five times its period, has stopped [s].
_SILENT: Final = 10.0
_FILLED: Final = 10
"""Fewer values than these fill no silence."""


def _choose(senders: list[_Sender], name: str, found: Obd, start: float) -> None:
    """Take every quantity from the control unit that gives it most often; others fill in."""
    names = dict.fromkeys(q for s in senders for q in s.values)
    left_out: dict[tuple[str, str], list[str]] = {}
    filled: dict[tuple[str, str], list[tuple[str, float, float]]] = {}
    for quantity in names:
        giving = [s for s in senders if quantity in s.values]
        giving.sort(key=lambda s: -s.values[quantity][0].size)
        best = giving[0]
        signal, problems = clean_signal(quantity, *best.values[quantity], name)
        found.problems.extend(problems)
        if signal is None:
            continue
        for other in giving[1:]:
            time, values = other.values[quantity]
            alone = _in_silence(signal, time)
            pair = (other.name, best.name)
            if quantity in _APART and _differ(signal, time, values, _APART[quantity]):
                text = Problem.of(
                    "vehicle.two_units",
                    quantity,
                    serious=True,
                    file=name,
                    first=best.name,
                    second=other.name,
                )
                found.problems.append(text)
            elif np.count_nonzero(alone) >= _FILLED:
                when = time[alone]
                span = (quantity, float(when[0]) - start, float(when[-1]) - start)
                filled.setdefault(pair, []).append(span)
                both = np.concatenate([signal.time, when])
                order = np.argsort(both, kind="stable")
                joined = np.concatenate([signal.values, values[alone]])[order]
                signal = clean_signal(quantity, both[order], joined, name)[0] or signal
            else:
                reported = f"{quantity} ({time.size} for {len(signal)})"
                left_out.setdefault(pair, []).append(reported)
        found.signals.append(signal)
    for (other_name, best_name), spans in filled.items():
        first, last = min(s[1] for s in spans), max(s[2] for s in spans)
        found.problems.append(
            Problem.of(
                "bus.filled_in",
                file=name,
                best=best_name,
                other=other_name,
                first=first,
                last=last,
                names=", ".join(s[0] for s in spans),
            )
        )
    for (other_name, best_name), quantities in left_out.items():
        found.problems.append(
            Problem.of(
                "bus.answered_twice",
                file=name,
                best=best_name,
                other=other_name,
                names=", ".join(quantities),
            )
        )
