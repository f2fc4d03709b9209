"""Keys that a person presses at the terminal while a scale runs."""

from __future__ import annotations

import contextlib
import select
import sys
from collections.abc import Callable, Iterator
from typing import Final

from weighbridge.live.orders import END, LOAD, TARE

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
