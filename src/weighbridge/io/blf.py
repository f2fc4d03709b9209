"""Vector BLF: frames out of its compressed containers, without a loop over frames.

The layout is that of the objects LOG_CONTAINER, CAN_MESSAGE, CAN_MESSAGE2,
CAN_FD_MESSAGE and CAN_FD_MESSAGE_64 as python-can documents and writes them.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weighbridge.errors import DriveError
from weighbridge.io.frames import EXTENDED_MASK, Frames, in_order
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.signals import Problem
from weighbridge.signals.words import counted

_Bytes = NDArray[np.uint8]

_CONTAINER: Final = 10
_OBJECT: Final = int.from_bytes(b"LOBJ", "little")
_HEADER: Final = 32
_CONTAINER_HEADER: Final = 32
_CONTAINER_LIMIT: Final = 1 << 26
# Containers decoded together: enough for few numpy calls, few enough for little memory.
_BATCH: Final = 1 << 24


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
    found = [_frames(buffer, at[kind == k], n) for k, n in _LAYOUTS.items() if (kind == k).any()]
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


class _Layout(NamedTuple):
    """Where an object of frames has what, in bytes after its header."""

    fixed: int
    flags: int
    remote: int
    channel_bytes: int
    length: int
    data: int
    most: int


_CLASSIC: Final = _Layout(fixed=16, flags=2, remote=0x80, channel_bytes=2, length=3, data=8, most=8)

_LAYOUTS: Final = {
    1: _CLASSIC,
    86: _CLASSIC,
    100: _Layout(fixed=84, flags=2, remote=0x80, channel_bytes=2, length=14, data=20, most=64),
    101: _Layout(fixed=40, flags=12, remote=0x10, channel_bytes=1, length=2, data=40, most=64),
}
"""By the number of the object: CAN_MESSAGE, CAN_MESSAGE2, CAN_FD_MESSAGE, CAN_FD_MESSAGE_64."""


def _frames(
    buffer: _Bytes, at: NDArray[np.int64], layout: _Layout
) -> tuple[NDArray[np.int64], Frames]:
    """Frames of the objects at ``at``, and where each of these stands."""
    body = at + _number(buffer, at + 4, 2)
    good = body + layout.fixed <= buffer.size
    at, body = at[good], body[good]
    # Remote frames carry no data.
    good = buffer[body + layout.flags] & layout.remote == 0
    at, body = at[good], body[good]
    identifier = _number(buffer, body + 4, 4)
    begin = body + layout.data
    length = np.minimum(_number(buffer, body + layout.length, 1), layout.most)
    if layout.data == layout.fixed:
        # A frame may claim more bytes than its object holds; the others read as zero.
        length = np.minimum(length, np.maximum(at + _number(buffer, at + 8, 4) - begin, 0))
    columns = np.arange(layout.most)
    places = np.minimum(begin[:, None] + columns, buffer.size - 1)
    ten_micros = _number(buffer, at + 16, 4) == 1
    return at, Frames(
        np.asarray(_number(buffer, at + 24, 8) * np.where(ten_micros, 1e-5, 1e-9)),
        _number(buffer, body, layout.channel_bytes).astype(np.int16),
        (identifier & EXTENDED_MASK).astype(np.uint32),
        (identifier & 0x80000000) != 0,
        length.astype(np.uint8),
        np.where(columns < length[:, None], buffer[places], 0).astype(np.uint8),
    )
