"""Byte streams to adapters and receivers: serial line, TCP, Bluetooth Low Energy."""

from __future__ import annotations

import asyncio
import queue
import socket
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from threading import Thread
from time import monotonic
from typing import Any, Final, Protocol

from weighbridge.errors import ConfigError, MissingExtraError, SourceError
from weighbridge.live.sources.kind import checked_port, parted_rate

_MOST: Final = 4096
_CONNECTING: Final = 5.0
# A port is asked for bytes so often [s].
_SERIAL_WAIT: Final = 0.05

# Services of Bluetooth adapters that carry a serial line, with characteristics to hear and say:
# those of the makers' modules; none is a standard.
_BLE_SERVICES: Final = ("fff0", "ffe0", "18f0", "beef")


class Link(Protocol):
    """Bytes in and out. All three raise SourceError where the other end is gone."""

    def read(self, timeout: float) -> bytes:
        """Return bytes as soon as some are there; none after ``timeout`` [s]."""
        ...

    def write(self, data: bytes) -> None:
        """Send bytes."""
        ...

    def close(self) -> None:
        """End it; never raises."""
        ...


class SerialLink:
    """A serial port, of this process alone.

    Parameters
    ----------
    path : device file or name of the port
    baud : [bit/s]

    Raises
    ------
    SourceError
        It is not there, not permitted or in use.
    MissingExtraError
        serialx is not installed.
    """

    def __init__(self, path: str, baud: int) -> None:
        try:
            import serialx
        except ImportError:
            raise MissingExtraError("serialx", "live", f"serial port {path}") from None
        self._path = path
        try:
            self._port: Any = serialx.serial_for_url(
                path, baudrate=baud, read_timeout=_SERIAL_WAIT, write_timeout=1.0, exclusive=True
            )
            self._port.open()
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise SourceError(
                f"serial port {path} cannot be opened ({why}); is the device plugged in, free and "
                "permitted to this user?"
            ) from error

    def read(self, timeout: float) -> bytes:
        """Return bytes as soon as some are there; none after ``timeout`` [s]."""
        until = monotonic() + timeout
        try:
            if timeout <= 0.0 and not self._port.num_unread_bytes():
                return b""
            while not (data := self._port.read(_MOST)) and monotonic() < until:
                pass
        except (OSError, ValueError) as error:
            raise self._gone(error) from error
        return bytes(data or b"")

    def write(self, data: bytes) -> None:
        """Send bytes."""
        try:
            self._port.write(data)
        except (OSError, ValueError) as error:
            raise self._gone(error) from error

    def close(self) -> None:
        """End it; never raises."""
        with suppress(OSError, ValueError):
            self._port.close()

    def _gone(self, error: Exception) -> SourceError:
        return SourceError(f"serial port {self._path} is gone ({error}); plug the device in again")


def _why(error: OSError) -> str:
    """What the system says, without its number."""
    return error.strerror or str(error)


class TcpLink:
    """A TCP connection.

    Parameters
    ----------
    host, port : of the other end

    Raises
    ------
    SourceError
        Nobody answers there.
    """

    def __init__(self, host: str, port: int) -> None:
        self._place = f"{host}:{port}"
        try:
            self._socket = socket.create_connection((host, port), _CONNECTING)
        except OSError as error:
            raise SourceError(
                f"{self._place} cannot be reached ({_why(error)}); is the device on, and this "
                "host in its network?"
            ) from error

    def read(self, timeout: float) -> bytes:
        """Return bytes as soon as some are there; none after ``timeout`` [s]."""
        try:
            self._socket.settimeout(timeout)
            data = self._socket.recv(_MOST)
        except (TimeoutError, BlockingIOError):
            return b""
        except OSError as error:
            raise SourceError(f"{self._place} is gone ({_why(error)})") from error
        if not data:
            raise SourceError(f"{self._place} closed the connection")
        return data

    def write(self, data: bytes) -> None:
        """Send bytes."""
        try:
            self._socket.settimeout(1.0)
            self._socket.sendall(data)
        except OSError as error:
            raise SourceError(f"{self._place} is gone ({_why(error)})") from error

    def close(self) -> None:
        """End it; never raises."""
        with suppress(OSError):
            self._socket.close()


class BleLink:
    """A Bluetooth Low Energy adapter that carries a serial line.

    Parameters
    ----------
    address : of the adapter

    Raises
    ------
    SourceError
        It is not there, or carries no serial line.
    MissingExtraError
        bleak is not installed.
    """

    def __init__(self, address: str) -> None:
        try:
            import bleak
        except ImportError:
            raise MissingExtraError("bleak", "ble", f"Bluetooth adapter {address}") from None
        self._address = address
        self._heard: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._gone = False
        self._loop = asyncio.new_event_loop()
        self._thread = Thread(target=self._loop.run_forever, name=address, daemon=True)
        self._thread.start()
        self._client: Any = bleak.BleakClient(
            address, disconnected_callback=self._left, timeout=_CONNECTING
        )
        try:
            self._listen, self._say = self._wait(self._connected(), 2.0 * _CONNECTING)
        except SourceError:
            self.close()
            raise

    async def _connected(self) -> tuple[Any, Any]:
        """Connect, and find what to listen to and what to write to."""
        await self._client.connect()
        for service in self._client.services:
            if str(service.uuid)[4:8].lower() not in _BLE_SERVICES:
                continue
            heard = [c for c in service.characteristics if "notify" in c.properties]
            said = [
                c
                for c in service.characteristics
                if {"write", "write-without-response"} & set(c.properties)
            ]
            if heard and said:
                await self._client.start_notify(heard[0], self._hear)
                return heard[0], said[0]
        raise SourceError(
            f"Bluetooth device {self._address} carries no serial line; is it an ELM327 adapter?"
        )

    def _hear(self, _: Any, data: bytearray) -> None:
        self._heard.put(bytes(data))

    def _left(self, _: Any) -> None:
        self._gone = True
        self._heard.put(b"")

    def _wait(self, work: Any, timeout: float) -> Any:
        """Run something of the Bluetooth loop to its end."""
        result: Future[Any] = asyncio.run_coroutine_threadsafe(work, self._loop)
        try:
            return result.result(timeout)
        except SourceError:
            raise
        # The library's errors and those of the systems below it are of many kinds.
        except Exception as error:
            result.cancel()
            raise SourceError(
                f"Bluetooth adapter {self._address} is gone ({error or type(error).__name__}); is "
                "it on and near?"
            ) from error

    def read(self, timeout: float) -> bytes:
        """Return bytes as soon as some are there; none after ``timeout`` [s]."""
        try:
            data = self._heard.get(timeout=timeout)
        except queue.Empty:
            data = b""
        if self._gone:
            raise SourceError(f"Bluetooth adapter {self._address} is gone; is it on and near?")
        return data

    def write(self, data: bytes) -> None:
        """Send bytes."""
        sure = "write" in self._say.properties
        self._wait(self._client.write_gatt_char(self._say, data, response=sure), 2.0)

    def close(self) -> None:
        """End it; never raises."""
        with suppress(SourceError):
            self._wait(self._client.disconnect(), 0.5)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(0.5)
        if not self._loop.is_running():
            self._loop.close()


def tcp(name: str, place: str, example: str) -> Callable[[], Link]:
    """Return what opens the way to a device at ``HOST:PORT``.

    Parameters
    ----------
    name : of the source, for messages
    place
    example : of a name that can be used

    Raises
    ------
    ConfigError
        The place names no host, or no port.
    """
    host, _, port = place.rpartition(":")
    if not host:
        raise ConfigError(f"source {name!r} names no host; write {example}")
    number = checked_port(port, name)
    return lambda: TcpLink(host, number)


def serial_or_tcp(kind: str, text: str, baud: int) -> Callable[[], Link]:
    """Return what opens the way to a device at ``PATH[@BAUD]`` or ``tcp:HOST:PORT``.

    Parameters
    ----------
    kind : of the source, for messages
    text : the place
    baud : rate of a serial port where none is said [bit/s]

    Raises
    ------
    ConfigError
        The place cannot be used.
    """
    name = f"{kind}:{text}"
    before, _, rest = text.partition(":")
    if before == "tcp":
        return tcp(name, rest, f"{kind}:tcp:localhost:10110")
    path, rate = parted_rate(text, "baud rate")
    if not path:
        raise ConfigError(f"source {name!r} names no port; write {kind}:/dev/ttyACM0")
    return lambda: SerialLink(path, rate or baud)
