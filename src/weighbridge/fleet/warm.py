"""Kernels are compiled by one worker of a machine, and read from the disk by the others."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, TypeVar

Result = TypeVar("Result")

_done: Final[list[bool]] = []


def compiled_once(work: Callable[[], Result], useful: Callable[[Result], bool]) -> Result:
    """Do the first work of a process, alone on its machine until the kernels are on the disk.

    Parameters
    ----------
    work : what compiles the kernels it needs
    useful : says whether it came far enough to have used them
    """
    if _done:
        return work()
    mark = _mark()
    if mark is None or mark.exists():
        _done.append(True)
        return work()
    with _alone(mark.with_suffix(".lock")):
        result = work()
        if useful(result):
            _done.append(True)
            with contextlib.suppress(OSError):
                mark.touch()
    return result


def _mark() -> Path | None:
    """File that says that the kernels of these sources are compiled for this processor."""
    import llvmlite.binding as llvm
    import numba

    from weighbridge.kernels import _jit, rls

    cache = getattr(rls.step, "_cache", None)
    place = getattr(cache, "_cache_path", None)
    if not place or not Path(place).is_dir():
        # Made with the first kernel that is written.
        if not place:
            return None
        with contextlib.suppress(OSError):
            Path(place).mkdir(parents=True, exist_ok=True)
    texts = (_jit.SOURCES, numba.__version__, llvm.get_host_cpu_name())
    name = hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16]
    return Path(place) / f"fleet-{name}.compiled"


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a lock; go on without where there can be none."""
    try:
        file = path.open("ab")
    except OSError:
        yield
        return
    with file:
        if os.name != "nt":
            import fcntl

            with contextlib.suppress(OSError):
                fcntl.flock(file.fileno(), fcntl.LOCK_EX)
        yield
