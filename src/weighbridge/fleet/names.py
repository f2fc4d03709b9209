"""Names of files: which make a folder a drive, and which are drives of their own."""

from __future__ import annotations

import re
from collections.abc import Collection
from itertools import islice
from pathlib import Path
from typing import Final

from weighbridge.io import is_log
from weighbridge.io.info import FILE_NAME as INFO_NAME
from weighbridge.io.parts import SUFFIX as PARTS
from weighbridge.io.read import TRUTH_NAME
from weighbridge.signals.catalogue import TABLES

_SHOWN: Final = 3

# Texts beside drives that are none, though logs may be text, too.
_BESIDE: Final = re.compile(
    r"(?:read[ _-]?me|lies[ _-]?mich|licen[cs]e|lizenz|copying|changelog)(?![^\W_])", re.IGNORECASE
)


def some(names: Collection[str | None]) -> str:
    """Return the first few names as a text, and how many more there are."""
    first = ", ".join(name or "no name" for name in islice(names, _SHOWN))
    more = len(names) - _SHOWN
    return first + (f" and {more} more" if more > 0 else "")


def is_table_name(name: str) -> bool:
    """Say whether a file of such a name makes its folder a drive."""
    if name == INFO_NAME:
        return True
    path = Path(name)
    return path.stem.lower() in TABLES and (path.suffix == PARTS or is_log(path))


def is_drive_name(name: str) -> bool:
    """Say whether a file of such a name may be a drive of its own."""
    path = Path(name)
    if _BESIDE.match(name) is not None:
        return False
    return path.stem.lower() != TRUTH_NAME and not name.startswith(".") and is_log(path)
