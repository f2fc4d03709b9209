"""What receiver and sensor send of a drive: NMEA 0183, and JSON lines as ``lines`` reads them."""

from __future__ import annotations

import datetime as dt
import json
import math
from functools import reduce
from operator import xor
from typing import Final

import numpy as np

from weighbridge.signals import Drive, Floats, scalar_from_si
from weighbridge.signals.catalogue import IMU_SIGNALS

_HDOP: Final = 1.0

# Digits after the point: 1e-5 m/s^2 and rad/s are far below the noise of a sensor.
_DIGITS: Final = 5


class Sentences:
    """RMC, GGA and, where the drive knows the accuracy, GST of each fix.

    Parameters
    ----------
    drive : with latitude and longitude
    date : wall-clock time of its first sample, in UTC
    """

    def __init__(self, drive: Drive, date: dt.datetime) -> None:
        self._drive = drive
        self._date = date
        self._start = drive.start
        self._stamps = drive.signals["latitude"].time

    def between(self, start: float, end: float) -> bytes:
        """Sentences of the fixes later than ``start`` and not later than ``end`` [s]."""
        first, last = np.searchsorted(self._stamps, [start, end], side="right")
        return b"".join(self._fix(float(stamp)) for stamp in self._stamps[first:last])

    def _fix(self, stamp: float) -> bytes:
        date = self._date + dt.timedelta(seconds=stamp - self._start)
        clock = f"{date:%H%M%S}.{date.microsecond // 1000:03d}"
        place = ",".join(
            (
                _coordinate(self._value("latitude", stamp), 2, "NS"),
                _coordinate(self._value("longitude", stamp), 3, "EW"),
            )
        )
        speed = _number(scalar_from_si(self._value("gnss_speed", stamp), "kn"), 3)
        course = _number(math.degrees(self._value("gnss_course", stamp)) % 360.0, 2)
        altitude = _number(self._value("altitude", stamp), 2)
        dilution = self._value("hdop", stamp)
        dilution = _HDOP if math.isnan(dilution) else dilution
        texts = [
            f"GPRMC,{clock},A,{place},{speed},{course},{date:%d%m%y},,,A",
            f"GPGGA,{clock},{place},1,12,{dilution:.1f},{altitude},M,0.0,M,,",
        ]
        accuracy = self._value("gnss_accuracy", stamp)
        if not math.isnan(accuracy):
            # Of equal parts to the north and to the east.
            part = f"{accuracy / math.sqrt(2.0):.2f}"
            texts.append(f"GPGST,{clock},{accuracy:.2f},{part},{part},0.0,{part},{part},")
        return b"".join(map(_sentence, texts))

    def _value(self, name: str, stamp: float) -> float:
        signal = self._drive.get(name)
        return math.nan if signal is None else float(signal.at(np.array([stamp]))[0])


def _coordinate(angle: float, digits: int, sides: str) -> str:
    """Degrees and minutes, and the side."""
    degrees, minutes = divmod(round(abs(math.degrees(angle)) * 60.0, 6), 60.0)
    return f"{int(degrees):0{digits}d}{minutes:09.6f},{sides[angle < 0.0]}"


def _number(value: float, places: int) -> str:
    return "" if math.isnan(value) else f"{value:.{places}f}"


def _sentence(text: str) -> bytes:
    return f"${text}*{reduce(xor, text.encode('ascii')):02X}\r\n".encode("ascii")


class InertialLines:
    """A line for each sample of the accelerometer, with the gyro's reading at that instant.

    Parameters
    ----------
    drive : with an accelerometer and a gyro
    """

    def __init__(self, drive: Drive) -> None:
        self._stamps = drive.signals[IMU_SIGNALS[0]].time
        columns = [drive.signals[name] for name in IMU_SIGNALS]
        self._rows = np.round(
            np.stack([np.interp(self._stamps, s.time, s.values) for s in columns], axis=1), _DIGITS
        )

    def between(self, start: float, end: float) -> list[bytes]:
        """Lines of the samples later than ``start`` and not later than ``end`` [s]."""
        first, last = np.searchsorted(self._stamps, [start, end], side="right")
        return [_line(self._stamps[k], self._rows[k]) for k in range(first, last)]


def _line(stamp: float, row: Floats) -> bytes:
    said = {"t": round(float(stamp), 6), "accel": row[:3].tolist(), "gyro": row[3:].tolist()}
    return json.dumps(said).encode("ascii") + b"\n"
