"""``drive.toml``: what is known of a drive beside its signals."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import tomlkit

from weighbridge.arguments import suggestion
from weighbridge.errors import DriveError
from weighbridge.signals import QUANTITIES, DriveInfo
from weighbridge.signals.tomlfile import Section, exact_text, parse_toml, read_toml

FILE_NAME: Final = "drive.toml"

MDF_INFO_MARK: Final = "# drive.toml\n"
"""First line of an MDF file's comment that holds what is known of the drive."""

# Key, field and canonical unit of every number.
_NUMBERS: Final = (
    ("mass", "mass", "kg"),
    ("ambient_temperature", "ambient_temperature", "degc"),
    ("barometric_pressure", "barometric_pressure", "kpa"),
    ("wind_speed", "wind_speed", "mps"),
    ("wind_from", "wind_from", "deg"),
)
_TEXTS: Final = ("start_time", "vehicle", "notes")


def read_info(path: Path) -> DriveInfo:
    """Read a ``drive.toml``.

    Raises
    ------
    DriveError
        A key is unknown or a value impossible.
    """
    return _info(read_toml(path, DriveError))


def parse_info(text: str, name: str) -> DriveInfo:
    """Read the text of a ``drive.toml`` that is in ``name``.

    Raises
    ------
    DriveError
        It is no TOML, a key is unknown or a value impossible.
    """
    return _info(Section(parse_toml(text, name, DriveError), name, {}, error=DriveError))


def _info(root: Section) -> DriveInfo:
    texts = {name: root.text(name) for name in _TEXTS}
    numbers = {name: root.quantity(stem, suffix) for stem, name, suffix in _NUMBERS}
    for key, low in (("mass", 0.0), ("ambient_temperature", 0.0), ("barometric_pressure", 0.0)):
        value = numbers[key]
        if value is not None and value <= low:
            written = next(k for k in root.data if k.startswith(f"{key}_"))
            root.fail(written, f"must be above {'absolute zero' if 'temp' in key else 0}")
    trusted = root.texts("trusted") or ()
    for name in trusted:
        if name not in QUANTITIES:
            root.fail("trusted", f"names {name!r}, no quantity{suggestion(name, QUANTITIES)}")
    root.done()
    return DriveInfo(**texts, **numbers, trusted=trusted)  # type: ignore[arg-type]


def info_text(info: DriveInfo) -> str:
    """Text of a ``drive.toml``; what is unknown is left out."""
    document = tomlkit.document()
    for name in _TEXTS:
        if (text := getattr(info, name)) is not None:
            document.add(name, tomlkit.item(text))
    for stem, name, suffix in _NUMBERS:
        if (value := getattr(info, name)) is not None:
            document.add(f"{stem}_{suffix}", tomlkit.value(exact_text(value, suffix)))
    if info.trusted:
        document.add("trusted", tomlkit.item(list(info.trusted)))
    return tomlkit.dumps(document)
