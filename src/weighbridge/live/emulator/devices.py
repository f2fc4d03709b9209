"""The emulated devices at their ports: adapter and receiver over TCP, sensor by UDP."""

from __future__ import annotations

import datetime as dt
import socket
import socketserver
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from threading import Event, Thread
from typing import Any, Final

from weighbridge.errors import SourceError
from weighbridge.live.emulator.adapter import Elm327
from weighbridge.live.emulator.played import Played
from weighbridge.live.emulator.sent import InertialLines, Sentences
from weighbridge.signals.catalogue import IMU_SIGNALS

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
