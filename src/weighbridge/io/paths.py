"""Paths that a user gives."""

from __future__ import annotations

import stat
from collections.abc import Iterable, Mapping
from pathlib import Path
from urllib.parse import unquote

from weighbridge.arguments import check_path, check_type, is_frame, type_name
from weighbridge.errors import ArgumentTypeError, DriveError


def is_folder(path: Path) -> bool:
    """Return whether a path is a folder.

    Raises
    ------
    DriveError
        The path can be none: its name is too long, or its links lead round.
    """
    try:
        # Raises where `Path.is_dir` would answer no, or in some versions raise.
        return stat.S_ISDIR(path.stat().st_mode)
    except FileNotFoundError:
        raise DriveError(f"{path}: no such file or folder") from None
    except (OSError, ValueError) as e:
        reason = e.strerror if isinstance(e, OSError) else e
        raise DriveError(f"{path} cannot be read: {reason}") from None


def given_paths(name: str, given: Iterable[str | Path]) -> list[str | Path]:
    """Several paths, each checked; data frames, which hold names of columns, are distinguished."""
    expected = "a path, as text or pathlib.Path, or a list of them"
    if is_frame(given) or isinstance(given, Mapping):
        raise ArgumentTypeError(
            f"{name} must be {expected}, got {type_name(given)}; read_frame reads data frames"
        )
    check_type(name, given, Iterable, expected)
    paths = list(given)
    for one in paths:
        check_path(f"each {name}", one)
    return paths


def partitions(names: Iterable[str]) -> dict[str, str]:
    """Values by key of folders that are the partitions of a table, such as ``date=2026-10-08``.

    Parameters
    ----------
    names : of folders, the nearest first
    """
    found: dict[str, str] = {}
    for name in names:
        key, equals, value = name.partition("=")
        if equals and key.isidentifier() and value:
            found.setdefault(key, unquote(value))
    return found
