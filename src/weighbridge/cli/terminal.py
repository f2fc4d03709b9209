"""What reaches the terminal: no control character of a file, no letter it does not have."""

from __future__ import annotations

import codecs
import contextlib
import io
import os
import signal
import sys
import threading
from collections.abc import Iterable, Iterator
from typing import IO, TYPE_CHECKING, Any, Final, TextIO, cast

from weighbridge.visible import cut, plain_json, visible, visible_json, visible_text

if TYPE_CHECKING:
    from rich.console import Console

# What letters that a terminal may lack are written as; others become escapes.
_PLAIN: Final = {
    "²": "2", "³": "3", "±": "+-", "–": "-", "—": "-", "−": "-", "…": "...", "·": " ", "°": "deg",
    "’": "'", "“": '"', "”": '"', "×": "x", "é": "e", "ä": "ae", "ö": "oe", "ü": "ue", "ã": "a",
    "ß": "ss", "→": "->", "≥": ">=", "≤": "<=", "µ": "u", "μ": "u", "σ": "sigma", "α": "alpha",
}  # fmt: skip

STREAM: Final = "standard output"
"""What errors call a stream."""

_ERRORS: Final = "weighbridge.plain"


def _plainly(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return "".join(_PLAIN.get(c) or f"\\u{ord(c):04x}" for c in lacking), error.end


class Terminal(io.TextIOBase):
    """A stream on which control characters are written as escapes.

    Parameters
    ----------
    below : the stream that is written to
    styled : whether control characters pass, for a help page of ours with its colours
    """

    def __init__(self, below: TextIO, styled: bool = False) -> None:
        self.below = below
        self.styled = styled

    def write(self, text: str) -> int:
        """Write text."""
        with _named():
            self.below.write(text if self.styled else visible_text(text))
        return len(text)

    def flush(self) -> None:
        """Flush the stream below; a closed one has nothing to flush, as at the end of Python."""
        with _named():
            if not self.below.closed:
                self.below.flush()

    def isatty(self) -> bool:
        """Say whether a person reads along."""
        compatible = os.environ.get("TTY_COMPATIBLE") != "0"
        return compatible and not self.below.closed and self.below.isatty()

    def fileno(self) -> int:
        """Return the number of the open file."""
        return self.below.fileno()

    def writable(self) -> bool:
        """Say that the stream can be written to."""
        return True

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Encoding of the stream below."""
        return self.below.encoding

    @property
    def errors(self) -> str | None:  # type: ignore[override]
        """What happens to letters that the encoding lacks."""
        return self.below.errors


@contextlib.contextmanager
def _named() -> Iterator[None]:
    """Name the stream in an error, as errors of files name theirs."""
    try:
        yield
    except OSError as e:
        e.filename = e.filename or STREAM
        raise


@contextlib.contextmanager
def guarded(styled: bool = False) -> Iterator[None]:
    """Let standard output and error be a `Terminal` while a command runs."""
    for number in range(3):
        # A file would be opened under the number of a stream that was closed.
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    codecs.register_error(_ERRORS, _plainly)
    before = sys.stdout, sys.stderr
    for name in ("stdout", "stderr"):
        below = getattr(sys, name)
        if below is None:
            below = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, PTH123
        with contextlib.suppress(AttributeError, ValueError):
            below.reconfigure(errors=_ERRORS)
        setattr(sys, name, Terminal(below, styled))
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def say(text: str) -> None:
    """Print one line of results."""
    print(visible(cut(text)))  # noqa: T201


def complain(text: str) -> None:
    """Print one line to standard error."""
    with contextlib.suppress(OSError, ValueError):
        print(visible(cut(text)), file=sys.stderr, flush=True)  # noqa: T201


def say_json(text: str) -> None:
    """Print JSON, whole, in letters that the terminal has."""
    text = visible_json(text)
    try:
        text.encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except (UnicodeEncodeError, LookupError):
        text = plain_json(text)
    print(text)  # noqa: T201


def shown(text: str) -> str:
    """Write a text of a file for a table: no control characters, no marks of rich, not endless."""
    from rich.markup import escape

    return escape(visible(cut(text)))


def say_notes(notes: Iterable[str], screen: Console) -> None:
    """Print notes below a result: broken between words on a terminal, one line each elsewhere."""
    if not screen.is_terminal:
        for note in notes:
            say(f"  note: {note}")
        return
    from rich.table import Table

    grid = Table.grid(padding=(0, 1))
    grid.add_column(no_wrap=True)
    grid.add_column(overflow="fold")
    for note in notes:
        grid.add_row("  note:", shown(note))
    screen.print(grid, highlight=False)


def leave_quietly() -> None:
    """Let nothing be written any more to a standard output that nobody reads."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def console(*, stderr: bool = False, **settings: Any) -> Console:
    """Return a console whose own control sequences are the only ones."""
    from rich.console import Console
    from rich.segment import Segment

    class SafeConsole(Console):
        def render(self, renderable: Any, options: Any = None) -> Iterable[Segment]:
            for s in super().render(renderable, options):
                yield s if s.control else Segment(visible_text(s.text), s.style)

        def on_broken_pipe(self) -> None:
            # The one who called the command is shown, as by any other write.
            raise

    stream = sys.stderr if stderr else sys.stdout
    below = stream.below if isinstance(stream, Terminal) else stream
    return SafeConsole(file=cast("IO[str]", Terminal(below, styled=True)), **settings)


@contextlib.contextmanager
def ended_by_signals(stop: threading.Event) -> Iterator[None]:
    """Set an event where Ctrl-C or the system asks the process to end, until the block ends."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, lambda *_: stop.set()) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
