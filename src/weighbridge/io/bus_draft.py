"""A mapping drafted from bus traffic: which signals of a DBC are which quantities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io import mdf
from weighbridge.io.channels import Channel, Recording, draft_of
from weighbridge.io.dbc import Database, Found, is_readable, message_frames, physical
from weighbridge.io.draft import Draft
from weighbridge.io.formats import format_of, unreadable
from weighbridge.io.frames import Frames
from weighbridge.io.j1939 import decode_j1939, is_j1939
from weighbridge.io.obd import decode_obd
from weighbridge.signals import Problem


class NoFramesError(DriveError):
    """A log for which a DBC was given has no CAN frames."""


def draft_bus(path: Path, databases: Sequence[Database]) -> Draft:
    """Look at the frames of a log, and at its channels if it has any, and draft their mapping.

    Parameters
    ----------
    path : MDF, BLF, ASC, TRC, candump or another log of CAN frames
    databases : as of `weighbridge.io.dbc.load_dbcs`

    Raises
    ------
    NoFramesError
        It has no frames.
    DriveError
        It has none of the databases' messages, or no signal that is known.
    """
    form = format_of(path)
    if form is None:
        raise DriveError(unreadable(path))
    if form.read is mdf.read_mdf:
        with mdf.opened(path) as found:
            return _draft(path, found, databases)
    return _draft(path, Recording([], frames=form.read(path, None, None).frames), databases)


def _draft(path: Path, found: Recording, databases: Sequence[Database]) -> Draft:
    frames = found.frames
    if frames is None or not len(frames):
        raise NoFramesError(f"{path} has no CAN frames; leave --dbc out")
    signals = bus_channels(frames, databases)
    if not signals:
        names = " and ".join(d.path.name for d in databases)
        raise DriveError(
            f"{path}: none of its frames is a message of {names}; it may be the DBC of another "
            "vehicle or bus"
        )
    found.channels += signals
    found.notes += [note for d in databases for note in d.notes]
    drafted = draft_of(path, found)
    flags = _flags(databases)
    columns = (replace(c, valid=flags.get(c.name.partition(".")[0], "")) for c in drafted.columns)
    return replace(
        drafted, columns=tuple(columns), read_anyway=drafted.read_anyway | _read_anyway(frames)
    )


def _read_anyway(frames: Frames) -> frozenset[str]:
    """Name what OBD-II answers and J1939 in the traffic show without a database."""
    signals = decode_obd(frames).signals
    if is_j1939(rest := frames.select(frames.extended)):
        signals = [*signals, *decode_j1939(rest).signals]
    return frozenset(signal.name for signal in signals)


def _flags(databases: Sequence[Database]) -> dict[str, str]:
    """Name the flag of each message that has one of its own, such as ``SpeedValid``."""
    found = {}
    for message in (m for d in databases for m in d.messages):
        named = [s.name for s in message.signals if s.length == 1 and "valid" in s.name.lower()]
        if len(named) == 1:
            found[message.name] = named[0]
    return found


def bus_channels(frames: Frames, databases: Sequence[Database]) -> list[Channel]:
    """Signals of the databases' messages that are in the traffic, to be decoded where wanted."""
    return [
        Channel(
            f"{message.name}.{signal.name}",
            frames.time[at[message.name]],
            np.empty(0),
            str(signal.unit or ""),
            load=partial(_decoded, frames, Found(message, signal, at[message.name])),
        )
        for database in databases
        for at in (message_frames(frames, database),)
        for message in database.messages
        if message.name in at
        for signal in message.signals
        if is_readable(signal)
    ]


def _decoded(frames: Frames, found: Found, quantity: str) -> tuple[Channel, list[Problem]]:
    values, at = physical(frames, found)
    name = f"{found.message.name}.{found.signal.name}"
    return Channel(name, frames.time[at], values, str(found.signal.unit or "")), []
