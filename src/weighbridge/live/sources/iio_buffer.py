"""The buffer of a sensor of Linux' industrial I/O: set up, read, and left as it was."""

from __future__ import annotations

import os
import select
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from weighbridge.errors import SourceError
from weighbridge.live.clock import now
from weighbridge.live.device_clock import DeviceClock
from weighbridge.live.sources.iio_scan import TIMESTAMP, Element, Scan, read_type
from weighbridge.signals import Ints

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
