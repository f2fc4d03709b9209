"""What a log format is: one frozen record, and what of a mapping it can use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

from weighbridge.io.log import Reader
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
