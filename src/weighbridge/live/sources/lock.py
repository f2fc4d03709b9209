"""One owner of a device: two that ask one vehicle at once would take each other's answers."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from weighbridge.errors import SourceError
from weighbridge.whole import lock_file


@contextmanager
def device_lock(source: str) -> Iterator[None]:
    """Keep other processes of a user from a device while it is used.

    Parameters
    ----------
    source : names the device

    Raises
    ------
    SourceError
        Another process holds it.
    """
    digest = hashlib.sha256(source.encode()).hexdigest()[:16]
    user = getattr(os, "getuid", int)()
    path = Path(tempfile.gettempdir()) / f"weighbridge-{user}-{digest}.lock"
    taken = SourceError(f"{source} is in use by another process; end that one first")
    try:
        file = path.open("ab")
    except OSError:
        raise taken from None
    with file:
        if not lock_file(file.fileno()):
            raise taken
        yield
