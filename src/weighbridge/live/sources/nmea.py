"""GNSS receivers that send NMEA 0183."""

from __future__ import annotations

import math
from typing import Final

from weighbridge.io import Sentence, UnfitSentenceError, read_sentence
from weighbridge.io.nmea import SENTENCE
from weighbridge.live.device_clock import DeviceClock
from weighbridge.live.sources.kind import SourceOptions
from weighbridge.live.sources.links import serial_or_tcp
from weighbridge.live.sources.receiver import ReceiverSource
from weighbridge.signals import scalar_to_si

BAUD: Final = 9600
"""Rate that receivers leave the works with [bit/s]."""

_MOST_TEXT: Final = 4096
_DAY: Final = 86_400.0


def make_nmea(text: str, options: SourceOptions) -> ReceiverSource:
    """Make a source of a receiver; see `weighbridge.live.sources.kind.SourceKind`.

    Raises
    ------
    ConfigError
        The place cannot be used.
    """
    open_link = serial_or_tcp("nmea", text, BAUD)
    no_fix = "the receiver has no fix, or sends no NMEA sentence such as RMC"
    return ReceiverSource(f"nmea:{text}", open_link, SentenceReader, no_fix)


class SentenceReader:
    """Finds sentences in bytes as they come, whatever stands between them."""

    def __init__(self) -> None:
        self._text = b""
        self._clock = DeviceClock(_DAY)
        self._time = math.nan
        self._motion_reported = False

    def read(self, data: bytes, arrived: float) -> list[tuple[float, dict[str, float]]]:
        """Return instants [s] and values [SI] of the sentences that are whole now.

        Parameters
        ----------
        data : what came
        arrived : when, by the host's clock [s]
        """
        text = self._text + data
        end = text.rfind(b"\n") + 1
        whole, self._text = text[:end], text[end:][-_MOST_TEXT:]
        rows = []
        for found in SENTENCE.finditer(whole):
            try:
                said = read_sentence(found.group().decode("ascii").rstrip())
            except UnfitSentenceError:
                continue
            if said.clock is not None:
                self._time = self._clock.host(said.clock, arrived)
            values = self._values(said)
            if values and math.isfinite(self._time):
                rows.append((self._time, values))
        return rows

    def _values(self, said: Sentence) -> dict[str, float]:
        """Values of one sentence; as in a file, RMC shows the speed and GGA the place."""
        values: dict[str, float] = {}
        if said.kind == "RMC":
            self._motion_reported = True
            values = _motion(said.motion, "kn")
        elif said.kind == "VTG" and not self._motion_reported:
            values = _motion(said.motion, "kmh")
        elif said.kind == "GST":
            values = {"gnss_accuracy": said.spread}
        elif said.kind in ("GGA", "GNS"):
            latitude, longitude, height, dilution = said.place
            values = {
                "latitude": math.radians(latitude),
                "longitude": math.radians(longitude),
                "altitude": height,
                "hdop": dilution,
            }
        return {name: value for name, value in values.items() if math.isfinite(value)}


def _motion(motion: tuple[float, ...], unit: str) -> dict[str, float]:
    speed, course = motion
    return {"gnss_speed": scalar_to_si(speed, unit), "gnss_course": math.radians(course)}
