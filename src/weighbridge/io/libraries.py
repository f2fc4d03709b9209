"""Libraries that read the formats of others: what is lacking or damaged becomes one sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from weighbridge.errors import DriveError, MissingExtraError, WeighbridgeError
from weighbridge.io.quiet import first_line


@contextmanager
def importing(package: str, extra: str, purpose: str) -> Iterator[None]:
    """Say which extra of the project installs a package that is not there.

    Parameters
    ----------
    package : what is imported, as it is installed; empty where the import itself names it
    extra : of the project
    purpose : what it is needed for
    """
    try:
        yield
    except ImportError as e:
        raise MissingExtraError(package or e.name or "", extra, purpose) from None


@contextmanager
def parsing(path: Path, kind: str) -> Iterator[None]:
    """Say that a file is not readable where a library raises anything.

    Parameters
    ----------
    path : the file
    kind : what it should be
    """
    try:
        yield
    except WeighbridgeError:
        raise
    # The libraries' errors on damaged files are of many kinds, down to MemoryError.
    except Exception as e:
        if isinstance(e, OSError) and e.errno is not None and e.filename is not None:
            raise
        raise unreadable(path, kind, reason_of(e)) from None


def reason_of(error: BaseException) -> str:
    """What a library says of an error, else what kind it is."""
    return first_line(error) or type(error).__name__


def unreadable(path: Path, kind: str, reason: str) -> DriveError:
    """Say that a file is not what it should be, and why."""
    return DriveError(
        f"{path} is not a readable {kind} ({reason}); it may have been cut off: copy it again"
    )
