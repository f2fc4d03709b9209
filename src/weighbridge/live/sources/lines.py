"""JSON lines of any signal: from standard input, or by UDP."""

from __future__ import annotations

import json
import logging
import math
import os
import select
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event
from typing import Any, Final

from weighbridge.errors import ConfigError, SourceError
from weighbridge.io.columns import UnitlessColumnError, near_column, parse_column
from weighbridge.live.clock import now
from weighbridge.live.device_clock import DeviceClock
from weighbridge.live.source import Samples
from weighbridge.live.sources.gathered import BLOCK, SLICE, Gathered
from weighbridge.live.sources.kind import SourceOptions, checked_port
from weighbridge.signals import scalar_to_si

_logger = logging.getLogger(__name__)

LOOPBACK: Final = "127.0.0.1"
"""Only programs of this host can send, unless a host is named."""

LONGEST: Final = 65_536
"""Bytes of a line at most."""

_AXES: Final = ("accel", "gyro")


def make_lines(text: str, options: SourceOptions) -> LinesSource:
    """Make a source of lines; see `weighbridge.live.sources.kind.SourceKind`.

    Raises
    ------
    ConfigError
        The place cannot be used.
    """
    name = f"lines:{text}"
    if text == "-":
        return LinesSource(name, _standard_input)
    kind, _, place = text.partition(":")
    if kind != "udp":
        raise ConfigError(f"source {name!r}: write lines:- or lines:udp:PORT")
    host, _, port = place.rpartition(":")
    number = checked_port(port, name)
    return LinesSource(name, lambda: _datagrams(host or LOOPBACK, number))


class LinesSource:
    """Reads lines.

    Parameters
    ----------
    name : as on the command line
    open_reader : opens the way they come; its reader gives bytes, none after a while, or None at
        the end
    """

    def __init__(self, name: str, open_reader: Callable[[], Any]) -> None:
        self.name = name
        self.renewed = 0
        self._open = open_reader

    def run(self, put: Callable[[Samples], None], stop: Event) -> None:
        """Hand over what lines say until asked to stop; see `live.source.Source.run`."""
        reader = LineReader(self.name)
        with Gathered(put) as gathered, self._open() as read:
            while not stop.is_set():
                data = read()
                if data is None:
                    break
                for time, values in reader.read(data, now()):
                    gathered.add(time, values)
                gathered.flush(BLOCK)
                self.renewed = reader.renewed


@contextmanager
def _standard_input() -> Iterator[Callable[[], bytes | None]]:
    number = sys.stdin.fileno()

    def read() -> bytes | None:
        if not select.select([number], [], [], SLICE)[0]:
            return b""
        return os.read(number, LONGEST) or None

    yield read


@contextmanager
def _datagrams(host: str, port: int) -> Iterator[Callable[[], bytes]]:
    try:
        family, kind, protocol, _, place = socket.getaddrinfo(
            host, port, type=socket.SOCK_DGRAM, flags=socket.AI_PASSIVE
        )[0]
        opened = socket.socket(family, kind, protocol)
    except OSError as error:
        raise SourceError(f"lines:udp:{host}:{port} cannot be used ({error})") from error
    with opened:
        try:
            opened.bind(place)
        except OSError as error:
            raise SourceError(
                f"lines:udp:{host}:{port} cannot be used ({error}); is another program at it?"
            ) from error
        opened.settimeout(SLICE)

        def read() -> bytes:
            try:
                # A datagram ends a line, whether it says so or not.
                return opened.recv(LONGEST) + b"\n"
            except TimeoutError:
                return b""

        yield read


class _UnfitLineError(Exception):
    """A line without a value; its text is why."""


class LineReader:
    """Turns lines into samples; what cannot be understood is counted and reported once.

    Parameters
    ----------
    name : of the source, for messages
    """

    def __init__(self, name: str) -> None:
        self.bad = 0
        self._name = name
        self._text = b""
        self._clock = DeviceClock()
        self._columns: dict[str, tuple[str, str] | None] = {}
        self._reported: set[str] = set()

    @property
    def renewed(self) -> int:
        """How often the sender's clock has begun anew."""
        return self._clock.renewed

    def read(self, data: bytes, arrived: float) -> list[tuple[float, dict[str, float]]]:
        """Return instants [s] and values [SI] of the lines that are whole now.

        Parameters
        ----------
        data : what came
        arrived : when, by the host's clock [s]
        """
        *lines, rest = (self._text + data).split(b"\n")
        self._text = rest[-LONGEST:]
        rows = []
        for line in filter(bytes.strip, lines):
            try:
                stamp, values = self._said(line)
            except _UnfitLineError as error:
                self.bad += 1
                shown = line[:60].decode("utf-8", "replace")
                why = f"a line {error} and is left out, as is any like it: {shown!r}"
                self._tell(str(error), why)
                continue
            if values:
                rows.append(
                    (arrived if stamp is None else self._clock.host(stamp, arrived), values)
                )
        return rows

    def _said(self, line: bytes) -> tuple[float | None, dict[str, float]]:
        """Stamp by the sender's clock [s], if any, and values [SI] of one line."""
        try:
            said = json.loads(line)
        except (ValueError, RecursionError):
            raise _UnfitLineError("is no JSON") from None
        if not isinstance(said, dict):
            raise _UnfitLineError("is no JSON object")
        stamp = said.pop("t", None)
        if stamp is not None and not _is_number(stamp):
            raise _UnfitLineError("has a t that is no number of seconds")
        values: dict[str, float] = {}
        for key, value in said.items():
            if key in _AXES:
                if not (
                    isinstance(value, list) and len(value) == 3 and all(map(_is_number, value))
                ):
                    raise _UnfitLineError(f"has an {key} that is no list of three numbers")
                values |= {f"{key}_{a}": float(v) for a, v in zip("xyz", value, strict=True)}
            elif value is not None and (column := self._column(key)) is not None:
                if not _is_number(value):
                    raise _UnfitLineError(f"has a {key} that is no number")
                name, unit = column
                values[name] = scalar_to_si(float(value), unit) if unit else float(value)
        return None if stamp is None else float(stamp), values

    def _column(self, key: str) -> tuple[str, str] | None:
        """Name and unit of a column as in a drive's files; None where it is unknown."""
        if key not in self._columns:
            self._columns[key] = self._looked_up(key)
        return self._columns[key]

    def _looked_up(self, key: str) -> tuple[str, str] | None:
        found = None
        why = "is not known"
        # The columns of a GNSS table have names that say too little elsewhere.
        for table in (None, "gnss"):
            try:
                found = found or parse_column(key, table)
            except UnitlessColumnError as error:
                why = str(error)
        if found is None:
            near = near_column(key)
            hint = f"; did you mean {near}?" if near and why == "is not known" else ""
            self._tell(key, f"signal {key!r:.60} {why}{hint}; it is left out")
            return None
        return found[0].name, found[1]

    def _tell(self, key: str, text: str) -> None:
        if key not in self._reported and len(self._reported) < 20:
            self._reported.add(key)
            _logger.warning("%s: %s", self._name, text)


def _is_number(value: object) -> bool:
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and abs(value) < 1e300
        and math.isfinite(value)
    )
