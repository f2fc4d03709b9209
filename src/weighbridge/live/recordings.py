"""A recording in several drives: a new one where one is large, old ones removed."""

from __future__ import annotations

import logging
import math
import re
import shutil
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Final

from weighbridge.io.info import FILE_NAME as INFO_NAME
from weighbridge.io.parts import SUFFIX
from weighbridge.io.table import DATES
from weighbridge.live.recorder import Recorder, free_folder
from weighbridge.live.source import Samples
from weighbridge.signals import DriveInfo
from weighbridge.signals.catalogue import TABLES

_logger = logging.getLogger(__name__)

LOOKED: Final = 3600.0
"""Old drives are looked for so often, at the beginning and with each new drive [s]."""

# What a recorder writes into the folder of a drive.
_OWN: Final = frozenset((INFO_NAME, *(f"{t}{s}" for t in TABLES for s in (".parquet", SUFFIX))))


class Recordings:
    """Records into a folder, and into folders numbered beside it: ``trip``, ``trip-2`` and so on.

    Each is a whole drive. No sample is lost between two: the next takes what comes while the one
    before is still joined. Memory and the loss by a kill are those of `Recorder`.

    Parameters
    ----------
    folder : of the first drive; one that holds something stays, see `free_folder`
    info : of each drive, see `Recorder`
    split : a new drive begins where the parts of one have so many bytes; infinite for never
    keep : drives whose newest file is so old are removed [s]; infinite for none. Only folders of
        this series, which hold nothing but what a recorder wrote
    clock : for parts, and for how often old drives are looked for [s]
    date : seconds since 1970, as files have it

    Attributes
    ----------
    folders : that were recorded into, in order

    Raises
    ------
    DriveError
        The folder cannot be made.
    """

    def __init__(
        self,
        folder: Path,
        info: DriveInfo | None = None,
        *,
        split: float = math.inf,
        keep: float = math.inf,
        clock: Callable[[], float] = time.monotonic,
        date: Callable[[], float] = time.time,
    ) -> None:
        self._first = folder
        self._info = info
        self._split, self._keep = split, keep
        self._clock, self._date = clock, date
        self._recorder = Recorder(free_folder(folder), info, clock=clock)
        self.folders = [self._recorder.folder]
        self._closing: list[tuple[Recorder, Future[None]]] = []
        self._closer = ThreadPoolExecutor(1, "recordings")
        self._looked = -math.inf
        self._look()

    @property
    def problem(self) -> str:
        """Why the recording has ended, one sentence; empty while it goes on."""
        reported = [r.problem for r, _ in self._closing] + [self._recorder.problem]
        return next(filter(None, reported), "")

    def put(self, samples: Samples) -> None:
        """Take a block of samples."""
        self._recorder.put(samples)
        self.tick()

    def tick(self) -> None:
        """Write a part, begin a new drive or remove old ones if it is time."""
        self._recorder.tick()
        if self._recorder.written >= self._split and not self._recorder.problem:
            self._next()
        if self._clock() - self._looked >= LOOKED:
            self._look()

    def close(self) -> None:
        """Write what is left, and join the parts of each drive."""
        self._recorder.close()
        self._closer.shutdown(wait=True)

    def __enter__(self) -> Recordings:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _next(self) -> None:
        """Go on in a new drive; the one before is joined beside."""
        before = self._recorder
        folder = free_folder(self._first)
        self._recorder = Recorder(folder, self._info, clock=self._clock)
        self.folders.append(folder)
        self._closing = [c for c in self._closing if not c[1].done() or c[0].problem]
        self._closing.append((before, self._closer.submit(before.close)))
        self._look()

    def _look(self) -> None:
        """Remove the drives of this series that are too old."""
        self._looked = self._clock()
        if math.isinf(self._keep):
            return
        busy = {self._recorder.folder, *(r.folder for r, f in self._closing if not f.done())}
        for folder in series(self._first):
            if folder not in busy and self._date() - _newest(folder) > self._keep:
                try:
                    shutil.rmtree(folder)
                except OSError as error:
                    _logger.warning("%s cannot be removed: %s", folder, error.strerror or error)
                else:
                    _logger.warning("%s is older than is to be kept: removed", folder)


def recordings(
    folder: Path, info: DriveInfo, *, split_mb: float | None, keep_days: float | None
) -> Recordings:
    """Record in a series, as a person says it.

    Parameters
    ----------
    folder, info : see `Recordings`
    split_mb : a new drive begins where one has so many megabytes; None for never
    keep_days : drives are removed after so many days; None for never
    """
    return Recordings(
        folder,
        info,
        split=math.inf if split_mb is None else split_mb * 1e6,
        keep=math.inf if keep_days is None else keep_days * 86_400.0,
    )


def series(folder: Path) -> list[Path]:
    """List the drives of a series that hold nothing but what a recorder wrote.

    Parameters
    ----------
    folder : the first
    """
    form = re.compile(rf"{re.escape(folder.name)}(-[1-9][0-9]*)?")
    try:
        beside = sorted(folder.parent.iterdir())
    except OSError:
        return []
    return [
        f
        for f in beside
        if form.fullmatch(f.name)
        and f.is_dir()
        and not f.is_symlink()
        and {inner.name for inner in f.iterdir()} <= _OWN
    ]


def _newest(folder: Path) -> float:
    """When the newest file of a drive was written [s since 1970].

    Infinite where a clock that was not set wrote it, or where there is none: nobody knows.
    """
    times = [f.stat().st_mtime for f in folder.rglob("*") if f.is_file()]
    newest = max(times, default=math.inf)
    return newest if DATES[0] < newest < DATES[1] else math.inf
