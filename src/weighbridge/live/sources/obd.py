"""OBD-II over a CAN interface: a small requester of service 01.

Nothing else is ever sent: no flow control either, since only parameters whose answer fits into
one frame are asked for together.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import Event
from time import monotonic
from typing import Any, Final

from weighbridge.errors import MissingExtraError, SourceError
from weighbridge.io.obd import parameters_of
from weighbridge.live.source import Samples
from weighbridge.live.sources.canbus import BusPlace, receive
from weighbridge.live.sources.kind import SourceOptions
from weighbridge.live.sources.lock import DeviceLock
from weighbridge.live.sources.polling import Pace, Poller
from weighbridge.live.sources.schedule import PROBE, Request

SERVICE: Final = 0x01

# A control unit answers within 50 ms (ISO 15765-4, P2); a gateway may take as long again [s].
_ANSWER: Final = 0.15
_ANSWERS_OF_ALL: Final = 0.25

_ALL_11, _ALL_29 = 0x7DF, 0x18DB33F1
_FIRST_11, _LAST_11 = 0x7E0, 0x7E7
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
    probe : a vehicle at rest is asked one request in so long at most [s]
    """

    def __init__(self, bus: BusPlace, probe: float = PROBE) -> None:
        self.name = bus.source
        self.trouble = ""
        self._bus = bus
        self._probe = probe

    def run(self, put: Callable[[Samples], None], stop: Event) -> None:
        """Ask until asked to stop; see `weighbridge.live.source.Source.run`."""
        self.trouble = ""
        with DeviceLock(self.name):
            bus = self._bus.open(_ANSWERS)
            try:
                carrier = CanCarrier(bus, self._bus, stop)
                Poller(carrier, put, stop, self._say, self._probe).run()
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
    """Requests and answers as ISO-TP messages; see `weighbridge.live.sources.polling.Carrier`.

    Parameters
    ----------
    bus : of python-can
    place : the bus, for messages
    stop : ends waiting

    Raises
    ------
    MissingExtraError
        can-isotp is not installed.
    """

    together = True

    def __init__(self, bus: Any, place: BusPlace, stop: Event) -> None:
        try:
            import isotp
        except ImportError:
            raise MissingExtraError("can-isotp", "live", f"source {place.source}") from None
        self._isotp = isotp
        self._bus = bus
        self._place = place
        self._stop = stop
        self._pace = Pace()
        self._extended = False
        self._given = False
        self._layers: dict[int, Any] = {}

    def ask_all(self, parameter: int) -> dict[int, bytes]:
        """Ask every control unit, with identifiers of 11 bits, or 29 where none answers."""
        for _ in range(2):
            found = self._ask_all(parameter)
            if found or self._stop.is_set():
                return found
            self._extended = not self._extended
        return {}

    def _ask_all(self, parameter: int) -> dict[int, bytes]:
        self._forget()
        everyone = _ALL_29 if self._extended else _ALL_11
        self._send(everyone, self._extended, bytes([2, SERVICE, parameter, *bytes(5)]))
        found: dict[int, bytes] = {}
        until = monotonic() + _ANSWERS_OF_ALL
        while (left := until - monotonic()) > 0.0:
            message = receive(self._bus, self._place, left)
            if message is None or message.is_extended_id != self._extended:
                continue
            size = message.data[0] if len(message.data) else 0
            answer = parameters_of(bytes(message.data[1 : 1 + size])) if size < 8 else {}
            if parameter in answer:
                found.setdefault(message.arbitration_id, answer[parameter])
        return found

    def ask(self, request: Request) -> dict[int, bytes]:
        """Return the bytes of each parameter that was answered."""
        layer = self._layer(request.unit)
        layer.reset()
        layer.send(bytes([SERVICE, *request.parameters]))
        until = monotonic() + _ANSWER
        while (left := until - monotonic()) > 0.0 and not self._stop.is_set():
            self._given = False
            layer.process(rx_timeout=left)
            while (answer := layer.recv()) is not None:
                if answer[0] == _REFUSED and answer[1:2] == bytes([SERVICE]):
                    return {}
                found = parameters_of(bytes(answer))
                # What answers an earlier request came too late.
                if any(number in found for number in request.parameters):
                    return found
        return {}

    def voltage(self) -> None:
        """Nothing but the vehicle knows it."""

    def _layer(self, unit: int) -> Any:
        """ISO-TP to one control unit, by the identifier it answers with."""
        if unit not in self._layers:
            isotp = self._isotp
            if unit > 0x7FF:
                to = _TO_29 | (unit & 0xFF) << 8
                mode = isotp.AddressingMode.Normal_29bits
            else:
                to, mode = unit - 8, isotp.AddressingMode.Normal_11bits
            self._layers[unit] = isotp.TransportLayerLogic(
                rxfn=self._receive,
                txfn=self._transmit,
                address=isotp.Address(mode, txid=to, rxid=unit),
                error_handler=_disregard,
                params={"tx_padding": 0, "tx_data_min_length": 8, "blocking_send": False},
            )
        return self._layers[unit]

    def _receive(self, timeout: float) -> Any:
        # The library asks on until nothing comes: one frame at a time, so that it does not wait.
        message = None if self._given else receive(self._bus, self._place, timeout)
        if message is None:
            return None
        self._given = True
        return self._isotp.CanMessage(
            arbitration_id=message.arbitration_id,
            data=bytes(message.data),
            extended_id=message.is_extended_id,
        )

    def _transmit(self, message: Any) -> None:
        data = bytes(message.data)
        # ISO-TP would send a flow control where a control unit begins a long message.
        if is_request(message.arbitration_id, message.is_extended_id, data):
            self._send(message.arbitration_id, message.is_extended_id, data)

    def _send(self, identifier: int, extended: bool, data: bytes) -> None:
        """Send one request, not sooner than the pace allows."""
        import can

        if not is_request(identifier, extended, data):
            raise AssertionError(f"{identifier:X} {data.hex()} is no request of service 01")
        self._pace.wait(self._stop)
        if self._stop.is_set():
            return
        try:
            self._bus.send(
                can.Message(arbitration_id=identifier, is_extended_id=extended, data=data), 0.1
            )
        # Each interface has errors of its own kind.
        except Exception as error:
            raise SourceError(
                f"{self._place.source} cannot send ({error}); is the adapter plugged in, and the "
                "ignition on?"
            ) from error

    def _forget(self) -> None:
        """Drop what came before it was asked for."""
        while receive(self._bus, self._place, 0.0) is not None:
            pass


def _disregard(error: Exception) -> None:
    """An answer that is no whole message counts as none."""
