"""How much a command shows beside its results: ``--quiet`` and ``--verbose`` of every command."""

from __future__ import annotations

import contextlib
import copy
import inspect
import logging
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Annotated, Any, Final

import typer
from typer.core import TyperGroup, TyperOption

from weighbridge.cli.listed import option
from weighbridge.cli.terminal import complain, say
from weighbridge.customary import shown_in

_SHARED: Final = ("quiet", "verbose")
"""Options that stand behind every command as well as before it."""


@dataclass(slots=True)
class _Asked:
    """What the user asked for in this run."""

    quiet: bool = False
    verbose: int = 0
    ends: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)


_asked: Final = _Asked()


def _take_quiet(wanted: bool) -> None:
    _take(quiet=wanted)


def _take_verbose(times: int) -> None:
    _take(verbose=times)


def _take(*, quiet: bool = False, verbose: int = 0) -> None:
    """Add what one option asks for; it may stand before the command and behind it."""
    _asked.quiet |= quiet
    _asked.verbose += verbose
    if _asked.quiet and _asked.verbose:
        raise typer.BadParameter("--quiet and --verbose exclude each other; give one")
    if _asked.quiet or _asked.verbose:
        _asked.ends.enter_context(logged(_asked.quiet, _asked.verbose))


def show_in(units: str) -> str:
    """Show what people read in these units until the command ends."""
    _asked.ends.enter_context(shown_in(units))
    return units


Quiet = Annotated[bool, option("--quiet", callback=_take_quiet)]
Verbose = Annotated[
    int, option("--verbose", count=True, callback=_take_verbose, metavar="", show_default=False)
]


class EveryCommand(TyperGroup):
    """The root of all commands; its ``--quiet`` and ``--verbose`` are options of each of them."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        shared = [given for given in self.params if given.name in _SHARED]
        for command in _leaves(self.commands.values()):
            command.help = _unbroken(command.help or "")
            for given in shared:
                own = copy.copy(given)
                assert isinstance(own, TyperOption)
                own.expose_value = False
                command.params.append(own)


def _unbroken(text: str) -> str:
    """Join the lines of each paragraph of a docstring, for the terminal breaks them anew."""
    return "\n\n".join(" ".join(part.split()) for part in inspect.cleandoc(text).split("\n\n"))


def _leaves(commands: Iterable[Any]) -> Iterator[Any]:
    """Yield the commands themselves, those of groups included."""
    for command in commands:
        inside = getattr(command, "commands", None)
        if inside is None:
            yield command
        else:
            yield from _leaves(inside.values())


def watched() -> bool:
    """Say whether a person at a terminal wants to see how far the work is."""
    return not _asked.quiet and sys.stderr.isatty()


def quiet() -> bool:
    """Say whether results and errors alone are wanted."""
    return _asked.quiet


def notice(text: str) -> None:
    """Print one line about the work, which is no result, to standard error."""
    if not _asked.quiet:
        complain(text)


def say_written(path: object, *, aside: bool = False) -> None:
    """Name a file that was written; ``aside`` from JSON that is on standard output."""
    if not _asked.quiet:
        (complain if aside else say)(f"written: {path}")


@contextlib.contextmanager
def asked_anew() -> Iterator[None]:
    """Let one run of the command line ask for itself, and leave logging as it was."""
    with contextlib.ExitStack() as ends:
        _asked.quiet, _asked.verbose, _asked.ends = False, 0, ends
        yield


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
