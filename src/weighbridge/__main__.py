"""The command ``weighbridge``, quiet from the first import on when it is interrupted."""

from __future__ import annotations

import os
import sys


def run() -> None:
    """Run the command line."""
    # Products are of small matrices: threads would wait for each other longer than they work.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Colours of its messages would end with a control character on our standard output.
    os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")
    try:
        from weighbridge.cli.main import run as run_commands

        run_commands()
    except KeyboardInterrupt:
        # As a shell ends a program by SIGINT.
        sys.exit(130)


if __name__ == "__main__":
    run()
