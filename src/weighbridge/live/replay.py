"""A recorded drive as a source: as fast as it was recorded, faster, or as fast as it goes."""

from __future__ import annotations

import math
from collections.abc import Callable
from threading import Event
from time import monotonic
from typing import Final

from weighbridge.errors import ConfigError
from weighbridge.live.source import Samples
from weighbridge.signals import Drive

BLOCK: Final = 0.1
"""Samples of so long come together, in time of the drive [s],"""

FASTEST_BLOCK: Final = 1.0
"""or of so long as fast as it goes [s]."""


class Replay:
    """Hands the samples of a drive over at a rate.

    Parameters
    ----------
    drive
    rate : seconds of the drive per second; infinite for as fast as it goes

    Attributes
    ----------
    name : ``replay:`` and the name of the drive
    patient : it waits for room, so that nothing is dropped

    Raises
    ------
    ConfigError
        The rate is not above 0.
    """

    patient = True

    def __init__(self, drive: Drive, rate: float = 1.0) -> None:
        if not rate > 0.0:
            raise ConfigError(f"--rate {rate:g}: give 1 for as recorded, 10 for tenfold, or max")
        self.name = f"replay:{drive.name}"
        self._drive, self._rate = drive, rate

    def run(self, put: Callable[[Samples], None], stop: Event) -> None:
        """Hand the samples over until the end of the drive."""
        drive = self._drive
        length = BLOCK if math.isfinite(self._rate) else FASTEST_BLOCK
        begun, block = monotonic(), 0
        while drive.start + block * length <= drive.end:
            # The end of a block is the very start of the next, or samples fall between them.
            part = drive.between(*(drive.start + k * length for k in (block, block + 1)))
            block += 1
            if math.isfinite(self._rate):
                due = begun + block * length / self._rate
                if stop.wait(max(due - monotonic(), 0.0)):
                    return
            elif stop.is_set():
                return
            if part.signals:
                put({name: (s.time, s.values) for name, s in part.signals.items()})
            else:
                block = self._over_silence(block, length)

    def _over_silence(self, block: int, length: float) -> int:
        """Return the block of the next sample: a gap of days is not waited for."""
        after = self._drive.start + block * length
        later = [
            float(s.time[k])
            for s in self._drive.signals.values()
            for k in [int(s.time.searchsorted(after))]
            if k < len(s)
        ]
        if not later or not math.isinf(self._rate):
            return block
        return max(block, math.floor((min(later) - self._drive.start) / length))
