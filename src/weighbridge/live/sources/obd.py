"""OBD-II over a CAN interface: a small requester of service 01.

Nothing else is ever sent: no flow control either, since only parameters whose answer fits into
one frame are asked for together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from threading import Event
from time import monotonic
from typing import Any, Final

from weighbridge.errors import SourceError
from weighbridge.io.obd import parameters_of
from weighbridge.live.source import Samples
from weighbridge.live.sources.canbus import BusPlace, receive
from weighbridge.live.sources.kind import SourceOptions
from weighbridge.live.sources.lock import device_lock
from weighbridge.live.sources.polling import Pace, Poller
from weighbridge.live.sources.schedule import Request

SERVICE: Final = 0x01

# A control unit answers within 50 ms (ISO 15765-4, P2); a gateway may take as long again [s].
_ANSWER: Final = 0.15
_ANSWERS_OF_ALL: Final = 0.25

_ALL_11, _ALL_29 = 0x7DF, 0x18DB33F1
_FIRST_11, _LAST_11, _LONGEST_11 = 0x7E0, 0x7E7, 0x7FF
_TO_29, _FROM_29 = 0x18DA00F1, 0x18DAF100
_ANSWERS: Final = [(0x7E8, 0x7F8, False), (_FROM_29, 0x1FFFFF00, True)]
_REFUSED: Final = 0x7F


def make_obd(text: str, options: SourceOptions) -> ObdSource:
    """Make a source that asks; see `weighbridge.live.sources.kind.SourceKind`.

    Raises
    ------
    ConfigError
        The place cannot be used.
    """
    return ObdSource(BusPlace.of(f"obd:{text}", listen_only=False))


class ObdSource:
    """Asks a car over CAN.

    Parameters
    ----------
    bus : where it is
    """

    def __init__(self, bus: BusPlace) -> None:
        self.name = bus.source
        self.trouble = ""
        self._bus = bus

    def run(self, put: Callable[[Samples], None], stop: Event) -> None:
        """Ask until asked to stop; see `weighbridge.live.source.Source.run`."""
        self.trouble = ""
        with device_lock(self.name):
            bus = self._bus.open(_ANSWERS)
            try:
                carrier = CanCarrier(bus, self._bus, stop)
                Poller(carrier, put, stop, self._say).run()
            finally:
                self.trouble = ""
                bus.shutdown()

    def _say(self, trouble: str) -> None:
        self.trouble = trouble


def is_request(identifier: int, extended: bool, data: bytes) -> bool:
    """Say whether a frame is a request of service 01: the only kind that is ever sent."""
    if extended:
        known = identifier == _ALL_29 or (identifier & 0x1FFF00FF) == _TO_29
    else:
        known = identifier == _ALL_11 or _FIRST_11 <= identifier <= _LAST_11
    # A single frame: its length, the service, one to six parameters.
    return known and len(data) == 8 and 2 <= data[0] <= 7 and data[1] == SERVICE


class CanCarrier:
    """Requests and answers of one frame; see `weighbridge.live.sources.polling.Carrier`.

    Parameters
    ----------
    bus : of python-can
    place : the bus, for messages
    stop : ends waiting
    """

    together = True

    def __init__(self, bus: Any, place: BusPlace, stop: Event) -> None:
        self._bus = bus
        self._place = place
        self._stop = stop
        self._pace = Pace()
        self._extended = False

    def ask_all(self, parameter: int) -> dict[int, bytes]:
        """Ask every control unit, with identifiers of 11 bits, or 29 where none answers."""
        for _ in range(2):
            # What came before it was asked for is dropped.
            while receive(self._bus, self._place, 0.0) is not None:
                pass
            found: dict[int, bytes] = {}
            everyone = _ALL_29 if self._extended else _ALL_11
            for unit, answer in self._answers(everyone, (parameter,), _ANSWERS_OF_ALL):
                if parameter in (values := parameters_of(answer)):
                    found.setdefault(unit, values[parameter])
            if found or self._stop.is_set():
                return found
            self._extended = not self._extended
        return {}

    def ask(self, request: Request) -> dict[int, bytes]:
        """Return the bytes of each parameter that was answered."""
        unit = request.unit
        to = _TO_29 | (unit & 0xFF) << 8 if unit > _LONGEST_11 else unit - 8
        for sender, answer in self._answers(to, request.parameters, _ANSWER):
            if sender != unit:
                continue
            if answer[:2] == bytes([_REFUSED, SERVICE]):
                return {}
            found = parameters_of(answer)
            # What answers an earlier request came too late.
            if any(number in found for number in request.parameters):
                return found
        return {}

    def voltage(self) -> None:
        """Nothing but the vehicle knows it."""

    def _answers(
        self, to: int, parameters: Sequence[int], seconds: float
    ) -> Iterator[tuple[int, bytes]]:
        """Send one request, not sooner than the pace allows; yield who answers, and what.

        An answer of several frames counts as none (ISO 15765-2): it would need a flow control.
        """
        import can

        extended = to > _LONGEST_11
        data = bytes([1 + len(parameters), SERVICE, *parameters]).ljust(8, b"\0")
        if not is_request(to, extended, data):
            raise AssertionError(f"{to:X} {data.hex()} is no request of service 01")
        self._pace.wait(self._stop)
        if self._stop.is_set():
            return
        try:
            self._bus.send(can.Message(arbitration_id=to, is_extended_id=extended, data=data), 0.1)
        # Each interface has errors of its own kind.
        except Exception as error:
            raise SourceError(
                f"{self._place.source} cannot send ({error}); is the adapter plugged in, and the "
                "ignition on?"
            ) from error
        until = monotonic() + seconds
        while (left := until - monotonic()) > 0.0 and not self._stop.is_set():
            message = receive(self._bus, self._place, left)
            if message is not None and message.is_extended_id == extended and message.data:
                size = message.data[0]
                if size < 8:
                    yield message.arbitration_id, bytes(message.data[1 : 1 + size])
