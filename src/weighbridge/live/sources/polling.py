"""Asks a vehicle for OBD-II values, by whatever carries the requests."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from threading import Event
from time import monotonic
from typing import Final, Protocol

from weighbridge.io.obd import values_of
from weighbridge.live.clock import now
from weighbridge.live.source import Samples
from weighbridge.live.sources.gathered import Gathered
from weighbridge.live.sources.schedule import (
    CHARGING,
    LOW_BATTERY,
    LOW_VOLTAGE,
    PROBE,
    Request,
    Schedule,
    Vigil,
    supported_of,
)

REQUEST_RATE: Final = 50.0
"""Requests that are sent in a second at most [1/s]."""

# The adapter's own voltmeter is asked so often, while polling and at rest [s].
_VOLTAGE_EVERY: Final = 30.0
_VOLTAGE_AT_REST: Final = 5.0
_GLANCE: Final = 0.1
_LAST_LIST: Final = 0xA0
_VOLTAGE_PARAMETER: Final = 0x42


class Carrier(Protocol):
    """Carries requests of service 01 to the vehicle.

    Attributes
    ----------
    together : whether several parameters may be asked at once
    """

    together: bool

    def ask_all(self, parameter: int) -> dict[int, bytes]:
        """Ask every control unit for one parameter.

        Returns
        -------
        The parameter's bytes by control unit; empty where none answered.
        """
        ...

    def ask(self, request: Request) -> dict[int, bytes]:
        """Return the bytes of each parameter that was answered."""
        ...

    def voltage(self) -> float | None:
        """Voltage of the battery without a request to the vehicle [V]; None where unknown."""
        ...


class Pace:
    """Keeps requests apart."""

    def __init__(self) -> None:
        self._next = 0.0

    def wait(self, stop: Event) -> None:
        """Wait until the next request may be sent."""
        left = self._next - monotonic()
        if left > 0.0:
            stop.wait(left)
        self._next = monotonic() + 1.0 / REQUEST_RATE


class Poller:
    """Asks for the values that a weighing needs, and lets a vehicle that is off alone.

    Parameters
    ----------
    carrier : of the requests
    put : takes the samples
    stop : ends it
    say : takes why no samples come, one sentence; empty where they do
    """

    def __init__(
        self,
        carrier: Carrier,
        put: Callable[[Samples], None],
        stop: Event,
        say: Callable[[str], None],
    ) -> None:
        self._carrier = carrier
        self._gathered = Gathered(put)
        self._stop = stop
        self._say = say

    def run(self) -> None:
        """Ask until asked to stop."""
        with self._gathered:
            while not self._stop.is_set():
                volts = self._carrier.voltage()
                if volts is not None and volts < LOW_VOLTAGE:
                    self._say(f"{LOW_BATTERY}; it is looked at again every {PROBE:g} s")
                    self._rest()
                    continue
                supported = self._supported()
                if not supported:
                    self._say(
                        "the vehicle does not answer; is the ignition on? It is asked again every "
                        f"{PROBE:g} s"
                    )
                    self._rest()
                    continue
                schedule = Schedule(supported, together=self._carrier.together)
                if schedule.empty:
                    self._say(
                        "the vehicle has none of the OBD-II parameters that a weighing can use"
                    )
                    self._rest()
                    continue
                self._say("")
                self._ask_until_silent(schedule)

    def _supported(self) -> dict[int, set[int]]:
        """Ask each control unit which parameters it has."""
        first = self._carrier.ask_all(0x00)
        found = {unit: supported_of(0x00, raw) for unit, raw in first.items()}
        for unit, has in found.items():
            for number in range(0x20, _LAST_LIST + 1, 0x20):
                if number not in has or self._stop.is_set():
                    break
                answer = self._carrier.ask(Request(unit, (number,)))
                if number not in answer:
                    break
                has |= supported_of(number, answer[number])
        return {unit: has for unit, has in found.items() if has}

    def _ask_until_silent(self, schedule: Schedule) -> None:
        """Ask in turn; return where the vehicle answers nothing any more."""
        vigil = Vigil(monotonic())
        measured = monotonic()
        while not self._stop.is_set():
            time = monotonic()
            if time - measured > _VOLTAGE_EVERY:
                measured = time
                self._measure(vigil)
            if why := vigil.why_asleep(time):
                self._gathered.flush()
                self._say(f"{why}; it is asked again every {PROBE:g} s")
                silent = vigil.silent
                self._rest()
                if silent or self._stop.is_set():
                    return
                vigil.rested(monotonic())
                self._look(schedule, vigil)
                if not vigil.why_asleep(monotonic()):
                    self._say("")
                continue
            request = schedule.next(time)
            if request is None:
                self._gathered.flush()
                self._stop.wait(_GLANCE)
                continue
            schedule.note(request, self._asked(request, vigil))

    def _asked(self, request: Request, vigil: Vigil) -> Mapping[int, bytes]:
        answer = self._carrier.ask(request)
        values: dict[str, float] = {}
        for number, raw in answer.items():
            values |= values_of(number, raw)
        if values:
            self._gathered.add(now(), values)
        vigil.note(monotonic(), values, answered=bool(answer))
        return answer

    def _look(self, schedule: Schedule, vigil: Vigil) -> None:
        """Ask a vehicle at rest one request."""
        self._measure(vigil)
        parameters: Sequence[int] = (_VOLTAGE_PARAMETER,) if vigil.low else ()
        fast = schedule.fast[0]
        self._asked(Request(fast.unit, tuple(parameters) or fast.parameters), vigil)

    def _measure(self, vigil: Vigil) -> None:
        volts = self._carrier.voltage()
        if volts is not None:
            vigil.voltage(monotonic(), volts)

    def _rest(self) -> None:
        """Send nothing for a while; less where the battery is charged, so that the engine runs."""
        until = monotonic() + PROBE
        measured = monotonic()
        before = self._carrier.voltage()
        while monotonic() < until and not self._stop.wait(_GLANCE):
            if before is None or monotonic() - measured < _VOLTAGE_AT_REST:
                continue
            measured = monotonic()
            volts = self._carrier.voltage()
            if volts is not None and volts > CHARGING > before:
                return
            before = volts if volts is not None else before
