"""NMEA 0183: position, speed and course as receivers send them, u-blox among them.

Sentences RMC, GGA, GNS, GST and VTG are read, of any talker; between them any
other bytes may stand, as in a mixed u-blox recording.
"""

from __future__ import annotations

import datetime as dt
import math
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.libraries import importing
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.io.table import DAY, unwrapped
from weighbridge.io.understood import Lines
from weighbridge.messages import phrase
from weighbridge.signals import Floats, Problem, to_si

# Longest sentence of the standard is 82 characters; receivers send longer ones of their own.
SENTENCE: Final = re.compile(
    rb"\$[A-Z]{2}(?:RMC|GGA|GNS|GST|VTG)[ -#%-)+-~]{0,180}(?:\*[0-9A-Fa-f]{2})?"
)
"""A sentence that is read, among any other bytes; it ends with its checksum, where it has one."""

_WHOLE: Final = re.compile(
    rb"^[^$\n]{0,80}\$G[A-Z]{4},[ -)+-~]{0,180}\*[0-9A-Fa-f]{2}", re.MULTILINE
)
"""A line with a whole sentence, after what an app may write before it."""

_OTHER: Final = re.compile(rb"\$[A-Z]{5,6},")

# Quality 0 is no fix, 6 dead reckoning, 7 put in by hand, 8 simulated (NMEA 0183, GGA).
_NO_FIX: Final = frozenset((0, 6, 7, 8))


# Fields up to the last one read: without a checksum a sentence that was cut off shows only here.
_FIXLESS: Final = "without a fix"

_FIELDS: Final = {"RMC": 9, "GGA": 9, "GNS": 9, "GST": 7, "VTG": 7}


def is_nmea(head: bytes) -> bool:
    """Return whether a text has lines of sentences, with or without something before them."""
    return len(_WHOLE.findall(head)) >= 2


class UnfitSentenceError(Exception):
    """A sentence that shows nothing; its text is why, as in ``3 sentences damaged``."""


@dataclass(frozen=True, slots=True)
class Sentence:
    """What one sentence says, in its own units.

    Attributes
    ----------
    kind : RMC, GGA, GNS, GST or VTG
    clock : time of day [s]; None for VTG, which follows the sentences of its epoch
    day : date as seconds from 1970; NaN where it has none
    place : latitude, longitude [deg] and, of GGA and GNS, height [m] and dilution; empty without
    motion : speed [kn; km/h of VTG] and course [deg]; empty without
    spread : horizontal standard deviation [m]; NaN without
    """

    kind: str
    clock: float | None
    day: float = math.nan
    place: tuple[float, ...] = ()
    motion: tuple[float, ...] = ()
    spread: float = math.nan


def read_sentence(text: str) -> Sentence:
    """Read one sentence, from its ``$`` on.

    Raises
    ------
    UnfitSentenceError
        It is damaged, or there is no fix.
    MissingExtraError
        pynmea2 is not installed.
    """
    with importing("pynmea2", "position", "reading NMEA sentences"):
        import pynmea2
    try:
        return _read(pynmea2.parse(text))
    except UnfitSentenceError:
        raise
    except pynmea2.ChecksumError:
        raise UnfitSentenceError("with a wrong checksum") from None
    # The parser leaves damage in a field to whoever asks for it, with errors of many kinds.
    except Exception:
        raise UnfitSentenceError("damaged") from None


def _read(message: Any) -> Sentence:
    kind = message.sentence_type
    if len(message.data) < _FIELDS[kind]:
        raise UnfitSentenceError("damaged")
    if kind == "VTG":
        moving = (_number(message.spd_over_grnd_kmph), _number(message.true_track))
        return Sentence(kind, None, motion=moving)
    clock = _clock(message)
    day = _day(message) if kind == "RMC" else math.nan
    if clock is None or not _fixed(message, kind):
        raise UnfitSentenceError(_FIXLESS)
    if kind == "GST":
        spread = math.hypot(_number(message.std_dev_latitude), _number(message.std_dev_longitude))
        return Sentence(kind, clock, spread=spread)
    place = (_coordinate(message, "lat", 90.0), _coordinate(message, "lon", 180.0))
    if kind == "RMC":
        moving = (_number(message.spd_over_grnd), _number(message.true_course))
        return Sentence(kind, clock, day, place, moving)
    dilution = message.horizontal_dil if kind == "GGA" else message.hdop
    return Sentence(kind, clock, place=(*place, _number(message.altitude), _number(dilution)))


class _Rows:
    """Values of one kind of sentence, each with the stamp of its epoch."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self.stamps: list[int] = []
        self.values: list[tuple[float, ...]] = []

    def add(self, stamp: int, values: tuple[float, ...]) -> None:
        self.stamps.append(stamp)
        self.values.append(values)


def read_nmea(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
    """Read a file of NMEA 0183 sentences; see `weighbridge.io.log.Reader`.

    A mapping gives the offset of the clock only: names and units are the
    standard's.

    Raises
    ------
    DriveError
        No position in it.
    MissingExtraError
        pynmea2 is not installed.
    """
    with importing("pynmea2", "position", f"reading {path.name}"):
        import pynmea2  # noqa: F401
    data = path.read_bytes()
    log = Log(path)
    position = _Rows(("latitude", "longitude", "altitude", "hdop"))
    minimum = _Rows(("latitude", "longitude"))
    motion = _Rows(("gnss_speed", "gnss_course"))
    velocity = _Rows(("gnss_speed", "gnss_course"))
    accuracy = _Rows(("gnss_accuracy",))
    clocks: list[float] = []
    days: list[float] = []
    lost: Counter[str] = Counter()
    lines = Lines()
    for found in SENTENCE.finditer(data):
        try:
            said = read_sentence(found.group().decode("ascii").rstrip())
        except UnfitSentenceError as error:
            lost[str(error)] += 1
            damaged = str(error) != _FIXLESS
            first = data.count(b"\n", 0, found.start()) + 1 if damaged and not lines.first else 0
            lines.add(b"", 1, damaged, first)
            continue
        lines.add(b"", 1, 0, 0)
        if said.clock is None:
            if clocks:
                velocity.add(len(clocks) - 1, said.motion)
            continue
        stamp = len(clocks)
        clocks.append(said.clock)
        days.append(said.day)
        if said.kind == "RMC":
            minimum.add(stamp, said.place)
            motion.add(stamp, said.motion)
        elif said.kind == "GST":
            accuracy.add(stamp, (said.spread,))
        else:
            position.add(stamp, said.place)
        if b"*" not in found.group()[-3:]:
            lost[phrase("no_checksum")] += 1
    if not clocks:
        raise DriveError(_nothing(path, data, lost))
    lines.refuse(path)
    time, log.absolute = _time(np.array(clocks), np.array(days))
    if mapping:
        time = time + mapping.time.offset
    for reason, count in lost.items():
        log.problems.append(
            Problem.of("file.sentences", file=path.name, count=count, reason=reason)
        )
    known = position if position.stamps else minimum
    speeds, unit = (motion, "kn") if motion.stamps else (velocity, "kmh")
    for rows, units in (
        (known, ("deg", "deg", "m", "")),
        (speeds, (unit, "deg")),
        (accuracy, ("m",)),
    ):
        _add(log, rows, units, time)
    if not log.signals:
        raise DriveError(_nothing(path, data, lost))
    return log


def _add(log: Log, rows: _Rows, units: tuple[str, ...], time: Floats) -> None:
    if not rows.stamps:
        return
    table = np.array(rows.values, dtype=np.float64)
    columns = [
        (name, to_si(table[:, k], unit) if unit else table[:, k])
        for k, (name, unit) in enumerate(zip(rows.names, units, strict=False))
        if np.isfinite(table[:, k]).any()
    ]
    log.take(time[np.array(rows.stamps)], columns)


def _clock(message: Any) -> float | None:
    """Time of day [s]; None where the receiver does not know it."""
    stamp = message.timestamp
    if not isinstance(stamp, dt.time):
        return None
    return 3600.0 * stamp.hour + 60.0 * stamp.minute + stamp.second + 1e-6 * stamp.microsecond


def _day(message: Any) -> float:
    """Date as seconds from 1970; NaN where there is none."""
    date = message.datestamp
    if not isinstance(date, dt.date):
        return math.nan
    return (date - dt.date(1970, 1, 1)).days * DAY


def _fixed(message: Any, kind: str) -> bool:
    if kind == "RMC":
        return bool(message.status == "A")
    if kind == "GGA":
        return int(message.gps_qual) not in _NO_FIX
    if kind == "GNS":
        return any(c not in "NESM" for c in message.mode_indicator)
    return True


def _coordinate(message: Any, name: str, limit: float) -> float:
    """Latitude or longitude [deg], north and east positive; NaN where it cannot be."""
    if not getattr(message, name) or not getattr(message, f"{name}_dir"):
        return math.nan
    value = float(message.latitude if name == "lat" else message.longitude)
    return value if abs(value) <= limit else math.nan


def _number(value: Any) -> float:
    return math.nan if value is None or value == "" else float(value)


def _time(clock: Floats, day: Floats) -> tuple[Floats, bool]:
    """Put times of day on one clock, over midnight and with the dates there are.

    A receiver with a wrong date for a while has it outvoted: the date of most
    sentences counts.
    """
    running = unwrapped(clock)
    dated = np.isfinite(day)
    if not dated.any():
        return running, False
    starts = day[dated] - (running - clock)[dated]
    values, counts = np.unique(starts, return_counts=True)
    if counts.max() > 0.5 * starts.size:
        return running + float(values[np.argmax(counts)]), True
    # Recordings of several days in one file: each sentence takes the date last reported.
    last = np.maximum.accumulate(np.where(dated, np.arange(day.size), 0))
    last[: int(np.argmax(dated))] = int(np.argmax(dated))
    reported = day[last] + clock[last]
    time = day[last] + clock
    return time + DAY * np.round((reported - time) / DAY), True


def _nothing(path: Path, data: bytes, lost: Counter[str]) -> str:
    if lost:
        why = ", ".join(f"{count} {reason}" for reason, count in lost.items())
        return f"{path} has no usable NMEA sentence ({why}); record it again with a fix"
    if _OTHER.search(data):
        return (
            f"{path} has NMEA sentences, but none of RMC, GGA, GNS, GST, VTG; "
            "turn RMC and GGA on at the receiver"
        )
    return (
        f"{path} holds no NMEA sentence such as $GPRMC; u-blox receivers send them once "
        "NMEA output is turned on"
    )
