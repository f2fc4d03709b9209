"""Position, speed and course from gpsd: JSON over TCP."""

from __future__ import annotations

import datetime as dt
import json
import math
from collections.abc import Callable, Mapping
from threading import Event
from time import monotonic
from typing import Any, Final

from weighbridge.errors import ConfigError
from weighbridge.live.clock import now
from weighbridge.live.device_clock import DeviceClock
from weighbridge.live.source import Samples
from weighbridge.live.sources.gathered import BLOCK, Gathered
from weighbridge.live.sources.kind import SourceOptions, checked_port
from weighbridge.live.sources.links import TcpLink

PORT: Final = 2947
"""Port that gpsd listens on."""

SILENT: Final = 5.0
"""Without a fix for so long there is a trouble [s]."""

_WATCH: Final = b'?WATCH={"enable":true,"json":true};\n'
_SLICE: Final = 0.1
_MOST_TEXT: Final = 65_536

# A report of class TPV: its fields, and what they are (gpsd_json(5)); heights above the sea first.
_FIELDS: Final = (
    ("latitude", ("lat",), math.radians(1.0)),
    ("longitude", ("lon",), math.radians(1.0)),
    ("altitude", ("altMSL", "altHAE", "alt"), 1.0),
    ("gnss_speed", ("speed",), 1.0),
    ("gnss_course", ("track",), math.radians(1.0)),
    ("gnss_accuracy", ("eph",), 1.0),
)
_FIX_2D, _FIX_3D = 2, 3


def make_gpsd(text: str, options: SourceOptions) -> GpsdSource:
    """Make a source of gpsd; see `weighbridge.live.sources.kind.SourceKind`.

    Raises
    ------
    ConfigError
        The place cannot be used.
    """
    host, _, port = text.rpartition(":")
    if not host:
        raise ConfigError(f"source 'gpsd:{text}' names no host; write gpsd:localhost:{PORT}")
    return GpsdSource(f"gpsd:{text}", host, checked_port(port, f"gpsd:{text}"))


class GpsdSource:
    """Listens to gpsd.

    Parameters
    ----------
    name : as on the command line
    host, port : where gpsd listens
    """

    def __init__(self, name: str, host: str, port: int) -> None:
        self.name = name
        self.trouble = ""
        self._host = host
        self._port = port

    def run(self, put: Callable[[Samples], None], stop: Event) -> None:
        """Hand over fixes until asked to stop; see `weighbridge.live.source.Source.run`."""
        self.trouble = ""
        link = TcpLink(self._host, self._port)
        gathered = Gathered(put)
        clock = DeviceClock()
        text = b""
        fixed = monotonic()
        try:
            link.write(_WATCH)
            while not stop.is_set():
                *lines, text = (text + link.read(_SLICE)).split(b"\n")
                text = text[-_MOST_TEXT:]
                for line in lines:
                    stamp, values = read_report(line)
                    if "latitude" in values:
                        fixed, self.trouble = monotonic(), ""
                    if values:
                        arrived = now()
                        known = math.isfinite(stamp)
                        gathered.add(clock.host(stamp, arrived) if known else arrived, values)
                gathered.flush(BLOCK)
                if monotonic() - fixed > SILENT:
                    self.trouble = (
                        "gpsd has no fix; is a receiver connected, with a view of the sky?"
                    )
            gathered.flush()
        finally:
            self.trouble = ""
            link.close()


def read_report(line: bytes) -> tuple[float, dict[str, float]]:
    """Read one line of gpsd.

    Returns
    -------
    When it was measured by the receiver [s since 1970], NaN where it does not say; values [SI] by
    canonical name, none where it is no fix.
    """
    try:
        report = json.loads(line)
    except (ValueError, RecursionError):
        return math.nan, {}
    if not isinstance(report, dict):
        return math.nan, {}
    if report.get("class") == "SKY":
        dilution = _number(report, ("hdop",))
        return math.nan, {"hdop": dilution} if math.isfinite(dilution) else {}
    mode = report.get("mode")
    if report.get("class") != "TPV" or mode not in (_FIX_2D, _FIX_3D):
        return math.nan, {}
    values = {name: _number(report, keys) * factor for name, keys, factor in _FIELDS}
    if mode == _FIX_2D:
        values.pop("altitude")
    return _instant(report.get("time")), {n: v for n, v in values.items() if math.isfinite(v)}


def _number(report: Mapping[str, Any], keys: tuple[str, ...]) -> float:
    for key in keys:
        value = report.get(key)
        if isinstance(value, int | float) and not isinstance(value, bool):
            return float(value)
    return math.nan


def _instant(text: object) -> float:
    """Seconds since 1970 of a date such as ``2026-01-31T17:58:02.200Z``."""
    try:
        return dt.datetime.fromisoformat(str(text)).timestamp()
    except (ValueError, OverflowError, OSError):
        return math.nan
