"""Every kind of source, one record each: the only place that lists them.

A package of its own adds a kind by an entry point of the group ``weighbridge.sources`` that
names a `weighbridge.live.sources.kind.SourceKind`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from weighbridge.arguments import near_miss
from weighbridge.errors import ConfigError
from weighbridge.io.dbc import DbcSource
from weighbridge.io.mapping import MappingSource
from weighbridge.live.source import Source
from weighbridge.live.sources import canbus, elm, gpsd, iio, lines, nmea, obd, ubx
from weighbridge.live.sources.kind import SourceKind, SourceOptions
from weighbridge.registry import Registry

GROUP: Final = "weighbridge.sources"
"""Entry points by which packages add kinds of sources."""

SOURCES: Final[Registry[SourceKind]] = Registry(
    SourceKind,
    GROUP,
    (
        SourceKind(
            name="can",
            form="can:INTERFACE:CHANNEL[@BITRATE]",
            about="listens to a CAN bus and reads the signals of a DBC, and answers of OBD-II "
            "that another device asks for",
            make=canbus.make_can,
            package="python-can",
        ),
        SourceKind(
            name="j1939",
            form="j1939:INTERFACE:CHANNEL[@BITRATE]",
            about="listens to the CAN bus of a truck or bus (SAE J1939) and sends nothing",
            make=canbus.make_j1939,
            package="python-can",
        ),
        SourceKind(
            name="obd",
            form="obd:INTERFACE:CHANNEL[@BITRATE]",
            about="asks a car for OBD-II values over a CAN interface",
            make=obd.make_obd,
            asks=True,
            package="can-isotp",
        ),
        SourceKind(
            name="elm",
            form="elm:PATH[@BAUD], elm:tcp:HOST:PORT or elm:ble:ADDRESS",
            about="asks a car for OBD-II values by an ELM327 adapter on USB, Wi-Fi or Bluetooth",
            make=elm.make_elm,
            asks=True,
            package="serialx",
        ),
        SourceKind(
            name="gpsd",
            form="gpsd:HOST:PORT",
            about="takes position, speed and course from gpsd",
            make=gpsd.make_gpsd,
        ),
        SourceKind(
            name="nmea",
            form="nmea:PATH[@BAUD] or nmea:tcp:HOST:PORT",
            about="takes position, speed and course from a GNSS receiver that sends NMEA 0183",
            make=nmea.make_nmea,
            package="serialx",
        ),
        SourceKind(
            name="ubx",
            form="ubx:PATH[@BAUD] or ubx:tcp:HOST:PORT",
            about="takes position and velocity from a GNSS receiver of u-blox that sends UBX, "
            "NMEA 0183 or both",
            make=ubx.make_ubx,
            package="pyubx2",
        ),
        SourceKind(
            name="lines",
            form="lines:- or lines:udp:[HOST:]PORT",
            about="takes JSON lines of any signal from standard input or by UDP",
            make=lines.make_lines,
        ),
        SourceKind(
            name="iio",
            form="iio:NAME[@RATE]",
            about="reads an accelerometer and a gyro of Linux' industrial I/O",
            make=iio.make_iio,
        ),
    ),
)
"""Kinds of sources by name."""


def parse_source(
    text: str,
    *,
    dbc: Sequence[DbcSource] = (),
    mapping: MappingSource | None = None,
    listen_only: bool = False,
) -> Source:
    """Make the source that a text names, such as ``can:socketcan:can0``.

    Parameters
    ----------
    text : kind, colon and where it is found
    dbc, mapping : names of signals in CAN frames, as of `weighbridge.read_drive`
    listen_only : refuse what sends anything to the vehicle

    Raises
    ------
    ConfigError
        No such kind, no such place, or it sends requests and ``listen_only`` is set.
    MissingExtraError
        A library is not installed.
    """
    name, mark, rest = text.partition(":")
    kind = SOURCES.get(name)
    if kind is None:
        meant = near_miss(name, SOURCES)
        hint = f"; did you mean {meant}?" if meant else ""
        raise ConfigError(
            f"source {text!r} is of no known kind; begin it with {SOURCES.names}{hint}"
        )
    if not mark or not rest:
        raise ConfigError(f"source {text!r} says no place; write {kind.form}")
    if listen_only and kind.asks:
        raise ConfigError(
            f"source {text!r} asks the vehicle for every value and cannot listen only; use "
            "can:INTERFACE:CHANNEL, which sends nothing, or leave --listen-only out"
        )
    options = SourceOptions(dbc=tuple(dbc), mapping=mapping, listen_only=listen_only)
    return kind.make(rest, options)
