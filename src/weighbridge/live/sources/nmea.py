"""GNSS receivers that send NMEA 0183 over a serial line."""

from __future__ import annotations

import math
from collections.abc import Callable
from threading import Event
from time import monotonic
from typing import Final

from weighbridge.errors import ConfigError
from weighbridge.io.nmea import SENTENCE, Sentence, UnfitSentenceError, read_sentence
from weighbridge.live.clock import now
from weighbridge.live.device_clock import DeviceClock
from weighbridge.live.source import Samples
from weighbridge.live.sources.gathered import BLOCK, Gathered
from weighbridge.live.sources.kind import SourceOptions, parted_rate
from weighbridge.live.sources.links import Link, SerialLink
from weighbridge.live.sources.lock import DeviceLock
from weighbridge.signals.units import scalar_to_si

BAUD: Final = 9600
"""Rate that receivers leave the works with [bit/s]."""

SILENT: Final = 5.0
"""A receiver that sends no sentence with a fix for so long has a trouble [s]."""

_SLICE: Final = 0.1
_MOST_TEXT: Final = 4096
_DAY: Final = 86_400.0


def make_nmea(text: str, options: SourceOptions) -> NmeaSource:
    """Make a source of a receiver; see `weighbridge.live.sources.kind.SourceKind`.

    Raises
    ------
    ConfigError
        The place cannot be used.
    """
    path, baud = parted_rate(text, "baud rate")
    if not path:
        raise ConfigError(f"source 'nmea:{text}' names no port; write nmea:/dev/ttyACM0")
    return NmeaSource(f"nmea:{text}", lambda: SerialLink(path, baud or BAUD))


class NmeaSource:
    """Listens to a receiver.

    Parameters
    ----------
    name : as on the command line
    open_link : opens the way to it
    """

    def __init__(self, name: str, open_link: Callable[[], Link]) -> None:
        self.name = name
        self.trouble = ""
        self._open = open_link

    def run(self, put: Callable[[Samples], None], stop: Event) -> None:
        """Hand over fixes until told to stop; see `weighbridge.live.source.Source.run`."""
        self.trouble = ""
        with DeviceLock(self.name):
            link = self._open()
            try:
                self._listen(link, put, stop)
            finally:
                self.trouble = ""
                link.close()

    def _listen(self, link: Link, put: Callable[[Samples], None], stop: Event) -> None:
        gathered = Gathered(put)
        reader = SentenceReader()
        heard = monotonic()
        fixed = heard
        while not stop.is_set():
            data = link.read(_SLICE)
            if data:
                heard = monotonic()
            for time, values in reader.read(data, now()):
                fixed, self.trouble = monotonic(), ""
                gathered.add(time, values)
            gathered.flush(BLOCK)
            if monotonic() - heard > SILENT:
                self.trouble = f"the receiver sent nothing for {SILENT:g} s; check cable and rate"
            elif monotonic() - fixed > SILENT:
                self.trouble = "the receiver has no fix, or sends no NMEA sentence such as RMC"
        gathered.flush()


class SentenceReader:
    """Finds sentences in bytes as they come, whatever stands between them."""

    def __init__(self) -> None:
        self._text = b""
        self._clock = DeviceClock()
        self._before = math.nan
        self._days = 0.0
        self._time = math.nan
        self._motion_told = False

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
                self._time = self._clock.host(self._running(said.clock), arrived)
            values = self._values(said)
            if values and math.isfinite(self._time):
                rows.append((self._time, values))
        return rows

    def _running(self, clock: float) -> float:
        """Time of day that goes on over midnight [s]."""
        if clock - self._before < -0.5 * _DAY:
            self._days += _DAY
        self._before = clock
        return clock + self._days

    def _values(self, said: Sentence) -> dict[str, float]:
        """Values of one sentence; as in a file, RMC tells the speed and GGA the place."""
        values: dict[str, float] = {}
        if said.kind == "RMC":
            self._motion_told = True
            values = _motion(said.motion, "kn")
        elif said.kind == "VTG" and not self._motion_told:
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
