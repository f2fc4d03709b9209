"""openpilot's ``rlog`` and ``qlog``: speeds of the car, inertial sensor, position, CAN frames.

The time is that of the device since it was started, so the segments of one route go on one after
another. Of the accelerometers and gyroscopes of a device the first is taken, whose axes are
right-handed and which reads the reaction to gravity. Frames that the device sent itself have bus
numbers from 128 on and are left out.
"""

from __future__ import annotations

import bz2
from array import array
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.channels import Channel, Recording, most_unpacked
from weighbridge.io.frames import EXTENDED_MASK, Frames
from weighbridge.io.libraries import importing
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.quiet import first_line
from weighbridge.messages import Problem
from weighbridge.signals import Floats

_BZIP2: Final = b"BZh"
_ZSTANDARD: Final = b"\x28\xb5\x2f\xfd"
_BLOCK: Final = 1 << 12

# More than the library itself takes.
_MOST_SEGMENTS: Final = 512

# Android's numbers of the sensor and of its type, in logs up to 2022.
_OLD_SENSORS: Final = {(1, 1): "acceleration", (5, 16): "gyroUncalibrated"}

_SENT: Final = 128
_LAST_STANDARD: Final = 0x7FF
_LONGEST: Final = 64

# The sensor's clock is the device's, a few milliseconds before the log's [s].
_NEAR: Final = 1.0

_AXES: Final = {"acceleration": ("accel", "mps2"), "gyroUncalibrated": ("gyro", "radps")}
_CAR: Final = (
    ("vEgoRaw", "vehicle_speed", "mps"),
    ("engineRpm", "engine_speed", "rpm"),
    ("gas", "accelerator_pedal", "ratio"),
    ("brakePressed", "brake_switch", ""),
    ("clutchPressed", "clutch_switch", ""),
)
_PLACE: Final = (
    ("latitude", "latitude", "deg"),
    ("longitude", "longitude", "deg"),
    ("altitude", "altitude", "m"),
    ("speed", "gnss_speed", "mps"),
    ("bearingDeg", "gnss_course", "deg"),
    ("horizontalAccuracy", "gnss_accuracy", "m"),
)
_GPS: Final = ("gpsLocationExternal", "gpsLocation")


@dataclass(slots=True)
class _Rows:
    """Rows of numbers with their times."""

    width: int
    time: array[float] = field(default_factory=lambda: array("d"))
    cells: array[float] = field(default_factory=lambda: array("d"))

    def add(self, time: float, row: Iterable[float]) -> None:
        """Add one row."""
        values = array("d", row)
        if len(values) == self.width:
            self.time.append(time)
            self.cells.extend(values)

    def arrays(self) -> tuple[Floats, Floats]:
        """(n,) times and (n, width) values."""
        cells = np.frombuffer(self.cells, dtype=np.float64).reshape(-1, self.width)
        return np.frombuffer(self.time, dtype=np.float64), cells


@dataclass(slots=True)
class _Held:
    """What the events of a log hold."""

    car: _Rows = field(default_factory=lambda: _Rows(len(_CAR)))
    sensors: dict[str, _Rows] = field(default_factory=lambda: {k: _Rows(3) for k in _AXES})
    places: dict[str, _Rows] = field(default_factory=lambda: {k: _Rows(len(_PLACE)) for k in _GPS})
    frames: list[tuple[float, int, int, bytes]] = field(default_factory=list)


@lru_cache(maxsize=1)
def _schema(capnp: Any) -> Any:
    capnp.remove_import_hook()
    return capnp.load(str(Path(__file__).with_name("openpilot.capnp")))


def open_openpilot(path: Path, time: TimeColumn) -> Recording:
    """Read one segment of openpilot; see `weighbridge.io.channels.Opener`.

    Raises
    ------
    DriveError
        No log of openpilot, or one of which nothing can be read.
    MissingExtraError
        pycapnp, or for a ``.zst`` zstandard, is not installed.
    """
    with importing("pycapnp", "openpilot", f"reading {path.name}"):
        import capnp

        event = _schema(capnp).Event
    data, reason = _unpacked(path)
    held = _Held()
    count = strange = 0
    try:
        for message in event.read_multiple_bytes(data):
            count += 1
            try:
                _take(message, held)
            # Of events that a newer version added, and of damaged ones, the library complains.
            except Exception:
                strange += 1
    # So it does where the file breaks off within one.
    except Exception as e:
        reason = reason or first_line(e)
    found = _recording(held)
    if not found.channels and found.frames is None:
        why = f" ({reason})" if reason else f", only {count} other events" if count else ""
        raise DriveError(
            f"{path} holds no event of openpilot that can be used{why}; copy it again, or give "
            "the rlog"
        )
    if reason:
        found.notes.append(Problem.of("file.breaks_off", reason=reason))
    if strange:
        found.notes.append(Problem.of("file.events_damaged", count=strange, events=count))
    return found


def _unpacked(path: Path) -> tuple[bytes, str]:
    """Whole events of a log, and why it ends early; empty where it does not."""
    data = path.read_bytes()
    reason = ""
    if data.startswith(_ZSTANDARD):
        with importing("zstandard", "openpilot", f"reading {path.name}"):
            import zstandard
        data, reason = _decompressed(path, data, zstandard.ZstdDecompressor().decompressobj)
    elif data.startswith(_BZIP2):
        data, reason = _decompressed(path, data, bz2.BZ2Decompressor)
    end = _whole_events(data)
    return data[:end], reason or ("its last event is cut off" if end < len(data) else "")


def _decompressed(path: Path, data: bytes, opener: Callable[[], Any]) -> tuple[bytes, str]:
    """Unpack streams one after another as far as they are whole."""
    parts: list[bytes] = []
    size = at = 0
    stream = opener()
    try:
        while at < len(data):
            # Little at a time: few bytes can stand for very many.
            parts.append(stream.decompress(data[at : at + _BLOCK]))
            at += _BLOCK
            size += len(parts[-1])
            if size > most_unpacked(path):
                raise DriveError(f"{path} unpacks to more than 1 GB; a segment is a minute")
            if stream.eof:
                at = min(at, len(data)) - len(stream.unused_data)
                stream = opener()
                if at >= len(data):
                    return b"".join(parts), ""
    except DriveError:
        raise
    # zstandard has an error of its own, bz2 raises OSError or EOFError.
    except Exception as e:
        return b"".join(parts), first_line(e) or type(e).__name__
    return b"".join(parts), "its last packed block is cut off"


def _whole_events(data: bytes) -> int:
    """Where the last whole event ends.

    Before each stand the number of its segments less one and their sizes in words of 8 bytes, as
    32-bit numbers filled up to a word (Cap'n Proto, *Serialization over a stream*).
    """
    at = 0
    while at + 8 <= len(data):
        segments = int.from_bytes(data[at : at + 4], "little") + 1
        if segments > _MOST_SEGMENTS:
            return at
        head = 4 * (segments + 1 + (segments + 1) % 2)
        if at + head > len(data):
            return at
        sizes = np.frombuffer(data[at + 4 : at + 4 + 4 * segments], "<u4")
        end = at + head + 8 * int(sizes.sum(dtype=np.int64))
        if sizes.size < segments or end > len(data):
            return at
        at = end
    return at


def _take(event: Any, held: _Held) -> None:
    """Add one event to what is held."""
    kind = event.which()
    time = event.logMonoTime * 1e-9
    if kind == "carState":
        state = event.carState
        held.car.add(time, (float(getattr(state, name)) for name, _, _ in _CAR))
    elif kind == "accelerometer":
        _take_sensor(event.accelerometer, time, held)
    elif kind == "gyroscope":
        _take_sensor(event.gyroscope, time, held)
    elif kind == "sensorEventsDEPRECATED":
        for reading in event.sensorEventsDEPRECATED:
            if reading.which() == _OLD_SENSORS.get((reading.sensor, reading.type)):
                _take_sensor(reading, time, held)
    elif kind in _GPS:
        place = getattr(event, kind)
        # Up to 2022 the lowest bit of the flags said what hasFix says since.
        if place.hasFix or place.flags & 1:
            held.places[kind].add(time, (float(getattr(place, name)) for name, _, _ in _PLACE))
    elif kind == "can":
        held.frames += [(time, f.src, f.address, bytes(f.dat)) for f in event.can if f.src < _SENT]


def _take_sensor(reading: Any, time: float, held: _Held) -> None:
    kind = reading.which()
    if kind in held.sensors:
        own = reading.timestamp * 1e-9
        held.sensors[kind].add(own if abs(own - time) < _NEAR else time, getattr(reading, kind).v)


def _recording(held: _Held) -> Recording:
    found = Recording([])

    def put(rows: _Rows, names: Iterable[tuple[str, str, str]], needed: frozenset[str]) -> None:
        time, cells = rows.arrays()
        for k, (name, quantity, unit) in enumerate(names):
            # What a car does not show is 0 in the log.
            if time.size and (name in needed or np.any(cells[:, k] != 0.0)):
                values = np.ascontiguousarray(cells[:, k])
                found.channels.append(Channel(name, time, values, unit, quantity))

    put(held.car, ((f"carState.{n}", q, u) for n, q, u in _CAR), frozenset({"carState.vEgoRaw"}))
    for kind, (stem, unit) in _AXES.items():
        names = [(f"{kind}.v.{k}", f"{stem}_{a}", unit) for k, a in enumerate("xyz")]
        put(held.sensors[kind], names, frozenset(n for n, _, _ in names))
    kind = max(held.places, key=lambda k: len(held.places[k].time))
    put(held.places[kind], ((f"{kind}.{n}", q, u) for n, q, u in _PLACE), frozenset())
    found.frames = _frames(held.frames)
    return found


def _frames(held: list[tuple[float, int, int, bytes]]) -> Frames | None:
    held = [f for f in held if len(f[3]) <= _LONGEST and f[2] <= EXTENDED_MASK]
    if not held:
        return None
    width = max(8, *(len(f[3]) for f in held))
    data = np.frombuffer(b"".join(f[3].ljust(width, b"\0") for f in held), np.uint8)
    identifier = np.array([f[2] for f in held], np.uint32)
    return Frames(
        np.array([f[0] for f in held]),
        np.array([f[1] for f in held], np.int16),
        identifier,
        identifier > _LAST_STANDARD,
        np.array([len(f[3]) for f in held], np.uint8),
        data.reshape(-1, width),
    )
