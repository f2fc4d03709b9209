"""What a person asks of a scale that runs: by a file or a pipe, and by keys at the terminal."""

from __future__ import annotations

import contextlib
import os
import select
import stat
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from weighbridge.errors import ConfigError

TARE: Final = "tare"
LOAD: Final = "load"
END: Final = "end"
ORDERS: Final = (TARE, LOAD, END)
"""What a line of the file may say: take the mass as nought, the load has changed, end."""

_MOST: Final = 4096
"""Bytes that are read at a time; a longer line is no order."""


class OrderFile:
    """Reads orders, a line each, from a named pipe or from a file that is appended to.

    What a file holds already was for an earlier run. Where nothing is there a pipe is made that
    only its owner may write to, and taken away at the end.

    Parameters
    ----------
    path : of the pipe or file

    Raises
    ------
    ConfigError
        It can be neither read nor made, or is neither of the two.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._made = False
        self._rest = b""
        try:
            if not path.exists():
                self._make()
            kind = path.stat().st_mode
            if not (stat.S_ISFIFO(kind) or stat.S_ISREG(kind)):
                raise ConfigError(f"{path} is neither a named pipe nor a file: name another")
            # A pipe that nobody writes to must not be waited for.
            self._file = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        except OSError as error:
            raise ConfigError(f"{path} cannot be read: {error.strerror or error}") from None
        self._pipe = stat.S_ISFIFO(kind)
        self._at = 0 if self._pipe else os.fstat(self._file).st_size

    def _make(self) -> None:
        if hasattr(os, "mkfifo"):
            os.mkfifo(self.path, 0o600)
            self._made = True
        else:
            self.path.touch()

    def read(self) -> list[str]:
        """Return the lines that came since the last time, without their ends."""
        data = self._rest + self._more()
        *lines, self._rest = data.split(b"\n")
        if len(self._rest) > _MOST:
            self._rest = b""
        texts = (line[:_MOST].decode("utf-8", "replace").strip() for line in lines)
        return [text for text in texts if text]

    def _more(self) -> bytes:
        try:
            if self._pipe:
                return os.read(self._file, _MOST)
            size = os.fstat(self._file).st_size
            if size < self._at:
                # It was emptied.
                self._at, self._rest = 0, b""
            os.lseek(self._file, self._at, os.SEEK_SET)
            data = os.read(self._file, _MOST)
        except OSError:
            return b""
        self._at += len(data)
        return data

    def close(self) -> None:
        """Read no more."""
        os.close(self._file)
        if self._made:
            with contextlib.suppress(OSError):
                self.path.unlink()


@contextlib.contextmanager
def order_file(path: Path | None) -> Iterator[OrderFile | None]:
    """Open the file of orders for a while; None for none."""
    if path is None:
        yield None
        return
    file = OrderFile(path)
    try:
        yield file
    finally:
        file.close()


ORDER_OF: Final = {"t": TARE, "l": LOAD, "q": END}
"""What a key asks for."""


@contextlib.contextmanager
def keys(wanted: bool) -> Iterator[Callable[[], str]]:
    """Give a function that returns the keys pressed since it was called last.

    Parameters
    ----------
    wanted : whether standard input is for keys; if not, or if it is no terminal, none come
    """
    if not wanted or not sys.stdin.isatty():
        yield lambda: ""
        return
    try:
        import termios
        import tty
    except ImportError:
        # No terminal of Unix: the scale runs without keys.
        yield lambda: ""
        return
    number = sys.stdin.fileno()
    before = termios.tcgetattr(number)
    tty.setcbreak(number)

    def pressed() -> str:
        found = ""
        while select.select([number], [], [], 0.0)[0]:
            key = sys.stdin.read(1)
            if not key:
                break
            found += key
        return found

    try:
        yield pressed
    finally:
        termios.tcsetattr(number, termios.TCSADRAIN, before)
