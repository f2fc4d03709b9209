"""What a kind of source is: one frozen record, and what all kinds are given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from weighbridge.errors import ConfigError
from weighbridge.io.dbc import DbcSource
from weighbridge.io.mapping import MappingSource
from weighbridge.live.source import Source


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceOptions:
    """What the command line says of all sources.

    Attributes
    ----------
    dbc : files that name the signals of CAN frames; those of the mapping when none is given
    mapping : names of those signals that are wanted; None for canonical names
    listen_only : nothing is sent to the vehicle
    """

    dbc: tuple[DbcSource, ...] = ()
    mapping: MappingSource | None = None
    listen_only: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceKind:
    """One kind of source.

    Attributes
    ----------
    name : before the first colon, as in ``can:socketcan:can0``
    form : how one is written, for people
    about : what it does, one sentence
    make : makes a source of what follows the first colon
    asks : whether it sends requests to the vehicle
    package : library it needs that is no dependency of the project; empty for none
    """

    name: str
    form: str
    about: str
    make: Callable[[str, SourceOptions], Source]
    asks: bool = False
    package: str = ""


def parted_rate(text: str, what: str) -> tuple[str, int | None]:
    """Take a rate off the end of a place: ``/dev/ttyUSB0@38400`` has 38400, ``can0`` has None.

    Raises
    ------
    ConfigError
        What follows the last ``@`` is no positive whole number.
    """
    place, mark, rate = text.rpartition("@")
    if not mark:
        return text, None
    if not (rate.isascii() and rate.isdigit() and 0 < int(rate) < 100_000_000):
        raise ConfigError(f"source {text!r}: {rate!r} is no {what}; write a whole number after @")
    return place, int(rate)


def checked_port(text: str, source: str) -> int:
    """Return the number of a network port.

    Raises
    ------
    ConfigError
        It is none.
    """
    if not (text.isascii() and text.isdigit() and 0 < int(text) < 65536):
        raise ConfigError(f"source {source!r}: {text!r} is no port; write a number up to 65535")
    return int(text)
