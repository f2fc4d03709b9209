"""Samples as they come from a vehicle, put in order behind a window of lateness."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from weighbridge.errors import ConfigError
from weighbridge.signals import Floats, Signal
from weighbridge.signals.catalogue import QUANTITIES

LATENESS: Final = 1.0
"""A sample may come so much later than the newest [s]: PX4 waits 0.2, openpilot 1 s."""

FARTHEST: Final = 3600.0
"""A stamp so far ahead of the newest is false [s]: no drive goes on after such a gap."""


class Records:
    """Samples of many signals, each on its own clock.

    Samples come in any order within ``lateness``; later ones are counted and dropped. What was
    sealed never changes again, so that what is made of it hangs on neither order nor block sizes.

    Parameters
    ----------
    lateness : by which a sample may be older than the newest of all signals [s]

    Attributes
    ----------
    newest : instant of the newest sample [s]; -inf before the first
    oldest : instant of the first sample of all that were taken [s]; inf before the first
    late, unfit : samples dropped because they came too late, or were no finite number or
        impossible instant, by signal
    """

    def __init__(self, lateness: float = LATENESS) -> None:
        if not 0.0 <= lateness < math.inf:
            raise ConfigError(f"lateness must be 0 s or more, got {lateness}")
        self.lateness = lateness
        self.newest = -math.inf
        self.oldest = math.inf
        self.late: dict[str, int] = {}
        self.unfit: dict[str, int] = {}
        self._sealed: dict[str, tuple[Floats, Floats]] = {}
        self._open: dict[str, list[tuple[Floats, Floats]]] = {}

    @property
    def watermark(self) -> float:
        """No sample before this instant is taken any more [s]."""
        return self.newest - self.lateness

    def add(self, name: str, time: Floats, values: Floats) -> None:
        """Take samples of one signal.

        Parameters
        ----------
        name : canonical name of the signal
        time : (n,) [s]
        values : (n,) in SI

        Raises
        ------
        ConfigError
            There is no such signal, or times and values differ in number.
        """
        if name not in QUANTITIES:
            raise ConfigError(
                f"{name!r} is no signal; weighbridge.signals.catalogue lists those there are"
            )
        if time.shape != values.shape or time.ndim != 1:
            raise ConfigError(
                f"{name}: {time.size} instants and {values.size} values; give one for each"
            )
        known = np.isfinite(time) & np.isfinite(values)
        if math.isfinite(self.newest):
            known &= time < self.newest + FARTHEST
        fresh = known & (time >= self.watermark)
        self._count(self.unfit, name, int(np.count_nonzero(~known)))
        self._count(self.late, name, int(np.count_nonzero(known & ~fresh)))
        if not fresh.any():
            return
        time, values = time[fresh], values[fresh]
        self._open.setdefault(name, []).append((time, values))
        self.newest = max(self.newest, float(time.max()))
        self.oldest = min(self.oldest, float(time.min()))

    @staticmethod
    def _count(counts: dict[str, int], name: str, more: int) -> None:
        if more:
            counts[name] = counts.get(name, 0) + more

    def seal(self, until: float) -> None:
        """Put all samples before ``until`` in order; none of them comes any more."""
        for name, parts in self._open.items():
            time = np.concatenate([t for t, _ in parts])
            values = np.concatenate([v for _, v in parts])
            old = time < until
            self._open[name] = [(time[~old], values[~old])]
            if not old.any():
                continue
            time, values = time[old], values[old]
            # Of two samples with one stamp the order they came in must not choose.
            order = np.lexsort((values, time))
            time, values = time[order], values[order]
            first = np.concatenate(([True], np.diff(time) > 0.0))
            before = self._sealed.get(name)
            if before is not None:
                time = np.concatenate((before[0], time[first]))
                values = np.concatenate((before[1], values[first]))
                self._sealed[name] = time, values
            else:
                self._sealed[name] = time[first], values[first]

    def forget(self, before: float) -> None:
        """Let sealed samples before an instant go [s]."""
        for name, (time, values) in self._sealed.items():
            keep = int(np.searchsorted(time, before))
            # Copies, or the memory of the whole would stay.
            self._sealed[name] = time[keep:].copy(), values[keep:].copy()

    def between(self, start: float, end: float) -> dict[str, Signal]:
        """Sealed samples from ``start`` to before ``end`` [s], by signal; none is empty."""
        found = {}
        for name, (time, values) in self._sealed.items():
            first, last = np.searchsorted(time, (start, end))
            if last > first:
                found[name] = Signal(name, time[first:last], values[first:last])
        return found
