"""The program's log on standard error."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from typing import Final

from weighbridge.cli.terminal import complain

_LEVELS: Final = (logging.WARNING, logging.INFO, logging.DEBUG)
"""Level of our log for no ``--verbose``, for one and for two."""


class ToTerminal(logging.Handler):
    """Writes log lines to the standard error of the moment, which a progress bar may hold."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write one record, each line of a traceback for itself."""
        for line in self.format(record).splitlines():
            complain(line)


class Stamped(logging.Formatter):
    """A log line with the time since the start and where it comes from."""

    def formatMessage(self, record: logging.LogRecord) -> str:
        """Write the line of a record."""
        place = record.name.removeprefix("weighbridge.")
        return f"{1e-3 * record.relativeCreated:7.2f} s  {place}: {record.getMessage()}"


@contextlib.contextmanager
def logged(quiet: bool, verbose: int) -> Iterator[None]:
    """Let our log go to standard error from a level on, and the warnings of libraries.

    Parameters
    ----------
    quiet : errors only
    verbose : 1 logs each drive, 2 each stage
    """
    level = logging.ERROR if quiet else _LEVELS[min(verbose, len(_LEVELS) - 1)]
    root, ours = logging.getLogger(), logging.getLogger("weighbridge")
    before = root.level, ours.level
    handler = ToTerminal()
    if verbose:
        handler.setFormatter(Stamped())
    new = not any(isinstance(known, ToTerminal) for known in root.handlers)
    if new:
        root.addHandler(handler)
    root.setLevel(max(level, logging.WARNING))
    ours.setLevel(level)
    try:
        yield
    finally:
        if new:
            root.removeHandler(handler)
        root.setLevel(before[0])
        ours.setLevel(before[1])
