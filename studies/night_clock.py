"""Time that is computed, not waited for: threads of the program take turns on a virtual clock.

Each thread is a greenlet. One runs until it waits; then the one that is due next goes on, at its
instant. So an order of events depends on nothing but the seed, and eight hours take no longer than
their computing.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from greenlet import GreenletExit, getcurrent, greenlet


class Off(BaseException):
    """The power is off: what waits never goes on."""


class Clock:
    """A virtual clock, and the threads that wait on it.

    Attributes
    ----------
    now : instant [s]
    lag : how long a thread takes until it has begun, by its name [s]
    """

    def __init__(self) -> None:
        self.now = 1000.0
        self.lag: Callable[[str], float] = lambda _: 0.0
        self.failures: list[BaseException] = []
        self._due: list[tuple[float, int, Any, int]] = []
        self._count = 0
        self._hub = getcurrent()
        self._turns: dict[greenlet, int] = {}
        self._until = math.inf
        self.powerless = False

    def monotonic(self) -> float:
        """Return the instant [s]."""
        return self.now

    def call(self, at: float, what: Callable[[], None]) -> None:
        """Call something at an instant [s]; it must not wait."""
        self._push(max(at, self.now), what, -1)

    def spawn(self, run: Callable[[], None], name: str) -> greenlet:
        """Let a thread begin."""

        def caught() -> None:
            try:
                run()
            except (Off, GreenletExit):
                pass
            # Handed to who looks at the run: no thread of the program may fail.
            except BaseException as failure:
                self.failures.append(failure)
            finally:
                self._turns.pop(thread, None)

        thread = greenlet(caught, parent=self._hub)
        self._turns[thread] = 0
        self._push(self.now + self.lag(name), thread, 0)
        return thread

    def wait(self, seconds: float, waiting: list[tuple[Any, int]] | None = None) -> None:
        """Let others run for so long [s], or until somebody wakes who is in ``waiting``."""
        if self.powerless:
            raise Off
        me = getcurrent()
        at = self.now + max(seconds, 0.0)
        if at < self._until and (not self._due or at < self._due[0][0]):
            # Nobody else is due before: nobody can wake it sooner.
            self.now = at
            return
        turn = self._turns[me] = self._turns[me] + 1
        if waiting is not None:
            waiting.append((me, turn))
        if math.isfinite(at):
            self._push(at, me, turn)
        self._hub.switch()
        if waiting is not None and (me, turn) in waiting:
            waiting.remove((me, turn))
        if self.powerless:
            raise Off

    def wake(self, waiting: list[tuple[Any, int]]) -> None:
        """Let those go on who wait."""
        for thread, turn in waiting:
            if self._turns.get(thread) == turn:
                self._push(self.now, thread, turn)
        waiting.clear()

    def run(self, until: float) -> None:
        """Let all run until an instant [s]."""
        self._until = until
        while self._due and self._due[0][0] < until:
            at, _, what, turn = heapq.heappop(self._due)
            self.now = max(self.now, at)
            if turn < 0:
                what()
            elif self._turns.get(what) == turn:
                self._turns[what] += 1
                what.switch()
        self.now = max(self.now, until) if math.isfinite(until) else self.now

    def alive(self) -> bool:
        """Whether any thread has not ended."""
        return bool(self._turns)

    def power_off(self) -> None:
        """Throw all threads away, where they are, and what was to be called."""
        self.powerless = True
        for thread in list(self._turns):
            if thread:
                thread.throw(Off)
        self._turns.clear()
        self._due.clear()
        self.powerless = False

    def _push(self, at: float, what: Any, turn: int) -> None:
        self._count += 1
        heapq.heappush(self._due, (at, self._count, what, turn))


class Lock:
    """Held by one of several that take turns: nobody waits while it is held."""

    def __enter__(self) -> Lock:
        return self

    def __exit__(self, *_: object) -> None:
        pass


class Threads:
    """The classes of `threading` and `concurrent.futures` that the program uses, on a clock."""

    def __init__(self, clock: Clock) -> None:
        class Condition(Lock):
            def __init__(self) -> None:
                self._waiting: list[tuple[Any, int]] = []

            def wait(self, timeout: float | None = None) -> None:
                clock.wait(math.inf if timeout is None else timeout, self._waiting)

            def wait_for(self, true: Callable[[], Any], timeout: float | None = None) -> Any:
                until = math.inf if timeout is None else clock.now + timeout
                while not (found := true()) and clock.now < until:
                    self.wait(until - clock.now)
                return found

            def notify_all(self) -> None:
                clock.wake(self._waiting)

        class Event:
            def __init__(self) -> None:
                self._set, self._changed = False, Condition()

            def is_set(self) -> bool:
                return self._set

            def set(self) -> None:
                self._set = True
                self._changed.notify_all()

            def wait(self, timeout: float | None = None) -> bool:
                if not self._set:
                    self._changed.wait_for(lambda: self._set, timeout)
                return self._set

        class Thread:
            def __init__(
                self, target: Callable[..., None], args: tuple[Any, ...] = (), name: str = "",
                daemon: bool = False,
            ) -> None:  # fmt: skip
                self.name, self._ended, self._begun = name, Event(), False
                self._work = lambda: target(*args)

            def start(self) -> None:
                def run() -> None:
                    try:
                        self._work()
                    finally:
                        self._ended.set()

                self._begun = True
                clock.spawn(run, self.name)

            def is_alive(self) -> bool:
                return self._begun and not self._ended.is_set()

            def join(self, timeout: float | None = None) -> None:
                self._ended.wait(timeout)

        class Future:
            def __init__(self) -> None:
                self._ended = Event()

            def done(self) -> bool:
                return self._ended.is_set()

        class ThreadPoolExecutor:
            def __init__(self, workers: int, name: str) -> None:
                self._name, self._last = name, Future()
                self._last._ended.set()

            def submit(self, work: Callable[..., None], *args: Any) -> Future:
                before, mine = self._last, Future()

                def run() -> None:
                    before._ended.wait()
                    try:
                        work(*args)
                    finally:
                        mine._ended.set()

                self._last = mine
                clock.spawn(run, self._name)
                return mine

            def shutdown(self, *, wait: bool = True) -> None:
                self._last._ended.wait()

        def wait(futures: list[Future], timeout: float) -> Any:
            for future in futures:
                future._ended.wait(timeout)
            return type("Waited", (), {"done": [f for f in futures if f.done()]})

        self.Condition, self.Event, self.Thread, self.Lock = Condition, Event, Thread, Lock
        self.ThreadPoolExecutor, self.wait = ThreadPoolExecutor, wait


@contextmanager
def on_clock(clock: Clock, wall: Callable[[], float]) -> Iterator[Threads]:
    """Let all of live run on a clock.

    Parameters
    ----------
    clock
    wall : the host's date, which may be set [s since 1970]
    """
    from weighbridge.live import clock as of_live
    from weighbridge.live import feed, keeper, looking, recorder, recordings, session
    from weighbridge.live.outputs import mqtt
    from weighbridge.live.sources import elm, polling, receiver

    threads = Threads(clock)
    places = {
        feed: ("Condition", "Event", "Lock", "Thread"),
        mqtt: ("Condition", "Event", "Lock", "Thread"),
        looking: ("Thread",),
        recorder: ("ThreadPoolExecutor", "wait"),
        recordings: ("ThreadPoolExecutor",),
    }
    held = [patch.object(m, n, getattr(threads, n)) for m, names in places.items() for n in names]
    held += [
        patch.object(module, "monotonic", clock.monotonic)
        for module in (feed, session, keeper, mqtt, elm, polling, receiver)
    ]
    times = type("Times", (), {"time": staticmethod(wall), "monotonic": clock.monotonic})
    held.append(patch.object(of_live, "time", times))
    for each in held:
        each.start()
    try:
        yield threads
    finally:
        for each in reversed(held):
            each.stop()
