"""The command ``weighbridge``."""

from __future__ import annotations

import contextlib
import errno
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from types import FrameType, TracebackType
from typing import Annotated, Final

import typer

from weighbridge import __version__
from weighbridge.cli import (
    benchmark,
    bound,
    calibrate,
    coast,
    convert,
    demo,
    doctor,
    emulate,
    fleet,
    inertia,
    inspect,
    live,
    map,
    record,
    reproduce,
    simulate,
    vehicle,
    weigh,
)
from weighbridge.cli.listed import ListsNames, option
from weighbridge.cli.terminal import STREAM, complain, guarded, leave_quietly, say
from weighbridge.cli.verbosity import EveryCommand, Quiet, Verbose, asked_anew
from weighbridge.errors import WeighbridgeError
from weighbridge.visible import visible_text

_INTERRUPTED: Final = 130
_NOBODY_READS: Final = 141
"""Exit statuses that a shell gives a program ended by SIGINT and by SIGPIPE: 128 + number."""

app = typer.Typer(
    name="weighbridge",
    cls=EveryCommand,
    help="Weigh a road vehicle while it drives, from data it already has.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    epilog="Start with: weighbridge demo",
)

app.command()(demo.demo)
app.command()(inspect.inspect)
app.command(cls=ListsNames)(calibrate.calibrate)
app.command(cls=ListsNames)(weigh.weigh)
app.command()(live.live)
app.command()(inertia.inertia)
app.command()(bound.bound)
app.command()(coast.coast)
app.command()(convert.convert)
app.command()(record.record)
app.command()(emulate.emulate)
app.command()(reproduce.reproduce)
app.command("map")(map.map_log)
app.command()(doctor.doctor)
app.add_typer(vehicle.app, name="vehicle")
app.add_typer(fleet.app, name="fleet")
app.add_typer(simulate.app, name="simulate")
app.add_typer(benchmark.app, name="benchmark")


def _print_version(wanted: bool) -> None:
    if wanted:
        say(f"weighbridge {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[bool, option("--version", callback=_print_version, is_eager=True)] = False,
    quiet: Quiet = False,
    verbose: Verbose = 0,
) -> None:
    """Weigh a road vehicle while it drives, from data it already has."""


def run() -> None:
    """Run the command line; a mistake of the caller is one line and exit status 2."""
    words = sys.argv[1:]
    # A help page is ours alone: its colours may pass.
    styled = not words or not {"-h", "--help"}.isdisjoint(words)
    with guarded(styled), asked_anew(), _interruptible() as interrupted:
        try:
            code = _started(words)
            sys.stdout.flush()
        except KeyboardInterrupt:
            code = _INTERRUPTED
        except SystemExit as leaving:
            code = leaving.code
            if _is_broken_pipe(leaving.__context__):
                leave_quietly()
                code = _NOBODY_READS
        except Exception as error:
            # Libraries turn an interruption inside an import into errors of their own.
            code = _INTERRUPTED if interrupted else _failed(error)
        if interrupted:
            code = _INTERRUPTED
    sys.exit(code)


def _started(words: list[str]) -> int | str | None:
    """Run a command; return its exit status."""
    if not words:
        app(["--help"], standalone_mode=False)
        return 2
    found = app(standalone_mode=False)
    return found if isinstance(found, int) else 0


def _failed(error: Exception) -> int:
    """Print an error of the caller in one line; raise any other again."""
    if isinstance(error, WeighbridgeError):
        complain(f"weighbridge: {error}")
    elif _is_broken_pipe(error):
        leave_quietly()
        return _NOBODY_READS
    elif isinstance(error, OSError):
        # The machine's fault, not ours: a full disk, a name too long, a folder closed to us.
        if error.filename == STREAM:
            leave_quietly()
        place = f"{error.filename}: " if error.filename else ""
        complain(f"weighbridge: {place}{error.strerror or error}")
    elif isinstance(error, MemoryError):
        complain("weighbridge: the memory is full; close other programs, or give shorter drives")
    elif hasattr(error, "format_message"):
        # Usage errors of typer, whose home differs between its versions. A group of commands
        # alone has none: its help is printed.
        if text := error.format_message():
            complain(f"weighbridge: {text.rstrip('.')}; weighbridge COMMAND --help shows how")
    else:
        sys.excepthook = _show_bug
        raise error
    return 2


def _show_bug(kind: type[BaseException], error: BaseException, at: TracebackType | None) -> None:
    text = "".join(traceback.format_exception(kind, error, at))
    sys.stderr.write(visible_text(text))


def _is_broken_pipe(error: BaseException | None) -> bool:
    return isinstance(error, OSError) and error.errno == errno.EPIPE


@contextlib.contextmanager
def _interruptible() -> Iterator[list[int]]:
    """Collect interruptions, which otherwise may be lost inside an import."""
    interrupted: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        interrupted.append(number)
        raise KeyboardInterrupt

    ignored = signal.getsignal(signal.SIGINT) in (signal.SIG_IGN, None)
    if ignored or threading.current_thread() is not threading.main_thread():
        yield interrupted
        return
    before = signal.signal(signal.SIGINT, note)
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, before)
