"""CAN frames out of tables of text: SavvyCAN's GVRET CSV and the CRTD of OVMS.

GVRET CSV, as SavvyCAN writes it: ``Time Stamp,ID,Extended[,Dir],Bus,LEN,D1,…,D8``, the time in
microseconds, identifier and bytes hexadecimal. CRTD: one record a line, ``seconds [bus]R11 id
bytes``; R for received, T for sent, 11 or 29 bits (Open Vehicles, *CRTD CAN Log Format*).
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl

from weighbridge.errors import DriveError
from weighbridge.io.candump import whole_lines
from weighbridge.io.frames import EXTENDED_MASK, Frames, in_order
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.io.quiet import PARSE_ERRORS, first_line, quietly
from weighbridge.io.understood import Lines

_GVRET: Final = re.compile(rb"^(?:\xef\xbb\xbf)?time ?stamp,id,extended,(?:dir,)?bus,len,d1,", re.I)
_CRTD: Final = re.compile(rb"^\d+(?:\.\d+)? \d?(?:C[A-Z]{2}|[RT](?:11|29))\b")
_RECORD: Final = (
    r"^(\d+(?:\.\d+)?) (\d)?[RT](11|29) ([0-9A-Fa-f]{1,8})((?: [0-9A-Fa-f]{2}){0,64})\s*$"
)
_OTHER: Final = r"^\S+ \d?C[A-Z]{2}\b"

_SHORTEST: Final = 8
_LONGEST: Final = 64
_EPOCH: Final = 1e8


def is_gvret(head: bytes) -> bool:
    """Tell whether a CSV begins as SavvyCAN's do."""
    return _GVRET.match(head) is not None


def is_crtd(head: bytes) -> bool:
    """Tell whether a text begins with a record of CRTD."""
    return _CRTD.match(head) is not None


def read_gvret(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a GVRET CSV; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No frame in it.
    """
    parts: list[Frames] = []
    names: list[str] = []
    lines = Lines()
    factor = 1e-6
    for block in whole_lines(path):
        head = b""
        if not names:
            head, _, block = block.partition(b"\n")
            cells = head.decode("utf-8-sig", "replace").strip().lower().split(",")
            names = [n.replace(" ", "") for n in cells[: cells.index("d1")]]
            # A stamp with a point is in seconds, as other programs write this form.
            factor = 1.0 if b"." in block.split(b",", 1)[0] else 1e-6
        if not block.strip():
            continue
        rows = _gvret_rows(path, block, names, _SHORTEST)
        if (rows["length"] > _SHORTEST).any():
            rows = _gvret_rows(path, block, names, _LONGEST)
        fits = (pl.col("data").bin.size() == pl.col("length")).fill_null(False)
        frames = frames_of_table(rows.filter(fits).with_columns(time=pl.col("time") * factor))
        bad = rows.height - len(frames)
        strange = np.flatnonzero(~rows.select(_whole() & fits).to_series())
        top = 1 if head else 0
        first = int(strange[0]) + 1 + top if strange.size else 0
        lines.add(b"\n" * top + block, rows.height, bad, first)
        parts.append(frames)
    return _log(path, in_order(parts), lines)


def _gvret_rows(path: Path, block: bytes, names: list[str], width: int) -> pl.DataFrame:
    """Rows of a block of lines, of up to ``width`` bytes."""
    cells = [f"d{k}" for k in range(1, width + 1)]
    plain = {n: pl.col(n).str.strip_chars() for n in names}
    length = plain["len"].cast(pl.Int64, strict=False)
    data = pl.concat_str([pl.col(c).str.strip_chars().str.zfill(2).fill_null("") for c in cells])
    try:
        with quietly():
            # With a header of its own, the width does not hang on the first row.
            rows = pl.read_csv(
                ",".join([*names, *cells]).encode() + b"\n" + block,
                schema=dict.fromkeys([*names, *cells], pl.String),
                truncate_ragged_lines=True,
                quote_char=None,
                encoding="utf8-lossy",
            )
            return rows.select(
                time=plain["timestamp"].cast(pl.Float64, strict=False),
                channel=plain["bus"].cast(pl.Int16, strict=False),
                id=plain["id"].str.to_integer(base=16, strict=False),
                extended=plain["extended"].str.to_lowercase() == "true",
                data=data.str.slice(0, 2 * length).str.decode("hex", strict=False),
                length=length,
            )
    except PARSE_ERRORS as error:
        raise DriveError(f"{path} cannot be read ({first_line(error)}); copy it again") from None


def read_crtd(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a CRTD log; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No frame in it.
    """
    parts: list[Frames] = []
    lines = Lines()
    for block in whole_lines(path):
        text = pl.Series(block.decode("utf-8", "replace").split("\n"), dtype=pl.String)
        # Blank lines and records of other kinds, such as remarks and events, hold no frame.
        other = text.str.contains(_OTHER) | (text.str.strip_chars() == "")
        groups = text.str.extract_groups(_RECORD).struct.unnest()
        rows = groups.select(
            time=pl.col("1").cast(pl.Float64, strict=False),
            # The bus of version 1 of the format, which had one.
            channel=pl.col("2").fill_null("1").cast(pl.Int16),
            id=pl.col("4").str.to_integer(base=16, strict=False),
            extended=pl.col("3") == "29",
            data=pl.col("5").str.replace_all(" ", "").str.decode("hex", strict=False),
        )
        frames = frames_of_table(rows)
        total = int((~other).sum())
        strange = np.flatnonzero(~(rows.select(_whole()).to_series() | other))
        first = int(strange[0]) + 1 if strange.size else 0
        lines.add(block, total, total - len(frames), first)
        parts.append(frames)
    return _log(path, in_order(parts), lines)


def _whole() -> pl.Expr:
    """Whether a row has all its cells."""
    return pl.all_horizontal(pl.all().is_not_null())


def frames_of_table(table: pl.DataFrame) -> Frames:
    """Make frames of rows; those with an empty cell or an impossible value are left out.

    Parameters
    ----------
    table : columns time [s], channel, id, extended (bool) and data (binary), and others
    """
    rows = (
        table.select("time", "channel", "id", "extended", "data")
        .drop_nulls()
        .filter(
            (pl.col("data").bin.size() <= _LONGEST)
            & pl.col("id").is_between(0, EXTENDED_MASK)
            & pl.col("time").is_finite()
        )
    )
    chunks = rows["data"].to_list()
    width = max([8, *map(len, chunks)])
    flat = np.frombuffer(b"".join(c.ljust(width, b"\0") for c in chunks), np.uint8)
    return Frames(
        np.array(rows["time"].to_numpy(), dtype=np.float64),
        rows["channel"].cast(pl.Int16).to_numpy(),
        rows["id"].cast(pl.UInt32).to_numpy(),
        rows["extended"].to_numpy(),
        rows["data"].bin.size().cast(pl.UInt8).to_numpy(),
        flat.reshape(-1, width),
    )


def _log(path: Path, frames: Frames, lines: Lines) -> Log:
    problems = lines.problems("file.lines_left_out", path)
    if not len(frames):
        raise DriveError(f"{path} holds no CAN frame that can be read; record it again")
    log = Log(path, absolute=bool(np.median(frames.time) > _EPOCH), frames=frames)
    log.problems += problems
    return log
