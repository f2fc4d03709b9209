"""CAN frames out of text whose header says what stands where: tables with named columns, the text
windows of Kvaser's CanKing, and BUSMASTER's logs.

Tables are those of CSS Electronics (CLX000), Kvaser and Vehicle Spy, and any other that names a
time, an identifier and bytes. The forms are those that descriptions give; no file of these tools
was at hand.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl

from weighbridge.errors import DriveError
from weighbridge.io.bus_text import frames_of_table
from weighbridge.io.candump import whole_lines
from weighbridge.io.draft_time import is_number, text_time_format
from weighbridge.io.frames import Frames, in_order
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.io.table import SEPARATORS, cells, unwrapped
from weighbridge.io.understood import Lines

_NAMES: Final[Mapping[str, frozenset[str]]] = {
    "time": frozenset(
        ("time", "timestamp", "time stamp", "abs time", "time s", "abs time sec", "time sec",
         "absolute time", "timestampepoch")
    ),
    "id": frozenset(
        ("id", "arb id", "arbid", "can id", "canid", "identifier", "arbitration id", "msg id",
         "message id", "id hex", "can id hex")
    ),
    "extended": frozenset(("extended", "ext", "xtd", "ide", "type", "flags", "frame type")),
    "bus": frozenset(("channel", "bus", "network", "chn", "busid", "busnum")),
    "length": frozenset(("dlc", "len", "length", "size", "datalength")),
    "data": frozenset(("data", "payload", "data bytes", "databytes", "data hex", "bytes")),
}  # fmt: skip
"""What columns of frames are called."""

_BYTE: Final = re.compile(r"(?:b|d|data|byte|data ?byte|byte ?data) ?(\d{1,2})$")
_EXTENDED: Final = frozenset(("1", "t", "true", "x", "e", "ext", "extended", "xtd", "yes"))
"""What says that an identifier has 29 bits; 1 is CLX000's type."""

_HEAD_LINES: Final = 60
_EPOCH: Final = 1e8
_STANDARD: Final = 0x7FF
_CLX_TIME: Final = "%Y%m%dT%H%M%S%3f"

_BUSMASTER: Final = re.compile(rb"\s*\*\*\*BUSMASTER", re.IGNORECASE)
_BUSMASTER_LINE: Final = (
    r"^(\d+):(\d+):(\d+):(\d+) [RT]x (\d+) (?:0x)?([0-9A-Fa-f]+) ([sx])\w* \d+"
    r"((?: [0-9A-Fa-f]{1,3})*)\s*$"
)
_CANKING: Final = re.compile(rb"\s*Chn\s+Identifier\s+Flg\b", re.IGNORECASE)
_CANKING_LINE: Final = (
    r"^\s*(\d+)\s+([0-9A-Fa-f]{3,8})\s+(X?)[ RTEWN]*?(\d{1,2})((?:\s+[0-9A-Fa-f]{1,3})*)"
    r"\s+(\d+\.\d+)\s+[RT]\s*$"
)


def is_busmaster(head: bytes) -> bool:
    """Tell whether a text begins as BUSMASTER's logs do."""
    return _BUSMASTER.match(head) is not None


def is_canking(head: bytes) -> bool:
    """Tell whether a text begins with the header of CanKing's window."""
    return _CANKING.match(head) is not None


def is_frame_table(head: bytes) -> bool:
    """Tell whether a text begins with a table of frames that names its columns."""
    lines = head.removeprefix(b"\xef\xbb\xbf").decode("utf-8", "replace").splitlines()
    return _table_header(lines) is not None


def _plain(name: str) -> str:
    return " ".join(re.findall(r"[a-z]+|\d+", name.lower()))


def _table_header(lines: Sequence[str]) -> tuple[int, str, dict[str, int], list[int]] | None:
    """Find the header of a table of frames.

    Returns
    -------
    Line, separator, places of what `_NAMES` lists, and those of single bytes; None where there is
    none
    """
    for k, line in enumerate(lines[:_HEAD_LINES]):
        separator = max(SEPARATORS, key=line.count)
        names = [_plain(cell) for cell in cells(line, separator)]
        places = {
            what: next((i for i, name in enumerate(names) if name in said), -1)
            for what, said in _NAMES.items()
        }
        single = [i for i, name in enumerate(names) if _BYTE.match(name)]
        if min(places["time"], places["id"]) >= 0 and (single or places["data"] >= 0):
            return k, separator, places, single
    return None


def read_frame_table(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a table with named columns; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No frame in it, or no header.
    """
    parts: list[Frames] = []
    lines = Lines()
    header = None
    for block in whole_lines(path):
        text = block.decode("utf-8-sig", "replace").replace("\r", "")
        skipped = 0
        if header is None:
            header = _table_header(text.split("\n", _HEAD_LINES))
            if header is None:
                break
            skipped = header[0] + 1
        rows = text.split("\n")[skipped:]
        frames, strange = _table_frames(rows, *header[1:])
        first = skipped + strange[0] + 1 if strange else 0
        lines.add(block, len(frames) + len(strange), len(strange), first)
        parts.append(frames)
    return _log(path, parts, lines)


def _table_frames(
    rows: Sequence[str], separator: str, places: Mapping[str, int], single: Sequence[int]
) -> tuple[Frames, list[int]]:
    """Frames of rows, and the places of rows that are none."""
    quote = '"' if any('"' in row for row in rows[:100]) else ""
    texts = pl.Series([row.replace(quote, "") if quote else row for row in rows], dtype=pl.String)
    parts = texts.str.split(separator)

    def column(place: int) -> pl.Series:
        return parts.list.get(place, null_on_oob=True).str.strip_chars()

    number = column(places["id"]).str.to_lowercase().str.strip_prefix("0x")
    decimal = False
    if single:
        said = pl.DataFrame({str(k): column(k).str.strip_prefix("0x") for k in single})
        # A byte of three digits is decimal.
        decimal = any(one.str.contains(r"^\d{3}$").any() for one in said)
        text = said.select(pl.concat_str(pl.all().fill_null(""), separator=" ")).to_series()
        data = _bytes(text, decimal=decimal)
    else:
        data = _bytes(column(places["data"]).str.replace_all(r"[:\-]|0x", " "), decimal=False)
    base = 10 if decimal else 16
    if places["length"] >= 0:
        size = column(places["length"]).cast(pl.Int64, strict=False)
        cut = pl.DataFrame({"data": data, "size": size.fill_null(64)})
        data = cut.select(pl.col("data").bin.slice(0, pl.col("size"))).to_series()
    identifier = number.str.to_integer(base=base, strict=False)
    extended = identifier > _STANDARD
    if places["extended"] >= 0:
        told = column(places["extended"]).str.to_lowercase().is_in(sorted(_EXTENDED))
        extended = extended | told.fill_null(value=False)
    bus = column(places["bus"]) if places["bus"] >= 0 else pl.repeat("0", len(rows), eager=True)
    kinds = {name: k for k, name in enumerate(bus.drop_nulls().unique(maintain_order=True))}
    channel = bus.cast(pl.Int16, strict=False)
    if channel.null_count() > bus.null_count() + 0.5 * len(rows):
        channel = bus.replace_strict(kinds, default=None, return_dtype=pl.Int16)
    table = pl.DataFrame(
        {
            "time": _seconds(column(places["time"])),
            "channel": channel,
            "id": identifier,
            "extended": extended,
            "data": data,
        }
    ).with_columns(pl.col("time").fill_nan(None))
    whole = table.select(pl.all_horizontal(pl.all().is_not_null())).to_series()
    filled = texts.str.strip_chars() != ""
    return frames_of_table(table), np.flatnonzero(~whole & filled).tolist()


def _seconds(stamps: pl.Series) -> pl.Series:
    """Times of the rows [s]: numbers, times of day or dates; NaN where there is none."""
    sample = [t for t in stamps.drop_nulls().head(200).to_list() if t]
    if sum(map(is_number, sample)) > 0.5 * len(sample):
        return stamps.cast(pl.Float64, strict=False)
    form = _CLX_TIME if sample and re.match(r"\d{8}T\d{9}$", sample[0]) else ""
    form = form or text_time_format(sample)[0]
    if form == "clock":
        part = stamps.str.extract_groups(r"^(\d+):(\d+):(\d+(?:[.,]\d+)?)$").struct.unnest()
        hour, minute, second = (
            part[c].str.replace(",", ".", literal=True).cast(pl.Float64, strict=False)
            for c in part.columns
        )
        day = (3600.0 * hour + 60.0 * minute + second).fill_null(float("nan"))
        return pl.Series(unwrapped(np.array(day.to_numpy())))
    if form == "iso":
        stamps = stamps.str.replace(" ", "T", literal=True).str.replace(r"Z$", "")
        form = "%Y-%m-%dT%H:%M:%S%.f"
    if not form:
        return pl.repeat(float("nan"), stamps.len(), eager=True)
    parsed = stamps.str.to_datetime(form, strict=False, time_unit="us")
    return (parsed.cast(pl.Int64).cast(pl.Float64) * 1e-6).fill_null(float("nan"))


def read_busmaster(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a BUSMASTER log; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No frame in it.
    """
    with path.open("rb") as file:
        head = file.read(4096).upper()
    decimal, relative = b"***DEC***" in head, b"***RELATIVE MODE***" in head

    def rows(found: pl.DataFrame) -> pl.DataFrame:
        hour, minute, second, part = (
            pl.col(str(k)).cast(pl.Float64, strict=False) for k in range(1, 5)
        )
        return found.select(
            time=3600.0 * hour + 60.0 * minute + second + 1e-4 * part,
            channel=pl.col("5").cast(pl.Int16, strict=False),
            id=pl.col("6").str.to_integer(base=10 if decimal else 16, strict=False),
            extended=pl.col("7") == "x",
            data=pl.col("8"),
        )

    log = _read_lines(path, _BUSMASTER_LINE, rows, r"^\s*(\*\*\*.*)?$", decimal=decimal)
    assert log.frames is not None
    time = log.frames.time
    log.frames = replace(log.frames, time=np.cumsum(time) if relative else unwrapped(time))
    log.of_day = not relative
    return log


def read_canking(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a text window of Kvaser's CanKing; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No frame in it.
    """
    with path.open("rb") as file:
        sample = file.read(1 << 16).decode("latin-1")
    told = re.findall(_CANKING_LINE, sample, re.MULTILINE)
    words = [word for line in told for word in (line[1], *line[4].split())]
    # Bytes of three digits are decimal, unless a letter shows that they are not.
    letters = any(re.search("[A-Fa-f]", word) for word in words)
    decimal = not letters and any(len(w) == 3 for line in told for w in line[4].split())

    def rows(found: pl.DataFrame) -> pl.DataFrame:
        number = pl.col("2").str.to_integer(base=10 if decimal else 16, strict=False)
        return found.select(
            time=pl.col("6").cast(pl.Float64, strict=False),
            channel=pl.col("1").cast(pl.Int16, strict=False),
            id=number,
            extended=(pl.col("3") == "X") | (number > _STANDARD),
            data=pl.col("5"),
        )

    other = r"^\s*(Chn\s|Logging|$)"
    return _read_lines(path, _CANKING_LINE, rows, other, decimal=decimal)


def _read_lines(
    path: Path,
    form: str,
    rows: Callable[[pl.DataFrame], pl.DataFrame],
    other: str,
    *,
    decimal: bool,
) -> Log:
    """Read frames that stand one on a line.

    Parameters
    ----------
    path : the file
    form : pattern of a line
    rows : makes columns of `frames_of_table` of what the pattern finds; data as text
    other : pattern of lines that hold no frame
    decimal : whether bytes are decimal
    """
    parts: list[Frames] = []
    lines = Lines()
    for block in whole_lines(path):
        text = pl.Series(block.decode("latin-1").replace("\r", "").split("\n"), dtype=pl.String)
        ignored = text.str.contains(other)
        found = rows(text.str.extract_groups(form).struct.unnest())
        found = found.with_columns(data=_bytes(found["data"], decimal=decimal))
        whole = found.select(pl.all_horizontal(pl.all().is_not_null())).to_series()
        strange = np.flatnonzero(~(whole | ignored))
        total = int((~ignored).sum())
        lines.add(block, total, strange.size, int(strange[0]) + 1 if strange.size else 0)
        parts.append(frames_of_table(found))
    return _log(path, parts, lines)


def _bytes(texts: pl.Series, *, decimal: bool) -> pl.Series:
    """Bytes that are spelled one after the other, parted by blanks; null where they are none."""
    if not decimal:
        # A byte of one digit stands alone between blanks.
        padded = texts.str.replace_all(r"\b([0-9A-Fa-f])\b", "0${1}")
        return padded.str.replace_all(r"\s+", "").str.decode("hex", strict=False)
    found: list[bytes | None] = []
    for text in texts.to_list():
        words = (text or "").split()
        numbers = [int(word) for word in words if word.isascii() and word.isdecimal()]
        fits = text is not None and len(numbers) == len(words) and max(numbers, default=0) < 256
        found.append(bytes(numbers) if fits else None)
    return pl.Series(found, dtype=pl.Binary)


def _log(path: Path, parts: list[Frames], lines: Lines) -> Log:
    problems = lines.problems("file.lines_left_out", path)
    frames = in_order(parts)
    if not len(frames):
        raise DriveError(f"{path} holds no CAN frame that can be read; record it again")
    log = Log(path, absolute=bool(np.median(frames.time) > _EPOCH), frames=frames)
    log.problems += problems
    return log
