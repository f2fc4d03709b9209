"""Accelerometers and gyros of Linux' industrial I/O (IIO): by their buffer, else by sysfs."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from time import monotonic
from typing import Final

from weighbridge.errors import ConfigError, SourceError
from weighbridge.live.clock import now
from weighbridge.live.source import Samples
from weighbridge.live.sources.gathered import BLOCK, SLICE, Gathered
from weighbridge.live.sources.iio_buffer import Buffer, UnbufferedError, buffered
from weighbridge.live.sources.kind import SourceOptions, parted_rate

_logger = logging.getLogger(__name__)

DEVICES: Final = Path("/sys/bus/iio/devices")
"""Where the kernel shows its devices."""

NODES: Final = Path("/dev")
"""Where their device files are."""

RATE: Final = 100
"""Readings in a second, where none is said [1/s]."""

SILENT: Final = 2.0
"""A buffer that gets nothing for so long has no trigger, or its sensor is gone [s]."""

_HIGHEST_RATE: Final = 500
# What the kernel calls them; after scale and offset m/s^2 and rad/s (its ABI, sysfs-bus-iio).
_KINDS: Final = {"accel": "accel", "anglvel": "gyro"}
_MOST_TEXT: Final = 64
_FAILURES: Final = 20


def make_iio(text: str, options: SourceOptions) -> IioSource:
    """Make a source of a sensor; see `weighbridge.live.sources.kind.SourceKind`.

    Raises
    ------
    ConfigError
        The rate cannot be used.
    """
    name, rate = parted_rate(text, "rate")
    if rate is not None and rate > _HIGHEST_RATE:
        raise ConfigError(f"source 'iio:{text}': read {_HIGHEST_RATE} times a second at most")
    return IioSource(name, rate or RATE, text=f"iio:{text}")


@dataclass(frozen=True, slots=True)
class _Channel:
    """One axis: ``value = (raw + offset) * scale``; ``element`` is the kernel's name of it."""

    name: str
    element: str
    file: int
    scale: float
    offset: float

    def read(self) -> float:
        return self.value(float(os.pread(self.file, _MOST_TEXT, 0)))

    def value(self, raw: float) -> float:
        return (raw + self.offset) * self.scale


class IioSource:
    """Reads a sensor: what its buffer got, or again and again where it has none.

    Parameters
    ----------
    sensor : what the kernel calls it, as in its file ``name``, or its folder
    rate : readings in a second [1/s]
    devices, nodes : where the kernel shows its devices, and their device files
    text : as on the command line
    """

    def __init__(
        self,
        sensor: str,
        rate: float = RATE,
        devices: Path = DEVICES,
        nodes: Path = NODES,
        text: str = "",
    ) -> None:
        self.name = text or f"iio:{sensor}"
        self._sensor = sensor
        self._rate = rate
        self._devices = devices
        self._nodes = nodes
        self._reported = False

    def run(self, put: Callable[[Samples], None], stop: Event) -> None:
        """Hand over readings until asked to stop; see `weighbridge.live.source.Source.run`."""
        gathered = Gathered(put)
        folder = self._folder()
        node = self._nodes / folder.name
        with ExitStack() as stack:
            channels = self._channels(folder, stack)
            try:
                with buffered(folder, node, [c.element for c in channels], self._rate) as buffer:
                    self._drain(buffer, channels, gathered, stop)
            except UnbufferedError as error:
                self._tell(error)
                self._poll(channels, gathered, stop)
        gathered.flush()

    def _drain(
        self, buffer: Buffer, channels: list[_Channel], gathered: Gathered, stop: Event
    ) -> None:
        """Take what the buffer gets.

        Raises
        ------
        UnbufferedError
            It gets nothing.
        SourceError
            It gets nothing any more.
        """
        came, heard = False, monotonic()
        while not stop.is_set():
            times, raw = buffer.read(SLICE)
            for k, time in enumerate(times):
                gathered.add(time, {c.name: c.value(float(raw[c.element][k])) for c in channels})
            gathered.flush(BLOCK)
            if times:
                came, heard = True, monotonic()
            elif monotonic() - heard > SILENT:
                if not came:
                    raise UnbufferedError(f"nothing came for {SILENT:g} s; has it a trigger?")
                raise SourceError(f"{self.name} sent nothing for {SILENT:g} s")

    def _poll(self, channels: list[_Channel], gathered: Gathered, stop: Event) -> None:
        """Read every value by itself."""
        due = monotonic()
        failures = 0
        while not stop.is_set():
            begun = now()
            try:
                values = {c.name: c.read() for c in channels}
            except (OSError, ValueError) as error:
                failures += 1
                if failures >= _FAILURES:
                    raise SourceError(f"{self.name} cannot be read any more ({error})") from error
            else:
                failures = 0
                gathered.add(0.5 * (begun + now()), values)
            # A reading that took too long leaves the next one out.
            due = max(due + 1.0 / self._rate, monotonic())
            stop.wait(due - monotonic())

    def _tell(self, why: UnbufferedError) -> None:
        if not self._reported:
            self._reported = True
            _logger.warning(
                "%s: its buffer cannot be used (%s); every value is read by itself, at less "
                "even instants",
                self.name,
                why,
            )

    def _folder(self) -> Path:
        """Folder of the sensor, among those of all."""
        try:
            folders = sorted(self._devices.iterdir())
        except OSError:
            folders = []
        names = {folder: _text(folder / "name") for folder in folders}
        for folder, name in names.items():
            if self._sensor in (name, folder.name):
                return folder
        known = ", ".join(sorted(name for name in names.values() if name)) or "none"
        raise SourceError(f"{self.name} is not there; sensors of this host: {known}")

    def _channels(self, folder: Path, stack: ExitStack) -> list[_Channel]:
        channels = []
        for kind, ours in _KINDS.items():
            for axis in "xyz":
                channel = f"in_{kind}_{axis}"
                try:
                    file = os.open(folder / f"{channel}_raw", os.O_RDONLY)
                except OSError:
                    continue
                stack.callback(os.close, file)
                scale = _first(folder, (f"{channel}_scale", f"in_{kind}_scale"), 1.0)
                offset = _first(folder, (f"{channel}_offset", f"in_{kind}_offset"), 0.0)
                channels.append(_Channel(f"{ours}_{axis}", channel, file, scale, offset))
        if not channels:
            raise SourceError(f"{self.name} has neither an accelerometer nor a gyro")
        return channels


def _text(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return ""


def _first(folder: Path, files: tuple[str, ...], otherwise: float) -> float:
    """Number in the first file that is there."""
    for file in files:
        if text := _text(folder / file):
            try:
                return float(text)
            except ValueError:
                raise SourceError(f"{folder / file} holds no number: {text!r:.40}") from None
    return otherwise
