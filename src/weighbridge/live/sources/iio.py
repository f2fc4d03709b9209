"""Accelerometers and gyros of Linux' industrial I/O (IIO), read through sysfs."""

from __future__ import annotations

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
from weighbridge.live.sources.gathered import Gathered
from weighbridge.live.sources.kind import SourceOptions, parted_rate

DEVICES: Final = Path("/sys/bus/iio/devices")
"""Where the kernel shows its devices."""

RATE: Final = 100
"""Readings in a second, where none is said [1/s]."""

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
    """One axis: ``value = (raw + offset) * scale``."""

    name: str
    file: int
    scale: float
    offset: float

    def read(self) -> float:
        raw = os.pread(self.file, _MOST_TEXT, 0)
        return (float(raw) + self.offset) * self.scale


class IioSource:
    """Reads a sensor again and again.

    Parameters
    ----------
    sensor : what the kernel calls it, as in its file ``name``, or its folder
    rate : readings in a second [1/s]
    devices : where the kernel shows its devices
    text : as on the command line
    """

    def __init__(
        self, sensor: str, rate: float = RATE, devices: Path = DEVICES, text: str = ""
    ) -> None:
        self.name = text or f"iio:{sensor}"
        self._sensor = sensor
        self._apart = 1.0 / rate
        self._devices = devices

    def run(self, put: Callable[[Samples], None], stop: Event) -> None:
        """Hand over readings until told to stop; see `weighbridge.live.source.Source.run`."""
        gathered = Gathered(put)
        with ExitStack() as stack:
            channels = self._channels(self._folder(), stack)
            due = monotonic()
            failures = 0
            while not stop.is_set():
                begun = now()
                try:
                    values = {c.name: c.read() for c in channels}
                except (OSError, ValueError) as error:
                    failures += 1
                    if failures >= _FAILURES:
                        raise SourceError(
                            f"{self.name} cannot be read any more ({error})"
                        ) from error
                else:
                    failures = 0
                    gathered.add(0.5 * (begun + now()), values)
                # A reading that took too long leaves the next one out.
                due = max(due + self._apart, monotonic())
                stop.wait(due - monotonic())
        gathered.flush()

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
                channels.append(_Channel(f"{ours}_{axis}", file, scale, offset))
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
