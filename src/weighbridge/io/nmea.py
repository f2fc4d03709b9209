"""NMEA 0183: position, speed and course as receivers send them, u-blox among them.

Sentences RMC, GGA, GNS, GST and VTG are read, of any talker; between them any
other bytes may stand, as in a mixed u-blox recording.
"""

from __future__ import annotations

import datetime as dt
import math
import re
from collections import Counter
from pathlib import Path
from typing import Any, Final

import numpy as np

from weighbridge.errors import DriveError, MissingExtraError
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping
from weighbridge.io.table import unwrapped
from weighbridge.signals import Floats, Problem
from weighbridge.signals.cleaning import clean_columns
from weighbridge.signals.units import to_si

# Longest sentence of the standard is 82 characters; receivers send longer ones of their own.
_SENTENCE: Final = re.compile(rb"\$[A-Z]{2}(?:RMC|GGA|GNS|GST|VTG)[ -#%-~]{0,180}")
_OTHER: Final = re.compile(rb"\$[A-Z]{5,6},")
_DAY: Final = 86_400.0

# Quality 0 is no fix, 6 dead reckoning, 7 put in by hand, 8 simulated (NMEA 0183, GGA).
_NO_FIX: Final = frozenset((0, 6, 7, 8))


# Fields up to the last one read: without a checksum a sentence that was cut off shows only here.
_FIELDS: Final = {"RMC": 9, "GGA": 9, "GNS": 9, "GST": 7, "VTG": 7}


class _Rows:
    """Values of one kind of sentence, each with the stamp of its epoch."""

    def __init__(self, *names: str) -> None:
        self.names = names
        self.stamps: list[int] = []
        self.values: list[tuple[float, ...]] = []

    def add(self, stamp: int, *values: float) -> None:
        self.stamps.append(stamp)
        self.values.append(values)


class _Sentences:
    """What the sentences of a file say, one after another.

    Attributes
    ----------
    position, minimum : of GGA and GNS, and of RMC, which has less of it
    motion, velocity : of RMC in knots, of VTG in km/h
    accuracy : of GST
    clocks, days : time of day and date of each epoch [s]
    lost : how many sentences were left out, by reason
    """

    def __init__(self) -> None:
        self.position = _Rows("latitude", "longitude", "altitude", "hdop")
        self.minimum = _Rows("latitude", "longitude")
        self.motion = _Rows("gnss_speed", "gnss_course")
        self.velocity = _Rows("gnss_speed", "gnss_course")
        self.accuracy = _Rows("gnss_accuracy")
        self.clocks: list[float] = []
        self.days: list[float] = []
        self.lost: Counter[str] = Counter()

    def take(self, message: Any, *, checked: bool) -> None:
        """Take what a parsed sentence says; damage in a field is raised as the parser has it."""
        kind = message.sentence_type
        if len(message.data) < _FIELDS[kind]:
            self.lost["damaged"] += 1
            return
        if kind == "VTG":
            # It has no time of its own and follows the sentences of its epoch.
            row = (_number(message.spd_over_grnd_kmph), _number(message.true_track))
            if self.clocks:
                self.velocity.add(len(self.clocks) - 1, *row)
            return
        clock = _clock(message)
        day = _day(message) if kind == "RMC" else math.nan
        if clock is None or not _fixed(message, kind):
            self.lost["without a fix"] += 1
            return
        # Nothing is added before all fields are known to be sound.
        found = self._read(message, kind)
        for rows, values in found:
            rows.add(len(self.clocks), *values)
        self.clocks.append(clock)
        self.days.append(day)
        if not checked:
            self.lost["taken without a checksum"] += 1

    def _read(self, message: Any, kind: str) -> list[tuple[_Rows, tuple[float, ...]]]:
        """Read the fields of a sentence with a time, for the rows they belong to."""
        if kind == "GST":
            spread = math.hypot(
                _number(message.std_dev_latitude), _number(message.std_dev_longitude)
            )
            return [(self.accuracy, (spread,))]
        place = (_coordinate(message, "lat", 90.0), _coordinate(message, "lon", 180.0))
        if kind == "RMC":
            moving = (_number(message.spd_over_grnd), _number(message.true_course))
            return [(self.minimum, place), (self.motion, moving)]
        dilution = message.horizontal_dil if kind == "GGA" else message.hdop
        return [(self.position, (*place, _number(message.altitude), _number(dilution)))]


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
    try:
        import pynmea2
    except ImportError:
        raise MissingExtraError("pynmea2", "position", f"reading {path.name}") from None
    data = path.read_bytes()
    log = Log(path)
    read = _Sentences()
    lost = read.lost
    for found in _SENTENCE.finditer(data):
        text = found.group().decode("ascii").rstrip()
        try:
            read.take(pynmea2.parse(text), checked=b"*" in found.group()[-5:])
        except pynmea2.ChecksumError:
            lost["with a wrong checksum"] += 1
        # The parser leaves damage in a field to whoever asks for it, with errors of many kinds.
        except Exception:
            lost["damaged"] += 1
    if not read.clocks:
        raise DriveError(_nothing(path, data, lost))
    time, log.absolute = _time(np.array(read.clocks), np.array(read.days))
    if mapping:
        time = time + mapping.time.offset
    for reason, count in lost.items():
        log.problems.append(Problem("", f"{path.name}: {count} NMEA sentences {reason}"))
    known = read.position if read.position.stamps else read.minimum
    speeds, unit = (read.motion, "kn") if read.motion.stamps else (read.velocity, "kmh")
    for rows, units in (
        (known, ("deg", "deg", "m", "")),
        (speeds, (unit, "deg")),
        (read.accuracy, ("m",)),
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
    signals, problems = clean_columns(time[np.array(rows.stamps)], columns, log.path.name)
    log.signals += signals
    log.problems += problems


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
    return (date - dt.date(1970, 1, 1)).days * _DAY


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
    # Recordings of several days in one file: each sentence takes the date last told.
    last = np.maximum.accumulate(np.where(dated, np.arange(day.size), 0))
    last[: int(np.argmax(dated))] = int(np.argmax(dated))
    told = day[last] + clock[last]
    time = day[last] + clock
    return time + _DAY * np.round((told - time) / _DAY), True


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
