"""Signals out of CAN traffic that is still going on: a part of it at a time.

What is decoded, and how, is laid down where recorded traffic is decoded: `weighbridge.io.dbc`,
`weighbridge.io.obd` and `weighbridge.io.j1939`. Here stands what has to be kept in between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from weighbridge.errors import ConfigError
from weighbridge.io.bus import Decoded, Wanted, canonical_signals, mapped_signals, valid_values
from weighbridge.io.dbc import Database, Found, message_frames, physical
from weighbridge.io.frames import Frames, in_order, parameter_group
from weighbridge.io.isotp import join_messages
from weighbridge.io.j1939 import (
    EC1,
    FRICTION_AGE,
    NAMES,
    PLAIN,
    SPN,
    SWITCHES,
    TP_CM,
    TP_DT,
    Spn,
    is_pressed,
    spn_values,
)
from weighbridge.io.j1939 import assemble as assemble_packets
from weighbridge.io.mapping import TableMapping
from weighbridge.io.obd import parameters_of, values_of
from weighbridge.signals import Floats, to_si

Values: TypeAlias = dict[str, tuple[Floats, Floats]]
"""By canonical name: instants (n,) [s] and values (n,) in SI."""

Filter: TypeAlias = tuple[int, int, bool]
"""Identifier, the bits of it that count, and whether it has 29."""

# Who is silent for longer is replaced by another that says the same [s].
_SILENT: Final = 5.0
# The frames of one answer follow each other within a second (ISO 15765-2, N_Cr).
_ANSWER: Final = 1.2
# Six packets of an engine configuration, up to 1.25 s apart (J1939-21, T2).
_PACKETS: Final = 8.0


class Stream(Protocol):
    """Decodes traffic part by part."""

    def filters(self) -> list[Filter]:
        """Frames that are wanted; no other need be handed over."""
        ...

    def step(self, frames: Frames) -> Values:
        """Decode what came since the last time, in the order of time."""
        ...


class _Chosen:
    """Who says each thing: the first that did, until silent for long.

    Parameters
    ----------
    lowest : a lower identifier goes before, such as the engine's in OBD-II
    """

    def __init__(self, *, lowest: bool = False) -> None:
        self._lowest = lowest
        self._sender: dict[str, tuple[int, float]] = {}

    def takes(self, name: str, sender: int, time: float) -> bool:
        """Return whether what a sender says at a time counts."""
        chosen, last = self._sender.get(name, (sender, time))
        first = self._lowest and sender < chosen
        if chosen != sender and time - last <= _SILENT and not first:
            return False
        self._sender[name] = (sender, time)
        return True


class DbcStream:
    """Signals of databases.

    Parameters
    ----------
    databases : as of `weighbridge.io.dbc.load_dbcs`
    mapping : names the signals that are wanted; None for those with canonical names
    name : of the bus, for messages

    Raises
    ------
    ConfigError
        None of the signals wanted is in the databases, one is in several messages, or a unit is
        not known.
    """

    def __init__(
        self, databases: Sequence[Database], mapping: TableMapping | None, name: str
    ) -> None:
        nowhere = [{m.name: np.zeros(0, np.intp) for m in d.messages} for d in databases]
        done = Decoded()
        self._name = name
        self._chosen = _Chosen()
        self._wanted: Wanted = (
            mapped_signals(Frames.empty(), name, mapping, databases, nowhere, done)
            if mapping is not None
            else canonical_signals(databases, nowhere)
        )
        if not self._wanted:
            files = " and ".join(d.path.name for d in databases)
            why = done.lacking[0].text if done.lacking else f"no signal of {files} is canonical"
            raise ConfigError(f"{name}: {why}; name the signals that are wanted in a mapping")
        needed = {id(found.message) for found, _, _ in self._wanted.values()}
        self._databases = [
            replace(d, messages=tuple(m for m in d.messages if id(m) in needed)) for d in databases
        ]

    def filters(self) -> list[Filter]:
        """Frames that are wanted."""
        return [
            (int(m.frame_id), 0x00FFFF00, True)
            if m.is_extended_frame and m.protocol == "j1939"
            else (
                int(m.frame_id),
                0x1FFFFFFF if m.is_extended_frame else 0x7FF,
                bool(m.is_extended_frame),
            )
            for d in self._databases
            for m in d.messages
        ]

    def step(self, frames: Frames) -> Values:
        """Decode what came since the last time, in the order of time."""
        carried: dict[int, NDArray[np.intp]] = {}
        for d in self._databases:
            at_names = message_frames(frames, d)
            carried |= {id(m): at_names[m.name] for m in d.messages if m.name in at_names}
        values: Values = {}
        for quantity, (place, suffix, mapped) in self._wanted.items():
            at = carried.get(id(place.message))
            if at is None:
                continue
            found = Found(place.message, place.signal, at)
            physically, at = physical(frames, found)
            physically, at = physically[np.isfinite(physically)], at[np.isfinite(physically)]
            if place.message.protocol == "j1939":
                kept = _kept(self._chosen, quantity, frames.select(at))
                physically, at = physically[kept], at[kept]
            if mapped is not None:
                physically = physically * mapped.factor + mapped.offset
                physically, at = valid_values(
                    frames, self._name, found, mapped, physically, at, Decoded()
                )
            if at.size:
                si = to_si(physically, suffix) if suffix else physically
                values[quantity] = (frames.time[at], si)
        return values


def _kept(chosen: _Chosen, name: str, frames: Frames) -> NDArray[np.bool_]:
    """Mark the frames of the sender that counts; J1939 names it in the lowest byte."""
    senders = (frames.id & 0xFF).astype(np.int64)
    kept = np.zeros(senders.size, dtype=bool)
    for sender in dict.fromkeys(senders.tolist()):
        of_it = senders == sender
        if chosen.takes(name, sender, float(frames.time[of_it][-1])):
            kept |= of_it
    return kept


class ObdStream:
    """Answers of OBD-II that another device asks for."""

    def __init__(self) -> None:
        self._waiting = Frames.empty()
        self._done: dict[int, float] = {}
        self._chosen = _Chosen(lowest=True)

    def filters(self) -> list[Filter]:
        """Frames that are wanted: 0x7E8 to 0x7EF, and 18DAF1xx (ISO 15765-4)."""
        return [(0x7E8, 0x7F8, False), (0x18DAF100, 0x1FFFFF00, True)]

    def step(self, frames: Frames) -> Values:
        """Decode what came since the last time, in the order of time."""
        answers = np.where(
            frames.extended,
            (frames.id & 0x1FFFFF00) == 0x18DAF100,
            (frames.id >= 0x7E8) & (frames.id <= 0x7EF),
        )
        self._waiting = in_order([self._waiting, frames.select(answers)])
        if not len(self._waiting):
            return {}
        rows: dict[str, list[tuple[float, float]]] = {}
        for sender in np.unique(self._waiting.id).tolist():
            messages = join_messages(self._waiting.select(self._waiting.id == sender))
            new = np.flatnonzero(messages.time > self._done.get(sender, -np.inf))
            for k in new.tolist():
                time = float(messages.time[k])
                self._done[sender] = time
                answer = messages.data[k, : int(messages.length[k])].tobytes()
                for number, raw in parameters_of(answer).items():
                    for quantity, value in values_of(number, raw).items():
                        if self._chosen.takes(quantity, sender, time):
                            rows.setdefault(quantity, []).append((time, value))
        last = float(self._waiting.time[-1])
        self._waiting = self._waiting.select(self._waiting.time > last - _ANSWER)
        return {
            name: (np.array([t for t, _ in found]), np.array([v for _, v in found]))
            for name, found in rows.items()
        }


class J1939Stream:
    """Parameters of SAE J1939; net torque and switches as `weighbridge.io.j1939` makes them.

    Friction and losses hold their last value, where a recording has the next one as well.
    """

    def __init__(self) -> None:
        self._chosen = _Chosen()
        self._packets = Frames.empty()
        self._configured = -np.inf
        self._friction = (-np.inf, np.nan)
        self._parasitic = 0.0
        self._begun = np.inf
        self._switches: dict[tuple[str, int], tuple[float, bool]] = {}
        self._counts: dict[tuple[str, int], int] = {}
        self._reported: dict[str, bool] = {}

    def filters(self) -> list[Filter]:
        """Frames that are wanted: the known parameter groups, of any sender."""
        return [
            (g << 8, 0x03FFFF00 if (g >> 8) >= 240 else 0x03FF0000, True) for g in NAMES if g != EC1
        ]

    def step(self, frames: Frames) -> Values:
        """Decode what came since the last time, in the order of time."""
        frames = frames.select(frames.extended & (frames.length <= 8))
        if not len(frames):
            return {}
        group = parameter_group(frames.id)
        parts = {g: frames.select(group == g) for g in np.unique(group).tolist() if g in NAMES}
        parts[EC1] = self._configuration(frames, np.isin(group, (TP_CM, TP_DT)))
        values: Values = {}
        for name in PLAIN:
            if (found := self._read(parts, SPN[name])) is not None:
                values[name] = found
        values |= self._torque(parts)
        for switch, spns in SWITCHES.items():
            if (found := self._switch(parts, switch, spns)) is not None:
                values[switch] = found
        return values

    def _configuration(self, frames: Frames, which: NDArray[np.bool_]) -> Frames:
        """Engine configurations that are whole now."""
        if not which.any():
            return Frames.empty()
        kept = in_order([self._packets, frames.select(which)])
        kept = kept.select(kept.time > kept.time[-1] - _PACKETS)
        self._packets = kept
        group = parameter_group(kept.id)
        whole, _ = assemble_packets(kept.select(group == TP_CM), kept.select(group == TP_DT), EC1)
        new = whole.select(whole.time > self._configured)
        if len(new):
            self._configured = float(new.time.max())
        return new

    def _read(self, parts: dict[int, Frames], spn: Spn) -> tuple[Floats, Floats] | None:
        part = parts.get(spn.pgn)
        if part is None or not len(part):
            return None
        values = spn_values(part, spn)
        there = np.isfinite(values)
        part, values = part.select(there), values[there]
        kept = _kept(self._chosen, spn.name, part)
        return (part.time[kept], values[kept]) if kept.any() else None

    def _torque(self, parts: dict[int, Frames]) -> Values:
        """Net torque fraction; the indicated one under both names where no friction is reported."""
        if (friction := self._read(parts, SPN["friction_torque"])) is not None:
            self._friction = (float(friction[0][-1]), float(friction[1][-1]))
        if (parasitic := self._read(parts, SPN["parasitic_torque"])) is not None:
            # A controller that does not know it sends its lowest code, -125 %.
            self._parasitic = max(float(parasitic[1][-1]), 0.0)
        actual = self._read(parts, SPN["actual_torque"])
        if actual is None:
            return {}
        time, torque = actual
        self._begun = min(self._begun, float(time[0]))
        reported, friction_torque = self._friction
        if np.isfinite(reported):
            near = np.abs(time - reported) <= FRICTION_AGE
            net = (torque - friction_torque - self._parasitic)[near]
            return {"engine_torque_fraction": (time[near], net)} if near.any() else {}
        late = time - self._begun > FRICTION_AGE
        if not late.any():
            return {}
        reported_alone = (time[late], torque[late])
        return dict.fromkeys(
            ("engine_torque_fraction", "indicated_torque_fraction"), reported_alone
        )

    def _switch(
        self, parts: dict[int, Frames], switch: str, spns: Sequence[str]
    ) -> tuple[Floats, Floats] | None:
        """One switch of several: pressed where any says so, each holding its last value a while."""
        events: list[tuple[float, tuple[str, int], bool]] = []
        for spn in spns:
            part = parts.get(SPN[spn].pgn)
            if part is None or not len(part):
                continue
            values = spn_values(part, SPN[spn])
            there = np.isfinite(values)
            reported = is_pressed(spn, values[there])
            senders = (part.id[there] & 0xFF).tolist()
            keys = [(spn, sender) for sender in senders]
            events += zip(part.time[there].tolist(), keys, reported.tolist(), strict=True)
        if not events:
            return None
        rows: list[tuple[float, float]] = []
        for time, key, said in sorted(events):
            self._switches[key] = (time, said)
            self._counts[key] = self._counts.get(key, 0) + 1
            on = any(
                pressed and time - last <= _SILENT
                for (name, _), (last, pressed) in self._switches.items()
                if name in spns
            )
            # Senders that speak one shortly after another say nothing new: the one that says most
            # gives the clock, others where they differ.
            most = max((k for k in self._counts if k[0] in spns), key=self._counts.__getitem__)
            if key == most or self._reported.get(switch) != on:
                rows.append((time, float(on)))
            self._reported[switch] = on
        return (np.array([t for t, _ in rows]), np.array([v for _, v in rows])) if rows else None
