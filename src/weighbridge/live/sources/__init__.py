"""Every kind of source, one record each; `kinds.toml` lists them.

A package of its own adds a kind by an entry point of the group ``weighbridge.sources`` that
names a `weighbridge.live.sources.kind.SourceKind`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from weighbridge.arguments import near_miss
from weighbridge.data import toml_of
from weighbridge.errors import ConfigError
from weighbridge.first_use import at_first_call
from weighbridge.io.dbc import DbcSource
from weighbridge.io.mapping import MappingSource
from weighbridge.live.source import Source
from weighbridge.live.sources.kind import SourceKind, SourceOptions
from weighbridge.registry import Registry

GROUP: Final = "weighbridge.sources"
"""Entry points by which packages add kinds of sources."""


def _kind(name: str, *, make: str, **others: Any) -> SourceKind:
    return SourceKind(name=name, make=at_first_call(f"{__name__}.{make}"), **others)


_LISTED: Final = toml_of("live.sources", "kinds.toml")

SOURCES: Final[Registry[SourceKind]] = Registry(
    SourceKind, GROUP, tuple(_kind(name, **record) for name, record in _LISTED.items())
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
