"""Frames of ASC, TRC and python-can's CSV, as python-can parses them."""

from __future__ import annotations

import logging
from array import array
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from weighbridge.errors import DriveError, MissingExtraError
from weighbridge.io.frames import EXTENDED_MASK, Frames
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.signals import Problem

CSV_HEADER: Final = "timestamp,arbitration_id,extended,remote,error,dlc,data"
"""First line of a CSV written by python-can."""

_EPOCH_LIKE: Final = 1e8
_LONGEST: Final = 64


def read_asc(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a Vector ASC log; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No frame in it.
    MissingExtraError
        python-can is not installed.
    """
    can = _library(path)
    with path.open("r", encoding="utf-8", errors="replace") as file:
        # Counts buses from 0 where the log counts from 1.
        return _read(path, can.ASCReader(file, relative_timestamp=False), 1)


def read_trc(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a PEAK TRC log; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No frame in it.
    MissingExtraError
        python-can is not installed.
    """
    can = _library(path)
    with path.open("r", encoding="utf-8", errors="replace") as file:
        return _read(path, can.TRCReader(file), 0)


def is_can_csv(path: Path) -> bool:
    """Tell whether a CSV begins as python-can writes them."""
    with path.open("rb") as file:
        return file.read(len(CSV_HEADER)).decode("latin-1") == CSV_HEADER


def read_can_csv(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a CSV written by python-can; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No frame in it.
    """
    try:
        cells = pl.read_csv(
            path.read_bytes(),
            infer_schema=False,
            ignore_errors=True,
            truncate_ragged_lines=True,
            quote_char=None,
            encoding="utf8-lossy",
        )
        rows = cells.select(
            pl.col("timestamp").cast(pl.Float64, strict=False),
            pl.col("arbitration_id").str.strip_prefix("0x").str.to_integer(base=16, strict=False),
            pl.col("extended") == "1",
            (pl.col("remote") == "1") | (pl.col("error") == "1"),
            pl.col("data").fill_null("").str.decode("base64", strict=False),
        )
    except pl.exceptions.PolarsError as error:
        reason = str(error).split("\n", 1)[0]
        raise DriveError(f"{path} cannot be read ({reason}); copy it again") from None
    usable = rows.drop_nulls().filter(
        (pl.col("data").bin.size() <= _LONGEST)
        & pl.col("arbitration_id").is_between(0, EXTENDED_MASK)
    )
    strange = len(rows) - len(usable)
    known = usable.filter(~pl.col("remote"))
    if len(known) == 0:
        raise DriveError(f"{path} holds no CAN frame that can be read; record it again")
    chunks = known["data"].to_list()
    width = max(8, *(len(c) for c in chunks))
    frames = Frames(
        known["timestamp"].to_numpy(),
        np.zeros(len(known), np.int16),
        known["arbitration_id"].cast(pl.UInt32).to_numpy(),
        known["extended"].to_numpy(),
        known["data"].bin.size().cast(pl.UInt8).to_numpy(),
        np.frombuffer(b"".join(c.ljust(width, b"\0") for c in chunks), np.uint8).reshape(-1, width),
    )
    log = Log(path, absolute=bool(np.median(frames.time) > _EPOCH_LIKE), frames=frames)
    if strange:
        log.problems.append(
            Problem(
                "", f"{path.name}: {strange} of {len(rows)} lines are no frames and were left out"
            )
        )
    return log


def _library(path: Path) -> Any:
    try:
        import can
    except ImportError:
        raise MissingExtraError("python-can", "can", f"reading {path.name}") from None
    logging.getLogger("can").setLevel(logging.ERROR)
    return can


def _read(path: Path, messages: Iterable[Any], first_channel: int) -> Log:
    time, identifier = array("d"), array("L")
    channel, length = array("h"), array("B")
    flags, data = bytearray(), bytearray()
    found: list[str] = []
    for m in _until_damaged(messages, found):
        if m.is_error_frame or m.is_remote_frame:
            continue
        content = bytes(m.data[:_LONGEST])
        time.append(m.timestamp)
        identifier.append(m.arbitration_id & EXTENDED_MASK)
        flags.append(m.is_extended_id)
        bus = m.channel if isinstance(m.channel, int) else 0
        channel.append(min(max(bus + first_channel, 0), 32_000))
        length.append(len(content))
        data += content.ljust(_LONGEST, b"\0")
    damage = found[0] if found else ""
    if not time:
        raise DriveError(
            f"{path} holds no CAN frame that can be read{f' ({damage})' if damage else ''}; "
            "record it again, or copy it again"
        )
    sizes = np.array(length, np.uint8)
    width = 8 if sizes.max() <= 8 else _LONGEST
    frames = Frames(
        np.array(time),
        np.array(channel, np.int16),
        np.array(identifier, np.uint32),
        np.frombuffer(flags, np.bool_).copy(),
        sizes,
        np.frombuffer(data, np.uint8).reshape(-1, _LONGEST)[:, :width].copy(),
    )
    log = Log(path, absolute=bool(np.median(frames.time) > _EPOCH_LIKE), frames=frames)
    if damage:
        log.problems.append(
            Problem(
                "",
                f"{path.name} is damaged or was cut off ({damage}); {len(frames)} frames could be "
                "read",
            )
        )
    return log


def _until_damaged(messages: Iterable[Any], damage: list[str]) -> Iterator[Any]:
    """Messages up to the first that the library cannot parse."""
    try:
        yield from messages
    # The library's errors on damaged text are of many kinds.
    except Exception as error:
        damage.append((str(error).split("\n", 1)[0] or type(error).__name__)[:80])
