"""Files of data beside the modules of a room: tables, and texts."""

from __future__ import annotations

import csv
import tomllib
from importlib.resources import files
from typing import Any


def text_of(room: str, name: str) -> str:
    """Return the text of a file of a room of this package, such as ``io`` or ``live.sources``."""
    return files(f"weighbridge.{room}").joinpath(name).read_text(encoding="utf-8")


def toml_of(room: str, name: str) -> dict[str, Any]:
    """Return what a TOML file of a room holds."""
    return tomllib.loads(text_of(room, name))


def rows_of(room: str, name: str) -> list[dict[str, str]]:
    """Return the rows of a CSV file of a room, by the names of its first line."""
    return list(csv.DictReader(text_of(room, name).splitlines()))
