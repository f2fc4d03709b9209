"""The command ``weighbridge``, quiet from the first import on when it is interrupted."""

from __future__ import annotations

import atexit
import contextlib
import gc
import os
import signal
import sys
import threading
from typing import TYPE_CHECKING, Final, NoReturn

if TYPE_CHECKING:
    from types import FrameType

_INTERRUPTED = 130
"""Exit status of a program that SIGINT ends, as a shell gives it."""

_OBJECTS: Final = 10_000
"""New objects after which the youngest are searched for cycles, 700 by Python itself: a command
makes some 300 000 that stay, and searching them again and again takes 5 % of a weighing."""


def run() -> None:
    """Run the command line."""
    # Products are of small matrices: threads would wait for each other longer than they work.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Colours of its messages would end with a control character on our standard output.
    os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")
    gc.set_threshold(_OBJECTS)
    interrupted: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        interrupted.append(number)
        raise KeyboardInterrupt

    usual = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if usual and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, note)
    try:
        from weighbridge.cli import run as run_commands

        run_commands()
    except KeyboardInterrupt:
        _leave()
    except SystemExit as leaving:
        if leaving.code == _INTERRUPTED:
            _leave()
        raise
    except Exception:
        # Libraries turn an interruption inside an import into errors of their own.
        if interrupted:
            _leave()
        raise


def _leave() -> NoReturn:
    """End with the status of an interruption: Python may have kept it, and end by the signal.

    Threads that write are waited for as at any end, unless it is interrupted again.
    """
    try:
        with contextlib.suppress(KeyboardInterrupt):
            threading._shutdown()  # type: ignore[attr-defined]
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(_INTERRUPTED)


if __name__ == "__main__":
    run()
