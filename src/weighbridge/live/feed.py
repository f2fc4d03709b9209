"""Runs sources, each in a thread, and gathers what they hand over."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from threading import Condition, Event, Lock, Thread
from time import monotonic
from typing import Final

from weighbridge.errors import SourceError
from weighbridge.live.clock import now
from weighbridge.live.source import Samples, Source

_logger = logging.getLogger(__name__)

SHORTEST_PAUSE: Final = 1.0
LONGEST_PAUSE: Final = 30.0
"""A lost source is tried again after so long, and twice as long each time up to the longest [s]."""

# Blocks of samples that wait at most: 50 s of ten sources at 10 blocks a second.
_MOST_BLOCKS: Final = 5000
# A source must end within a second of being asked to.
_CLOSING: Final = 1.5
# How long a source that waits for room sleeps before it looks whether it shall stop [s].
_GLANCE: Final = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceState:
    """How one source does.

    Attributes
    ----------
    name : as on the command line
    connected : whether samples come from it
    since : when that began, by the host's clock that never jumps [s]
    error : why none come, one sentence; empty where they do
    restarts : how often it was begun anew
    ended : whether it has no more, as a recorded drive
    """

    name: str
    connected: bool
    since: float
    error: str
    restarts: int
    ended: bool = False


def trouble_text(name: str, error: str) -> str:
    """Say in a sentence which source has a trouble, its place named once.

    Parameters
    ----------
    name : of the source, as ``nmea:tcp:127.0.0.1:10110``
    error : why no samples come from it
    """
    kind, place = _parted(name)
    return f"{kind}: {error}" if place in error else f"{source_text(name)}: {error}"


def source_text(name: str) -> str:
    """Write a source as people call it: ``nmea 127.0.0.1:10110``."""
    return " ".join(_parted(name)).rstrip()


def _parted(name: str) -> tuple[str, str]:
    """Part the name of a source into its kind and its place."""
    kind, _, place = name.partition(":")
    return kind, place.removeprefix("tcp:")


class Feed:
    """Samples of all sources, as they come.

    A source may have three more attributes. ``trouble``: why it has no samples although its device
    is there, such as a bus that is silent; empty where it has. ``patient``: true where it waits
    for room instead of having its oldest samples dropped, as a recorded drive. ``renewed``: how
    often the clock of its device has begun anew.

    Parameters
    ----------
    sources : to run from now on
    most : blocks of samples that wait to be read; the oldest are dropped and counted then
    pauses : shortest and longest time until a lost source is tried again [s]
    """

    def __init__(
        self,
        sources: Sequence[Source],
        *,
        most: int = _MOST_BLOCKS,
        pauses: tuple[float, float] = (SHORTEST_PAUSE, LONGEST_PAUSE),
    ) -> None:
        self._most = most
        self._pauses = pauses
        self._blocks: deque[Samples] = deque()
        self._changed = Condition()
        self._stop = Event()
        self._failure: BaseException | None = None
        self._dropped = 0
        self._runners = [_Runner(self, source) for source in sources]
        for runner in self._runners:
            runner.thread.start()

    @property
    def dropped(self) -> int:
        """Blocks of samples dropped because nobody read them in time."""
        return self._dropped

    @property
    def ended(self) -> bool:
        """Whether all sources have ended and everything was read."""
        with self._changed:
            return not self._blocks and self._silent()

    def read(self, timeout: float) -> list[Samples]:
        """Return what came since the last time; wait for something up to ``timeout`` [s].

        Returns
        -------
        In the order of arrival; empty where nothing came.

        Raises
        ------
        WeighbridgeError
            A source cannot be used as it was named: that does not correct itself.
        """
        with self._changed:
            self._changed.wait_for(
                lambda: self._blocks or self._failure is not None or self._silent(), timeout
            )
            if self._failure is not None:
                raise self._failure
            blocks = list(self._blocks)
            self._blocks.clear()
            self._changed.notify_all()
        for runner in self._runners:
            runner.look()
        return blocks

    @property
    def renewed(self) -> int:
        """How often the clock of any device has begun anew."""
        return sum(int(getattr(runner.source, "renewed", 0)) for runner in self._runners)

    def states(self) -> list[SourceState]:
        """How each source does, in the order they were named."""
        return [runner.state() for runner in self._runners]

    def close(self) -> None:
        """Stop all sources and wait until they have ended."""
        self._stop.set()
        with self._changed:
            self._changed.notify_all()
        until = monotonic() + _CLOSING
        for runner in self._runners:
            runner.thread.join(max(until - monotonic(), 0.0))
            if runner.thread.is_alive():
                _logger.warning(
                    "%s does not end; it is left behind", source_text(runner.source.name)
                )

    def __enter__(self) -> Feed:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _silent(self) -> bool:
        return all(runner.ended for runner in self._runners)

    def _add(self, samples: Samples, *, patient: bool) -> None:
        with self._changed:
            while patient and len(self._blocks) >= self._most and not self._stop.is_set():
                self._changed.wait(_GLANCE)
            if len(self._blocks) >= self._most:
                self._blocks.popleft()
                self._dropped += 1
                if self._dropped == 1:
                    _logger.warning("samples come faster than they are used; the oldest are lost")
            self._blocks.append(samples)
            self._changed.notify_all()

    def _end(self, failure: BaseException | None = None) -> None:
        with self._changed:
            self._failure = self._failure or failure
            self._changed.notify_all()


class _Runner:
    """Runs one source until it ends, again and again where its device is lost."""

    def __init__(self, feed: Feed, source: Source) -> None:
        self.source = source
        self.ended = False
        self._feed = feed
        self._patient = bool(getattr(source, "patient", False))
        self._lock = Lock()
        self._lost = ""
        self._came = False
        self._error = "no sample yet"
        self._reported = False
        self._since = now()
        self._restarts = 0
        self.thread = Thread(target=self._run, name=source.name, daemon=True)

    def state(self) -> SourceState:
        self.look()
        return SourceState(
            name=self.source.name,
            connected=not self._error,
            since=self._since,
            error=self._error,
            restarts=self._restarts,
            ended=self.ended,
        )

    def look(self) -> None:
        """See how the source does; log once that it is lost, and once that it is back."""
        with self._lock:
            trouble = str(getattr(self.source, "trouble", "")) or self._lost
            error = trouble or ("" if self._came else "no sample yet")
            if bool(error) != bool(self._error):
                self._since = now()
            self._error = error
            if trouble and not self._reported:
                _logger.warning("%s", trouble_text(self.source.name, trouble))
                self._reported = True
            elif not error and self._reported:
                _logger.warning("%s is back", source_text(self.source.name))
                self._reported = False

    def _run(self) -> None:
        shortest, longest = self._feed._pauses
        stop = self._feed._stop
        pause = shortest
        while not stop.is_set():
            self._came = False
            try:
                self.source.run(self._put, stop)
            except SourceError as error:
                pause = shortest if self._came else pause
                self._came, self._lost = False, str(error)
                self.look()
                if stop.wait(pause):
                    break
                pause = min(2.0 * pause, longest)
                self._restarts += 1
            # What cannot be corrected by trying again is for whoever reads.
            except BaseException as failure:
                self.ended = True
                self._feed._end(failure)
                return
            else:
                break
        self.ended = True
        self._feed._end()

    def _put(self, samples: Samples) -> None:
        if not self._came:
            self._came, self._lost = True, ""
            self.look()
        self._feed._add(samples, patient=self._patient)
