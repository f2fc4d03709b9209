"""Every log format, one record each; `formats.toml` lists them.

A package of its own adds a format by an entry point of the group ``weighbridge.formats`` that
names a `weighbridge.io.formats.Format`.
"""

from __future__ import annotations

import difflib
import logging
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from weighbridge.data import toml_of
from weighbridge.first_use import at_first_call
from weighbridge.io.log import Log, Reader
from weighbridge.io.mapping import TableMapping, TimeColumn
from weighbridge.io.table import TextFormat

if TYPE_CHECKING:
    from weighbridge.io.draft import Draft


class Takes(Enum):
    """What of a mapping a format can use; the value says it for people."""

    TEXT = "all of it"
    PLAIN = "[signals] with the rest, as a plain table, or offset_s and align of [time] alone"
    COLUMNS = "[time] and [signals]"
    NUMBERS = "[signals], and all of [time] but format"
    CHANNELS = "[signals], and offset_s and align of [time]"
    CLOCK = "offset_s and align of [time]"


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """One log format.

    Attributes
    ----------
    name : short name, for people and messages
    suffixes : ends of the file names it has, in small letters, such as ``.csv``; one without a
        dot is a whole name, or the end of one after a mark such as ``-`` or ``_``
    read : reads one file
    about : what is read of it, one line for people
    takes : what of a mapping it can use
    begins : shows by a file's first bytes (4096 of them) that it is of this format; None where
        the suffix decides
    magic : whether ``begins`` knows the format under any suffix
    self_described : whether it names quantities and units itself, so that a mapping of the
        drive's other files need not know it
    package : library that parses it, or the DBC of its frames, and is no dependency of the project;
        empty for none
    extra : extra of the project that installs that library
    draft : drafts a mapping; None where it is read as it is
    """

    name: str
    suffixes: tuple[str, ...]
    read: Reader
    about: str
    takes: Takes
    begins: Callable[[bytes], bool] | None = None
    magic: bool = False
    self_described: bool = False
    package: str = ""
    extra: str = ""
    draft: Callable[[Path], Draft] | None = None

    def unusable(self, mapping: TableMapping) -> str:
        """Name the first section of a mapping that this format has no use for; empty for none."""
        text = mapping.text != TextFormat()
        clock = TimeColumn(offset=mapping.time.offset, align=mapping.time.align)
        plain = self.takes is Takes.PLAIN and bool(mapping.signals)
        if text and self.takes is not Takes.TEXT and not plain:
            return "[csv]"
        if mapping.time != clock and self.takes in (Takes.CHANNELS, Takes.CLOCK):
            return "column, unit, format or rate_hz of [time]"
        if mapping.time.format is not None and self.takes is Takes.NUMBERS:
            return "format of [time]"
        if mapping.signals and self.takes is Takes.CLOCK:
            return "[signals]"
        return ""

    @property
    def holds_frames(self) -> bool:
        """Whether a DBC may name signals of its frames."""
        return self.takes is Takes.CHANNELS and (self.extra in ("can", "mdf", "openpilot"))

    def ends(self, name: str) -> int:
        """Length of the longest of the suffixes that a file's name ends in; 0 for none."""
        name = name.lower()
        fits = (
            len(s) for s in self.suffixes if name.endswith(s) and _parted(name.removesuffix(s), s)
        )
        return max(fits, default=0)


def _parted(stem: str, suffix: str) -> bool:
    """Whether a suffix means itself: after a name by its dot, or as a word of its own."""
    return bool(stem) if suffix.startswith(".") else not stem[-1:].isalnum()


def starts_with(*marks: bytes) -> Callable[[bytes], bool]:
    """Recognise a format by the bytes it begins with."""
    return lambda head: head.startswith(marks)


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
            _logger.warning("log format %s is no weighbridge.io.formats.Format", point.value)
    return tuple(found)
