"""Samples as they come from a vehicle, put in order behind a window of lateness."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from weighbridge.arguments import check_number
from weighbridge.errors import ConfigError
from weighbridge.live.source import Samples
from weighbridge.signals import Drive, DriveInfo, Floats, Signal
from weighbridge.signals.catalogue import QUANTITIES
from weighbridge.signals.recent import FEWEST_SAMPLES

LATENESS: Final = 1.0
"""A sample may come so much later than the newest [s]: PX4 waits 0.2, openpilot 1 s."""

FARTHEST: Final = 3600.0
"""A stamp so far ahead of the newest is of another clock [s]: no drive goes on after such a gap."""

BACK: Final = 60.0
"""So far behind the newest likewise [s]."""

JUMPED: Final = 50
"""Of so many such samples in succession, and of no other, the clock has jumped; fewer are false."""

JUMPED_FOR: Final = 2.0
"""They go on for so long [s]: one of several sources whose clock begins anew is not all of them."""

SILENCE: Final = 3.0
"""Where no sample came for so long, all were silent [s]."""

_FIRST: Final = 1e10
"""No clock has such an instant [s]: it is the year 2286."""

_ROOM: Final = 256

_NONE: Final = np.empty(0)


class _Column:
    """Sealed samples of one signal in rising order, and those that are still open."""

    def __init__(self) -> None:
        self.time, self.values = np.empty(_ROOM), np.empty(_ROOM)
        self.first = self.last = 0
        self.single_times: list[float] = []
        self.single_values: list[float] = []
        self.blocks: list[tuple[Floats, Floats]] = []
        self.newest = -math.inf

    @property
    def is_open(self) -> bool:
        """Whether samples wait to be sealed."""
        return bool(self.blocks or self.single_times)

    def waiting(self) -> tuple[Floats, Floats]:
        """Times (n,) and values of the open samples, in no order."""
        if self.single_times:
            self.blocks.append((np.array(self.single_times), np.array(self.single_values)))
            self.single_times, self.single_values = [], []
        if not self.blocks:
            return _NONE, _NONE
        if len(self.blocks) > 1:
            times, values = zip(*self.blocks, strict=True)
            self.blocks = [(np.concatenate(times), np.concatenate(values))]
        return self.blocks[0]

    def seal(self, until: float) -> None:
        """Put the open samples before ``until`` in order behind the sealed ones."""
        time, values = self.waiting()
        old = time < until
        if not old.any():
            return
        self.blocks = [] if old.all() else [(time[~old], values[~old])]
        self._append(*_in_order(time[old], values[old]))

    def _append(self, time: Floats, values: Floats) -> None:
        count = self.last - self.first
        need = count + time.size
        if self.last + time.size > self.time.size:
            # New arrays, never the old ones moved: a drive may still look at them.
            room = max(_ROOM, 2 * need)
            grown = np.empty(room), np.empty(room)
            for new, old in zip(grown, (self.time, self.values), strict=True):
                new[:count] = old[self.first : self.last]
            self.time, self.values = grown
            self.first, self.last = 0, count
        end = self.last + time.size
        self.time[self.last : end], self.values[self.last : end] = time, values
        self.last = end

    @property
    def sealed(self) -> tuple[Floats, Floats]:
        return self.time[self.first : self.last], self.values[self.first : self.last]


def _in_order(time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Put samples (n,) in rising order, one for each instant."""
    if (np.diff(time) <= 0.0).any():
        # Of two samples with one stamp the order they came in must not choose.
        order = np.lexsort((values, time))
        time, values = time[order], values[order]
        keep = np.concatenate(([True], np.diff(time) > 0.0))
        time, values = time[keep], values[keep]
    return time, values


class Records:
    """Samples of many signals, each on its own clock.

    Samples come in any order within ``lateness``; later ones are counted and dropped. What was
    sealed never changes again, so that what is made of it depends on neither order nor block sizes.
    A clock that jumps is brought back: time goes on from the newest sample.

    Parameters
    ----------
    lateness : by which a sample may be older than the newest of all signals [s]

    Attributes
    ----------
    newest : instant of the newest sample [s]; -inf before the first
    oldest : instant of the first sample of all that were taken [s]; inf before the first
    offset : what jumps of the clock have added up to, which is taken off [s]
    jumps : jumps of the clock so far
    resumed : instant of the first sample after all were silent for `SILENCE` the last time [s];
        -inf before that
    silence : length of that silence [s]; 0 before any, infinite where nobody knows
    late, unfit : samples dropped because they came too late, or were no finite number or
        impossible instant, by signal
    """

    def __init__(self, lateness: float = LATENESS) -> None:
        check_number("lateness", lateness)
        if not 0.0 <= lateness < math.inf:
            raise ConfigError(f"lateness must be 0 s or more, got {lateness}")
        self.lateness = lateness
        self.newest = -math.inf
        self.oldest = math.inf
        self.resumed = -math.inf
        self.silence = 0.0
        self.offset = 0.0
        self.jumps = 0
        self.late: dict[str, int] = {}
        self.unfit: dict[str, int] = {}
        self._columns: dict[str, _Column] = {}
        self._followed = math.nan
        self._strange = 0
        self._strange_from = math.nan
        self._sealed_to = -math.inf

    @property
    def watermark(self) -> float:
        """No sample before this instant is taken any more [s]."""
        return self._bounds()[1]

    def add(self, name: str, time: float, value: float) -> None:
        """Take one sample of a signal; see `add_block`."""
        at = time - self.offset
        first, in_time, last = self._bounds()
        if not (in_time <= at < last and first < at and math.isfinite(value)):
            self.add_block({name: (np.array([time]), np.array([value]))})
            return
        column = self._columns.get(name) or self._column(name)
        column.single_times.append(at)
        column.single_values.append(value)
        column.newest = max(column.newest, at)
        self._strange = 0
        self._resume(at)
        self.newest, self.oldest = max(self.newest, at), min(self.oldest, at)

    def add_block(self, samples: Samples) -> None:
        """Take samples of several signals that came together.

        Parameters
        ----------
        samples : by canonical name, instants (n,) [s] and values (n,) in SI

        Raises
        ------
        ConfigError
            There is no such signal, or times and values differ in number.
        """
        newest = self.newest
        strange: list[Floats] = []
        ordinary = False
        first, in_time, last = self._bounds()
        for name, (time, values) in samples.items():
            if time.shape != values.shape or time.ndim != 1:
                raise ConfigError(
                    f"{name}: {time.size} instants and {values.size} values; give one for each"
                )
            column = self._columns.get(name) or self._column(name)
            at = time - self.offset
            # Nearly every block is as it should be.
            sound = at.size and first < at.min() >= in_time and at.max() < last
            if not (sound and np.isfinite(values).all()):
                finite = np.isfinite(at) & np.isfinite(values)
                near = finite & (at > first) & (at < last)
                fresh = near & (at >= in_time)
                self._count(self.unfit, name, int(np.count_nonzero(~near)))
                self._count(self.late, name, int(np.count_nonzero(near & ~fresh)))
                strange.append(at[finite & ~near])
                ordinary = ordinary or bool(near.any())
                at, values = at[fresh], values[fresh]
                if not at.size:
                    continue
            ordinary = True
            earliest, latest = float(at.min()), float(at.max())
            column.blocks.append((at, values))
            column.newest = max(column.newest, latest)
            self._resume(earliest)
            newest = max(newest, latest)
            self.oldest = min(self.oldest, earliest)
        self.newest = newest
        self._watch(np.concatenate([*strange, _NONE]), ordinary)

    def _bounds(self) -> tuple[float, float, float]:
        """Instants between which a stamp can be so: after, in time from, before [s].

        A stamp outside the outer two is of another clock; one before that in the middle is late.
        """
        newest, sealed_to = self.newest, self._sealed_to
        if newest == -math.inf:
            return -_FIRST, sealed_to, _FIRST
        open_from = newest - self.lateness
        in_time = open_from if open_from > sealed_to else sealed_to
        return in_time - BACK, in_time, newest + FARTHEST

    def _resume(self, at: float) -> None:
        if at - self.newest > SILENCE and math.isfinite(self.newest):
            self.resumed = at
            self.silence = math.inf if self.newest == self._followed else at - self.newest

    def follow(self, start: float, after: float) -> None:
        """Take it that the clock was set back in a silence that was as long as nobody knows.

        Parameters
        ----------
        start : instant by that clock from which samples come now [s]
        after : so long behind the newest it is put [s]
        """
        self.offset += start - (self.newest + after)
        self.jumps += 1
        self._followed = self.newest

    def _column(self, name: str) -> _Column:
        if name not in QUANTITIES:
            raise ConfigError(
                f"{name!r} is no signal; weighbridge.signals.catalogue lists those there are"
            )
        return self._columns.setdefault(name, _Column())

    @staticmethod
    def _count(counts: dict[str, int], name: str, more: int) -> None:
        if more:
            counts[name] = counts.get(name, 0) + more

    def _watch(self, strange: Floats, ordinary: bool) -> None:
        """Look for a clock that has jumped: samples of it come, and no others."""
        if ordinary or not math.isfinite(self.newest):
            self._strange = 0
        elif strange.size:
            low, high = float(strange.min()), float(strange.max())
            if not self._strange or not -BACK < low - self._strange_from < BACK:
                self._strange, self._strange_from = 0, low
            self._strange += strange.size
            if self._strange >= JUMPED and high - self._strange_from >= JUMPED_FOR:
                # What came of it so far is left out, and leaves a gap of its length.
                self.offset += self._strange_from - self.newest
                self.jumps += 1
                self._strange = 0

    def seal(self, until: float) -> None:
        """Put all samples before ``until`` in order; none of them comes any more."""
        self._sealed_to = max(self._sealed_to, until)
        for column in self._columns.values():
            if column.is_open:
                column.seal(until)

    @property
    def newest_sealed(self) -> float:
        """Instant of the last sealed sample [s]; -inf without any."""
        ends = [c.sealed[0][-1] for c in self._columns.values() if c.last > c.first]
        return float(max(ends, default=-math.inf))

    @property
    def waiting_from(self) -> float:
        """Instant of the first sample that is not sealed [s]; inf without any."""
        waiting = [float(c.waiting()[0].min()) for c in self._columns.values() if c.is_open]
        return min(waiting, default=math.inf)

    def forget(self, before: float, fewest: int) -> None:
        """Let sealed samples before an instant [s] go, but for the last ``fewest`` of a signal."""
        for column in self._columns.values():
            time = column.sealed[0]
            keep = min(int(time.searchsorted(before)), time.size - fewest)
            column.first += max(keep, 0)

    def cut(self, before: float) -> None:
        """Let all samples before an instant [s] go, however few are left."""
        self.seal(before)
        self.forget(before, 0)
        self.oldest = max(self.oldest, before)

    def last(self, span: float) -> dict[str, tuple[Floats, Floats]]:
        """Samples of the last ``span`` [s], `FEWEST_SAMPLES` of each signal at least, open ones."""
        found = {}
        for name, column in self._columns.items():
            time, values = column.sealed
            keep = max(
                min(int(time.searchsorted(self.newest - span)), time.size - FEWEST_SAMPLES), 0
            )
            more = column.waiting()
            found[name] = (
                np.concatenate([time[keep:], more[0]]),
                np.concatenate([values[keep:], more[1]]),
            )
        return found

    def drive(self, info: DriveInfo) -> Drive:
        """Sealed samples as a drive, which shares their memory."""
        return Drive(
            "live",
            {n: Signal(n, *c.sealed) for n, c in self._columns.items() if c.last > c.first},
            info,
        )

    def so_far(self, info: DriveInfo, span: float) -> Drive:
        """Samples of the last ``span`` [s] as a drive, `last`, late ones may still come."""
        return Drive(
            "live",
            {
                n: Signal(n, *_in_order(*pair))
                for n, pair in self.last(span).items()
                if pair[0].size
            },
            info,
        )

    def names(self) -> tuple[str, ...]:
        """Signals of which samples came, in order."""
        return tuple(sorted(self._columns))

    def newest_of(self, name: str) -> float:
        """Instant of the newest sample of a signal [s]; -inf without any."""
        column = self._columns.get(name)
        return -math.inf if column is None else column.newest

    def newest_value(self, name: str) -> float:
        """Value of the newest sample of a signal; NaN without any."""
        values = self._newest(name, 1)[1]
        return float(values[-1]) if values.size else math.nan

    def gaps(self, name: str) -> Floats:
        """Times between the last `FEWEST_SAMPLES` samples of a signal, late ones counted [s].

        Empty where fewer than two came.
        """
        return np.diff(self._newest(name, FEWEST_SAMPLES)[0])

    def _newest(self, name: str, count: int) -> tuple[Floats, Floats]:
        """Return the last samples of a signal in order, ``count`` at most."""
        column = self._columns.get(name)
        if column is None:
            return _NONE, _NONE
        time, values = column.sealed
        more = column.waiting()
        time, values = _in_order(
            np.concatenate([time[-count:], more[0]]), np.concatenate([values[-count:], more[1]])
        )
        return time[-count:], values[-count:]

    def rate(self, name: str, span: float) -> float:
        """Sealed samples per second of a signal over the last ``span`` [s] that were sealed.

        One that comes more seldom has the rate of its last two.
        """
        column = self._columns.get(name)
        if column is None:
            return 0.0
        time = column.sealed[0]
        end = min(self.watermark, self.newest)
        count = time.size - int(time.searchsorted(end - span))
        if count < 2 <= time.size:
            return 1.0 / float(time[-1] - time[-2])
        return count / span
