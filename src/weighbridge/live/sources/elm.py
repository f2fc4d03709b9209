"""OBD-II by an ELM327-type adapter on a serial line, TCP or Bluetooth Low Energy."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from threading import Event
from time import monotonic
from typing import Final

import numpy as np

from weighbridge.errors import ConfigError, SourceError
from weighbridge.io import join_messages
from weighbridge.io.frames import Frames
from weighbridge.io.obd import parameters_of
from weighbridge.live.source import Samples
from weighbridge.live.sources.gathered import SLICE
from weighbridge.live.sources.kind import SourceOptions, parted_rate
from weighbridge.live.sources.links import BleLink, Link, SerialLink, tcp
from weighbridge.live.sources.lock import device_lock
from weighbridge.live.sources.polling import Pace, Poller
from weighbridge.live.sources.schedule import Request

TROUBLES: Final = (
    "NO DATA", "UNABLE TO CONNECT", "STOPPED", "BUS ERROR", "CAN ERROR", "BUS BUSY", "DATA ERROR",
    "BUFFER FULL", "FB ERROR", "RX ERROR", "LV RESET", "LP ALERT", "ACT ALERT", "ERROR", "ERR", "?",
)  # fmt: skip
"""Words that say why there is no answer (ELM327 data sheet, error messages)."""

RESTARTED: Final = ("LV RESET", "ELM327")
"""Words of an adapter that has begun anew and forgotten how it was set up."""

_BEFORE_DATA: Final = re.compile(r"^(?:SEARCHING\.*|BUS INIT:?[ .]*(?:OK)?)\s*")
_HEX: Final = re.compile(r"^[0-9A-F]+$")
_PART: Final = re.compile(r"^([0-9A-F]):([0-9A-F]+)$")
_VOLTS: Final = re.compile(r"\b(\d{1,2}\.\d{1,2})\s*V", re.IGNORECASE)

_CURRENT_DATA: Final = "41"
# Adapters whose voltmeter is not connected say 0.0 V.
_LEAST_VOLTAGE: Final = 6.0


@dataclass(slots=True)
class Reply:
    """What came before one prompt.

    Attributes
    ----------
    answers : payloads by control unit: its identifier or address, 0 where headers are off
    trouble : the adapter's word for why there is none; empty where there is
    restarted : whether the adapter has begun anew
    """

    answers: dict[int, list[bytes]] = field(default_factory=dict)
    trouble: str = ""
    restarted: bool = False


def read_reply(text: str, command: str) -> Reply:
    """Take a reply apart.

    Parameters
    ----------
    text : up to the prompt
    command : what was sent, which may be echoed
    """
    reply = Reply()
    frames: list[tuple[int, bool, bytes]] = []
    parts: dict[int, str] = {}
    size = 0
    for raw in re.split(r"[\r\n>]+", text.replace("\0", "").upper()):
        line = _BEFORE_DATA.sub("", raw.strip())
        digits = line.replace(" ", "")
        if not digits or digits == command.replace(" ", "").upper():
            continue
        if any(word in line for word in RESTARTED):
            reply.restarted = True
        elif found := _PART.match(digits):
            parts[len(parts)] = found[2]
        elif not _HEX.match(digits):
            trouble = next((word for word in TROUBLES if word in line), "")
            reply.trouble = reply.trouble or trouble
        elif len(digits) == 3:
            size = int(digits, 16)
        else:
            _take(digits, frames, reply.answers)
    _add_parts(parts, size, reply)
    _add_frames(frames, reply)
    if reply.answers:
        reply.trouble = ""
    return reply


def _take(
    digits: str, frames: list[tuple[int, bool, bytes]], answers: dict[int, list[bytes]]
) -> None:
    """Take one line of hexadecimal digits for what it looks like, if it is anything."""
    if len(digits) % 2 == 1:
        # Only an identifier of 11 bits has three digits.
        if re.match(r"7E[89A-F]", digits):
            frames.append((int(digits[:3], 16), False, bytes.fromhex(digits[3:])))
        return
    data = bytes.fromhex(digits)
    if digits.startswith("18DAF1") and len(data) > 4:
        frames.append((int(digits[:8], 16), True, data[4:]))
    elif digits.startswith(_CURRENT_DATA):
        answers.setdefault(0, []).append(data)
    elif len(data) > 5 and data[3] == int(_CURRENT_DATA, 16) and _sound(data):
        answers.setdefault(data[2], []).append(data[3:-1])


def _sound(data: bytes) -> bool:
    """Whether the last byte checks the others: a sum (ISO 9141, ISO 14230) or SAE J1850's CRC."""
    if sum(data[:-1]) & 0xFF == data[-1]:
        return True
    crc = 0xFF
    for byte in data[:-1]:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x1D if crc & 0x80 else 0)) & 0xFF
    return crc ^ 0xFF == data[-1]


def _add_parts(parts: dict[int, str], size: int, reply: Reply) -> None:
    """Add a long answer without headers: its length, then numbered parts."""
    data = bytes.fromhex("".join(p if len(p) % 2 == 0 else "" for p in parts.values()))
    if size and len(data) >= size:
        reply.answers.setdefault(0, []).append(data[:size])


def _add_frames(frames: Sequence[tuple[int, bool, bytes]], reply: Reply) -> None:
    """Add answers that come as CAN frames, several of them for a long one."""
    for sender in dict.fromkeys(sender for sender, _, _ in frames):
        mine = [(extended, data[:8]) for s, extended, data in frames if s == sender]
        # Nearly every answer is one frame: to join it as those of a log takes the most time of all.
        alone = [_alone(data) for _, data in mine]
        whole = _joined(sender, mine) if None in alone else [data for data in alone if data]
        if whole:
            reply.answers.setdefault(sender, []).extend(whole)


def _alone(data: bytes) -> bytes | None:
    """Payload of a single frame, empty where it is shorter than it says; None of any other."""
    if not data or data[0] >> 4:
        return None
    size = data[0] & 0x0F
    return data[1 : 1 + size] if size < len(data) else b""


def _joined(sender: int, frames: Sequence[tuple[bool, bytes]]) -> list[bytes]:
    """Payloads of all messages of one sender."""
    table = np.zeros((len(frames), 8), np.uint8)
    for row, (_, data) in zip(table, frames, strict=True):
        row[: len(data)] = np.frombuffer(data, np.uint8)
    messages = join_messages(
        Frames(
            1e-3 * np.arange(len(frames), dtype=np.float64),
            np.zeros(len(frames), np.int16),
            np.full(len(frames), sender, np.uint32),
            np.array([extended for extended, _ in frames]),
            np.array([len(data) for _, data in frames], np.uint8),
            table,
        )
    )
    lengths = messages.length.tolist()
    return [row[:size].tobytes() for row, size in zip(messages.data, lengths, strict=True)]


def read_voltage(text: str) -> float | None:
    """Voltage that an adapter says [V]; None where it says none, or one that no vehicle has."""
    found = _VOLTS.search(text)
    volts = float(found[1]) if found else 0.0
    return volts if volts > _LEAST_VOLTAGE else None


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
        with device_lock(self.name):
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
