"""One owner of a device: two that ask one vehicle at once would take each other's answers."""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path
from types import TracebackType
from typing import IO

from weighbridge.errors import SourceError


class DeviceLock:
    """Held while a device is used, by one process of a user.

    Parameters
    ----------
    source : names the device

    Raises
    ------
    SourceError
        On entering: another process holds it.
    """

    def __init__(self, source: str) -> None:
        self._source = source
        digest = hashlib.sha256(source.encode()).hexdigest()[:16]
        user = getattr(os, "getuid", int)()
        self._path = Path(tempfile.gettempdir()) / f"weighbridge-{user}-{digest}.lock"
        self._file: IO[bytes] | None = None

    def __enter__(self) -> DeviceLock:
        try:
            import fcntl
        except ImportError:  # a system that opens ports for one process only
            return self
        file = None
        try:
            file = self._path.open("ab")
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            if file is not None:
                file.close()
            raise SourceError(
                f"{self._source} is in use by another process; end that one first"
            ) from None
        self._file = file
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
