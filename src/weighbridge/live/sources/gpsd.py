"""Position, speed and course from gpsd: JSON over TCP."""

from __future__ import annotations

import datetime as dt
import json
import math
from collections.abc import Mapping
from typing import Any, Final

from weighbridge.live.device_clock import DeviceClock
from weighbridge.live.sources.kind import SourceOptions
from weighbridge.live.sources.links import Link, tcp
from weighbridge.live.sources.receiver import ReceiverSource

PORT: Final = 2947
"""Port that gpsd listens on."""

_WATCH: Final = b'?WATCH={"enable":true,"json":true};\n'
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


def make_gpsd(text: str, options: SourceOptions) -> ReceiverSource:
    """Make a source of gpsd; see `weighbridge.live.sources.kind.SourceKind`.

    Raises
    ------
    ConfigError
        The place cannot be used.
    """
    name = f"gpsd:{text}"
    connected = tcp(name, text, f"gpsd:localhost:{PORT}")

    def watching() -> Link:
        link = connected()
        link.write(_WATCH)
        return link

    no_fix = "gpsd has no fix; is a receiver connected, with a view of the sky?"
    return ReceiverSource(name, watching, ReportReader, no_fix, shared=True)


class ReportReader:
    """Finds reports of a fix among the lines of gpsd."""

    def __init__(self) -> None:
        self._text = b""
        self._clock = DeviceClock()

    def read(self, data: bytes, arrived: float) -> list[tuple[float, dict[str, float]]]:
        """Return instants [s] and values [SI] of the lines that are whole now.

        Parameters
        ----------
        data : what came
        arrived : when, by the host's clock [s]
        """
        *lines, rest = (self._text + data).split(b"\n")
        self._text = rest[-_MOST_TEXT:]
        rows = []
        for line in lines:
            stamp, values = read_report(line)
            if values:
                known = math.isfinite(stamp)
                rows.append((self._clock.host(stamp, arrived) if known else arrived, values))
        return rows


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
