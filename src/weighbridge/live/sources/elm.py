"""OBD-II by an ELM327-type adapter on a serial line, TCP or Bluetooth Low Energy."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event
from time import monotonic
from typing import Final

from weighbridge.errors import ConfigError, SourceError
from weighbridge.io.obd import parameters_of
from weighbridge.live.source import Samples
from weighbridge.live.sources.elm_text import Reply, read_reply, read_voltage
from weighbridge.live.sources.gathered import SLICE
from weighbridge.live.sources.kind import SourceOptions, parted_rate
from weighbridge.live.sources.links import BleLink, Link, SerialLink, tcp
from weighbridge.live.sources.lock import DeviceLock
from weighbridge.live.sources.polling import Pace, Poller
from weighbridge.live.sources.schedule import Request

BAUDS: Final = (38400, 115200, 9600)
"""Rates of the serial line that adapters leave the works with, the commonest first [bit/s]."""

SETUP: Final = ("ATE0", "ATL0", "ATS0", "ATH1", "ATAT1", "ATSP0")
"""No echo, no line feeds, no spaces, headers, adaptive timing, any protocol."""

# The adapter finds the vehicle's protocol by trying all.
_SEARCH: Final = 12.0
_RESET: Final = 2.5
_COMMAND: Final = 1.5
# Replies in a row that are damaged, until the adapter is set up anew, and until it is lost.
_ANEW: Final = 5
_LOST: Final = 10
_MOST_TEXT: Final = 16_384
_CAN: Final = frozenset("6789")


def make_elm(text: str, options: SourceOptions) -> ElmSource:
    """Make a source of an adapter; see `weighbridge.live.sources.kind.SourceKind`.

    Raises
    ------
    ConfigError
        The place cannot be used.
    """
    name = f"elm:{text}"
    kind, _, rest = text.partition(":")
    if kind == "tcp":
        return ElmSource(name, (tcp(name, rest, "elm:tcp:192.168.0.10:35000"),))
    if kind == "ble":
        if not rest:
            raise ConfigError(f"source {name!r} names no address; write elm:ble:AA:BB:CC:DD:EE:FF")
        return ElmSource(name, (lambda: BleLink(rest),))
    path, baud = parted_rate(text, "baud rate")
    bauds = BAUDS if baud is None else (baud,)
    return ElmSource(name, tuple(_serial(path, rate) for rate in bauds))


def _serial(path: str, baud: int) -> Callable[[], Link]:
    return lambda: SerialLink(path, baud)


class ElmSource:
    """Asks a car by an adapter.

    Parameters
    ----------
    name : as on the command line
    links : ways to the adapter, tried in turn until it answers
    """

    def __init__(self, name: str, links: tuple[Callable[[], Link], ...]) -> None:
        self.name = name
        self.trouble = ""
        self._links = links

    def run(self, put: Callable[[Samples], None], stop: Event) -> None:
        """Ask until asked to stop; see `weighbridge.live.source.Source.run`."""
        self.trouble = ""
        with DeviceLock(self.name):
            try:
                carrier = self._found(stop)
                if carrier is None:
                    return
                try:
                    Poller(carrier, put, stop, self._say).run()
                finally:
                    carrier.close()
            except _Stopped:
                return
            finally:
                self.trouble = ""

    def _found(self, stop: Event) -> ElmCarrier | None:
        """Set the adapter up, by the first way it answers on."""
        for way in self._links:
            link = way()
            carrier = ElmCarrier(self.name, link, stop)
            try:
                if carrier.set_up():
                    return carrier
            except BaseException:
                link.close()
                raise
            link.close()
            if stop.is_set():
                return None
        raise SourceError(
            f"{self.name}: no ELM327 adapter answers there; is it plugged in, paired and at the "
            "right baud rate?"
        )

    def _say(self, trouble: str) -> None:
        self.trouble = trouble


class _Stopped(Exception):
    """The source was asked to stop while it waited for the adapter."""


class ElmCarrier:
    """Requests by an adapter; see `weighbridge.live.sources.polling.Carrier`.

    Parameters
    ----------
    name : of the source, for messages
    link : to the adapter
    stop : ends waiting
    """

    def __init__(self, name: str, link: Link, stop: Event) -> None:
        self.together = False
        self._name = name
        self._link = link
        self._stop = stop
        self._pace = Pace()
        self._counted = False
        self._damaged = 0

    def close(self) -> None:
        """Let the adapter go."""
        self._link.close()

    def set_up(self) -> bool:
        """Bring the adapter into a known state; False where nothing answers."""
        self._counted = self.together = False
        if self._command("ATZ", _RESET) is None and self._command("ATZ", _RESET) is None:
            return False
        return all(self._command(command, _COMMAND) is not None for command in SETUP)

    def ask_all(self, parameter: int) -> dict[int, bytes]:
        """Ask every control unit; the first time the adapter looks for the protocol."""
        reply = self._request((parameter,), _SEARCH)
        found: dict[int, bytes] = {}
        for unit, payloads in reply.answers.items():
            for payload in payloads:
                if parameter in (values := parameters_of(payload)):
                    found.setdefault(unit, values[parameter])
        if found:
            said = (self._command("ATDPN", _COMMAND) or "").split()
            # A protocol found by itself has an A before its number.
            self.together = bool(said) and said[-1][-1:] in _CAN
            # One control unit: the adapter need not wait for another, if it knows their number.
            self._counted = len(found) == 1
        return found

    def ask(self, request: Request) -> dict[int, bytes]:
        """Return the bytes of each parameter that was answered."""
        reply = self._request(request.parameters, _COMMAND)
        found: dict[int, bytes] = {}
        for payload in reply.answers.get(request.unit, []):
            found |= parameters_of(payload)
        return {n: raw for n, raw in found.items() if n in request.parameters}

    def voltage(self) -> float | None:
        """Voltage at the adapter's plug, which no request to the vehicle is needed for [V]."""
        return read_voltage(self._command("ATRV", _COMMAND) or "")

    def _request(self, parameters: tuple[int, ...], timeout: float) -> Reply:
        """Send one request of service 01; ask again where the adapter broke it off."""
        request = "01" + "".join(f"{number:02X}" for number in parameters)
        for _ in range(2):
            self._pace.wait(self._stop)
            command = request + "1" * self._counted
            text = self._command(command, timeout)
            if text is None:
                self._note(damaged=True)
                return Reply()
            reply = read_reply(text, command)
            if reply.restarted:
                self.set_up()
                return reply
            if self._counted and reply.trouble == "?":
                # An adapter that knows no count of answers; ask without.
                self._counted = False
                continue
            if reply.trouble != "STOPPED":
                break
        self._note(
            damaged=not reply.answers and reply.trouble not in ("NO DATA", "UNABLE TO CONNECT")
        )
        return reply

    def _note(self, *, damaged: bool) -> None:
        """Set the adapter up anew where it says nothing of use; give it up where that is no help.

        Raises
        ------
        SourceError
            It is given up.
        """
        self._damaged = self._damaged + 1 if damaged else 0
        if self._damaged == _ANEW:
            self.set_up()
        elif self._damaged >= _LOST:
            self._damaged = 0
            raise SourceError(f"{self._name}: the adapter sends nothing of use; plug it in anew")

    def _command(self, command: str, timeout: float) -> str | None:
        """Send a command; return what comes before the prompt, None where no prompt comes."""
        self._drain()
        self._link.write(command.encode("ascii") + b"\r")
        said = bytearray()
        until = monotonic() + timeout
        while (left := until - monotonic()) > 0.0:
            if self._stop.is_set():
                raise _Stopped
            said += self._link.read(min(left, SLICE))
            if b">" in said:
                return said.partition(b">")[0].decode("ascii", "replace")
            del said[:-_MOST_TEXT]
        # Any character breaks off what the adapter does; the next command finds it waiting.
        self._link.write(b"\r")
        self._link.read(SLICE)
        return None

    def _drain(self) -> None:
        """Drop what came unasked."""
        while self._link.read(0.0):
            pass
