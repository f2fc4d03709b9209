"""Robot recordings (MCAP, ROS 1 and ROS 2 bags): topics of messages as channels.

Of each message the numbers that are no array are channels, ``topic.field``; messages with arrays
of any length (pictures, point clouds) are left alone. ``sensor_msgs/Imu`` and
``sensor_msgs/NavSatFix`` are known: ROS counts in SI, an accelerometer at rest reads +g upwards
(REP 103, REP 145), a covariance that begins with -1 says that the quantity is not measured, and
a status below 0 that there is no fix (the messages' own definitions).
"""

from __future__ import annotations

import bz2
import json
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from io import BytesIO
from operator import attrgetter
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np

from weighbridge.errors import DriveError
from weighbridge.io.channels import Channel, Recording, check_unpacked, most_unpacked
from weighbridge.io.json_lines import flat
from weighbridge.io.libraries import importing, reason_of
from weighbridge.io.mapping import TimeColumn
from weighbridge.io.table import column_list, since_1970
from weighbridge.messages import Problem
from weighbridge.signals import Floats

IMU: Final = "sensor_msgs/msg/Imu"
FIX: Final = "sensor_msgs/msg/NavSatFix"
FOXGLOVE_FIX: Final = "foxglove.LocationFix"

# By type: field, quantity, unit.
_KNOWN: Final = {
    IMU: (
        *((f"linear_acceleration.{a}", f"accel_{a}", "mps2") for a in "xyz"),
        *((f"angular_velocity.{a}", f"gyro_{a}", "radps") for a in "xyz"),
    ),
    **dict.fromkeys(
        (FIX, FOXGLOVE_FIX),
        (
            ("latitude", "latitude", "deg"),
            ("longitude", "longitude", "deg"),
            ("altitude", "altitude", "m"),
        ),
    ),
}
_SI: Final = {"linear_acceleration": "m/s^2", "angular_velocity": "rad/s", "linear": "m/s"}

_HEADER: Final = "std_msgs/msg/Header"
_TIMES: Final = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_MOST_FIELDS: Final = 64
_DEEPEST: Final = 8

# A header's stamp that is further from the recorder's clock is none [s].
_NEAR: Final = 5.0

# Records of MCAP: 8 bytes of magic, then kind and length of each; a chunk shows its unpacked
# size after two times (the format's specification).
_MAGIC: Final = 8
_RECORD: Final = 9
_CHUNK: Final = 6
_CHUNK_TIMES: Final = 16


@dataclass(slots=True)
class _Topic:
    """Numbers of the messages of one topic; ``find`` names them by the first message."""

    name: str
    kind: str
    decode: Callable[[bytes], Any]
    find: Callable[[Any], tuple[str, ...]]
    numbers: Callable[[Any], Sequence[float]]
    stamp: Callable[[Any], float]
    fields: tuple[str, ...] = ()
    absent: frozenset[str] = frozenset()
    rows: array[float] = field(default_factory=lambda: array("d"))
    logged: array[float] = field(default_factory=lambda: array("d"))
    stamps: array[float] = field(default_factory=lambda: array("d"))

    def take(self, data: bytes, logged: float) -> None:
        """Add one message."""
        message = self.decode(data)
        if not self.fields:
            self.fields = self.find(message)
            self.absent = _absent(message) if self.kind == IMU else frozenset()
        if not self.fields:
            return
        row = self.numbers(message)
        stamp = self.stamp(message)
        self.rows.extend(row)
        self.logged.append(logged)
        self.stamps.append(stamp)


_Message: TypeAlias = tuple[int, str, float, bytes, Callable[[], _Topic | None]]
"""Key and name of its topic, when it was logged [s], its bytes, and what makes its topic."""


def open_mcap(path: Path, time: TimeColumn) -> Recording:
    """Read an MCAP file of ROS 1, ROS 2 or JSON messages; see `weighbridge.io.channels.Opener`.

    Raises
    ------
    DriveError
        No MCAP file, without a message that has numbers, or one that unpacks to far more than
        it can hold.
    MissingExtraError
        mcap or rosbags is not installed.
    """
    with importing("", "ros", f"reading {path.name}"):
        import rosbags.typesys  # noqa: F401  (what decodes the messages)
        from mcap import records
    check_unpacked(path, _promised(path))

    def messages() -> Iterator[_Message]:
        schemas: dict[int, Any] = {}
        channels: dict[int, Any] = {}
        for record in _records(path):
            if isinstance(record, records.Schema):
                schemas[record.id] = record
            elif isinstance(record, records.Channel):
                channels[record.id] = record
            elif isinstance(record, records.Message) and record.channel_id in channels:
                channel = channels[record.channel_id]
                schema = schemas.get(channel.schema_id)
                if schema is not None:
                    make = partial(_topic_of_mcap, schema, channel)
                    yield channel.id, channel.topic, record.log_time * 1e-9, record.data, make

    return _recording(path, messages(), "MCAP")


def _promised(path: Path) -> int:
    """Bytes that the chunks of an MCAP say they unpack to."""
    size, at = 0, _MAGIC
    with path.open("rb") as file:
        file.seek(at)
        while len(head := file.read(_RECORD)) == _RECORD:
            if head[0] == _CHUNK:
                size += int.from_bytes(file.read(_CHUNK_TIMES + 8)[_CHUNK_TIMES:], "little")
            at += _RECORD + int.from_bytes(head[1:], "little")
            if at > path.stat().st_size:
                break
            file.seek(at)
    return size


def _records(path: Path) -> Iterator[Any]:
    """Records of an MCAP in the order of the file: one that broke off has no index."""
    from mcap.exceptions import EndOfFile
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader

    with path.open("rb") as file:
        size = path.stat().st_size
        for record in StreamReader(file, emit_chunks=True, record_size_limit=size).records:
            if not isinstance(record, Chunk):
                yield record
                continue
            data = _unpacked(record)
            inner = StreamReader(BytesIO(data), skip_magic=True, record_size_limit=len(data))
            with suppress(EndOfFile):
                yield from inner.records
            if len(data) != record.uncompressed_size:
                raise ValueError("a chunk unpacks to another size than it says")


def _unpacked(chunk: Any) -> bytes:
    """Content of a chunk, a byte more at most than it says it has."""
    most = chunk.uncompressed_size + 1
    if chunk.compression == "zstd":
        import zstandard

        return bytes(zstandard.ZstdDecompressor().stream_reader(chunk.data).read(most))
    if chunk.compression == "lz4":
        return _unpacked_lz4(chunk.data, most)
    if chunk.compression:
        raise ValueError(f"its compression {chunk.compression!r} is not read")
    return bytes(chunk.data)


def _unpacked_lz4(data: bytes, most: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

    return bytes(LZ4FrameDecompressor().decompress(data, max_length=most))


def open_bag(path: Path, time: TimeColumn) -> Recording:
    """Read a ROS 1 bag or the database of a ROS 2 bag; see `weighbridge.io.channels.Opener`.

    Raises
    ------
    DriveError
        No bag, without a message that has numbers, or one that unpacks to far more than it can
        hold.
    MissingExtraError
        rosbags is not installed.
    """
    with importing("", "ros", f"reading {path.name}"):
        from rosbags.interfaces import MessageDefinitionFormat
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
    one = path.suffix.lower() == ".bag"

    def messages() -> Iterator[_Message]:
        with (Reader1 if one else Reader2)(path) as bag:
            if one:
                _bound_chunks(path, bag)
            for connection, logged, data in bag.messages():
                name, defined = connection.topic, connection.msgdef
                make = partial(_ros_topic, name, connection.msgtype, defined.data, one)
                if defined.format == MessageDefinitionFormat.IDL:
                    continue
                yield connection.id, name, logged * 1e-9, bytes(data), make

    return _recording(path, messages(), "ROS bag")


def _recording(
    path: Path,
    messages: Iterator[_Message],
    what: str,
) -> Recording:
    """Collect the messages of all topics; each shows how its topic is read, asked once."""
    topics: dict[int, _Topic | None] = {}
    found = Recording([])
    damaged = 0
    reason = ""
    try:
        for key, name, logged, data, make in messages:
            if key not in topics:
                try:
                    topics[key] = make()
                # Definitions that cannot be parsed raise errors of many kinds.
                except Exception:
                    topics[key] = None
                    found.notes.append(
                        Problem.of("file.topic_undecoded", topic=column_list([name]))
                    )
            topic = topics[key]
            if topic is None:
                continue
            try:
                topic.take(data, logged)
            # Messages that do not fit their definition raise errors of many kinds.
            except Exception:
                damaged += 1
    except DriveError:
        raise
    # So do the libraries on damaged files.
    except Exception as e:
        reason = reason_of(e)
    held = [t for t in topics.values() if t is not None and t.logged]
    if not held:
        why = f" ({reason})" if reason else ""
        raise DriveError(
            f"{path} is no {what} with messages that can be read{why}; it may have been cut off: "
            "copy it again"
        )
    if reason:
        found.notes.append(Problem.of("file.breaks_off", reason=reason))
    if damaged:
        found.notes.append(Problem.of("file.messages_damaged", count=damaged))
    _channels(held, found)
    return found


def _channels(topics: list[_Topic], found: Recording) -> None:
    first: dict[str, _Topic] = {}
    for topic in sorted(topics, key=lambda t: -len(t.logged)):
        first.setdefault("fix" if topic.kind in (FIX, FOXGLOVE_FIX) else topic.kind, topic)
    others = [t.name for t in topics if t.kind in _KNOWN and t not in first.values()]
    if others:
        found.notes.append(Problem.of("file.several_sensors", others=column_list(others)))
    clocks = [_clock(t, found) for t in topics]
    found.absolute = all(since_1970(c) for c in clocks)
    for topic, clock in zip(topics, clocks, strict=True):
        rows = np.frombuffer(topic.rows, dtype=np.float64).reshape(-1, len(topic.fields))
        known = {f: (q, u) for f, q, u in _KNOWN.get(topic.kind, ()) if f not in topic.absent}
        valid = np.ones(len(rows), dtype=bool)
        if "status.status" in topic.fields and topic.kind == FIX:
            valid = rows[:, topic.fields.index("status.status")] >= 0.0
        for k, name in enumerate(topic.fields):
            # What else a sensor shows, such as its orientation, is no quantity of a drive.
            if topic.kind in _KNOWN and name not in known:
                continue
            values = np.where(valid, rows[:, k], np.nan)
            quantity, unit = known.get(name, ("", _unit(name)))
            quantity = quantity if topic in first.values() else ""
            found.channels.append(Channel(f"{topic.name}.{name}", clock, values, unit, quantity))


def _unit(name: str) -> str:
    parts = name.split(".")
    return _SI.get(parts[-2], "") if len(parts) > 1 else ""


def _clock(topic: _Topic, found: Recording) -> Floats:
    """Stamps of the messages' headers where they are near the recorder's clock, else that [s]."""
    logged = np.frombuffer(topic.logged, dtype=np.float64)
    stamps = np.frombuffer(topic.stamps, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        near = np.abs(stamps - logged) < _NEAR
    if near.all():
        return stamps
    if np.isfinite(stamps).any():
        found.notes.append(
            Problem.of("file.stamps_apart", topic=column_list([topic.name]), near=_NEAR)
        )
    return logged


def _topic_of_mcap(schema: Any, channel: Any) -> _Topic | None:
    """Topic of one channel; None where its encoding is not read."""
    if channel.message_encoding == "json":
        return _json_topic(channel.topic, schema.name)
    if (schema.encoding, channel.message_encoding) in (("ros1msg", "ros1"), ("ros2msg", "cdr")):
        text = schema.data.decode("utf-8", "replace")
        return _ros_topic(channel.topic, schema.name, text, schema.encoding == "ros1msg")
    return None


def _ros_topic(name: str, kind: str, text: str, one: bool) -> _Topic | None:
    """Topic of ROS messages; None where they have no numbers, or arrays of any length."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    from rosbags.typesys.msg import normalize_msgtype

    kind = normalize_msgtype(kind)
    # Old bags of ROS 2 carry no definitions: those of its own types are known.
    store = get_typestore(Stores.EMPTY if text else Stores.ROS2_HUMBLE)
    if text:
        types = get_types_from_msg(text, kind)
        store.register({k: v for k, v in types.items() if k not in store.fielddefs})
    if kind not in store.fielddefs:
        return None
    fields = _fields(store.fielddefs, kind, 0, {})
    if not fields or len(fields) > _MOST_FIELDS:
        return None
    whole: Callable[[Any], Any] = attrgetter(*fields)
    many = len(fields) > 1
    headed = ("header", _HEADER) in ((f, d[1]) for f, d in store.fielddefs[kind][1])
    decode = store.deserialize_ros1 if one else store.deserialize_cdr
    return _Topic(
        name,
        kind,
        lambda data: decode(data, kind),
        lambda _: fields,
        whole if many else lambda message: (whole(message),),
        _header_stamp if headed else lambda _: np.nan,
    )


def _fields(
    defined: Any, kind: str, depth: int, known: dict[tuple[str, int], tuple[str, ...]]
) -> tuple[str, ...]:
    """Numbers in a message, nested ones as well; none where an array of any length is in it.

    One more than the most that are read, so that few types nested deep cannot stand for millions;
    ``known`` has those of types and depths that were met.
    """
    from rosbags.interfaces import Nodetype

    if (kind, depth) in known:
        return known[kind, depth]
    found: list[str] = []
    for name, (node, what) in defined[kind][1]:
        if node == Nodetype.SEQUENCE:
            found = []
            break
        if node == Nodetype.BASE and what[0] not in ("string", "wstring", "char", "wchar"):
            found.append(name)
        elif node == Nodetype.NAME and what not in (_HEADER, *_TIMES) and depth < _DEEPEST:
            found += [f"{name}.{below}" for below in _fields(defined, what, depth + 1, known)]
        del found[_MOST_FIELDS + 1 :]
    known[kind, depth] = tuple(found)
    return known[kind, depth]


def _header_stamp(message: Any) -> float:
    stamp = message.header.stamp
    return float(stamp.sec + 1e-9 * stamp.nanosec)


def _absent(message: Any) -> frozenset[str]:
    """Fields that an IMU's first message says are not measured."""
    return frozenset(
        f"{part}.{axis}"
        for part in ("linear_acceleration", "angular_velocity")
        if getattr(message, f"{part}_covariance")[0] == -1.0
        for axis in "xyz"
    )


def _json_topic(name: str, kind: str) -> _Topic:
    """Topic of JSON messages, whose first one shows the fields."""
    topic = _Topic(name, kind, json.loads, _json_fields, lambda _: (), _json_stamp)

    def numbers(message: Any) -> Sequence[float]:
        found = _json_numbers(message)
        return [found.get(f, np.nan) for f in topic.fields]

    topic.numbers = numbers
    return topic


def _json_fields(message: Any) -> tuple[str, ...]:
    names = tuple(name for name in _json_numbers(message) if not name.startswith("timestamp."))
    return names if len(names) <= _MOST_FIELDS else ()


def _json_numbers(message: Any) -> dict[str, float]:
    return {name: float(x) for name, x in flat(message) if not isinstance(x, str)}


def _json_stamp(message: Any) -> float:
    stamp = message.get("timestamp") if isinstance(message, dict) else None
    if isinstance(stamp, dict) and "sec" in stamp:
        return float(stamp["sec"]) + 1e-9 * float(stamp.get("nsec", 0))
    return np.nan


def _bound_chunks(path: Path, bag: Any) -> None:
    """Let the chunks of an open ROS 1 bag unpack to `most_unpacked` in all.

    A chunk beyond raises `DriveError` when it is reached.
    """
    sizes: dict[int, int] = {}

    def bounded(place: int, unpack: Callable[[bytes, int], bytes]) -> Callable[[bytes], bytes]:
        def decompress(data: bytes) -> bytes:
            # A chunk may be read again, where its messages lie among those of others.
            others = sum(size for at, size in sizes.items() if at != place)
            found = unpack(data, most_unpacked(path) - others + 1)
            sizes[place] = len(found)
            check_unpacked(path, others + len(found))
            return found

        return decompress

    from lz4.frame import decompress

    known = {
        bz2.decompress: lambda data, most: bz2.BZ2Decompressor().decompress(data, max_length=most),
        decompress: _unpacked_lz4,
    }
    for place, chunk in bag.chunks.items():
        if chunk.decompressor in known:
            unpack = bounded(place, known[chunk.decompressor])
            bag.chunks[place] = chunk._replace(decompressor=unpack)
