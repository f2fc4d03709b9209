"""CAN frames out of text, one frame a line: what stands where in each of its forms.

ASC is Vector's, TRC of PEAK or CANHacker, candump of can-utils (its log, or what it shows on a
terminal), CRTD of OVMS, and CanKing and BUSMASTER as they save their windows. Tables name their
columns: those of python-can, SavvyCAN, CSS Electronics (CLX000), Kvaser and Vehicle Spy, and any
other with a time, an identifier and bytes. The forms of tables, of CanKing and of BUSMASTER are
those that descriptions give; no file of these tools was at hand.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import polars as pl

from weighbridge.errors import DriveError
from weighbridge.io.draft_text import HEAD_LINES
from weighbridge.io.draft_time import is_clock, is_number, text_time_format
from weighbridge.io.frames import Frames, in_order
from weighbridge.io.log import Log, Reader
from weighbridge.io.mapping import TableMapping
from weighbridge.io.table import SEPARATORS, parsed_dates, seconds_of, unwrapped
from weighbridge.io.understood import Lines, cells, plain_head
from weighbridge.io.vocabulary import words_in
from weighbridge.kernels.frame_text import (
    ALONE,
    BASE64,
    BLANK,
    CELL,
    FRAME,
    LACKING,
    MARKS,
    NOTHING,
    REMARK,
    STRANGE,
    UNSEEN,
    WORD,
    WORDS,
    FrameForm,
    FrameRows,
    parse_frames,
)
from weighbridge.signals import Floats

_BLOCK: Final = 1 << 25
_SAMPLE: Final = 1 << 16
_BUSES: Final = 256
_EPOCH: Final = 1e8
"""Stamps above count from 1970, not from the start of the log [s]."""
_FALLS: Final = 0.2
"""Part of the stamps that do not rise, from which they are times since the frame before [-]."""

_UNREADABLE: Final = "holds no CAN frame that can be read; record it again, or copy it again"


class Shape(NamedTuple):
    """A form of lines: its marks, and the places of its words; negative ones count from the end.

    ``marks`` are words, parted by blanks, of which one stands at a place. ``skip`` letters stand
    before the bytes, of which there are ``most``.
    """

    id: int = 0
    data: int = LACKING
    bus: int = LACKING
    size: int = LACKING
    extended: int = LACKING
    marks: Mapping[int, str] = {}
    kind: int = FRAME
    coding: int = WORDS
    skip: int = 0
    most: int = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """What stands where in a text of frames, see `weighbridge.kernels.frame_text.FrameForm`.

    Attributes
    ----------
    shapes, other, time, time_words, short, base, socketcan, coded, relative : of `FrameForm`
    alone, remark : letters that are words of their own, or begin lines without a frame
    separator : between cells; empty where blanks part words
    extended : words by which an identifier has 29 bits, parted by blanks
    unit, start : of the stamps [s], and what they count from [s since 1970]
    dates : how dates of stamps are written; empty where they are none
    bus : number of the bus of frames that name none
    """

    shapes: tuple[Shape, ...]
    other: int = STRANGE
    time: int = 0
    time_words: int = 1
    short: int = 0
    base: int = 16
    socketcan: bool = False
    coded: bool = False
    relative: bool = False
    alone: str = ""
    remark: str = ""
    separator: str = ""
    extended: str = ""
    unit: float = 1.0
    start: float = 0.0
    dates: str = ""
    bus: int = 0

    def compiled(self) -> FrameForm:
        """As the kernel takes it."""
        letters = np.zeros(256, np.uint8)
        blanks = ' \t\r"' if self.separator else " \t\r"
        for role, those in ((BLANK, blanks), (ALONE, self.alone), (REMARK, self.remark),
                            (CELL, self.separator)):  # fmt: skip
            letters[[ord(letter) for letter in those]] = role
        tags = [_tag(word) for word in self.extended.split()]
        reported = len(tags)
        rows = []
        for s in self.shapes:
            places = [p for p in (s.id, *s.marks, self.time) if p >= 0]
            row = [
                s.kind,
                1 + max(places, default=0),
                s.bus,
                s.id,
                s.extended,
                s.size,
                s.data,
                s.coding,
                s.skip,
                s.most,
            ]
            for place, words in s.marks.items():
                row += [place, len(tags), len(tags) + len(words.split())]
                tags += [_tag(word) for word in words.split()]
            rows.append(row + [LACKING, 0, 0] * (MARKS - len(s.marks)))
        return FrameForm(
            letters, np.array(rows, np.int64), np.array(tags, np.int64), reported, self.other,
            self.time, self.time_words, self.short, self.base, bool(self.separator),
            self.socketcan, self.coded, self.relative, bool(self.dates),
        )  # fmt: skip


def _tag(word: str) -> int:
    return int.from_bytes(word[:7].encode("ascii"), "big")


Pieces = Iterable[tuple[bytes, Form]]
"""Whole lines of a file, with their form; where it is a new one, relative stamps begin anew."""


def _reader(pieces: Callable[[Path], Pieces]) -> Reader:
    def read(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
        """Read the frames of a text; see `weighbridge.io.log.Reader`.

        Raises
        ------
        DriveError
            No frame in it, or a form of it that is not known.
        """
        parts: list[Frames] = []
        buses: dict[str, int] = {}
        lines = Lines()
        last, clock, of_day = None, 0.0, False
        for text, form in pieces(path):
            clock = clock if form is last else 0.0
            last = form
            frames, counts, clock, hours = _parse(text, form, buses, clock)
            of_day |= hours and not form.relative
            lines.add(text, *counts)
            parts.append(frames)
        problems = lines.problems("file.lines_left_out", path)
        frames = in_order(parts)
        if not len(frames):
            raise DriveError(f"{path} {_UNREADABLE}")
        if of_day:
            frames = replace(frames, time=unwrapped(frames.time))
        absolute = bool(np.median(frames.time) > _EPOCH)
        return Log(path, problems=problems, absolute=absolute, of_day=of_day, frames=frames)

    return read


def _parse(
    text: bytes, form: Form, buses: dict[str, int], clock: float
) -> tuple[Frames, tuple[int, int, int], float, bool]:
    """Read lines of one form.

    Returns
    -------
    Frames, counts of `Lines.add`, stamp of the last line, and whether stamps are times of day
    """
    letters = np.frombuffer(text, np.uint8)
    places = np.zeros((_BUSES, 2), np.int64)
    n = text.count(b"\n") + 1
    for width in (8, 64):
        rows = FrameRows(
            np.zeros(n), np.zeros(n, np.int16), np.zeros(n, np.uint32), np.zeros(n, np.bool_),
            np.zeros(n, np.uint8), np.zeros((n, width), np.uint8), np.zeros((n, 2), np.int64),
        )  # fmt: skip
        count, total, bad, first, seen, longest, last = parse_frames(
            letters, rows, places, form.compiled(), clock
        )
        if longest <= width:
            break
    numbers = np.zeros(max(seen, 1), np.int16)
    for k, (begin, end) in enumerate(places[:seen].tolist()):
        name = text[begin:end].decode("latin-1")
        numbers[k] = buses.setdefault(name, _number(name, buses) if name else form.bus)
    time = rows.time[:count]
    if form.dates:
        stamps = (text[begin:end] for begin, end in rows.stamp[:count].tolist())
        time = _dates([stamp.decode("latin-1") for stamp in stamps], form.dates)
    frames = Frames(
        time * form.unit + form.start, numbers[rows.channel[:count]],
        *(column[:count].copy() for column in rows[2:6]),
    )  # fmt: skip
    dated = np.isfinite(time)
    hours = count > 0 and not form.dates and b":" in text[slice(*rows.stamp[0].tolist())]
    counts = (total, bad + int(np.count_nonzero(~dated)), first)
    return frames.select(dated), counts, last, hours


def _number(bus: str, taken: Mapping[str, int]) -> int:
    """Number of a bus: the one its name ends in, or the first one free."""
    found = re.search(r"\d{1,3}$", bus)
    if found and int(found.group()) not in taken.values():
        return int(found.group())
    return next(k for k in range(1000) if k not in taken.values())


def _dates(stamps: Sequence[str], form: str) -> Floats:
    """Seconds since 1970, where no zone is shown by the clock of this computer; NaN of no date."""
    texts = pl.Series(stamps, dtype=pl.String)
    parsed = parsed_dates(texts, form)
    seconds, _ = seconds_of(parsed)
    first = parsed.drop_nulls().dt.replace_time_zone(None).head(1).to_list()
    if texts.str.ends_with("Z").any() or not first:
        return seconds
    naive = (first[0] - datetime(1970, 1, 1)).total_seconds()
    return seconds + float(first[0].timestamp() - naive)


def _begins(pattern: bytes) -> Callable[[bytes], bool]:
    """Recognise a form by the first line of a text."""
    mark = re.compile(pattern, re.IGNORECASE)
    return lambda head: mark.match(head) is not None


def _blocks(path: Path) -> Iterator[bytes]:
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


def _with_head(head: Callable[[Path, bytes], tuple[int, Form]], path: Path) -> Pieces:
    """Blocks of the form that the first shows, without the bytes that are its head."""
    form = None
    for block in _blocks(path):
        if form is None:
            length, form = head(path, block)
            # The lines of the head count.
            block = b"\n" * block.count(b"\n", 0, length) + block[length:]
        yield block, form


# ASC ----------------------------------------------------------------------------------------------

_ASC_MARK: Final = re.compile(
    rb"^[ \t]*(?:(?:date|begin[ \t]+triggerblock)[ \t]+\w+[ \t]+(?P<date>[^\r\n]+)"
    rb"|base[ \t]+(?P<base>hex|dec)(?:[ \t]+timestamps[ \t]+(?P<stamps>absolute|relative))?)",
    re.IGNORECASE | re.MULTILINE,
)
"""Lines of an ASC log that change how the lines after them are read."""
_GERMAN: Final = {"mär": "mar", "mai": "may", "okt": "oct", "dez": "dec"}
_WAYS: Final = "rx tx rxrq txrq"
_ASC: Final = Form(
    shapes=(
        Shape(marks={3: _WAYS, 4: "r errorframe"}, kind=NOTHING),
        # With CAN FD, a name of the message may stand between.
        Shape(4, 9, bus=2, size=8, marks={1: "canfd", 3: _WAYS, 5: "0 1", 6: "0 1"}),
        Shape(4, 10, bus=2, size=9, marks={1: "canfd", 3: _WAYS, 6: "0 1", 7: "0 1"}),
        Shape(2, 6, bus=1, size=5, marks={3: _WAYS, 4: "d"}, most=8),
        Shape(marks={3: _WAYS}, kind=STRANGE),
    ),
    other=UNSEEN,
)


def _asc(path: Path) -> Pieces:
    form = _ASC
    for k, block in enumerate(_blocks(path)):
        marks = [*_ASC_MARK.finditer(block)] if k == 0 or b"riggerblock" in block else []
        edges = [0, *(m.start() for m in marks), len(block)]
        for mark, begin, end in zip([None, *marks], edges[:-1], edges[1:], strict=True):
            if mark is not None and mark["date"] is not None:
                form = replace(form, start=_asc_date(mark["date"].decode("latin-1")) or form.start)
            elif mark is not None:
                base = 10 if mark["base"].lower() == b"dec" else 16
                relative = (mark["stamps"] or b"").lower() == b"relative"
                form = replace(form, base=base, relative=relative)
            yield block[begin:end], form


def _asc_date(text: str) -> float | None:
    """Seconds since 1970 of ``Sep 13 12:26:40.0 2020``, with or without am and pm.

    It is of the recording computer's clock, taken in the time zone of this one.
    """
    words = text.lower().split()
    words[:1] = [_GERMAN.get(month[:3], month[:3]) for month in words[:1]]
    for form in ("%b %d %H:%M:%S %Y", "%b %d %H:%M:%S.%f %Y", "%b %d %I:%M:%S %p %Y",
                 "%b %d %I:%M:%S.%f %p %Y"):  # fmt: skip
        with suppress(ValueError, OverflowError, OSError):
            return datetime.strptime(" ".join(words), form).timestamp()
    return None


# TRC ----------------------------------------------------------------------------------------------

_TRACE_KEY: Final = re.compile(rb"^;\$(?P<key>[A-Z]+)=(?P<value>[^\r\n]*)", re.MULTILINE)
_NUMBERED: Final = {1: ")"}
_ONES: Final = "ffffffff"
_TRACE_VERSIONS: Final[Mapping[str, tuple[int, Shape]]] = {
    # Version 1.0 reports the bus under an identifier of ones.
    "1.0": (2, Shape(3, 5, size=4, marks=_NUMBERED)),
    "1.1": (2, Shape(4, 6, size=5, marks={**_NUMBERED, 3: "rx tx"})),
    "1.3": (2, Shape(5, 8, bus=3, size=7, marks={**_NUMBERED, 4: "rx tx"})),
    "2.0": (1, Shape(3, 6, size=5, marks={2: "dt fd fb fe bi"})),
    "2.1": (1, Shape(4, 8, bus=3, size=7, marks={2: "dt fd fb fe bi"})),
}
"""Place of the stamp and form of lines, by version of the file."""


def _trace_form(time: int, shape: Shape, unit: float = 1e-3) -> Form:
    # Lines of other kinds are errors, status and remote frames; a kind stands behind the number.
    kinds = {p: words for p, words in shape.marks.items() if words != ")"}
    numbered = {p: words for p, words in shape.marks.items() if words == ")"}
    others = [Shape(marks={**numbered, shape.data: "rtr"}, kind=NOTHING)]
    if not kinds:
        others.append(Shape(marks={**numbered, shape.id: _ONES}, kind=NOTHING))
    behind = [Shape(max(kinds), marks=numbered, kind=NOTHING)] if kinds else []
    return Form(
        shapes=(*others, shape, *behind), time=time, short=4, alone=")", remark=";", bus=1,
        unit=unit,
    )  # fmt: skip


def _trace_head(path: Path, block: bytes) -> tuple[int, Form]:
    first, _, below = block.lstrip().partition(b"\n")
    # Without remarks, as CANHacker writes it, the first line names the columns.
    places = _places(first.decode("latin-1").split())
    if first[:1] != b";" and max(places[what] for what in _NEEDED) < LACKING:
        words = below.split()
        stamp = words[places["time"]] if len(words) > places["time"] else b""
        # Milliseconds are whole; seconds have decimals.
        unit = 1.0 if b"," in stamp or b"." in stamp else 1e-3
        shape = Shape(places["id"], places["data"], size=places["size"])
        return block.find(b"\n") + 1, _trace_form(places["time"], shape, unit)
    reported = {m["key"].upper(): m["value"].strip() for m in _TRACE_KEY.finditer(block)}
    version = reported.get(b"FILEVERSION", b"1.0").decode("latin-1")
    if version not in _TRACE_VERSIONS:
        raise DriveError(
            f"{path} is of TRC version {version}; known are {', '.join(_TRACE_VERSIONS)}: "
            "convert it"
        )
    time, shape = _TRACE_VERSIONS[version]
    coded = False
    if version.startswith("2"):
        columns = reported.get(b"COLUMNS", b"N,O,T,B,I,d,R,L,D").decode("latin-1").split(",")
        at = {name: columns.index(name) for name in columns}
        lacking = [n for n in ("O", "T", "I", "D") if n not in at]
        if lacking or not {"l", "L"} & set(at):
            raise DriveError(f"{path}: its $COLUMNS lack {', '.join(lacking) or 'l'}; convert it")
        coded = "l" not in at
        time = at["O"]
        shape = Shape(
            at["I"], at["D"], bus=at.get("B", LACKING), size=at["L" if coded else "l"],
            marks={at["T"]: shape.marks[2]},
        )  # fmt: skip
    try:
        days = float(reported.get(b"STARTTIME", b"nan"))
    except ValueError:
        days = math.nan
    # Days since the end of 1899.
    start = (days - 25569.0) * 86400.0
    start = start if math.isfinite(start) else 0.0
    return 0, replace(_trace_form(time, shape), start=start, coded=coded)


# candump ------------------------------------------------------------------------------------------

_CANDUMP_LINE: Final = re.compile(
    rb"(?:\xef\xbb\xbf)?\s*"
    rb"(?P<stamp>\((?:\d{4}-\d\d-\d\d \d\d:\d\d:)?\d+(?:\.\d+)?\)\s+)?"
    rb"\w+\s+(?:[RT]X\s+\S+\s+\S+\s+)?"
    rb"[0-9A-Fa-f]{3,8}(?:#|\s+\[\d{1,2}\](?:\s|$))"
)
is_candump: Final = _begins(_CANDUMP_LINE.pattern)


def _candump_form(words: int) -> Form:
    """Form of a log whose stamps have so many words."""
    bus = words + 2
    front = {0: "(", bus - 1: ")"}
    shapes = []
    # candump -x shows the direction and two flags before the identifier.
    for at, way in ((bus + 4, {bus + 1: "rx tx"}), (bus + 1, {})):
        known = {**front, **way}
        shapes += [
            Shape(marks={**known, at + 1: "[", at + 4: "remote"}, kind=NOTHING),
            # CAN FD has a digit of flags behind the second mark.
            Shape(at, at + 3, bus, marks={**known, at + 1: "#", at + 2: "#"}, coding=WORD, skip=1),
            Shape(at, at + 2, bus, marks={**known, at + 1: "#"}, coding=WORD),
            Shape(at, at + 4, bus, at + 2, marks={**known, at + 1: "[", at + 3: "]"}),
        ]  # fmt: skip
    return Form(
        shapes=tuple(shapes), time=1, time_words=words, socketcan=True, short=3, alone="()[]#",
        dates="iso" if words > 1 else "",
    )  # fmt: skip


def _candump_head(path: Path, block: bytes) -> tuple[int, Form]:
    head = block[:_SAMPLE]
    begins = _CANDUMP_LINE.match(head)
    if begins is not None and begins["stamp"] is None:
        raise DriveError(
            f"{path}: its frames have no times, without which nothing can be weighed; record it "
            "with candump -l"
        )
    if re.search(rb"\(\d{4}-\d\d-\d\d ", head):
        return 0, _candump_form(2)
    form = _candump_form(1)
    stamps = np.array([float(stamp) for stamp in re.findall(rb"^\s*\((\d+\.\d+)\)", head, re.M)])
    # candump -td gives the time since the frame before.
    relative = (
        stamps.size > 1
        and stamps[0] == 0.0
        and 0.0 < stamps.max() < _EPOCH
        and float(np.mean(np.diff(stamps) <= 0.0)) > _FALLS
    )
    return 0, replace(form, relative=relative)


# CRTD, CanKing, BUSMASTER -------------------------------------------------------------------------

is_crtd: Final = _begins(rb"\d+(?:\.\d+)? \d?(?:C[A-Z]{2}|[RT](?:11|29))\b")
# ``seconds [bus]R11 id bytes``; R for received, T for sent, 11 or 29 bits (Open Vehicles, *CRTD CAN
# Log Format*). Version 1 had one bus.
_CRTD: Final = Form(
    shapes=(
        Shape(4, 5, bus=1, extended=3, marks={2: "r t", 3: "11 29"}),
        Shape(3, 4, extended=2, marks={1: "r t", 2: "11 29"}),
    ),
    other=UNSEEN,
    alone="RT",
    extended="29",
    bus=1,
)

is_canking: Final = _begins(rb"\s*Chn\s+Identifier\s+Flg\b")
_CANKING: Final = Form(
    shapes=(
        Shape(1, 4, 0, 3, 2, marks={-1: "r t", 2: "x xr xt n r t e w"}),
        Shape(1, 3, 0, 2, marks={-1: "r t"}),
    ),
    time=-2,
    remark="CL",
    extended="x xr xt",
)

is_busmaster: Final = _begins(rb"\s*\*\*\*BUSMASTER")
_BUSMASTER: Final = Form(
    shapes=(
        Shape(marks={1: "rx tx", 4: "sr xr"}, kind=NOTHING),
        Shape(3, 6, 2, 5, 4, marks={1: "rx tx", 4: "s x"}),
    ),
    remark="*",
    extended="x",
)


def _canking_head(path: Path, block: bytes) -> tuple[int, Form]:
    lines = [line.split() for line in block[:_SAMPLE].decode("latin-1").split("\n")]
    words = [word for line in lines if line and line[-1] in ("R", "T") for word in line[1:-2]]
    # Bytes of three digits are decimal, unless a letter shows that they are not.
    letters = any(re.fullmatch("[0-9A-Fa-f]*[A-Fa-f][0-9A-Fa-f]*", word) for word in words)
    decimal = not letters and any(re.fullmatch(r"\d{3}", word) for word in words)
    return 0, replace(_CANKING, base=10 if decimal else 16)


def _busmaster_head(path: Path, block: bytes) -> tuple[int, Form]:
    head = block[:_SAMPLE].upper()
    return 0, replace(
        _BUSMASTER, base=10 if b"***DEC***" in head else 16, relative=b"***RELATIVE MODE***" in head
    )


# Tables -------------------------------------------------------------------------------------------

_NAMES: Final = words_in("frames")
"""What columns of frames are called."""
_NEEDED: Final = ("time", "id", "size", "data")
_BYTE: Final = re.compile(r"(?:b|d|data|byte|data ?byte|byte ?data) ?(\d{1,2})$")
_TRUE: Final = "1 t true x e ext extended xtd yes"
"""What says that an identifier has 29 bits, or that a frame is a remote one; 1 is CLX000's type."""
_PYTHON_CAN: Final = b"timestamp,arbitration_id,extended,remote,error,dlc,data"
_GVRET: Final = re.compile(rb"^time ?stamp,id,extended,(?:dir,)?bus,len,d1,", re.IGNORECASE)
_CLX_TIME: Final = "%Y%m%dT%H%M%S%3f"


def is_frame_table(head: bytes) -> bool:
    """Return whether a text begins with a table of frames that names its columns."""
    return _table_header(_head_lines(head)) is not None


def _head_lines(head: bytes) -> list[str]:
    return plain_head(head[:_SAMPLE]).split("\n")


def _plain(name: str) -> str:
    return " ".join(re.findall(r"[a-z]+|\d+", name.lower()))


def _places(names: Sequence[str]) -> dict[str, int]:
    """Columns of what `_NAMES` lists."""
    plain = list(map(_plain, names))
    return {
        what: next((k for k, name in enumerate(plain) if name in called), LACKING)
        for what, called in _NAMES.items()
    }


def _table_header(lines: Sequence[str]) -> tuple[int, str, dict[str, int], list[int]] | None:
    """Find the header of a table of frames.

    Returns
    -------
    Line, separator, places of what `_NAMES` lists, and those of single bytes; None where there is
    none
    """
    for k, line in enumerate(lines[:HEAD_LINES]):
        separator = max(SEPARATORS, key=line.count)
        names = cells(line, separator)
        places = _places(names)
        single = [i for i, name in enumerate(names) if _BYTE.match(_plain(name))]
        held = single or places["data"] < LACKING
        if max(places["time"], places["id"]) < LACKING and held:
            return k, separator, places, single
    return None


def _table_head(path: Path, block: bytes) -> tuple[int, Form]:
    lines = _head_lines(block)
    header = _table_header(lines)
    if header is None:
        raise DriveError(f"{path} {_UNREADABLE}")
    line, separator, places, single = header
    rows = [cells(row, separator) for row in lines[line + 1 : 1000]]

    def sample(place: int) -> list[str]:
        return [row[place] for row in rows if len(row) > place and row[place]]

    # A byte of three digits is decimal.
    decimal = any(re.fullmatch(r"\d{3}", cell) for place in single for cell in sample(place))
    stamps = sample(places["time"])[:200]
    dates = ""
    if sum(not (is_number(s) or is_clock(s)) for s in stamps) > 0.5 * len(stamps):
        dates = _CLX_TIME if re.match(r"\d{8}T\d{9}$", stamps[0]) else text_time_format(stamps)[0]
    head = lines[line].encode()
    # Stamps of SavvyCAN are microseconds; those with a point are in seconds, as other programs
    # write this form.
    micro = _GVRET.match(head) and not any("." in stamp for stamp in stamps[:1])
    coding = WORDS if single else WORD
    kinds = [places["remote"], places["error"]]
    frame = Shape(
        places["id"], single[0] if single else places["data"], places["bus"], places["size"],
        places["extended"], coding=BASE64 if head.startswith(_PYTHON_CAN) else coding,
        most=len(single) if single and places["size"] == LACKING else 64,
    )  # fmt: skip
    others = [Shape(marks={place: _TRUE}, kind=NOTHING) for place in kinds if place < LACKING]
    length = len(b"\n".join(block.split(b"\n", line + 1)[: line + 1]))
    return length, Form(
        shapes=(*others, frame), time=places["time"], separator=separator, extended=_TRUE,
        base=10 if decimal else 16, unit=1e-6 if micro else 1.0, dates=dates, remark="#",
    )  # fmt: skip


read_asc: Final = _reader(_asc)
read_trc: Final = _reader(partial(_with_head, _trace_head))
read_candump: Final = _reader(partial(_with_head, _candump_head))
read_crtd: Final = _reader(partial(_with_head, lambda *_: (0, _CRTD)))
read_canking: Final = _reader(partial(_with_head, _canking_head))
read_busmaster: Final = _reader(partial(_with_head, _busmaster_head))
read_frame_table: Final = _reader(partial(_with_head, _table_head))
