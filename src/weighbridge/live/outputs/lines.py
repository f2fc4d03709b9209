"""JSON lines: one weighing a line, to a file or to standard output."""

from __future__ import annotations

import contextlib
import json
import math
import os
from pathlib import Path
from typing import Any, BinaryIO, Final

from weighbridge.errors import ConfigError
from weighbridge.live.weighing import LiveWeighing
from weighbridge.visible import plain_json
from weighbridge.whole import is_stream

STANDARD_OUTPUT: Final = "-"

# Bytes at the end of a file in which its last line begins; one weighing takes some 3 kB.
_LONGEST_LINE: Final = 1 << 20


def json_line(weighing: LiveWeighing) -> str:
    """Write a weighing as JSON in one line of ASCII; a number that is not finite is null."""
    return plain_json(json.dumps(_finite(weighing.to_dict()), allow_nan=False))


class Lines:
    """Appends weighings to a file, or prints them; each line is out before the next begins.

    A line that a power cut tore off at the end of the file is removed.

    Parameters
    ----------
    target : a file, a device, or ``-`` for standard output

    Raises
    ------
    ConfigError
        It cannot be written to, or holds something else.
    """

    def __init__(self, target: str | Path) -> None:
        self.name = "standard output" if str(target) == STANDARD_OUTPUT else str(target)
        self._file = None if str(target) == STANDARD_OUTPUT else _opened(Path(target))

    def show(self, weighing: LiveWeighing) -> None:
        """Write one line.

        Raises
        ------
        ConfigError
            The disk is full or gone; the file ends with a whole line.
        """
        line = json_line(weighing)
        if self._file is None:
            print(line, flush=True)  # noqa: T201
            return
        data = line.encode("ascii") + b"\n"
        try:
            written = self._file.write(data)
            if written != len(data):
                # A file without a buffer takes what there is room for.
                self._take_back(written)
                raise OSError("the disk is full")
        except OSError as error:
            raise ConfigError(
                f"{self.name} cannot be written: {error.strerror or error}; weighing goes on"
            ) from None

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()

    def _take_back(self, count: int) -> None:
        assert self._file is not None
        with contextlib.suppress(OSError):
            size = os.fstat(self._file.fileno()).st_size
            self._file.truncate(size - count)


def _opened(path: Path) -> BinaryIO:
    """Open a file to append to, after its last whole line."""
    try:
        if path.is_file() and not is_stream(path):
            _repair(path)
        # Without a buffer: what is written is in the hands of the system.
        return path.open("ab", buffering=0)
    except OSError as error:
        raise ConfigError(f"{path} cannot be written: {error.strerror or error}") from None


def _repair(path: Path) -> None:
    with path.open("r+b") as file:
        if file.read(1) not in (b"", b"{"):
            raise ConfigError(f"{path} holds no JSON lines; name another file")
        size = file.seek(0, os.SEEK_END)
        begin = max(size - _LONGEST_LINE, 0)
        file.seek(begin)
        tail = file.read()
        last = tail.rpartition(b"\n")[2]
        if not last:
            return
        if len(last) == len(tail) and begin:
            raise ConfigError(f"{path} holds no JSON lines; name another file")
        try:
            json.loads(last)
        except ValueError:
            file.truncate(size - len(last))
        else:
            file.write(b"\n")


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
