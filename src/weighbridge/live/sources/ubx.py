"""GNSS receivers of u-blox that send UBX, their own protocol, alone or among NMEA 0183."""

from __future__ import annotations

import math
import re
from typing import Any, Final

from weighbridge.errors import MissingExtraError
from weighbridge.live.device_clock import DeviceClock
from weighbridge.live.sources.kind import SourceOptions
from weighbridge.live.sources.links import serial_or_tcp
from weighbridge.live.sources.nmea import SentenceReader
from weighbridge.live.sources.receiver import SILENT, ReceiverSource

BAUD: Final = 38_400
"""Rate of the serial port of receivers from the ninth generation on [bit/s]."""

# Navigation, position, velocity and time (NAV-PVT), in its lengths before and since protocol 15.
_HEADER: Final = re.compile(rb"\xb5b\x01\x07(?:\x54|\x5c)\x00")
_AROUND: Final = 8
_LONGEST: Final = 92 + _AROUND
_WEEK: Final = 604_800.0
# Fix types: 2 and 3 are a fix in two and three dimensions, 4 is one with dead reckoning. Dead
# reckoning alone (1) and time alone (5) are none.
_FLAT: Final = 2
_FIXED: Final = (_FLAT, 3, 4)


def make_ubx(text: str, options: SourceOptions) -> ReceiverSource:
    """Make a source of a receiver; see `weighbridge.live.sources.kind.SourceKind`.

    Raises
    ------
    ConfigError
        The place cannot be used.
    """
    open_link = serial_or_tcp("ubx", text, BAUD)
    no_fix = "the receiver has no fix, or sends no UBX message NAV-PVT and no NMEA sentence"
    return ReceiverSource(f"ubx:{text}", open_link, UbxReader, no_fix)


class UbxReader:
    """Finds messages NAV-PVT in bytes as they come, and sentences where there are none.

    Raises
    ------
    MissingExtraError
        pyubx2 is not installed.

    References
    ----------
    u-blox, Interface Description, section UBX-NAV-PVT.
    """

    def __init__(self) -> None:
        try:
            import pyubx2
        except ImportError:
            raise MissingExtraError("pyubx2", "live", "reading UBX messages") from None
        self._library: Any = pyubx2
        self._data = b""
        self._clock = DeviceClock(_WEEK)
        self._sentences = SentenceReader()
        self._reported = -math.inf

    def read(self, data: bytes, arrived: float) -> list[tuple[float, dict[str, float]]]:
        """Return instants [s] and values [SI] of what is whole now.

        Sentences say less of the same fixes: while messages come, they are left out.
        """
        rows = []
        for message in self._messages(data):
            self._reported = arrived
            if values := _values(message):
                rows.append((self._clock.host(1e-3 * message.iTOW, arrived), values))
        sentences = self._sentences.read(data, arrived)
        return sentences if arrived - self._reported > SILENT else rows

    def _messages(self, data: bytes) -> list[Any]:
        """Messages that are whole and undamaged; after a damaged one it looks on at once."""
        text = self._data + data
        found = []
        at = 0
        while (header := _HEADER.search(text, at)) is not None:
            begin = header.start()
            end = begin + _AROUND + text[begin + 4]
            if end > len(text):
                break
            try:
                found.append(self._library.UBXReader.parse(text[begin:end]))
                at = end
            except self._library.UBXParseError:
                at = begin + 1
        self._data = text[at:][-_LONGEST:]
        return found


def _values(message: Any) -> dict[str, float]:
    """Values [SI] of one message; empty without a fix."""
    if not message.gnssFixOk or message.fixType not in _FIXED:
        return {}
    north, east = 1e-3 * message.velN, 1e-3 * message.velE
    values = {"gnss_speed": math.hypot(north, east)}
    if north or east:
        values["gnss_course"] = math.atan2(east, north) % math.tau
    if not message.invalidLlh:
        values |= {
            "latitude": math.radians(message.lat),
            "longitude": math.radians(message.lon),
            "gnss_accuracy": 1e-3 * message.hAcc,
        }
        if message.fixType != _FLAT:
            values["altitude"] = 1e-3 * message.hMSL
    return values
