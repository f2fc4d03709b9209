"""Accelerometers and gyros of Linux' industrial I/O (IIO): by their buffer, else by sysfs."""

from __future__ import annotations

import logging
import os
import re
import select
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from time import monotonic
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.errors import ConfigError, SourceError
from weighbridge.live.clock import now
from weighbridge.live.device_clock import DeviceClock
from weighbridge.live.source import Samples
from weighbridge.live.sources.gathered import BLOCK, SLICE, Gathered
from weighbridge.live.sources.kind import SourceOptions, parted_rate
from weighbridge.signals import Ints

TIMESTAMP: Final = "in_timestamp"
"""The element that says when a scan was taken [ns]."""

_TYPE: Final = re.compile(r"(be|le):([su])(\d+)/(\d+)(?:X(\d+))?>>(\d+)")
_SIZES: Final = (8, 16, 32, 64)


@dataclass(frozen=True, slots=True, kw_only=True)
class ElementType:
    """How one element is stored.

    Attributes
    ----------
    big : whether the highest byte comes first
    signed : whether it is in two's complement
    bits : that mean something
    stored : bits that it takes: 8, 16, 32 or 64
    repeat : how many such values it has
    shift : to the right, before the bits are taken
    """

    big: bool
    signed: bool
    bits: int
    stored: int
    repeat: int
    shift: int

    @property
    def size(self) -> int:
        """Bytes that it takes."""
        return self.stored // 8 * self.repeat


def read_type(text: str) -> ElementType:
    """Read a type such as ``le:s12/16>>4``.

    Raises
    ------
    ValueError
        It is none.
    """
    text = text.strip()
    found = _TYPE.fullmatch(text)
    if found is None:
        raise ValueError(f"{text!r:.40} is no type such as le:s16/16>>0")
    bits, stored, shift = int(found[3]), int(found[4]), int(found[6])
    repeat = int(found[5] or 1)
    if stored not in _SIZES or not 0 < bits <= stored - shift or not 0 < repeat <= 64:
        raise ValueError(f"{text!r:.40} is a type that cannot be")
    return ElementType(
        big=found[1] == "be",
        signed=found[2] == "s",
        bits=bits,
        stored=stored,
        repeat=repeat,
        shift=shift,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Element:
    """One element of a scan, such as ``in_accel_x``; ``index`` says its place in the order."""

    name: str
    index: int
    type: ElementType


class Scan:
    """Layout of a scan: the elements by their index, each aligned to its own size.

    Parameters
    ----------
    elements : those that are enabled

    Attributes
    ----------
    size : bytes of a scan, so that every element of the next one is aligned as well
    """

    def __init__(self, elements: Iterable[Element]) -> None:
        self._elements = {e.name: e for e in sorted(elements, key=lambda e: e.index)}
        offsets: list[int] = []
        end, widest = 0, 1
        for element in self._elements.values():
            size = element.type.size
            begin = -(-end // size) * size
            offsets.append(begin)
            end, widest = begin + size, max(widest, size)
        self.size = -(-end // widest) * widest
        self._dtype = np.dtype(
            {
                "names": list(self._elements),
                "formats": [_storage(e.type) for e in self._elements.values()],
                "offsets": offsets,
                "itemsize": self.size,
            }
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Elements in their order."""
        return tuple(self._elements)

    def decode(self, data: bytes) -> dict[str, Ints]:
        """Raw values (n,) by element of n whole scans; elements of several values are left out."""
        rows = np.frombuffer(data, self._dtype)
        return {
            name: _integers(rows[name], e.type)
            for name, e in self._elements.items()
            if e.type.repeat == 1
        }


def _storage(kind: ElementType) -> tuple[str, tuple[int, ...]]:
    shape = (kind.repeat,) if kind.repeat > 1 else ()
    return f"{'>' if kind.big else '<'}u{kind.stored // 8}", shape


def _integers(stored: NDArray[np.unsignedinteger], kind: ElementType) -> Ints:
    """Take the bits that mean something, and their sign."""
    unused = 64 - kind.bits
    raw = (stored.astype(np.uint64) >> np.uint64(kind.shift)) << np.uint64(unused)
    if kind.signed:
        return raw.view(np.int64) >> np.int64(unused)
    return (raw >> np.uint64(unused)).astype(np.int64)


# Scans that the kernel keeps while nobody reads.
_LENGTH: Final = 256
_MOST: Final = 65_536
# The kernel's clock that no setting of the host's date moves.
_CLOCK: Final = "monotonic"
_RATES: Final = (
    "sampling_frequency",
    "in_accel_sampling_frequency",
    "in_anglvel_sampling_frequency",
)


class UnbufferedError(Exception):
    """A sensor has no buffer that can be used; its text is why."""


class Buffer:
    """Scans of a sensor as they come.

    Parameters
    ----------
    file : device file, open and not blocking
    scan : its layout
    rate : scans in a second, for sensors that do not stamp them [1/s]
    """

    def __init__(self, file: int, scan: Scan, rate: float) -> None:
        self._file = file
        self._scan = scan
        self._apart = 1.0 / rate
        self._data = b""
        self._clock = DeviceClock()

    def read(self, timeout: float) -> tuple[list[float], dict[str, Ints]]:
        """Return instants (n,) by the host's clock [s] and raw values (n,) of whole scans.

        Parameters
        ----------
        timeout : none after so long [s]

        Raises
        ------
        SourceError
            The sensor is gone.
        """
        if not select.select([self._file], [], [], timeout)[0]:
            return [], {}
        try:
            data = os.read(self._file, _MOST)
        except BlockingIOError:
            return [], {}
        except OSError as error:
            raise SourceError(f"the sensor's buffer is gone ({error.strerror})") from error
        if not data:
            raise SourceError("the sensor's buffer is gone (it has ended)")
        arrived = now()
        text = self._data + data
        whole = len(text) - len(text) % self._scan.size
        self._data = text[whole:]
        raw = self._scan.decode(text[:whole])
        count = whole // self._scan.size
        stamps = raw.pop(TIMESTAMP, None)
        if stamps is None:
            return [arrived - (count - 1 - k) * self._apart for k in range(count)], raw
        return [self._clock.host(1e-9 * int(stamp), arrived) for stamp in stamps], raw


@contextmanager
def buffered(folder: Path, node: Path, wanted: Iterable[str], rate: float) -> Iterator[Buffer]:
    """Let a sensor fill its buffer, and leave it at the end as it was found, but not filling.

    Parameters
    ----------
    folder : of the sensor in sysfs
    node : its device file
    wanted : channels to enable, such as ``in_accel_x``; others that are enabled stay so
    rate : scans in a second that are asked for; the sensor may have others [1/s]

    Raises
    ------
    UnbufferedError
        It cannot be used.
    """
    with ExitStack() as stack:
        try:
            file = os.open(node, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            raise UnbufferedError(f"{node}: {error.strerror}") from error
        stack.callback(os.close, file)
        try:
            # A program that was killed leaves it on, and nothing can be set then.
            _write(folder / "buffer/enable", "0")
            scan = _set_up(folder, set(wanted), rate, stack)
            stack.callback(_stop, folder)
            _write(folder / "buffer/enable", "1")
        except OSError as error:
            raise UnbufferedError(f"{error.filename}: {error.strerror}") from error
        except ValueError as error:
            raise UnbufferedError(f"{folder / 'scan_elements'}: {error}") from error
        yield Buffer(file, scan, _rate(folder) or rate)


def _set_up(folder: Path, wanted: set[str], rate: float, stack: ExitStack) -> Scan:
    """Enable what is wanted; return the layout of all that is enabled then."""
    elements = folder / "scan_elements"
    for name in (*sorted(wanted), TIMESTAMP):
        # Not every sensor stamps its scans.
        if name != TIMESTAMP or (elements / f"{name}_en").exists():
            _set(elements / f"{name}_en", "1", stack)
    _set_trigger(folder, stack)
    for path, text in (
        *((folder / name, _nearest(folder, name, rate)) for name in _RATES),
        (folder / "current_timestamp_clock", _CLOCK),
        (folder / "buffer/length", str(_LENGTH)),
        (folder / "buffer/watermark", "1"),
    ):
        # A sensor without one of these, or with a fixed one, does what it does.
        with suppress(OSError):
            _set(path, text, stack)
    return Scan(
        Element(
            name=path.name.removesuffix("_en"),
            index=int(_beside(path, "index")),
            type=read_type(_beside(path, "type")),
        )
        for path in sorted(elements.glob("*_en"))
        if path.read_text().strip() == "1"
    )


def _beside(enable: Path, what: str) -> str:
    return enable.with_name(f"{enable.name.removesuffix('_en')}_{what}").read_text()


def _set_trigger(folder: Path, stack: ExitStack) -> None:
    """Let the sensor's own trigger start scans where it takes one and has none."""
    chosen = folder / "trigger/current_trigger"
    if not chosen.exists() or chosen.read_text().strip():
        return
    number = folder.name.removeprefix("iio:device")
    for path in sorted(folder.parent.glob("trigger*/name")):
        name = path.read_text().strip()
        if name.endswith(f"-dev{number}"):
            _set(chosen, name, stack)
            return


def _nearest(folder: Path, name: str, rate: float) -> str:
    """Return the slowest rate that is no slower, of those that the sensor has."""
    try:
        text = (folder / f"{name}_available").read_text()
        # Between brackets it is a range: the lowest, the step and the highest.
        rates = [] if "[" in text else sorted(float(word) for word in text.split())
    except (OSError, ValueError):
        rates = []
    return f"{next((r for r in rates if r >= rate), rates[-1] if rates else rate):g}"


def _rate(folder: Path) -> float | None:
    """Scans in a second, as the sensor says [1/s]; None where it does not."""
    for name in _RATES:
        with suppress(OSError, ValueError):
            rate = float((folder / name).read_text())
            if rate > 0.0:
                return rate
    return None


def _set(path: Path, text: str, stack: ExitStack) -> None:
    """Write a setting, and its old value when the stack ends."""
    before = path.read_text().strip()
    if before == text:
        return
    stack.callback(_restore, path, before)
    _write(path, text)


def _write(path: Path, text: str) -> None:
    """Write a setting that is there; a file of sysfs is never made."""
    file = os.open(path, os.O_WRONLY | os.O_TRUNC)
    try:
        os.write(file, f"{text}\n".encode("ascii"))
    except OSError as error:
        error.filename = str(path)
        raise
    finally:
        os.close(file)


def _restore(path: Path, text: str) -> None:
    with suppress(OSError):
        _write(path, text)


def _stop(folder: Path) -> None:
    _restore(folder / "buffer/enable", "0")


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
        folder = self._folder()
        node = self._nodes / folder.name
        with ExitStack() as stack:
            gathered = stack.enter_context(Gathered(put))
            channels = self._channels(folder, stack)
            try:
                with buffered(folder, node, [c.element for c in channels], self._rate) as buffer:
                    self._drain(buffer, channels, gathered, stop)
            except UnbufferedError as error:
                self._tell(error)
                self._poll(channels, gathered, stop)

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
