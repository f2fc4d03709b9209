"""Devices that are not there: a recorded drive comes out of an adapter, a receiver and a sensor."""

from __future__ import annotations

import datetime as dt
import json
import math
import re
import socket
import socketserver
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import reduce
from operator import xor
from threading import Event, Lock, Thread
from time import monotonic
from typing import Any, Final

import numpy as np

from weighbridge.errors import ConfigError, DriveError, SourceError
from weighbridge.io.obd import CURRENT_DATA, PIDS, bytes_of
from weighbridge.signals import Drive, Floats, scalar_from_si
from weighbridge.signals.catalogue import IMU_SIGNALS

# Held between two samples; anything else goes from one to the next in a straight line.
_STEPS: Final = frozenset(("gear", "gear_ratio"))
_LIST: Final = 0x20
_NEEDED: Final = (
    ("vehicle_speed",),
    ("engine_speed",),
    ("engine_torque_fraction", "engine_load", "mass_air_flow"),
)


class Played:
    """A drive on a clock of its own, which begins when the vehicle is first asked.

    Parameters
    ----------
    drive
    rate : seconds of the drive per second

    Attributes
    ----------
    begun : set once the vehicle was asked
    start, end : of the drive, on its clock [s]
    parameters : of OBD-II that the drive has (SAE J1979, service 01)

    Raises
    ------
    ConfigError
        The rate is not above 0 and finite.
    DriveError
        The drive lacks what a weighing by OBD-II needs.
    """

    def __init__(self, drive: Drive, rate: float = 1.0) -> None:
        if not 0.0 < rate < float("inf"):
            raise ConfigError(f"--rate {rate:g}: give 1 for as recorded, or 5 for fivefold")
        self.drive = drive
        self.start, self.end = drive.start, drive.end
        self.begun = Event()
        self._rate = rate
        self._lock = Lock()
        self._since = 0.0
        self._names = {
            number: [p.name for p in PIDS if p.number == number and drive.has(p.name)]
            for number in sorted({p.number for p in PIDS})
        }
        self.parameters = tuple(n for n, names in self._names.items() if names)
        lacking = [names for names in _NEEDED if not any(drive.has(name) for name in names)]
        if lacking:
            missing = " and no ".join(", ".join(names) for names in lacking)
            raise DriveError(
                f"{drive.name} has no {missing}, which an OBD-II adapter sends; "
                "give a drive that was recorded by OBD-II, or a simulated car"
            )

    def begin(self) -> None:
        """Let the drive begin now, unless it has."""
        with self._lock:
            if not self.begun.is_set():
                self._since = monotonic()
                self.begun.set()

    @property
    def time(self) -> float:
        """Instant of the drive, on its clock [s]; its start before it has begun."""
        if not self.begun.is_set():
            return self.start
        return self.start + self._rate * (monotonic() - self._since)

    @property
    def ended(self) -> bool:
        """Whether it is over."""
        return self.time > self.end

    def answer(self, number: int) -> bytes | None:
        """Bytes of a parameter at this moment; None for one that the vehicle has not."""
        if number % _LIST == 0:
            return self._list(number)
        names = self._names.get(number)
        return bytes_of(number, {n: self._value(n) for n in names}) if names else None

    def _value(self, name: str) -> float:
        signal = self.drive.signals[name]
        time = np.array([min(max(self.time, signal.time[0]), signal.time[-1])])
        return float((signal.held if name in _STEPS else signal.at)(time)[0])

    def _list(self, first: int) -> bytes | None:
        """Which of the next 32 parameters there are; the last bit says whether any are later."""
        if first and not any(number > first for number in self.parameters):
            return None
        bits = sum(
            1 << (_LIST - (number - first))
            for number in self.parameters
            if first < number <= first + _LIST
        )
        return (bits | any(number > first + _LIST for number in self.parameters)).to_bytes(4)


NAME: Final = "ELM327 v1.5"

_UNIT: Final = "7E8"
_PROTOCOL: Final = {"DP": "AUTO, ISO 15765-4 (CAN 11/500)", "DPN": "A6"}
_VOLTAGE: Final = "14.1V"
_SWITCH: Final = re.compile(r"([EHSL])([01])")
# Settings that make no difference here: timing, protocol, memory, lengths, CAN formatting.
_WITHOUT_EFFECT: Final = re.compile(r"(?:AT[012]|ST[0-9A-F]{2}|T?SP.+|D|M[01]|AL|NL|CAF[01]|PC)")
_REQUEST: Final = re.compile(r"[0-9A-F]{2,}")
_CURRENT: Final = 0x01
_MOST_TOGETHER: Final = 6
# Bytes of a frame that carry an answer: alone, in the first of several, and in the next ones.
_SINGLE, _FIRST, _NEXT = 7, 6, 7


class Elm327:
    """One adapter that was just plugged in.

    Parameters
    ----------
    vehicle : whom it asks
    """

    def __init__(self, vehicle: Played) -> None:
        self._vehicle = vehicle
        self._before = ""
        self._reset()

    def say(self, command: str) -> str:
        """Return all that comes back for a command, prompt included.

        Parameters
        ----------
        command : without its carriage return; an empty one is the last once more
        """
        echo = command if self._on["E"] else None
        words = "".join(command.upper().split()) or self._before
        self._before = words
        lines = self._lines(words)
        end = "\r\n" if self._on["L"] else "\r"
        return end.join([*([] if echo is None else [echo]), *lines, "", ">"])

    def _reset(self) -> None:
        self._on = {"E": True, "H": False, "S": True, "L": False}

    def _lines(self, words: str) -> list[str]:
        if words.startswith("AT"):
            return [self._set(words.removeprefix("AT"))]
        if not _REQUEST.fullmatch(words):
            return ["?"]
        # A digit at the end says how many answers to wait for.
        request = bytes.fromhex(words[: len(words) - len(words) % 2])
        if request[0] != _CURRENT:
            return ["NO DATA"]
        self._vehicle.begin()
        answer = bytes([CURRENT_DATA])
        for number in request[1 : 1 + _MOST_TOGETHER]:
            value = None if self._vehicle.ended else self._vehicle.answer(number)
            answer += b"" if value is None else bytes([number]) + value
        return self._shown(answer) if len(answer) > 1 else ["NO DATA"]

    def _set(self, words: str) -> str:
        if words in ("Z", "WS"):
            self._reset()
            return f"\r\r{NAME}"
        if words == "I":
            return NAME
        if words == "RV":
            return _VOLTAGE
        if words in _PROTOCOL:
            return _PROTOCOL[words]
        if found := _SWITCH.fullmatch(words):
            self._on[found[1]] = found[2] == "1"
            return "OK"
        return "OK" if _WITHOUT_EFFECT.fullmatch(words) else "?"

    def _shown(self, answer: bytes) -> list[str]:
        """Lines of an answer, each a CAN frame (ISO 15765-2)."""
        size = len(answer)
        if size <= _SINGLE:
            return [self._line(bytes([size]), answer, "")]
        rest = answer[_FIRST:].ljust(-(-(size - _FIRST) // _NEXT) * _NEXT, b"\xaa")
        parts = [answer[:_FIRST], *(rest[k : k + _NEXT] for k in range(0, len(rest), _NEXT))]
        lines = [self._line(bytes([0x10 | size >> 8, size & 0xFF]), parts[0], "0")]
        for k, part in enumerate(parts[1:], 1):
            lines.append(self._line(bytes([0x20 | k & 0xF]), part, f"{k & 0xF:X}"))
        return lines if self._on["H"] else [f"{size:03X}", *lines]

    def _line(self, control: bytes, data: bytes, part: str) -> str:
        """One frame: with its header, or its data alone and which part of the answer it is."""
        gap = " " if self._on["S"] else ""
        if self._on["H"]:
            return gap.join((_UNIT, *(f"{byte:02X}" for byte in control + data)))
        text = gap.join(f"{byte:02X}" for byte in data)
        return f"{part}:{gap}{text}" if part else text


_HDOP: Final = 1.0

# Digits after the point: 1e-5 m/s^2 and rad/s are far below the noise of a sensor.
_DIGITS: Final = 5


class Sentences:
    """RMC, GGA and, where the drive knows the accuracy, GST of each fix.

    Parameters
    ----------
    drive : with latitude and longitude
    date : wall-clock time of its first sample, in UTC
    """

    def __init__(self, drive: Drive, date: dt.datetime) -> None:
        self._drive = drive
        self._date = date
        self._start = drive.start
        self._stamps = drive.signals["latitude"].time

    def between(self, start: float, end: float) -> bytes:
        """Sentences of the fixes later than ``start`` and not later than ``end`` [s]."""
        first, last = np.searchsorted(self._stamps, [start, end], side="right")
        return b"".join(self._fix(float(stamp)) for stamp in self._stamps[first:last])

    def _fix(self, stamp: float) -> bytes:
        date = self._date + dt.timedelta(seconds=stamp - self._start)
        clock = f"{date:%H%M%S}.{date.microsecond // 1000:03d}"
        place = ",".join(
            (
                _coordinate(self._value("latitude", stamp), 2, "NS"),
                _coordinate(self._value("longitude", stamp), 3, "EW"),
            )
        )
        speed = _number(scalar_from_si(self._value("gnss_speed", stamp), "kn"), 3)
        course = _number(math.degrees(self._value("gnss_course", stamp)) % 360.0, 2)
        altitude = _number(self._value("altitude", stamp), 2)
        dilution = self._value("hdop", stamp)
        dilution = _HDOP if math.isnan(dilution) else dilution
        texts = [
            f"GPRMC,{clock},A,{place},{speed},{course},{date:%d%m%y},,,A",
            f"GPGGA,{clock},{place},1,12,{dilution:.1f},{altitude},M,0.0,M,,",
        ]
        accuracy = self._value("gnss_accuracy", stamp)
        if not math.isnan(accuracy):
            # Of equal parts to the north and to the east.
            part = f"{accuracy / math.sqrt(2.0):.2f}"
            texts.append(f"GPGST,{clock},{accuracy:.2f},{part},{part},0.0,{part},{part},")
        return b"".join(map(_sentence, texts))

    def _value(self, name: str, stamp: float) -> float:
        signal = self._drive.get(name)
        return math.nan if signal is None else float(signal.at(np.array([stamp]))[0])


def _coordinate(angle: float, digits: int, sides: str) -> str:
    """Degrees and minutes, and the side."""
    degrees, minutes = divmod(round(abs(math.degrees(angle)) * 60.0, 6), 60.0)
    return f"{int(degrees):0{digits}d}{minutes:09.6f},{sides[angle < 0.0]}"


def _number(value: float, places: int) -> str:
    return "" if math.isnan(value) else f"{value:.{places}f}"


def _sentence(text: str) -> bytes:
    return f"${text}*{reduce(xor, text.encode('ascii')):02X}\r\n".encode("ascii")


class InertialLines:
    """A line for each sample of the accelerometer, with the gyro's reading at that instant.

    Parameters
    ----------
    drive : with an accelerometer and a gyro
    """

    def __init__(self, drive: Drive) -> None:
        self._stamps = drive.signals[IMU_SIGNALS[0]].time
        columns = [drive.signals[name] for name in IMU_SIGNALS]
        self._rows = np.round(
            np.stack([np.interp(self._stamps, s.time, s.values) for s in columns], axis=1), _DIGITS
        )

    def between(self, start: float, end: float) -> list[bytes]:
        """Lines of the samples later than ``start`` and not later than ``end`` [s]."""
        first, last = np.searchsorted(self._stamps, [start, end], side="right")
        return [_line(self._stamps[k], self._rows[k]) for k in range(first, last)]


def _line(stamp: float, row: Floats) -> bytes:
    said = {"t": round(float(stamp), 6), "accel": row[:3].tolist(), "gyro": row[3:].tolist()}
    return json.dumps(said).encode("ascii") + b"\n"


HOST: Final = "127.0.0.1"
"""The devices are at this computer alone."""

# What is due is sent so often [s].
_TICK: Final = 0.02
_MOST: Final = 4096
# Bytes of lines in one datagram: it passes through every network whole.
_DATAGRAM: Final = 1200

Serve = Callable[[socket.socket], None]


class _Server(socketserver.ThreadingTCPServer):
    allow_reuse_address = True
    daemon_threads = True
    block_on_close = False


@contextmanager
def devices(
    played: Played, *, adapter: int, receiver: int, sensor: int, stop: Event
) -> Iterator[list[str]]:
    """Let a drive come out of devices; yield the sources that read them.

    Parameters
    ----------
    played : what comes out of them
    adapter, receiver : TCP ports of the ELM327 and of the NMEA receiver
    sensor : UDP port that the inertial sensor sends to
    stop : ends them

    Raises
    ------
    SourceError
        A port is in use.
    """
    drive = played.drive
    with ExitStack() as stack:
        stack.callback(stop.set)
        stack.enter_context(_serving(adapter, lambda client: _converse(client, played, stop)))
        sources = [f"elm:tcp:{HOST}:{adapter}"]
        if drive.has("latitude", "longitude"):
            fixes = Sentences(drive, dt.datetime.now(dt.UTC))
            stack.enter_context(
                _serving(receiver, lambda client: _tell(client, fixes, played, stop))
            )
            sources.append(f"nmea:tcp:{HOST}:{receiver}")
        if drive.has(*IMU_SIGNALS):
            thread = Thread(
                target=_send, args=(InertialLines(drive), sensor, played, stop), daemon=True
            )
            thread.start()
            sources.append(f"lines:udp:{sensor}")
        yield sources


@contextmanager
def _serving(port: int, serve: Serve) -> Iterator[None]:
    """Serve each client in a thread."""

    class Handler(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            # A client that hangs up is no matter.
            with suppress(OSError):
                serve(self.request)

    try:
        server: Any = _Server((HOST, port), Handler)
    except OSError as error:
        raise SourceError(
            f"port {port} cannot be used ({error.strerror}); is it in use? Name another"
        ) from error
    thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
    thread.start()
    try:
        yield
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def _converse(client: socket.socket, played: Played, stop: Event) -> None:
    """Answer commands of an adapter, each ended by a carriage return."""
    adapter = Elm327(played)
    client.settimeout(0.1)
    text = ""
    while not stop.is_set():
        try:
            data = client.recv(_MOST)
        except TimeoutError:
            continue
        if not data:
            return
        *commands, text = (text + data.decode("ascii", "replace").replace("\n", "")).split("\r")
        text = text[-_MOST:]
        for command in commands:
            client.sendall(adapter.say(command).encode("ascii", "replace"))


def _tell(client: socket.socket, fixes: Sentences, played: Played, stop: Event) -> None:
    """Send fixes as they become due."""
    for before, time in _ticks(played, stop):
        if data := fixes.between(before, time):
            client.sendall(data)


def _send(lines: InertialLines, port: int, played: Played, stop: Event) -> None:
    """Send lines as they become due, whether anybody hears them or not."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for before, time in _ticks(played, stop):
            data = b""
            for line in lines.between(before, time):
                if len(data) + len(line) > _DATAGRAM:
                    _put(out, data, port)
                    data = b""
                data += line
            _put(out, data, port)


def _put(out: socket.socket, data: bytes, port: int) -> None:
    with suppress(OSError):
        if data:
            out.sendto(data, (HOST, port))


def _ticks(played: Played, stop: Event) -> Iterator[tuple[float, float]]:
    """Two instants of the drive that follow each other, as time goes, once it has begun [s]."""
    while not played.begun.wait(_TICK):
        if stop.is_set():
            return
    before = played.time
    while not stop.wait(_TICK):
        time = played.time
        yield before, time
        before = time
