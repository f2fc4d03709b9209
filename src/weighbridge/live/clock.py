"""A clock that never jumps, for samples that carry no instant of their own."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple


class _Course(NamedTuple):
    """The clock's time at an instant of the host's counter, and how fast it goes since [s]."""

    time: float
    counter: float
    rate: float

    def at(self, counter: float) -> float:
        return self.time + self.rate * (counter - self.counter)


_course = _Course(time.time(), time.monotonic(), 1.0)


def now() -> float:
    """Return the time since 1970 as it was when the process began, counted on evenly [s].

    A host that sets its clock on the way does not move it.
    """
    return _course.at(time.monotonic())


def pace() -> float:
    """Return how fast the clock goes: 1, or as many times as that of an emulated vehicle."""
    return _course.rate


@contextmanager
def at_rate(rate: float) -> Iterator[None]:
    """Let the clock go faster or slower for a while, as that of an emulated vehicle does.

    Parameters
    ----------
    rate : seconds per second, > 0
    """
    before = _course.rate
    _turn(rate)
    try:
        yield
    finally:
        _turn(before)


def _turn(rate: float) -> None:
    global _course
    counter = time.monotonic()
    _course = _Course(_course.at(counter), counter, rate)
