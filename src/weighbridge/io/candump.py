"""candump text (can-utils): the log of ``candump -l`` or what it shows, read in columns."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

from weighbridge.errors import DriveError
from weighbridge.io.frames import EXTENDED_MASK, Frames, in_order
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.signals import Problem

# (1436509052.249713) can0 18FEF100#FFFF0000 or 123##1DEADBEEF with CAN FD's flags
_LINE: Final = (
    r"^\s*\((\d+\.?\d*)\)\s+(\S+)\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?:#[0-9A-Fa-f])?"
    r"((?:[0-9A-Fa-f]{2}){0,64})(?:\s.*)?$"
)
# (000.005001)  can0  18FEDF00   [8]  8A A0 28 7D 7D FF FF F5
_SHOWN: Final = (
    r"^\s*\((\d+\.?\d*)\)\s+(\S+)\s+(?:[RT]X\s+\S+\s+)?([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})"
    r"\s+\[\d+\]((?:\s+[0-9A-Fa-f]{2}){0,64})\s*(?:'.*)?$"
)
_REMOTE: Final = r"#R|remote request"
_ERROR_FLAG: Final = 0x20000000
_BLOCK: Final = 1 << 25
_EPOCH_LIKE: Final = 1e8
"""Stamps above count from 1970, not from the start of the log [s]."""


def read_candump(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a candump log; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No line of the file is one of candump.
    """
    parts: list[Frames] = []
    channels: dict[str, int] = {}
    lines = strange = 0
    for block in whole_lines(path):
        frames, total, bad = _parse(block, channels)
        lines, strange = lines + total, strange + bad
        parts.append(frames)
    frames = in_order(parts)
    if not len(frames):
        raise DriveError(
            f"{path}: no line reads like candump's (1436509052.249713) can0 123#DEADBEEF; "
            "record it with candump -l, or convert it"
        )
    log = Log(path, absolute=bool(np.median(frames.time) > _EPOCH_LIKE), frames=frames)
    if strange:
        log.problems.append(
            Problem("", f"{path.name}: {strange} of {lines} lines are no frames and were left out")
        )
    return log


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


def _parse(block: bytes, channels: dict[str, int]) -> tuple[Frames, int, int]:
    """Frames of a block of lines, how many lines there are, how many say nothing."""
    if (quick := _parse_plain(block, channels)) is not None:
        return quick, len(quick), 0
    text = pl.Series("line", [block.decode("ascii", "replace")]).str.split("\n").explode()
    text = text.str.strip_chars_end("\r").filter(text.str.len_bytes() > 1)
    shown = bool(text[:100].str.contains(r"\s\[\d+\]").any())
    columns = text.str.extract_groups(_SHOWN if shown else _LINE).struct.unnest()
    columns.columns = ["time", "bus", "id", "data"]
    if shown:
        columns = columns.with_columns(pl.col("data").str.replace_all(r"\s", ""))
    known = columns.filter(pl.col("data").is_not_null())
    remote = int(text.str.contains(_REMOTE).sum())
    strange = len(text) - len(known) - remote
    return _frames(known, channels), len(text), strange


def _parse_plain(block: bytes, channels: dict[str, int]) -> Frames | None:
    """Frames of a block that holds nothing but data frames of classic CAN; None of any other."""
    try:
        columns = pl.read_csv(
            block, has_header=False, separator=" ", quote_char=None, infer_schema=False,
            new_columns=["time", "bus", "frame"],
        )  # fmt: skip
        if columns.width != 3:
            return None
        columns = columns.select(
            pl.col("time").str.strip_prefix("(").str.strip_suffix(")").cast(pl.Float64),
            "bus",
            pl.col("frame").str.strip_chars_end("\r").str.split_exact("#", 1).alias("frame"),
        ).unnest("frame")
        columns.columns = ["time", "bus", "id", "data"]
        sound = columns.select(
            sound=(
                pl.col("id").str.len_bytes().is_in([3, 8])
                & (pl.col("data").str.len_bytes() % 2 == 0)
                & (pl.col("data").str.len_bytes() <= 16)
                & pl.col("time").is_not_null()
            ).all()
        )
        return _frames(columns, channels) if sound["sound"][0] else None
    except pl.exceptions.PolarsError:
        return None


def _frames(known: pl.DataFrame, channels: dict[str, int]) -> Frames:
    """Data frames of columns of text; error frames are left out."""
    identifier = known["id"].str.to_integer(base=16, dtype=pl.UInt32).to_numpy()
    buses = known["bus"]
    for bus in buses.unique(maintain_order=True):
        channels.setdefault(bus, _number(bus, channels))
    length, data = bytes_of_hex(known["data"])
    frames = Frames(
        known["time"].cast(pl.Float64).to_numpy(),
        buses.replace_strict(channels, return_dtype=pl.Int16).to_numpy(),
        identifier & np.uint32(EXTENDED_MASK),
        known["id"].str.len_bytes().to_numpy() == 8,
        length,
        data,
    )
    error = frames.extended & ((identifier & np.uint32(_ERROR_FLAG)) != 0)
    return frames.select(~error) if error.any() else frames


def _number(bus: str, taken: dict[str, int]) -> int:
    """Number of an interface: the one it ends in, or the first one free."""
    found = re.search(r"\d{1,3}$", bus)
    if found and int(found.group()) not in taken.values():
        return int(found.group())
    return next(k for k in range(1000) if k not in taken.values())


def bytes_of_hex(text: pl.Series) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Lengths (n,) and bytes (n, 8 to 64) of hexadecimal text."""
    length = (text.str.len_bytes() // 2).cast(pl.UInt8).to_numpy()
    width = max(8, int(length.max())) if length.size else 8
    padded = text.str.pad_end(2 * width, "0").str.decode("hex")
    joined = b"".join(padded.to_list()) if len(text) else b""
    return length, np.frombuffer(joined, np.uint8).reshape(-1, width)
