"""Every log format, one record each; `formats.toml` lists them.

A package of its own adds a format by an entry point of the group ``weighbridge.formats`` that
names a `weighbridge.io.format.Format`.
"""

from __future__ import annotations

import difflib
import logging
import sys
from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from weighbridge.data import toml_of
from weighbridge.first_use import at_first_call
from weighbridge.io.format import Format, Takes, starts_with
from weighbridge.io.log import Log
from weighbridge.io.mapping import TableMapping

if TYPE_CHECKING:
    from weighbridge.io.draft import Draft

_logger = logging.getLogger(__name__)

GROUP: Final = "weighbridge.formats"
"""Entry points by which packages add formats."""

_HEAD: Final = 4096


@cache
def _of(path: str) -> Callable[..., Any]:
    """Return a function of a reader; the modules of the others are not imported for it."""
    return at_first_call(f"{__package__}.{path}")


draft_table: Final[Callable[..., Draft]] = _of("draft.draft_table")
"""Drafts the mapping of a table, whose columns may be named by hand."""


def _format(
    name: str,
    *,
    read: str = "",
    opens: str = "",
    begins: str = "",
    marks: Sequence[str] = (),
    draft: str = "",
    drafts: bool = False,
    suffixes: Sequence[str],
    takes: str,
    **others: Any,
) -> Format:
    """Record of a format, as `formats.toml` explains it."""

    def read_channels(path: Path, table: str | None, mapping: TableMapping | None) -> Log:
        from weighbridge.io.channels import reader

        return reader(_of(opens))(path, table, mapping)

    def draft_channels(path: Path) -> Draft:
        from weighbridge.io.channels import drafter

        return drafter(_of(opens))(path)

    known = starts_with(*(mark.encode("latin-1") for mark in marks)) if marks else None
    return Format(
        name=name,
        suffixes=tuple(suffixes),
        read=_of(read) if read else read_channels,
        begins=_of(begins) if begins else known,
        takes=Takes[takes.upper()],
        draft=draft_channels if drafts else _of(draft) if draft else None,
        **others,
    )


_TABLE: Final = toml_of("io", "formats.toml")

FORMATS: Final = tuple(_format(name, **record) for name, record in _TABLE["format"].items())
"""The formats of this project, in the order of `formats.toml`."""


def all_formats() -> tuple[Format, ...]:
    """All formats, those that packages add included."""
    return (*FORMATS, *_added(tuple(sys.path)))


def suffixes() -> tuple[str, ...]:
    """Ends of file names that are read, each once."""
    return tuple(dict.fromkeys(s for f in all_formats() for s in f.suffixes))


def is_log(path: Path) -> bool:
    """Return by its name whether a file is read as a log."""
    return any(f.ends(path.name) for f in all_formats())


_REMEDIES: Final = {end: text for text, ends in _TABLE["remedies"].items() for end in ends}
"""What helps with files that are no logs, or of formats that are not read, by suffix."""


def unreadable(path: Path) -> str:
    """Say of a file of no known format what helps, in a sentence.

    Parameters
    ----------
    path : the file
    """
    suffix = path.suffix.lower()
    remedy = _REMEDIES.get(suffix, "")
    if suffix not in _REMEDIES or suffix == ".dat":
        remedy = _of_text(path) or remedy
    near = difflib.get_close_matches(suffix, [s for s in suffixes() if s.startswith(".")], n=1)
    known = f"the nearest that is known is {near[0]}" if near and not remedy else ""
    reported = known or remedy or f"known are {', '.join(suffixes())}, and folders of tables"
    return f"{path}: logs of kind {path.suffix or 'without a suffix'!r} cannot be read; {reported}"


def _of_text(path: Path) -> str:
    """Say of a file of unknown suffix that is a text what helps; empty where it is none."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError:
        return ""
    printable = sum(byte >= 32 or byte in b"\t\r\n" for byte in head)
    lines = head.count(b"\n")
    if lines < 2 or printable < 0.98 * len(head):
        return ""
    return "it is a text: name it .csv where it is a table, .log where it holds CAN frames"


def format_of(path: Path) -> Format | None:
    """Format of a file, by its name and by its first bytes; None where it is not known.

    Parameters
    ----------
    path : a file that is there

    Raises
    ------
    OSError
        It cannot be opened.
    """
    known = [(f.ends(path.name), f) for f in all_formats()]
    longest = max(length for length, _ in known)
    named = [f for length, f in known if length == longest > 0]
    if len(named) == 1:
        return named[0]
    with path.open("rb") as file:
        head = file.read(_HEAD)
    among = named or [f for f in all_formats() if f.magic]
    for found in among:
        if found.begins is not None and found.begins(head):
            return found
    return next((f for f in named if f.begins is None), named[-1] if named else None)


@lru_cache(maxsize=4)
def _added(places: tuple[str, ...]) -> tuple[Format, ...]:
    """Formats of packages; ``places`` is where they are looked for."""
    from importlib.metadata import entry_points

    found = []
    for point in entry_points(group=GROUP):
        try:
            record = point.load()
        # A package of others may raise anything while it is imported.
        except Exception as e:
            _logger.warning(
                "log format %s cannot be loaded (%s: %s)", point.value, type(e).__name__, e
            )
            continue
        if isinstance(record, Format):
            found.append(record)
        else:
            _logger.warning("log format %s is no weighbridge.io.format.Format", point.value)
    return tuple(found)
