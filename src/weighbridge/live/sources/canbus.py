"""A CAN bus, listened to: signals of a DBC, foreign OBD-II answers, or SAE J1939."""

from __future__ import annotations

import re
from collections.abc import Callable
from threading import Event
from time import monotonic
from typing import Any, Final

import numpy as np

from weighbridge.errors import ConfigError, MissingExtraError, SourceError
from weighbridge.io import DbcStream, J1939Stream, ObdStream, Stream, load_dbcs, load_mapping
from weighbridge.io.frames import Frames
from weighbridge.io.mapping import TableMapping, named_dbcs
from weighbridge.live.clock import now
from weighbridge.live.device_clock import DeviceClock
from weighbridge.live.source import Samples
from weighbridge.live.sources.kind import SourceOptions, parted_rate

SILENT: Final = 5.0
"""A bus without a frame for so long is said to be silent [s]."""

# Frames are decoded so often [s]; fewer, larger parts cost less.
_PART: Final = 0.1
# Frames decoded at once at most, where a bus is busier than the host.
_MOST: Final = 4000
_BUS_NUMBER: Final = re.compile(r"(\d{1,3})\D*$")


def make_can(text: str, options: SourceOptions) -> CanSource:
    """Make a source of a CAN bus; see `weighbridge.live.sources.kind.SourceKind`.

    Raises
    ------
    ConfigError
        The place, a DBC or the mapping cannot be used.
    """
    bus = BusPlace.of(f"can:{text}", listen_only=options.listen_only)
    named = load_mapping(options.mapping) if options.mapping is not None else ()
    databases = load_dbcs(options.dbc or named_dbcs(named))
    streams: list[Stream] = [ObdStream()]
    if databases:
        mapping = _of_frames(bus.source, named)
        streams.insert(0, DbcStream(databases, mapping, bus.source))
    return CanSource(bus, streams)


def make_j1939(text: str, options: SourceOptions) -> CanSource:
    """Make a source of a truck's bus; see `weighbridge.live.sources.kind.SourceKind`.

    Raises
    ------
    ConfigError
        The place cannot be used.
    """
    bus = BusPlace.of(f"j1939:{text}", listen_only=options.listen_only)
    return CanSource(bus, [J1939Stream()])


def _of_frames(source: str, mappings: tuple[TableMapping, ...]) -> TableMapping | None:
    """Mapping for frames: of several tables the one that names signals."""
    if not mappings:
        return None
    found = [m for m in mappings if m.signals]
    if len(found) != 1:
        raise ConfigError(
            f"source {source}: the mapping names the signals of {len(found)} tables; give one "
            "that names those of the bus alone"
        )
    return found[0]


class BusPlace:
    """Where a CAN bus is, and how it is opened.

    Parameters
    ----------
    source : as on the command line, for messages
    interface, channel : as python-can names them
    bitrate : of the bus [bit/s]; None for what the system has set
    listen_only : set interfaces that can to acknowledge nothing
    """

    def __init__(
        self, source: str, interface: str, channel: str, bitrate: int | None, *, listen_only: bool
    ) -> None:
        self.source = source
        self.channel = channel
        self.number = int(found[1]) if (found := _BUS_NUMBER.search(channel)) else 0
        self._interface = interface
        self._bitrate = bitrate
        self._listen_only = listen_only

    @classmethod
    def of(cls, source: str, *, listen_only: bool) -> BusPlace:
        """Read ``KIND:INTERFACE:CHANNEL[@BITRATE]``.

        Raises
        ------
        ConfigError
            It is none.
        """
        interface, _, rest = source.split(":", 1)[1].partition(":")
        channel, bitrate = parted_rate(rest, "bit rate")
        if not interface or not channel:
            raise ConfigError(
                f"source {source!r} names no interface and channel; write them as in "
                f"{source.split(':')[0]}:socketcan:can0"
            )
        return cls(source, interface, channel, bitrate, listen_only=listen_only)

    def open(self, filters: list[tuple[int, int, bool]]) -> Any:
        """Open the bus.

        Raises
        ------
        SourceError
            It is not there or cannot be opened.
        MissingExtraError
            python-can is not installed.
        """
        try:
            import can
        except ImportError:
            raise MissingExtraError("python-can", "live", f"source {self.source}") from None
        settings: dict[str, Any] = {"receive_own_messages": False}
        if self._bitrate is not None:
            settings["bitrate"] = self._bitrate
        if self._listen_only and self._interface == "slcan":
            settings["listen_only"] = True
        if self._listen_only and self._interface == "pcan":
            settings["state"] = can.BusState.PASSIVE
        try:
            return can.Bus(
                interface=self._interface,
                channel=self.channel,
                can_filters=[
                    {"can_id": i, "can_mask": mask, "extended": extended}
                    for i, mask, extended in filters
                ],
                **settings,
            )
        except can.CanInterfaceNotImplementedError as error:
            raise ConfigError(
                f"source {self.source}: python-can cannot use interface {self._interface!r} "
                f"({error}); correct its name, or install what it needs"
            ) from error
        # Each interface has errors of its own kind.
        except Exception as error:
            raise SourceError(
                f"{self.source} cannot be opened ({error}); is the interface there and up?"
            ) from error


class CanSource:
    """Listens to a bus. It has no way to send.

    Parameters
    ----------
    bus : where it is
    streams : decode its frames; of two that say the same the first counts
    """

    def __init__(self, bus: BusPlace, streams: list[Stream]) -> None:
        self.name = bus.source
        self.trouble = ""
        self._bus = bus
        self._streams = streams

    def run(self, put: Callable[[Samples], None], stop: Event) -> None:
        """Hand over what frames say; see `weighbridge.live.source.Source.run`."""
        self.trouble = ""
        bus = self._bus.open([f for stream in self._streams for f in stream.filters()])
        clock = DeviceClock()
        heard = monotonic()
        try:
            while not stop.is_set():
                frames = part(bus, clock, self._bus, _PART)
                if len(frames):
                    heard, self.trouble = monotonic(), ""
                    if samples := self._decoded(frames):
                        put(samples)
                elif monotonic() - heard > SILENT:
                    self.trouble = (
                        f"no frame that is wanted came for {SILENT:g} s; is the ignition on, and "
                        "the bit rate right?"
                    )
        finally:
            self.trouble = ""
            bus.shutdown()

    def _decoded(self, frames: Frames) -> Samples:
        samples: dict[str, Any] = {}
        for stream in self._streams:
            for name, values in stream.step(frames).items():
                samples.setdefault(name, values)
        return samples


def part(bus: Any, clock: DeviceClock, place: BusPlace, span: float) -> Frames:
    """Receive frames for a moment.

    Parameters
    ----------
    bus : of python-can
    clock : of the interface
    place : the bus
    span : how long [s]

    Raises
    ------
    SourceError
        The interface is gone.
    """
    messages: list[Any] = []
    until = monotonic() + span
    while (left := until - monotonic()) > 0.0 and len(messages) < _MOST:
        message = receive(bus, place, left)
        if message is not None and len(message.data):
            arrived = now()
            # An interface without a clock stamps nothing.
            time = clock.host(message.timestamp, arrived) if message.timestamp else arrived
            messages.append((time, message))
    width = max([8, *(len(m.data) for _, m in messages)])
    data = np.zeros((len(messages), width), np.uint8)
    for row, (_, message) in zip(data, messages, strict=True):
        row[: len(message.data)] = np.frombuffer(message.data, np.uint8)
    frames = Frames(
        np.array([time for time, _ in messages], dtype=np.float64),
        np.full(len(messages), place.number, np.int16),
        np.array([m.arbitration_id for _, m in messages], np.uint32),
        np.array([m.is_extended_id for _, m in messages], np.bool_),
        np.array([len(m.data) for _, m in messages], np.uint8),
        data,
    )
    return frames.select(np.argsort(frames.time, kind="stable"))


def receive(bus: Any, place: BusPlace, timeout: float) -> Any:
    """Receive one data frame; None where none came in time.

    Raises
    ------
    SourceError
        The interface is gone.
    """
    try:
        message = bus.recv(timeout)
    # Each interface has errors of its own kind.
    except Exception as error:
        raise SourceError(f"{place.source} is gone ({error}); plug it in again") from error
    if message is None or message.is_error_frame or message.is_remote_frame:
        return None
    return message
