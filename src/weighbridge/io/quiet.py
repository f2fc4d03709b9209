"""Calls of polars on bytes of others: its panics are errors here and print nothing."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Iterator
from typing import Final

import polars as pl

from weighbridge.visible import visible

PARSE_ERRORS: Final = (pl.exceptions.PolarsError, pl.exceptions.PanicException)
"""What polars raises for a file that it cannot read: panics are no subclass of its errors, nor
of Exception."""

_STDERR: Final = 2

# Characters of a library's message that help.
_LONGEST: Final = 200

_lock = threading.RLock()


@contextlib.contextmanager
def quietly() -> Iterator[None]:
    """Keep what a library prints past Python, such as a panic with its place, off the terminal."""
    with _lock:
        if sys.stderr is not None:
            with contextlib.suppress(ValueError, OSError):
                sys.stderr.flush()
        try:
            kept = os.dup(_STDERR)
        except OSError:
            # No standard error: nothing to keep clean.
            yield
            return
        try:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, _STDERR)
            os.close(nowhere)
            yield
        finally:
            os.dup2(kept, _STDERR)
            os.close(kept)


def first_line(error: BaseException) -> str:
    """Return the first line of a library's message, cut off where it is long."""
    return visible(str(error).strip().split("\n", 1)[0])[:_LONGEST]
