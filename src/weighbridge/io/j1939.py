"""SAE J1939: the parameter groups of trucks and buses that a weighing can use.

Identifier, transport protocol and the coding of values that are missing follow
SAE J1939-21 (data link layer) and SAE J1939-71 (vehicle application layer).
The table `j1939.csv` holds facts of J1939-71 only: group, place, resolution, offset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weighbridge.data import rows_of
from weighbridge.io.frames import Frames, bits, parameter_group
from weighbridge.signals import Bools, Floats, Problem, Signal, clean_signal, to_si
from weighbridge.signals.words import counted

# J1939-21 5.10.2.4: packets of one message come within T1 = 0.75 s (broadcast)
# or T2 = 1.25 s; a receiver that lags may ask again, so the longer one is taken.
PACKET_TIME: Final = 1.25


def assemble(control: Frames, data: Frames, wanted: int) -> tuple[Frames, int]:
    """Put messages of the transport protocol together (J1939-21, 5.10).

    Both ways look the same to a listener: an announcement by broadcast (BAM)
    or to one address (RTS), then packets of seven bytes under a number each.

    Returns
    -------
    messages : whole ones of the group ``wanted``; time of the last packet
    incomplete : number of those with parts missing
    """
    empty = Frames.empty()
    if not len(control):
        return empty, 0
    opens = np.isin(control.data[:, 0], (16, 32)) & (control.length == 8)
    ends = opens | (control.data[:, 0] == 255)
    number = bits(control.data, 40, 24)
    # Bus, sender and receiver; an abort may come from either end.
    pair = _pair(control)
    back = _pair(control, swapped=True)
    pair_data = _pair(data)
    whole: list[tuple[int, float, NDArray[np.uint8]]] = []
    incomplete = 0
    for k in np.flatnonzero(opens & (number == wanted)).tolist():
        size = int(control.data[k, 1]) | int(control.data[k, 2]) << 8
        packets = int(control.data[k, 3])
        if packets == 0 or size > 7 * packets:
            incomplete += 1
            continue
        later = np.flatnonzero(
            ends[k + 1 :] & ((pair[k + 1 :] == pair[k]) | (back[k + 1 :] == pair[k]))
        )
        end = float(control.time[k]) + PACKET_TIME * (packets + 1)
        if later.size:
            end = min(end, float(control.time[k + 1 + later[0]]))
        a, b = np.searchsorted(data.time, [control.time[k], end], side="left")
        rows = a + np.flatnonzero((pair_data[a:b] == pair[k]) & (data.length[a:b] == 8))
        sequence = data.data[rows, 0].astype(np.int64)
        rows, sequence = rows[sequence <= packets], sequence[sequence <= packets]
        # A packet sent again replaces the one before.
        places = np.full(packets + 1, -1)
        places[sequence] = rows
        if (places[1:] < 0).any():
            incomplete += 1
            continue
        body = data.data[places[1:], 1:8].reshape(-1)[:size]
        whole.append((k, float(data.time[places[1:].max()]), body))
    if not whole:
        return empty, incomplete
    width = max(body.size for *_, body in whole)
    picked = np.array([k for k, *_ in whole])
    joined = np.zeros((len(whole), width), dtype=np.uint8)
    for row, (*_, body) in zip(joined, whole, strict=True):
        row[: body.size] = body
    return (
        Frames(
            time=np.array([t for _, t, _ in whole]),
            channel=control.channel[picked],
            id=control.id[picked],
            extended=control.extended[picked],
            length=np.array([min(body.size, 255) for *_, body in whole], dtype=np.uint8),
            data=joined,
        ),
        incomplete,
    )


def _pair(frames: Frames, *, swapped: bool = False) -> NDArray[np.int64]:
    """Bus, sender and receiver of addressed frames as one number."""
    sender = (frames.id & 0xFF).astype(np.int64)
    receiver = (frames.id >> 8 & 0xFF).astype(np.int64)
    if swapped:
        sender, receiver = receiver, sender
    return frames.channel.astype(np.int64) << 16 | sender << 8 | receiver


EEC1, EC1, VW = 0xF004, 0xFEE3, 0xFEEA
TP_CM, TP_DT = 0xEC00, 0xEB00


@dataclass(frozen=True, slots=True)
class Spn:
    """One suspect parameter: ``value = resolution * raw + offset`` in ``unit``.

    Attributes
    ----------
    number : SPN
    name : canonical quantity, or a word for what has none
    pgn : parameter group it is in
    byte : first byte, counted from 1 as the standard does
    bit : first bit in it, counted from 1
    bits : length
    resolution, offset : of the scaling
    unit : suffix as in `weighbridge.signals.units`; empty for switches and counts
    """

    number: int
    name: str
    pgn: int
    byte: int
    bit: int
    bits: int
    resolution: float = 1.0
    offset: float = 0.0
    unit: str = ""


def _spn(
    number: str, name: str, pgn: str, resolution: str, offset: str, unit: str, **places: str
) -> Spn:
    """Parameter of a row of `j1939.csv`: its group is hexadecimal, its resolution a fraction."""
    whole = {key: int(place) for key, place in places.items()}
    factor = float(Fraction(resolution))
    return Spn(
        int(number), name, int(pgn, 16), resolution=factor, offset=float(offset), unit=unit, **whole
    )


_ROWS: Final = rows_of("io", "j1939.csv")

NAMES: Final = {
    **{int(row["pgn"], 16): row.pop("group") for row in _ROWS},
    TP_CM: "TP.CM",
    TP_DT: "TP.DT",
}
"""Parameter groups by number, with the acronyms of J1939-71."""

SPNS: Final = tuple(_spn(**row) for row in _ROWS)
"""Every parameter read, all of SAE J1939-71."""

SPN: Final = {s.name: s for s in SPNS}
"""The parameters by name."""

PLAIN: Final = (
    "engine_speed", "vehicle_speed", "gear", "reference_torque", "throttle", "engine_load",
    "retarder_torque", "barometric_pressure", "ambient_temperature", "fuel_rate",
)  # fmt: skip
"""Parameters that are a canonical quantity as they are."""

SWITCHES: Final = {
    "brake_switch": ("brake", "ebs_brake", "brake_pedal", "retarder_torque"),
    "clutch_switch": ("clutch", "driveline_engaged", "shift_in_process"),
}
"""Switches, and the parameters of which any says that one is pressed."""

_ABOVE_ZERO: Final = frozenset(("reference_torque", "powered_weight", "maker_mass"))
"""Parameters whose zero is no value: a controller sends it until it knows one."""

_PARK: Final = 0xFB
"""SPN 523: a gearbox in park is shown by a code above the range of gears."""

# Friction changes with engine speed and heat; older than this it says nothing.
FRICTION_AGE: Final = 5.0


@dataclass(slots=True)
class J1939Summary:
    """What was found in J1939 traffic.

    Attributes
    ----------
    decoded : frames of the groups that were read, by acronym
    ignored : frames of all other groups, by parameter group number
    incomplete : multi-packet messages with parts missing
    extras : what has no canonical name, such as shaft speeds; in SI
    problems : what a person should know
    """

    decoded: dict[str, int] = field(default_factory=dict)
    ignored: dict[int, int] = field(default_factory=dict)
    incomplete: int = 0
    extras: dict[str, Signal] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)


class J1939(NamedTuple):
    """Signals of J1939 traffic and what they were made from."""

    signals: list[Signal]
    summary: J1939Summary


def is_j1939(frames: Frames) -> bool:
    """Return whether there is J1939 traffic: two of the groups known, in 8-byte frames.

    One known group alone may be a car's own 29-bit identifier.
    """
    groups = np.unique(parameter_group(frames.id[frames.extended & (frames.length == 8)]))
    return sum(int(g) in NAMES for g in groups) >= 2


def decode_j1939(frames: Frames, name: str = "J1939") -> J1939:
    """Decode the parameter groups of `SPNS`.

    Net engine torque is actual (SPN 513) less nominal friction (SPN 514) less
    parasitic losses (SPN 2978, where reported), in parts of the reference torque
    (SPN 544). The brake counts as pressed where any of the brake switches, the
    brake pedal or a retarder says so. The clutch counts as pressed while the
    gearbox shifts or has the driveline open.

    Parameters
    ----------
    frames : of all buses; frames with 11-bit identifiers are left alone
    name : the log, for messages

    Returns
    -------
    J1939
    """
    frames = frames.select(frames.extended & (frames.length <= 8))
    summary = J1939Summary()
    group = parameter_group(frames.id)
    numbers, counts = np.unique(group, return_counts=True)
    for number, count in zip(numbers.tolist(), counts.tolist(), strict=True):
        if number in NAMES:
            summary.decoded[NAMES[number]] = count
        else:
            summary.ignored[number] = count
    parts = {number: frames.select(group == number) for number in numbers.tolist()}
    empty = Frames.empty()
    assembled, summary.incomplete = assemble(parts.get(TP_CM, empty), parts.get(TP_DT, empty), EC1)
    parts[EC1] = assembled
    if len(assembled):
        summary.decoded[NAMES[EC1]] = len(assembled)
    reader = _Reader(parts, summary, name)

    signals = [reader.best(q) for q in PLAIN]
    signals += [
        *_net_torque(reader),
        *(reader.pressed(name, spns) for name, spns in SWITCHES.items()),
        _reported_mass(reader),
    ]
    for extra in ("input_shaft_speed", "output_shaft_speed", "clutch_slip", "gear_ratio"):
        if (found := reader.best(extra)) is not None:
            summary.extras[extra] = found
    found_signals = [s for s in signals if s is not None]
    _check_buses(reader)
    _check_distance(reader, found_signals)
    _tell_axle_weights(reader)
    if summary.incomplete:
        reader.note(
            Problem.of(
                "bus.packets_lost",
                "reference_torque",
                messages=counted(summary.incomplete, "multi-packet message"),
            )
        )
    return J1939(found_signals, summary)


class _Reader:
    """Reads parameters from frames sorted by parameter group."""

    def __init__(self, parts: dict[int, Frames], summary: J1939Summary, name: str) -> None:
        self.parts = parts
        self.summary = summary
        self.name = name
        engine = parts.get(EEC1)
        self.bus = 0
        if engine is not None and len(engine):
            # The bus that hears the engine most is the vehicle's; what it lacks may be on another.
            buses, counts = np.unique(engine.channel, return_counts=True)
            self.bus = int(buses[np.argmax(counts)])

    def note(self, problem: Problem) -> None:
        self.summary.problems.append(problem.at(self.name))

    def senders(self, spn: Spn) -> list[tuple[Floats, Floats]]:
        """Stamps and values of each that sends valid values.

        Those on the engine's bus come first, and of them those that send most.
        """
        part = self.parts.get(spn.pgn)
        if part is None or not len(part):
            return []
        values = spn_values(part, spn)
        sender = part.channel.astype(np.int64) << 8 | (part.id & 0xFF).astype(np.int64)
        found = []
        for s in np.unique(sender).tolist():
            which = (sender == s) & np.isfinite(values)
            if which.any():
                found.append((s, part.time[which], values[which]))
        found.sort(key=lambda f: (f[0] >> 8 != self.bus, -f[1].size, f[0]))
        return [(time, value) for _, time, value in found]

    def best(self, name: str) -> Signal | None:
        """The signal of the sender with the most valid values."""
        senders = self.senders(SPN[name])
        if not senders:
            return None
        time, values = senders[0]
        signal, problems = clean_signal(name, time, values, self.name)
        self.summary.problems += problems
        return signal

    def pressed(self, name: str, spns: Sequence[str]) -> Signal | None:
        """One switch of several: pressed where any says so, each holding its last value."""
        reported = []
        for spn in spns:
            for time, values in self.senders(SPN[spn]):
                on = is_pressed(spn, values)
                signal, problems = clean_signal(name, time, on.astype(np.float64), self.name)
                self.summary.problems += problems
                if signal is not None:
                    reported.append(signal)
        if not reported:
            return None
        time = np.unique(np.concatenate([s.time for s in reported]))
        on = np.array([np.nan_to_num(s.held(time)) for s in reported]).max(axis=0)
        # Senders that speak one shortly after another say nothing new, and would look like a
        # fast clock full of gaps: the one that says most gives the clock, others where they differ.
        most = max(reported, key=len)
        news = np.diff(on, prepend=np.nan) != 0.0
        kept = news | np.isin(time, most.time) | ~(most.age(time) <= 2.0 * most.period)
        return Signal(name, time[kept], on[kept])


def is_pressed(spn: str, values: Floats) -> Bools:
    """Whether a brake or clutch works, by what one parameter says."""
    match spn:
        case "driveline_engaged":
            return np.asarray(values < 0.5)
        case "retarder_torque":
            # Its torque is negative while it brakes; the resolution is 1 %.
            return np.asarray(values < -0.005)
        case "brake_pedal":
            # The pedal's rest may read one step.
            return np.asarray(values > 0.005)
    return np.asarray(values > 0.5)


def spn_values(part: Frames, spn: Spn) -> Floats:
    """Values of one parameter in SI; NaN where not available, in error or cut off.

    J1939-71, table 1: codes from 0xFB.. up are no values; a switch of two bits
    is 2 in error and 3 where not available.
    """
    first = 8 * (spn.byte - 1) + spn.bit - 1
    whole = 8 * part.length.astype(np.int64) >= first + spn.bits
    raw = bits(part.data, first, spn.bits)
    top = 1 if spn.bits == 2 else (0xFB << (spn.bits - 8)) - 1
    good = (raw <= top) & whole
    if spn.name in _ABOVE_ZERO:
        good &= raw > 0
    values = raw.astype(np.float64) * spn.resolution + spn.offset
    if spn.name == "gear":
        park = raw == _PARK
        good |= park & whole
        values = np.where(park, 0.0, values)
    values = np.where(good, values, np.nan)
    return to_si(values, spn.unit) if spn.unit else values


def _net_torque(reader: _Reader) -> list[Signal]:
    """Net torque fraction: actual less friction and parasitic losses.

    Where no friction is reported, the indicated torque under both names, so that its friction is
    not forgotten.
    """
    actual = reader.best("actual_torque")
    if actual is None:
        return []
    reader.summary.extras["actual_torque"] = actual
    friction = reader.best("friction_torque")
    if friction is None:
        reader.note(Problem.of("torque.friction_unknown", "engine_torque_fraction"))
        return [
            Signal(name, actual.time, actual.values)
            for name in ("engine_torque_fraction", "indicated_torque_fraction")
        ]
    reader.summary.extras["friction_torque"] = friction
    lost = np.interp(actual.time, friction.time, friction.values)
    parasitic = reader.best("parasitic_torque")
    if parasitic is not None:
        # A controller that does not know it sends its lowest code, -125 %.
        reported = np.interp(actual.time, parasitic.time, parasitic.values)
        lost = lost + np.where(reported > 0.0, reported, 0.0)
    near = friction.age(actual.time) <= FRICTION_AGE
    if not near.all():
        reader.note(
            Problem.of(
                "torque.friction_apart",
                "engine_torque_fraction",
                count=int(np.count_nonzero(~near)),
                values=near.size,
                age=FRICTION_AGE,
            )
        )
    if not near.any():
        return []
    return [Signal("engine_torque_fraction", actual.time[near], (actual.values - lost)[near])]


def _check_buses(reader: _Reader) -> None:
    """Find a second engine: one address on two buses, turning at another speed."""
    part = reader.parts.get(EEC1)
    if part is None or np.unique(part.channel).size < 2:
        return
    values = spn_values(part, SPN["engine_speed"])
    own = (part.channel == reader.bus) & np.isfinite(values)
    if not own.any():
        return
    for bus in np.unique(part.channel[part.channel != reader.bus]).tolist():
        other = (part.channel == bus) & np.isfinite(values)
        here = np.interp(part.time[other], part.time[own], values[own])
        running = np.maximum(here, values[other]) > 10.0
        if not running.any():
            continue
        apart = np.abs(values[other] / np.maximum(here, 1.0) - 1.0)[running]
        if float(np.median(apart)) > 0.1:
            reader.note(
                Problem.of(
                    "bus.two_vehicles", "engine_speed", bus=reader.bus, other=bus, serious=True
                )
            )


def _check_distance(reader: _Reader, signals: list[Signal]) -> None:
    """Compare the odometer with the speed, where the way is long enough to."""
    speed = next((s for s in signals if s.name == "vehicle_speed"), None)
    distance = reader.best("distance")
    if distance is None:
        return
    reader.summary.extras["distance"] = distance
    if speed is None or len(speed) < 2 or speed.period > 1.0:
        return
    way = float(distance.values[-1] - distance.values[0])
    step = np.diff(speed.time)
    middle = 0.5 * (speed.values[1:] + speed.values[:-1])
    inside = (speed.time[1:] <= distance.time[-1]) & (speed.time[:-1] >= distance.time[0])
    driven = float(np.sum((middle * step)[inside & (step < 1.0)]))
    if way < 500.0 or driven <= 0.0 or abs(driven / way - 1.0) < 0.1:
        return
    reader.note(Problem.of("speed.odometer", "vehicle_speed", driven=driven, way=way))


def _reported_mass(reader: _Reader) -> Signal | None:
    """Return the mass of the combination, as the vehicle reports it; else of the vehicle alone."""
    found = reader.best("maker_mass")
    if found is not None:
        return found
    alone = reader.best("powered_weight")
    return None if alone is None else Signal("maker_mass", alone.time, alone.values)


def _tell_axle_weights(reader: _Reader) -> None:
    """Note the sum of the axle weights that the vehicle itself reports: a hint, never a mass."""
    part = reader.parts.get(VW)
    if part is None or not len(part):
        return
    weight = spn_values(part, SPN["axle_weight"])
    axle = spn_values(part, SPN["axle"])
    good = np.isfinite(weight) & np.isfinite(axle)
    if good.any():
        total = sum(
            float(np.median(weight[good & (axle == a)])) for a in np.unique(axle[good]).tolist()
        )
        reader.note(Problem.of("mass.axles_reported", mass=total))
