"""Signals of CAN databases (DBC), taken out of raw frames in whole columns.

cantools reads the database; the bits are taken out with numpy, for the signals
wanted only.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from weighbridge.errors import ConfigError
from weighbridge.io.frames import Frames, bits, parameter_group
from weighbridge.io.labels import is_no_value
from weighbridge.io.libraries import importing
from weighbridge.signals import Bools, Floats, Problem

DbcSource = str | Path
"""A DBC file, for one bus alone where it is written ``1:file.dbc``."""

# Where a signal lies, and how long a message is. The library makes room for every bit it is given.
_PLACES: Final = re.compile(r":\s*(\d+)\s*\|\s*(\d+)\s*@")
_SIZES: Final = re.compile(r"\bBO_\s+\d+\s+\w+\s*:\s*(\d+)")

MOST_BITS: Final = 65_536
"""Bits of a message: ISO 15765-2 carries 4095 bytes, J1939-21 1785."""

# Characters of a library's message that help.
_LONGEST_REASON: Final = 200

# Messages and their signals; a statement about a signal of a message, up to its semicolon; and
# statements that decoding does without, the least needed first.
_DEFINED: Final = re.compile(
    r"^\s*(?:BO_\s+(?P<message>\d+)\s|SG_\s+(?P<signal>\w+)\s)", re.MULTILINE
)
_UP_TO_END: Final = r'(?:[^";]|"[^"]*")*;'
_ABOUT_SIGNAL: Final = re.compile(
    r"^[ \t]*(?:VAL_|SIG_VALTYPE_)\s+(?P<message>\d+)\s+(?P<signal>\w+)\b" + _UP_TO_END,
    re.MULTILINE,
)
_BESIDE: Final = tuple(
    re.compile(rf"^[ \t]*(?:{kind})\s(?!\s*:){_UP_TO_END}", re.MULTILINE)
    for kind in ("CM_", "SIG_GROUP_|BO_TX_BU_", "VAL_|VAL_TABLE_", r"BA_\w*")
)

# Above this part of values outside its range, a range of a database is not believed.
_BELIEVED: Final = 0.5

# Values by which a range is judged, at least.
_FEWEST: Final = 20

_CHANNEL: Final = re.compile(r"^(\d{1,3}):(.+)$")


@dataclass(frozen=True, slots=True)
class Database:
    """One DBC.

    Attributes
    ----------
    path : the file
    channel : the bus it is for; None for every bus
    messages : as cantools gives them
    notes : what of the file was left out
    """

    path: Path
    channel: int | None
    messages: tuple[Any, ...]
    notes: tuple[Problem, ...] = ()


@dataclass(frozen=True, slots=True)
class Found:
    """One signal of a database and the frames that carry it.

    Attributes
    ----------
    message, signal : as cantools gives them
    frames : indices of the message's frames
    """

    message: Any
    signal: Any
    frames: NDArray[np.intp]


Carried: TypeAlias = Sequence[dict[str, NDArray[np.intp]]]
"""Frames of each message that is in the traffic, by its name, for each database."""


def dbc_path(source: DbcSource) -> Path:
    """Return the path of a DBC that may be written ``1:file.dbc``."""
    return _parted(source)[1]


def seen_from(source: DbcSource, home: Path) -> str:
    """Return a DBC that is in a file of a folder, by a path that holds without it.

    Parameters
    ----------
    source : ``file.dbc`` or ``1:file.dbc``
    home : the folder
    """
    return with_path(source, home / dbc_path(source))


def with_path(source: DbcSource, path: Path) -> str:
    """Return a DBC of the same bus by another path."""
    channel = _parted(source)[0]
    return path.as_posix() if channel is None else f"{channel}:{path.as_posix()}"


def _parted(source: DbcSource) -> tuple[int | None, Path]:
    """Bus of a DBC, None for every bus, and its path."""
    found = _CHANNEL.match(str(source))
    return (int(found.group(1)), Path(found.group(2))) if found else (None, Path(source))


def load_dbcs(sources: Sequence[DbcSource]) -> tuple[Database, ...]:
    """Read DBC files.

    Raises
    ------
    ConfigError
        A file is not there or is no DBC.
    MissingExtraError
        cantools is not installed.
    """
    if not sources:
        return ()
    with importing("cantools", "can", f"reading {sources[0]}"):
        import cantools
    # It warns of what decoding does not need.
    logging.getLogger("cantools").setLevel(logging.ERROR)
    databases = []
    for source in sources:
        channel, path = _parted(source)
        try:
            if not path.is_file() and path.exists():
                kind = "folder" if path.is_dir() else "device or a pipe"
                raise ConfigError(f"--dbc {path} is a {kind}; name a DBC file")
            text = path.read_bytes().decode("cp1252", "replace")
        except FileNotFoundError:
            raise ConfigError(f"--dbc {path}: no such file") from None
        except OSError as error:
            raise ConfigError(f"--dbc {path} cannot be read: {error.strerror or error}") from None
        _refuse_endless(path, text)
        database, notes = _loaded(cantools, path, text)
        messages = tuple(getattr(database, "messages", ()))
        if not messages:
            raise ConfigError(f"--dbc {path} defines no message; name another file")
        databases.append(Database(path, channel, messages, notes))
    return tuple(databases)


def _loaded(cantools: Any, path: Path, text: str) -> tuple[Any, tuple[Problem, ...]]:
    """Database of a text, and what was left out of it: statements beside messages and signals.

    The library refuses a whole file for one text of a signal that is not there.
    """
    left_out: list[str] = []
    reason = ""
    for tried in (None, _of_nothing(text), *_BESIDE):
        if tried is not None:
            found = list(tried.finditer(text)) if isinstance(tried, re.Pattern) else tried
            left_out += [_place_of(text, m.start(), m.group()) for m in found]
            for m in reversed(found):
                # Line ends stay, so that lines keep their numbers.
                text = text[: m.start()] + "\n" * m.group().count("\n") + text[m.end() :]
            if not found:
                continue
        try:
            database = cantools.database.load_string(text, "dbc", strict=False)
        # The library's errors on text that is no DBC are of many kinds.
        except Exception as error:
            reason = reason or " ".join(str(error).split())[:_LONGEST_REASON]
            continue
        if not left_out:
            return database, ()
        note = Problem.of(
            "bus.dbc_part", database=path.name, count=len(left_out), example=left_out[0]
        )
        return database, (note,)
    raise ConfigError(f"--dbc {path} is no readable DBC ({reason})") from None


def _of_nothing(text: str) -> list[re.Match[str]]:
    """Statements about signals that no message of a database has."""
    known = set()
    message = ""
    for found in _DEFINED.finditer(text):
        message = found["message"] or message
        if found["signal"]:
            known.add((message, found["signal"]))
    return [m for m in _ABOUT_SIGNAL.finditer(text) if (m["message"], m["signal"]) not in known]


def _place_of(text: str, start: int, statement: str) -> str:
    """Return a statement as a message shows it: its line and its beginning."""
    line = text.count("\n", 0, start) + 1
    return f"line {line}: {' '.join(statement.split()).rstrip(' ;')[:60]}"


def _refuse_endless(path: Path, text: str) -> None:
    """Refuse signals and messages that no bus carries: reading them takes minutes."""
    numbers = [n for found in _PLACES.finditer(text) for n in found.groups()]
    numbers += [found.group(1) for found in _SIZES.finditer(text)]
    for number in numbers:
        # The length first: Python reads no whole number of thousands of digits.
        if len(number.lstrip("0")) > len(str(MOST_BITS)) or int(number) > MOST_BITS:
            raise ConfigError(
                f"--dbc {path}: a signal or message of {number[:20]} bits or bytes; {MOST_BITS} "
                "are the most, correct the file"
            )


def message_frames(frames: Frames, database: Database) -> dict[str, NDArray[np.intp]]:
    """Indices of the frames of each message, by its name.

    A J1939 message is known by its parameter group, whatever the sender and
    the priority; any other by its whole identifier.
    """
    # 30 bits, so that an hour of traffic stays small; no frame has the key -1.
    key = ((frames.id.astype(np.int32) << 1) | frames.extended).astype(np.int32)
    if database.channel is not None:
        key[frames.channel != database.channel] = -1
    present = set(np.unique(key).tolist())
    group = None
    found = {}
    for message in database.messages:
        identifier = int(message.frame_id)
        if message.is_extended_frame and message.protocol == "j1939":
            if group is None:
                known = parameter_group(frames.id).astype(np.int64)
                group = np.where(frames.extended & (key >= 0), known, -1)
            at = np.flatnonzero(group == parameter_group(np.uint32(identifier)))
        else:
            wanted = identifier << 1 | bool(message.is_extended_frame)
            at = np.flatnonzero(key == wanted) if wanted in present else np.zeros(0, np.intp)
        if at.size:
            found[message.name] = at
    return found


def find_signal(name: str, databases: Sequence[Database], carried: Carried) -> list[Found]:
    """Signals called ``name`` or, with their message, ``message.name``, that frames carry."""
    message_name, _, signal_name = name.rpartition(".")
    return [
        Found(message, signal, frames[message.name])
        for database, frames in zip(databases, carried, strict=True)
        for message in database.messages
        if message.name in frames and message_name.casefold() in ("", message.name.casefold())
        for signal in message.signals
        if signal.name.casefold() == signal_name.casefold() and is_readable(signal)
    ]


def is_readable(signal: Any) -> bool:
    """Return whether a signal is a number of a size that can be taken out."""
    length = int(signal.length)
    return length in (16, 32, 64) if signal.is_float else 0 < length <= 64


def physical(frames: Frames, found: Found) -> tuple[Floats, NDArray[np.intp]]:
    """Physical values of one signal, in its own unit.

    Parameters
    ----------
    frames : all traffic
    found : the signal and where its message stands

    Returns
    -------
    values : (m,) where the frame is long enough, the multiplexer selects it and,
        in J1939, the sender has it; NaN where the database says that it is no value
    indices : (m,) of those frames
    """
    signal, message, at = found.signal, found.message, found.frames
    at = at[frames.length[at] >= _bytes_needed(signal)]
    at = at[_selected(frames, at, message, signal)]
    raw = _raw(frames.data[at], signal)
    if message.protocol == "j1939":
        reported = _available(raw, int(signal.length))
        raw, at = raw[reported], at[reported]
    scale, offset = float(signal.scale), float(signal.offset)
    values = np.asarray(raw * scale + offset, dtype=np.float64)
    values[_named_no_value(raw, signal)] = np.nan
    values[beyond(values, raw, signal)] = np.nan
    return values, at


def _named_no_value(raw: Floats | NDArray[np.int64], signal: Any) -> Bools:
    """Which raw values the database names as none, such as "SNA"."""
    named = {k: str(text) for k, text in (signal.choices or {}).items()}
    return np.isin(raw, [k for k, text in named.items() if is_no_value(text)])


def beyond(values: Floats, raw: Floats | NDArray[np.int64], signal: Any) -> Bools:
    """Which values are outside the range that the database declares, where it declares one.

    Where half of all are, the range is wrong, and only a raw value of ones alone is none.
    """
    low, high = signal.minimum, signal.maximum
    if low is None or high is None or not float(low) < float(high):
        return np.zeros(values.size, dtype=bool)
    slack = 0.5 * abs(float(signal.scale))
    outside = np.asarray((values < float(low) - slack) | (values > float(high) + slack))
    if signal.is_float:
        full = np.zeros(values.size, dtype=bool)
    else:
        full = np.asarray(raw >= (1 << (int(signal.length) - bool(signal.is_signed))) - 2)
    known = np.isfinite(values) & ~full
    count = int(np.count_nonzero(known))
    if count > _FEWEST and np.count_nonzero(outside & known) > _BELIEVED * count:
        return outside & full
    return outside


def _available(raw: Floats | NDArray[np.int64], length: int) -> Bools:
    """Which raw values of J1939 are values: the top of their range says "none" (J1939-71)."""
    if length % 8 == 0:
        return np.asarray(raw < 0xFB << (length - 8))
    return np.asarray(raw < (1 << length) - 1) if length > 1 else np.ones(raw.size, dtype=bool)


def _selected(frames: Frames, at: NDArray[np.intp], message: Any, signal: Any) -> Bools:
    """Which frames carry a multiplexed signal; multiplexers may be multiplexed themselves."""
    chosen = np.ones(at.size, dtype=bool)
    seen = set()
    while signal.multiplexer_ids is not None and signal.multiplexer_signal not in seen:
        seen.add(signal.multiplexer_signal)
        switch = next(s for s in message.signals if s.name == signal.multiplexer_signal)
        long_enough = frames.length[at] >= _bytes_needed(switch)
        chosen &= long_enough & np.isin(_raw(frames.data[at], switch), list(signal.multiplexer_ids))
        signal = switch
    return chosen


def _place(signal: Any) -> tuple[int, int]:
    """First bit and length, bits counted in the order they are read in."""
    start = int(signal.start)
    if signal.byte_order == "big_endian":
        # A DBC names the most significant bit, numbered from the low end of its byte.
        start = 8 * (start // 8) + 7 - start % 8
    return start, int(signal.length)


def _bytes_needed(signal: Any) -> int:
    start, length = _place(signal)
    return (start + length + 7) // 8


def _raw(data: NDArray[np.uint8], signal: Any) -> Floats | NDArray[np.int64]:
    """(n,) raw values of a signal of up to 64 bits; data shorter than it read as zero."""
    start, length = _place(signal)
    value = bits(data, start, length, big_endian=signal.byte_order == "big_endian")
    if signal.is_float:
        kinds = {16: ("<u2", "<f2"), 32: ("<u4", "<f4"), 64: ("<u8", "<f8")}
        whole, real = kinds[length]
        return value.astype(whole).view(real).astype(np.float64)
    if signal.is_signed:
        sign = np.uint64(1 << (length - 1))
        return ((value ^ sign) - sign).astype(np.int64)
    return value.astype(np.int64) if length < 64 else value.astype(np.float64)
