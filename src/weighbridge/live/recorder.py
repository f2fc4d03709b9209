"""Records live samples as a drive that survives a power cut."""

from __future__ import annotations

import contextlib
import logging
import re
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from weighbridge.errors import DriveError, WeighbridgeError
from weighbridge.io import PARSE_ERRORS, join_parts
from weighbridge.io.info import FILE_NAME as INFO_NAME
from weighbridge.io.info import info_text
from weighbridge.io.parts import part_path
from weighbridge.io.table import DATES, start_text
from weighbridge.io.write import to_frames, write_frame
from weighbridge.live.source import Samples
from weighbridge.signals import QUANTITIES, Drive, DriveInfo, Floats, Signal
from weighbridge.signals.catalogue import TABLES
from weighbridge.whole import write_whole

_logger = logging.getLogger(__name__)

PERIOD: Final = 30.0
"""A part is written this often: with the time to write it, a power cut costs less than a
minute [s]."""

# Samples in memory from which a part is written before its time: 32 MB.
_MOST_SAMPLES: Final = 2_000_000

# Parts that wait for the disk, and how long more are put off before it is given up [s].
_MOST_WAITING: Final = 10
_PATIENCE: Final = 5.0

_Blocks = dict[str, list[tuple[Floats, Floats]]]


class Recorder:
    """Writes samples as a canonical drive: a part a half minute, one table each at the end.

    `weighbridge.read_drive` reads the folder at any time, also after the process was killed. A
    disk that is full or gone ends the recording, raises nothing, and is shown by `problem`.

    Parameters
    ----------
    folder : of the drive; made where it is not there
    info : what is known besides the signals; the start is found
    period : time between parts [s]
    clock : that time [s]

    Attributes
    ----------
    folder
    samples : that were taken
    written : bytes of the parts so far

    Raises
    ------
    DriveError
        The folder holds something, or cannot be made.
    """

    def __init__(
        self,
        folder: str | Path,
        info: DriveInfo | None = None,
        *,
        period: float = PERIOD,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.folder = Path(folder)
        self._made = not self.folder.exists()
        self._closed = False
        _refuse_drive(self.folder)
        self.samples = 0
        self.written = 0
        self._info = info or DriveInfo()
        self._period = period
        self._clock = clock
        self._blocks: _Blocks = {}
        self._held = 0
        self._begun = clock()
        self._parts = 0
        self._zero: float | None = None
        self._tables: set[str] = set()
        self._unknown: set[str] = set()
        self._problem = ""
        self._waiting: list[Future[None]] = []
        self._writer = ThreadPoolExecutor(1, "recorder")

    @property
    def problem(self) -> str:
        """Why the recording has ended, one sentence; empty while it goes on."""
        return self._problem

    def put(self, samples: Samples) -> None:
        """Take a block of samples."""
        if self._problem:
            return
        for name, (t, values) in samples.items():
            if name not in QUANTITIES:
                self._leave_out(name)
                continue
            # The caller may fill its arrays again.
            block = np.array(t, float), np.array(values, float)
            self._blocks.setdefault(name, []).append(block)
            self._held += block[0].size
            self.samples += block[0].size
        self.tick()

    def tick(self) -> None:
        """Write a part if it is time; to be called also while no samples come."""
        due = self._clock() - self._begun >= self._period or self._held >= _MOST_SAMPLES
        if due:
            self._flush()

    def close(self) -> None:
        """Write what is left and join the parts; let a folder go that was made for nothing."""
        if self._closed:
            return
        self._closed = True
        self._flush()
        self._writer.submit(self._join)
        self._writer.shutdown(wait=True)
        if self._made:
            # One that holds something stays.
            with contextlib.suppress(OSError):
                self.folder.rmdir()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _flush(self) -> None:
        """Hand what is held to the thread that writes."""
        self._begun = self._clock()
        blocks, self._blocks, self._held = self._blocks, {}, 0
        if not blocks or self._problem:
            return
        self._waiting = [f for f in self._waiting if not f.done()]
        if len(self._waiting) >= _MOST_WAITING and not wait(self._waiting[:1], _PATIENCE).done:
            self._stop(f"{self.folder} cannot be written as fast as samples come")
            return
        self._waiting.append(self._writer.submit(self._write, blocks))

    def _write(self, blocks: _Blocks) -> None:
        if self._problem:
            return
        try:
            signals = {name: s for name, b in blocks.items() if (s := _signal(name, b)) is not None}
            if not signals:
                return
            if self._zero is None:
                self._begin(min(float(s.time[0]) for s in signals.values()))
            zero = self._zero or 0.0
            signals = {n: Signal(n, s.time - zero, s.values) for n, s in signals.items()}
            self._parts += 1
            for table, frame in to_frames(Drive(self.folder.name, signals)).items():
                path = part_path(self.folder, table, self._parts)
                if table not in self._tables:
                    # Another recording into the same folder would have made it.
                    path.parent.mkdir()
                    self._tables.add(table)
                write_frame(frame, path)
                self.written += path.stat().st_size
        except WeighbridgeError as error:
            self._stop(str(error))
        except OSError as error:
            self._stop(f"{self.folder} cannot be written: {error.strerror or error}")
        except BaseException:
            self._stop(f"{self.folder} is not written any more because of a fault of the program")
            _logger.exception("recording failed")

    def _begin(self, first: float) -> None:
        """Let the drive's clock begin with its first second, where the host knows the date."""
        self._zero = 0.0
        info = self._info
        if DATES[0] < first < DATES[1]:
            self._zero = float(np.floor(first))
            info = replace(info, start_time=start_text(self._zero))
        if info != DriveInfo():
            write_whole(self.folder / INFO_NAME, info_text(info), DriveError)

    def _join(self) -> None:
        if self._problem:
            return
        try:
            for table in TABLES:
                if table in self._tables:
                    join_parts(self.folder, table)
        except (WeighbridgeError, OSError, *PARSE_ERRORS) as error:
            self._problem = f"{error}; the parts of {self.folder} stay and can be read as a drive"
            _logger.warning("%s", self._problem)

    def _stop(self, why: str) -> None:
        self._problem = f"{why}: recording has ended, what was written before is kept"
        self._blocks, self._held = {}, 0
        _logger.warning("%s", self._problem)

    def _leave_out(self, name: str) -> None:
        if name not in self._unknown and len(self._unknown) < len(QUANTITIES):
            self._unknown.add(name)
            _logger.warning("%s is no signal of the catalogue and is not recorded", name)


def free_folder(folder: Path) -> Path:
    """Return a folder to record into that holds nothing: this one, or one numbered beside it.

    The number is above all that are there, so that the order of the numbers is that of time.
    """
    form = re.compile(rf"{re.escape(folder.name)}(?:-([1-9][0-9]*))?")
    beside = folder.parent.iterdir() if folder.parent.is_dir() else ()
    names = [form.fullmatch(f.name) for f in beside if f.is_dir() and any(f.iterdir())]
    last = max((int(m[1] or 1) for m in names if m), default=0)
    return folder.with_name(f"{folder.name}-{last + 1}") if last else folder


def _refuse_drive(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise DriveError(
                f"{folder} is not empty, and a recording replaces nothing: name a new folder"
            )
    except FileExistsError:
        raise DriveError(f"{folder} is a file: name a new folder to record into") from None
    except OSError as error:
        raise DriveError(f"{folder} cannot be written: {error.strerror or error}") from None


def _signal(name: str, blocks: list[tuple[Floats, Floats]]) -> Signal | None:
    """Join blocks in the order of time; of several samples of one instant the last counts."""
    t = np.concatenate([b[0] for b in blocks])
    values = np.concatenate([b[1] for b in blocks])
    good = np.isfinite(t) & np.isfinite(values)
    t, values = t[good], values[good]
    if not t.size:
        return None
    order = np.argsort(t, kind="stable")
    t, values = t[order], values[order]
    last = np.append(t[1:] > t[:-1], True)
    return Signal(name, t[last], values[last])
