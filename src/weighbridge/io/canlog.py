"""Frames of Vector's ASC, PEAK's TRC and python-can's CSV.

The forms of ASC and TRC are those that python-can reads and writes; an hour of a busy bus is too
much for its loop over messages.
"""

from __future__ import annotations

import math
import re
from datetime import datetime
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

from weighbridge.errors import DriveError
from weighbridge.io.bus_text import frames_of_table
from weighbridge.io.candump import filled, room, whole_lines
from weighbridge.io.frames import Frames, in_order
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.io.quiet import PARSE_ERRORS, first_line, quietly
from weighbridge.io.understood import Lines
from weighbridge.kernels.frame_text import TraceColumns, parse_asc, parse_trace

CSV_HEADER: Final = "timestamp,arbitration_id,extended,remote,error,dlc,data"
"""First line of a CSV written by python-can."""

_EPOCH_LIKE: Final = 1e8
_LONGEST: Final = 64

# Lines of an ASC log that change how the lines after them are read.
_ASC_MARK: Final = re.compile(
    rb"^[ \t]*(?:(?:date|begin[ \t]+triggerblock)[ \t]+\w+[ \t]+(?P<date>[^\r\n]+)"
    rb"|base[ \t]+(?P<base>hex|dec)(?:[ \t]+timestamps[ \t]+(?P<stamps>absolute|relative))?)",
    re.IGNORECASE | re.MULTILINE,
)
_ASC_DATE: Final = re.compile(
    r"(?P<month>[^\W\d]{3})\w*\s+(?P<day>\d{1,2})\s+(?P<hour>\d{1,2}):(?P<minute>\d{2}):"
    r"(?P<second>\d{2})(?P<part>\.\d+)?(?:\s+(?P<half>[ap]m))?\s+(?P<year>\d{4})",
    re.IGNORECASE,
)
_MONTHS: Final = {
    name: k + 1
    for names in (
        "jan feb mar apr may jun jul aug sep oct nov dec",
        "jan feb mär apr mai jun jul aug sep okt nov dez",
    )
    for k, name in enumerate(names.split())
}

_TRACE_KEY: Final = re.compile(rb"^;\$(?P<key>[A-Z]+)=(?P<value>[^\r\n]*)", re.MULTILINE)


def _kinds(*words: str) -> NDArray[np.int64]:
    return np.array([256 * ord(w[0]) + ord(w[1]) for w in words], np.int64)


_RECEIVED: Final = _kinds("Rx", "Tx")
_TYPES: Final = _kinds("DT", "FD", "FB", "FE", "BI")
_TRACE_VERSIONS: Final[dict[str, TraceColumns]] = {
    "1.0": TraceColumns(1, -1, -1, 2, 3, 4, False, True, 1e-3, _kinds()),
    "1.1": TraceColumns(1, -1, 2, 3, 4, 5, False, True, 1e-3, _RECEIVED),
    "1.3": TraceColumns(1, 2, 3, 4, 6, 7, False, True, 1e-3, _RECEIVED),
    "2.0": TraceColumns(1, -1, 2, 3, 5, 6, True, False, 1e-3, _TYPES),
    "2.1": TraceColumns(1, 3, 2, 4, 7, 8, True, False, 1e-3, _TYPES),
}
"""Where the words of a line stand, by version of the file."""

_TRACE_NAMES: Final = {
    "time": ("time", "timestamp"),
    "id": ("id", "identifier", "canid", "can-id"),
    "length": ("dlc", "len", "length", "size"),
    "data": ("data",),
}
"""Names of columns in the first line of a log that has no remarks, as CANHacker writes it."""


def read_asc(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a Vector ASC log; see `weighbridge.io.log.Reader`.

    Dates are those of the recording computer's clock, taken in the time zone of this one.

    Raises
    ------
    DriveError
        No frame in it.
    """
    parts: list[Frames] = []
    lines, start, clock = Lines(), 0.0, 0.0
    decimal = relative = False
    for k, block in enumerate(whole_lines(path)):
        marks = [*_ASC_MARK.finditer(block)] if k == 0 or b"riggerblock" in block else []
        edges = [0, *(m.start() for m in marks), len(block)]
        for mark, begin, end in zip([None, *marks], edges[:-1], edges[1:], strict=True):
            if mark is not None and mark["date"] is not None:
                start = _asc_date(mark["date"].decode("latin-1")) or start
                clock = 0.0
            elif mark is not None:
                decimal = mark["base"].lower() == b"dec"
                relative = (mark["stamps"] or b"").lower() == b"relative"
            text = block[begin:end]
            rows = room(text, _LONGEST if b"CANFD" in text else 8)
            count, bad, first, clock = parse_asc(
                np.frombuffer(text, np.uint8), rows, decimal, relative, clock
            )
            lines.add(text, count + bad, bad, first)
            parts.append(filled(rows, count, start))
    return _log(path, parts, lines)


def read_trc(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a TRC log, of PEAK or of CANHacker; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No frame in it, or its version is not known.
    """
    parts: list[Frames] = []
    lines = Lines()
    columns, start = _TRACE_VERSIONS["1.0"], 0.0
    for k, block in enumerate(whole_lines(path)):
        if k == 0:
            columns, start, named = _trace_head(path, block)
            # Names of columns are no frame.
            block = b";" + block[:named] + block[named:] if named else block
        for width in (8, _LONGEST):
            rows = room(block, width)
            count, bad, first = parse_trace(np.frombuffer(block, np.uint8), rows, columns)
            if not bad:
                break
        lines.add(block, count + bad, bad, first)
        parts.append(filled(rows, count, start))
    return _log(path, parts, lines)


def _log(path: Path, parts: list[Frames], lines: Lines) -> Log:
    problems = lines.problems("file.frames_damaged", path)
    frames = in_order(parts)
    if not len(frames):
        raise DriveError(
            f"{path} holds no CAN frame that can be read; record it again, or copy it again"
        )
    log = Log(path, absolute=bool(np.median(frames.time) > _EPOCH_LIKE), frames=frames)
    log.problems += problems
    return log


def _asc_date(text: str) -> float | None:
    """Seconds since 1970 of ``Sep 13 12:26:40.0 2020``, with or without am and pm."""
    found = _ASC_DATE.match(text.strip())
    month = _MONTHS.get(found["month"].lower()) if found else None
    if found is None or month is None:
        return None
    hour = int(found["hour"])
    if found["half"]:
        hour = hour % 12 + (12 if found["half"].lower() == "pm" else 0)
    try:
        day = datetime(
            int(found["year"]), month, int(found["day"]), hour, int(found["minute"]),
            int(found["second"]),
        )  # fmt: skip
        return day.timestamp() + float(found["part"] or 0.0)
    except (ValueError, OverflowError, OSError):
        return None


def _trace_head(path: Path, block: bytes) -> tuple[TraceColumns, float, int]:
    """Columns and start [s since 1970] that the head of a TRC log tells, and where a line of
    names ends that is no remark.
    """
    first, _, below = block.lstrip().partition(b"\n")
    if first[:1] != b";" and (named := _named_columns(first, below)) is not None:
        return named, 0.0, block.find(b"\n") + 1
    told = {m["key"].upper(): m["value"].strip() for m in _TRACE_KEY.finditer(block)}
    version = told.get(b"FILEVERSION", b"1.0").decode("latin-1")
    if version not in _TRACE_VERSIONS:
        raise DriveError(
            f"{path} is of TRC version {version}; known are {', '.join(_TRACE_VERSIONS)}: "
            "convert it"
        )
    columns = _TRACE_VERSIONS[version]
    if version.startswith("2"):
        names = told.get(b"COLUMNS", b"N,O,T,B,I,d,R,L,D").decode("latin-1").split(",")
        lacking = [n for n in ("O", "T", "I", "D") if n not in names]
        if lacking or not {"l", "L"} & set(names):
            raise DriveError(f"{path}: its $COLUMNS lack {', '.join(lacking) or 'l'}; convert it")
        size = "l" if "l" in names else "L"
        columns = columns._replace(
            time=names.index("O"), bus=names.index("B") if "B" in names else -1,
            kind=names.index("T"), identifier=names.index("I"), size=names.index(size),
            data=names.index("D"), coded=size == "L",
        )  # fmt: skip
    try:
        days = float(told.get(b"STARTTIME", b"nan"))
    except ValueError:
        days = math.nan
    # Days since the end of 1899.
    start = (days - 25569.0) * 86400.0
    return columns, start if math.isfinite(start) else 0.0, 0


def _named_columns(first: bytes, below: bytes) -> TraceColumns | None:
    """Columns of a log whose first line names them, as CANHacker's does; None where none does."""
    names = first.decode("latin-1").lower().split()
    places = {
        what: next((k for k, name in enumerate(names) if name in said), -1)
        for what, said in _TRACE_NAMES.items()
    }
    if min(places.values()) < 0:
        return None
    stamp = below.split()[places["time"]] if len(below.split()) > places["time"] else b""
    # Milliseconds are whole; seconds have decimals.
    unit = 1.0 if b"," in stamp or b"." in stamp else 1e-3
    return TraceColumns(
        places["time"], -1, -1, places["id"], places["length"], places["data"], False, False, unit,
        _kinds(),
    )  # fmt: skip


def is_can_csv(head: bytes) -> bool:
    """Tell whether a CSV begins as python-can writes them."""
    return head.startswith(CSV_HEADER.encode())


def read_can_csv(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read the frames of a CSV written by python-can; see `weighbridge.io.log.Reader`.

    Raises
    ------
    DriveError
        No frame in it.
    """
    try:
        with quietly():
            cells = pl.read_csv(
                path.read_bytes(),
                infer_schema=False,
                ignore_errors=True,
                truncate_ragged_lines=True,
                quote_char=None,
                encoding="utf8-lossy",
            )
        identifier = pl.col("arbitration_id").str.strip_prefix("0x")
        rows = cells.select(
            time=pl.col("timestamp").cast(pl.Float64, strict=False),
            channel=pl.lit(0, pl.Int16),
            id=identifier.str.to_integer(base=16, strict=False),
            extended=pl.col("extended") == "1",
            data=pl.col("data").fill_null("").str.decode("base64", strict=False),
            remote=(pl.col("remote") == "1") | (pl.col("error") == "1"),
        )
    except PARSE_ERRORS as error:
        raise DriveError(f"{path} cannot be read ({first_line(error)}); copy it again") from None
    sent = rows.filter(~pl.col("remote")).drop("remote")
    frames = frames_of_table(sent)
    if not len(frames):
        raise DriveError(f"{path} holds no CAN frame that can be read; record it again")
    log = Log(path, absolute=bool(np.median(frames.time) > _EPOCH_LIKE), frames=frames)
    strange = len(sent) - len(frames) + int(rows["remote"].null_count())
    lines = Lines()
    empty = np.flatnonzero(rows.select(pl.any_horizontal(pl.all().is_null())).to_series())
    lines.add(b"", len(rows), strange, int(empty[0]) + 2 if empty.size else 0)
    log.problems += lines.problems("file.lines_left_out", path)
    return log
