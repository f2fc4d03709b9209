"""candump text (can-utils): the log of ``candump -l``, or what it shows on a terminal."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.frames import Frames, in_order
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.io.understood import Lines
from weighbridge.kernels.frame_text import FrameRows, parse_candump

_BLOCK: Final = 1 << 25
_HEAD: Final = 4096
_INTERFACES: Final = 256
_EPOCH_LIKE: Final = 1e8
"""Stamps above count from 1970, not from the start of the log [s]."""


_DATED: Final = re.compile(rb"\((\d{4}-\d\d-\d\d \d\d:\d\d:\d\d)(\.\d+)?\)")
"""A stamp of ``candump -tA``: date and time of day, by the clock of the computer."""

_FALLS: Final = 0.2
"""Part of the stamps that do not rise, from which they are times since the frame before [-]."""

_LINE: Final = re.compile(
    rb"(?:\xef\xbb\xbf)?\s*"
    rb"(?P<stamp>\((?:\d{4}-\d\d-\d\d \d\d:\d\d:)?\d+(?:\.\d+)?\)\s+)?"
    rb"\w+\s+(?:[RT]X\s+\S+\s+\S+\s+)?"
    rb"[0-9A-Fa-f]{3,8}(?:#|\s+\[\d{1,2}\](?:\s|$))"
)


def is_candump(head: bytes) -> bool:
    """Tell whether a text begins with a line of candump."""
    return _LINE.match(head) is not None


def read_candump(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a candump log; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No line of the file is one of candump.
    """
    parts: list[Frames] = []
    channels: dict[str, int] = {}
    lines = Lines()
    for block in whole_lines(path):
        block = _DATED.sub(_seconds, block) if _DATED.search(block, 0, _HEAD) else block
        frames, total, bad, first = _parse(block, channels)
        lines.add(block, total, bad, first)
        parts.append(frames)
    frames = in_order(parts)
    if not len(frames):
        with path.open("rb") as file:
            begins = _LINE.match(file.read(_HEAD))
        if begins is not None and begins["stamp"] is None:
            raise DriveError(
                f"{path}: its frames have no times, without which nothing can be weighed; record "
                "it with candump -l"
            )
        raise DriveError(
            f"{path}: no line reads like candump's (1436509052.249713) can0 123#DEADBEEF; "
            "record it with candump -l, or convert it"
        )
    if float(np.max(frames.time)) < _EPOCH_LIKE and frames.time.size > 1:
        # candump -td gives the time since the frame before.
        falls = np.mean(np.diff(frames.time) <= 0.0) if frames.time[0] == 0.0 else 0.0
        if falls > _FALLS and np.ptp(frames.time) > 0.0:
            frames = replace(frames, time=np.cumsum(frames.time))
    log = Log(path, absolute=bool(np.median(frames.time) > _EPOCH_LIKE), frames=frames)
    log.problems += lines.problems("file.lines_left_out", path)
    return log


def _seconds(stamp: re.Match[bytes]) -> bytes:
    """Write a date as seconds since 1970, in the time zone of this computer."""
    return b"(%d%s)" % (_since_1970(stamp[1]), stamp[2] or b"")


@lru_cache(maxsize=16)
def _since_1970(date: bytes) -> int:
    return int(datetime.fromisoformat(date.decode("ascii")).timestamp())


def whole_lines(path: Path) -> Iterator[bytes]:
    """Whole lines of a text file, many at a time."""
    with path.open("rb") as file:
        rest = b""
        while block := file.read(_BLOCK):
            block = rest + block
            end = block.rfind(b"\n") + 1
            if end == 0 and len(block) > 4 * _BLOCK:
                return
            rest = block[end:]
            if end:
                yield block[:end]
        if rest:
            yield rest


def room(text: bytes, width: int) -> FrameRows:
    """Room for one frame a line, of up to ``width`` bytes."""
    n = text.count(b"\n") + 1
    return FrameRows(
        np.zeros(n), np.zeros(n, np.int16), np.zeros(n, np.uint32), np.zeros(n, np.bool_),
        np.zeros(n, np.uint8), np.zeros((n, width), np.uint8),
    )  # fmt: skip


def filled(rows: FrameRows, count: int, start: float = 0.0) -> Frames:
    """Frames of the first ``count`` rows, their stamps counted from ``start`` [s]."""
    return Frames(rows[0][:count] + start, *(r[:count].copy() for r in rows[1:]))


def _parse(block: bytes, channels: dict[str, int]) -> tuple[Frames, int, int, int]:
    """Frames of a block of lines, how many lines there are, how many are no frames, the first."""
    text = np.frombuffer(block, np.uint8)
    buses = np.zeros((_INTERFACES, 2), np.int64)
    for width in (8, 64):
        rows = room(block, width)
        count, lines, strange, first, seen, longest = parse_candump(text, rows, buses)
        if longest <= width:
            break
    numbers = np.zeros(max(seen, 1), np.int16)
    for k, (start, end) in enumerate(buses[:seen].tolist()):
        name = block[start:end].decode("ascii", "replace")
        numbers[k] = channels.setdefault(name, _number(name, channels))
    frames = filled(rows, count)
    return replace(frames, channel=numbers[frames.channel]), lines, strange, first


def _number(bus: str, taken: dict[str, int]) -> int:
    """Number of an interface: the one it ends in, or the first one free."""
    found = re.search(r"\d{1,3}$", bus)
    if found and int(found.group()) not in taken.values():
        return int(found.group())
    return next(k for k in range(1000) if k not in taken.values())
