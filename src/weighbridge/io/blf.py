"""Vector BLF: frames out of its compressed containers, without a loop over frames.

The layout is that of the objects LOG_CONTAINER, CAN_MESSAGE, CAN_MESSAGE2,
CAN_FD_MESSAGE and CAN_FD_MESSAGE_64 as python-can documents and writes them.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.errors import DriveError
from weighbridge.io.frames import EXTENDED_MASK, Frames, in_order
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.signals import Floats, Problem
from weighbridge.signals.words import counted

_Bytes = NDArray[np.uint8]
_Part = tuple[NDArray[np.int64], Frames]

_CAN: Final = 1
_CAN_2: Final = 86
_CONTAINER: Final = 10
_CAN_FD: Final = 100
_CAN_FD_64: Final = 101
_OBJECT: Final = int.from_bytes(b"LOBJ", "little")
_HEADER: Final = 32
_CONTAINER_HEADER: Final = 32
_CONTAINER_LIMIT: Final = 1 << 26
# Containers decoded together: enough for few numpy calls, few enough for little memory.
_BATCH: Final = 1 << 24

_REMOTE: Final = 0x80
_REMOTE_FD_64: Final = 0x10


def read_blf(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a BLF file; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        Not a BLF file, or without one CAN frame that can be read.
    """
    raw = path.read_bytes()
    if raw[:4] != b"LOGG" or len(raw) < 72:
        raise DriveError(f"{path} is not a BLF file: it must begin with 'LOGG'; copy it again")
    (header,) = struct.unpack_from("<L", raw, 4)
    start = _start(raw)
    log = Log(path, absolute=start is not None)
    parts: list[Frames] = []
    batch = bytearray()
    damaged = 0
    for content in _containers(raw, header):
        if content is None:
            damaged += 1
            continue
        batch += content
        if len(batch) >= _BATCH:
            rest = _decode(bytes(batch), parts)
            batch = bytearray(rest)
    left = _decode(bytes(batch), parts)
    if damaged or left.strip(b"\0")[:4] == b"LOBJ":
        log.problems.append(
            Problem.of(
                "file.damaged", file=path.name, frames=counted(sum(map(len, parts)), "frame")
            )
        )
    if not parts:
        raise DriveError(
            f"{path} holds no CAN frame that can be read; record it again, or copy it again"
        )
    frames = in_order(parts)
    log.frames = replace(frames, time=frames.time + (start or 0.0))
    return log


def _start(raw: bytes) -> float | None:
    """When the log began [s since 1970], in the clock of the logger; None if not reported."""
    year, month, _, day, hour, minute, second, milli = struct.unpack_from("<8H", raw, 40)
    try:
        return datetime(
            year, month, day, hour, minute, second, milli * 1000, tzinfo=UTC
        ).timestamp()
    except ValueError:
        return None


def _containers(raw: bytes, at: int) -> Iterator[bytes | None]:
    """Contents of the containers of a file; None for one that is damaged."""
    while at + _CONTAINER_HEADER <= len(raw):
        signature, _, _, size, kind = struct.unpack_from("<4sHHLL", raw, at)
        if signature != b"LOBJ" or size < 16:
            found = raw.find(b"LOBJ", at + 1)
            yield None
            if found < 0:
                return
            at = found
            continue
        end = at + size
        if kind == _CONTAINER:
            method, unpacked = struct.unpack_from("<H6xL", raw, at + 16)
            packed = memoryview(raw)[at + _CONTAINER_HEADER : end]
            if method == 0:
                yield bytes(packed)
            else:
                unzip = zlib.decompressobj()
                try:
                    yield unzip.decompress(packed, min(unpacked, _CONTAINER_LIMIT) or 1)
                except zlib.error:
                    yield None
        else:
            yield raw[at:end]
        if end > len(raw):
            yield None
            return
        at = end + size % 4


def _decode(batch: bytes, parts: list[Frames]) -> bytes:
    """Append the frames of a batch to ``parts``; return what belongs to the next one."""
    buffer = np.frombuffer(batch, np.uint8)
    at, end = _objects(buffer)
    kind = _number(buffer, at + 12, 4)
    found = [d(buffer, at[kind == k]) for k, d in _DECODERS.items() if (kind == k).any()]
    if found:
        # The objects of several kinds, back in the order they were written in.
        order = np.argsort(np.concatenate([a for a, _ in found]), kind="stable")
        joined = in_order([f for _, f in found])
        if len(joined):
            parts.append(joined if len(found) == 1 else joined.select(order))
    return batch[end:]


def _objects(buffer: _Bytes) -> tuple[NDArray[np.int64], int]:
    """Where the whole objects of a buffer begin, and where what is left over does.

    Every place that reads LOBJ is a candidate; those inside an object's data
    are found because the object before them says where it ends.
    """
    hits = []
    for shift in range(4):
        words = buffer[shift : shift + (buffer.size - shift) // 4 * 4].view("<u4")
        hits.append(np.flatnonzero(words == _OBJECT) * 4 + shift)
    at = np.sort(np.concatenate(hits))
    at = at[at + _HEADER <= buffer.size]
    length = np.maximum(_number(buffer, at + 8, 4), 16)
    keep = np.ones(at.size, dtype=bool)
    # An object's end may be padded by up to 3 bytes.
    ends = at + length
    wrong = np.flatnonzero(at[1:] < ends[:-1]) + 1
    before = 0
    for k in wrong:
        before = max(before, int(k) - 1)
        while not keep[before]:
            before -= 1
        keep[k] = at[k] >= ends[before]
    at, ends = at[keep], ends[keep]
    whole = ends <= buffer.size
    if not whole.all():
        return at[whole], int(at[np.argmin(whole)])
    # What is too short for an object's header may be the beginning of one.
    return at, max(int(ends[-1]) if at.size else 0, buffer.size - _HEADER)


def _number(buffer: _Bytes, at: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    """(n,) little-endian numbers of up to 8 bytes."""
    value = np.zeros(at.size, np.uint64)
    for k in range(size):
        value |= buffer[at + k].astype(np.uint64) << np.uint64(8 * k)
    return value.astype(np.int64)


def _time(buffer: _Bytes, at: NDArray[np.int64]) -> Floats:
    """Time stamps since the start of the log [s]."""
    ten_micros = _number(buffer, at + 16, 4) == 1
    return np.asarray(_number(buffer, at + 24, 8) * np.where(ten_micros, 1e-5, 1e-9))


def _frames(
    buffer: _Bytes,
    at: NDArray[np.int64],
    channel: NDArray[np.int64],
    identifier: NDArray[np.int64],
    length: NDArray[np.int64],
    begin: NDArray[np.int64],
    width: int,
) -> Frames:
    """Frames of objects at ``at`` whose data begin at ``begin``."""
    length = np.clip(length, 0, width)
    columns = np.arange(width)
    places = np.minimum(begin[:, None] + columns, buffer.size - 1)
    return Frames(
        _time(buffer, at),
        channel.astype(np.int16),
        (identifier & EXTENDED_MASK).astype(np.uint32),
        (identifier & 0x80000000) != 0,
        length.astype(np.uint8),
        np.where(columns < length[:, None], buffer[places], 0).astype(np.uint8),
    )


def _can(buffer: _Bytes, at: NDArray[np.int64]) -> _Part:
    at, body = _inside(buffer, at, 16)
    at, body = _data_only(at, body, buffer[body + 2] & _REMOTE)
    channel, identifier = _number(buffer, body, 2), _number(buffer, body + 4, 4)
    length = _number(buffer, body + 3, 1)
    return at, _frames(buffer, at, channel, identifier, length, body + 8, 8)


def _can_fd(buffer: _Bytes, at: NDArray[np.int64]) -> _Part:
    at, body = _inside(buffer, at, 84)
    at, body = _data_only(at, body, buffer[body + 2] & _REMOTE)
    channel, identifier = _number(buffer, body, 2), _number(buffer, body + 4, 4)
    length = _number(buffer, body + 14, 1)
    return at, _frames(buffer, at, channel, identifier, length, body + 20, 64)


def _can_fd_64(buffer: _Bytes, at: NDArray[np.int64]) -> _Part:
    at, body = _inside(buffer, at, 40)
    at, body = _data_only(at, body, buffer[body + 12] & _REMOTE_FD_64)
    channel, identifier = _number(buffer, body, 1), _number(buffer, body + 4, 4)
    # A frame may claim more bytes than its object holds; the others read as zero.
    room = np.maximum(at + _number(buffer, at + 8, 4) - (body + 40), 0)
    length = np.minimum(_number(buffer, body + 2, 1), room)
    return at, _frames(buffer, at, channel, identifier, length, body + 40, 64)


def _data_only(
    at: NDArray[np.int64], body: NDArray[np.int64], remote: NDArray[np.integer]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Leave remote frames out: they carry no data."""
    return at[remote == 0], body[remote == 0]


def _inside(
    buffer: _Bytes, at: NDArray[np.int64], size: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where bodies begin, of the objects whose fixed part of ``size`` is in the buffer."""
    body = at + _number(buffer, at + 4, 2)
    good = body + size <= buffer.size
    return at[good], body[good]


_DECODERS: Final[dict[int, Callable[[_Bytes, NDArray[np.int64]], _Part]]] = {
    _CAN: _can,
    _CAN_2: _can,
    _CAN_FD: _can_fd,
    _CAN_FD_64: _can_fd_64,
}
