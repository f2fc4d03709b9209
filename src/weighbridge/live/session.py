"""One run of a live scale: samples in, weighings out, until the sources end."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from threading import Event
from time import monotonic
from typing import Final

from weighbridge.errors import WeighbridgeError
from weighbridge.live.alerts import Alert
from weighbridge.live.clock import now
from weighbridge.live.feed import Feed, trouble_text
from weighbridge.live.keeper import Keeper
from weighbridge.live.orders import LOAD, ORDERS, TARE
from weighbridge.live.outputs import Outputs
from weighbridge.live.recorder import Recorder
from weighbridge.live.recordings import Recordings
from weighbridge.live.scale import LiveScale
from weighbridge.live.weighing import LiveWeighing
from weighbridge.messages import Problem
from weighbridge.visible import cut, visible

_LOG = logging.getLogger(__name__)

WAIT: Final = 0.1
"""Samples are waited for so long at a time [s]."""

SILENT: Final = 3.0
"""When no sample has come for so long, all sources are silent [s]."""


@dataclass(slots=True)
class Session:
    """Feeds a scale, shows what it shows, and keeps its state.

    Attributes
    ----------
    feed, scale, outputs
    period : between weighings that are shown, on the clock of the samples; when none come, on
        the host's [s]
    keeper : writes checkpoints; None for none
    recorder : records what comes; None for none
    alerts : limits that are watched, by the settled mass
    orders : looked at between samples: what a person asks for, at the terminal or by a file
    ahead : show the provisional mass, which is younger; see `LiveScale.weighing`
    aside : go on showing it while the scale looks at all records, as a vehicle does not wait; what
        is shown at an instant then depends on how fast the machine is
    """

    feed: Feed
    scale: LiveScale
    outputs: Outputs
    period: float = 1.0
    keeper: Keeper | None = None
    recorder: Recorder | Recordings | None = None
    alerts: Sequence[Alert] = ()
    orders: Callable[[LiveScale], None] | None = None
    ahead: bool = True
    aside: bool = False
    _shown: float = field(default=-float("inf"), init=False)
    _looked: float = field(default=-float("inf"), init=False)
    _renewed: int = field(default=0, init=False)
    _heard: tuple[float, float] = field(default=(-float("inf"), 0.0), init=False)
    _settled: float = field(default=-float("inf"), init=False)

    def run(self, stop: Event) -> LiveWeighing:
        """Weigh until the sources end or ``stop`` is set; return the last weighing."""
        self.scale.looks_aside = self.aside
        try:
            while not stop.is_set() and not self.feed.ended:
                for samples in self.feed.read(WAIT):
                    if self.recorder is not None:
                        self.recorder.put(samples)
                    self.scale.update_block(samples)
                    if self.feed.renewed > self._renewed:
                        # A device was turned on again.
                        self._renewed = self.feed.renewed
                        self.scale.renew()
                    self._show()
                    if stop.is_set():
                        break
                if monotonic() - self._looked >= self.period:
                    self._show(due=True)
                if self.orders is not None:
                    self.orders(self.scale)
                if self.keeper is not None:
                    self.keeper.look(self.scale)
                if self.recorder is not None:
                    self.recorder.tick()
        finally:
            try:
                if self.recorder is not None:
                    self.recorder.close()
            finally:
                self.scale.finish()
            if self.keeper is not None:
                self.keeper.write(self.scale)
            self._show(due=True, ahead=False)
        return self.scale.weighing()

    def _show(self, *, due: bool = False, ahead: bool = True) -> None:
        newest = self.scale.newest
        if not due and newest - self._shown < self.period:
            return
        self._shown, self._looked = newest, monotonic()
        silence = self._silence()
        settled = self.scale.weighing(silence)
        if settled.parked and silence and newest != self._settled:
            # Nothing is under way any more that could be late.
            self._settled = newest
            self.scale.finish()
            settled = self.scale.weighing(silence)
        for alert in self.alerts:
            if event := alert.look(settled):
                _LOG.warning("%s", event.text)
        active = [Problem.of("live.alert", alert=a.text) for a in self.alerts if a.active]
        states = tuple(alert.state(settled) for alert in self.alerts)
        lost = [
            Problem.of("live.source", trouble=trouble_text(s.name, s.error))
            for s in self.feed.states()
            if s.error and not s.ended
        ]
        reported = (*active, *lost, *self._doubts())
        ahead = ahead and self.ahead and not settled.parked
        weighing = self.scale.weighing(silence, ahead=True) if ahead else settled
        self.outputs.show(
            replace(weighing, alerts=states, problems=(*reported, *weighing.problems))
        )

    def _silence(self) -> float:
        """Time since any sample came [s]; 0 while some come."""
        newest, then = self._heard
        if self.scale.newest != newest:
            self._heard = self.scale.newest, now()
            return 0.0
        silence = now() - then
        return silence if silence > SILENT else 0.0

    def _doubts(self) -> list[Problem]:
        trouble = "" if self.recorder is None else self.recorder.problem
        return [Problem.of("live.not_recorded", trouble=trouble)] if trouble else []


def order(scale: LiveScale, word: str) -> str:
    """Do what `weighbridge.live.orders.ORDERS` lists; return one sentence."""
    try:
        if word == TARE:
            return f"tare {scale.tare():.0f} kg: the payload counts from here"
        if word == LOAD:
            scale.load_changed()
            return "the load has changed: what was weighed before is forgotten"
    except WeighbridgeError as error:
        return str(error)
    return f"{visible(cut(word))!r} is no order: there are {', '.join(ORDERS)}"
