"""A look at all records, in the thread that feeds a scale or in one of its own beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from threading import Thread
from typing import Final, NamedTuple

from weighbridge.live.learning import Learned, learn
from weighbridge.live.on_the_move import time_on_the_move
from weighbridge.pipeline import forward
from weighbridge.pipeline.forward import ForwardState
from weighbridge.signals import Drive
from weighbridge.vehicle import Vehicle

FAR: Final = 3.0
"""The mass on the way and that of all records so far contradict each other beyond so many standard
deviations [-],"""

LEAST_FAR: Final = 0.03
"""and so much of the mass [-]."""


class Step(NamedTuple):
    """A step that the stages took while a look went on.

    Attributes
    ----------
    until : its instant [s]
    seen : the records that it read
    moved : time on the move in it [s]
    """

    until: float
    seen: Drive
    moved: float


@dataclass(slots=True, kw_only=True)
class Look:
    """A look that has begun, and what was known when it did.

    What it shows depends on that alone, and holds from its instant on: the steps that the stages
    took meanwhile are taken again from there. So the mass after a look is the same to the last bit
    however long the look took, and whether the stages waited for it or not.

    Attributes
    ----------
    drive : all that is kept
    kept_from : what is looked at of it begins there [s]
    until : instant up to which the records are complete [s]
    step : in which they are taken [s]
    mass, std : of the stages [kg]; NaN where there was none
    steps : that were taken meanwhile
    """

    drive: Drive
    kept_from: float
    until: float
    step: float
    mass: float
    std: float
    steps: list[Step] = field(default_factory=list)
    _found: Learned | None = None
    _failure: BaseException | None = None
    _thread: Thread | None = None

    def begin(self, vehicle: Vehicle, *, aside: bool) -> None:
        """Look; with ``aside`` in a thread of its own."""
        if aside:
            self._thread = Thread(target=self._caught, args=(vehicle,), name="look")
            self._thread.start()
        else:
            self._look(vehicle)

    @property
    def goes_on(self) -> bool:
        """Whether it has not ended yet."""
        return self._thread is not None and self._thread.is_alive()

    def end(self) -> None:
        """Wait until it has ended."""
        if self._thread is not None:
            self._thread.join()

    def found(self) -> Learned:
        """Return what it shows; wait until it has ended."""
        self.end()
        if self._failure is not None:
            raise self._failure
        assert self._found is not None
        return self._found

    def tells_more(self, since: float) -> bool:
        """Whether to go on from what was found, and not from the stages.

        Parameters
        ----------
        since : the load was known to be the same from that instant on [s]
        """
        found = self.found()
        far = abs(found.mass - self.mass) > max(
            FAR * math.hypot(self.std, found.std), LEAST_FAR * found.mass
        )
        # Where the records hold all of this load, nothing is known beside them. Without a setup
        # the stages' inertial sensor was left out.
        whole = self.kept_from <= max(since, found.since) or found.setup is None
        return math.isnan(self.mass) or far or whole or found.std <= 1.05 * self.std

    def state(self) -> ForwardState | None:
        """Return the state that was found, after the steps that were taken meanwhile."""
        found = self.found()
        state, setup = found.state, found.setup
        if state is None or setup is None:
            return state
        for step in self.steps:
            state, _ = forward.step(state, step.seen, step.until, setup)
        return state

    def driven_since(self, since: float) -> float:
        """Time on the move from an instant until the last of those steps [s]."""
        driven = time_on_the_move(self.drive, since)
        for step in self.steps:
            driven += step.moved
        return driven

    def _look(self, vehicle: Vehicle) -> None:
        # Slow signals are kept for longer; others would seem to begin late beside them.
        whole = self.kept_from == -math.inf
        kept = self.drive if whole else self.drive.between(self.kept_from, math.inf)
        self._found = learn(kept, vehicle, self.until, self.step)

    def _caught(self, vehicle: Vehicle) -> None:
        try:
            self._look(vehicle)
        # Raised again to who feeds the scale.
        except BaseException as failure:
            self._failure = failure
