"""MDF files cut off at any byte, or with links and lengths that lie.

What is whole is read, and said; else it is one sentence, without a hang, a crash or much memory.
"""

import struct
import tracemalloc
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import error, has

from weighbridge import DriveError, WeighbridgeError, read_drive
from weighbridge.io.mdf_repair import corrected, guard
from weighbridge.messages import phrase

ANSWERS = 200
# Stamps 0.1 s apart, and the speed that each answer of PID 0D tells [km/h].
TIMES = 0.1 * np.arange(ANSWERS)
SPEEDS = (np.arange(ANSWERS) % 150).astype(np.uint8)


def channel(name, kind, place, bits, follower=None, child=None, data=None, sync=0, number=0):
    """Links and body of a CN block; ``number`` 0 is unsigned, 4 a float, 10 bytes."""
    links = [follower, child, f"text {name}", None, None, data, None, None]
    body = struct.pack("<BBBBII", kind, sync, number, 0, place, bits) + bytes(60)
    return b"##CN", links, body


def blocks(layout):
    """All blocks of a log of OBD-II answers, by name; links are names."""
    # A record: id of the record, time, identifier, bytes, place of the data among all.
    size = 8 + 4 + 1 + 8
    cycles = 0 if layout == "unfinished" else ANSWERS
    answers = [bytes([3, 0x41, 0x0D, speed, 0, 0, 0, 0]) for speed in SPEEDS.tolist()]
    data = b"".join(struct.pack("<I", len(a)) + a for a in answers)
    records = [struct.pack("<dIBQ", t, 0x7E8, 8, k * 12) for k, t in enumerate(TIMES.tolist())]
    mixed = layout in ("unfinished", "unsorted")
    found = {"head": (b"##HD", ["group", "history", None, None, None, None], bytes(32))}
    found["history"] = (b"##FH", [None, None], bytes(16))
    found["group"] = (
        b"##DG", [None, "frames", "data", None], bytes([1 if mixed else 0]) + bytes(7)
    )  # fmt: skip
    flags = 0x2 | 0x4
    found["frames"] = (
        b"##CG", ["values" if mixed else None, "time", None, None, None, None],
        struct.pack("<QQHHIII", 1, cycles, flags, 46, 0, size, 0),
    )  # fmt: skip
    if mixed:
        found["values"] = (
            b"##CG", [None] * 6, struct.pack("<QQHHIII", 2, cycles, 1, 0, 0, len(data), 0)
        )  # fmt: skip
    found["time"] = channel("t", 2, 0, 64, "frame", sync=1, number=4)
    found["frame"] = channel("CAN_DataFrame", 0, 8, 13 * 8, None, "id", number=10)
    found["id"] = channel("CAN_DataFrame.ID", 0, 8, 32, "length")
    found["length"] = channel("CAN_DataFrame.DataLength", 0, 12, 8, "bytes")
    found["bytes"] = channel(
        "CAN_DataFrame.DataBytes", 1, 13, 64, data="values" if mixed else "strings", number=10
    )
    for name in ("t", "CAN_DataFrame", "CAN_DataFrame.ID", "CAN_DataFrame.DataLength",
                 "CAN_DataFrame.DataBytes"):  # fmt: skip
        text = name.encode() + b"\0"
        found[f"text {name}"] = (b"##TX", [], text.ljust((len(text) + 7) // 8 * 8, b"\0"))
    if mixed:
        content = b"".join(
            b"\1" + r + b"\2" + struct.pack("<I", 8) + a
            for r, a in zip(records, answers, strict=True)
        )
        found["data"] = (b"##DT", [], content)
        return found
    if layout == "lists":
        fifth = ANSWERS // 5
        pieces = [b"".join(records[k : k + fifth]) for k in range(0, ANSWERS, fifth)]
        names = [f"piece {k}" for k in range(len(pieces))]
        found["data"] = (b"##HL", ["list"], struct.pack("<HB5x", 1, 0))
        places = np.cumsum([0, *map(len, pieces[:-1])]).tolist()
        found["list"] = (
            b"##DL", [None, *names],
            struct.pack("<B3xI", 0, len(names)) + struct.pack(f"<{len(names)}Q", *places),
        )  # fmt: skip
        found["strings"] = (b"##SD", [], data)
        for k, (name, piece) in enumerate(zip(names, pieces, strict=True)):
            kind = k % 2
            plain = np.frombuffer(piece, np.uint8).reshape(-1, size).T.tobytes() if kind else piece
            packed = zlib.compress(plain)
            head = struct.pack("<2sBxIQQ", b"DT", kind, size if kind else 0, len(piece),
                               len(packed))  # fmt: skip
            found[name] = (b"##DZ", [], head + packed)
        return found
    found["data"] = (b"##DT", [], b"".join(records))
    found["strings"] = (b"##SD", [], data)
    return found


def log(layout):
    """Bytes of the file, blocks in the order of ``blocks``."""
    found = blocks(layout)
    places, at = {}, 64
    for name, (_, links, body) in found.items():
        places[name] = at
        at += (24 + 8 * len(links) + len(body) + 7) // 8 * 8
    name = b"UnFinMF " if layout == "unfinished" else b"MDF     "
    flags = 0x1 | 0x4 | 0x20 if layout == "unfinished" else 0
    raw = name + b"4.11    test    " + bytes(4) + struct.pack("<H", 411) + bytes(30)
    raw += struct.pack("<HH", flags, 0)
    for kind, links, body in found.values():
        length = 24 + 8 * len(links) + len(body)
        if layout == "unfinished" and kind == b"##DT":
            length = 24
        raw += struct.pack("<4s4xQQ", kind, length, len(links))
        raw += struct.pack(f"<{len(links)}Q", *(places[x] if x else 0 for x in links)) + body
        raw += bytes(-len(raw) % 8) if kind != b"##DT" or layout != "unfinished" else b""
    return raw


LAYOUTS = ("sorted", "lists", "unsorted", "unfinished")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_whole_files_are_left_alone(tmp_path, layout):
    path = tmp_path / "log.mf4"
    path.write_bytes(log(layout))
    assert corrected(path) is None
    drive = read_drive(path)
    assert drive.problems == ()
    assert_allclose(drive.signals["vehicle_speed"].time, TIMES, atol=1e-9)
    assert_allclose(drive.signals["vehicle_speed"].values, SPEEDS / 3.6)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_cut_at_many_places(tmp_path, layout):
    raw = log(layout)
    path = tmp_path / "log.mf4"
    read = []
    for end in range(0, len(raw), 83):
        path.write_bytes(raw[:end])
        try:
            drive = read_drive(path)
        except DriveError:
            continue
        speed = drive.signals["vehicle_speed"]
        read.append(len(speed))
        assert_allclose(speed.time, TIMES[: len(speed)], atol=1e-9)
        assert_allclose(speed.values, SPEEDS[: len(speed)] / 3.6)
        if layout != "unfinished" and len(speed) < ANSWERS:
            assert has(drive.problems[:1], "file.ends_short")
            kept = drive.problems[0].values["kept"]
            assert kept.startswith(phrase("kept_records", kept=len(speed), records=ANSWERS))
    # The more of the file is there, the more is read of it, up to nearly all.
    assert_array_equal(read, sorted(read))
    assert read[0] < 0.3 * ANSWERS
    assert read[-1] > 0.95 * ANSWERS
    assert len(read) > 10
    assert path.read_bytes() == raw[:end]


def test_a_file_without_its_data_is_refused_in_a_sentence(tmp_path):
    raw = log("sorted")
    path = tmp_path / "log.mf4"
    path.write_bytes(raw[: raw.index(b"##SD")])
    with error(DriveError, "log.mf4 200"):
        read_drive(path)
    path.write_bytes(raw[:300])
    with error(DriveError, "log.mf4"):
        read_drive(path)


COUNT = 40
STAMPS = 0.1 * np.arange(COUNT)
RISING = np.linspace(0.0, 20.0, COUNT)


def place(raw, kind, link=None, number=0):
    """Where a block stands, or one of its links."""
    at = -1
    for _ in range(number + 1):
        at = raw.index(kind, at + 1)
    return at if link is None else at + 24 + 8 * link


def body(raw, kind, number=0):
    at = place(raw, kind, number=number)
    return at + 24 + 8 * struct.unpack_from("<Q", raw, at + 16)[0]


def written(tmp_path, version="4.10", compression=0, values=RISING):
    from asammdf import MDF, Signal

    path = tmp_path / ("log.mf4" if version[0] == "4" else "log.mdf")
    with MDF(version=version) as file:
        file.append([Signal(values, STAMPS, name="vehicle_speed_mps", unit="mps")])
        file.save(path, compression=compression)
    return path


def patched(path, form, at, value):
    """Write a number into a file."""
    raw = bytearray(path.read_bytes())
    struct.pack_into(form, raw, at(raw) if callable(at) else at, value)
    path.write_bytes(raw)


def group_3(raw):
    return struct.unpack_from("<I", raw, 68)[0]


@pytest.mark.parametrize("compression", [0, 1, 2])
def test_whole_files_of_asammdf_pass(tmp_path, compression):
    assert corrected(written(tmp_path, compression=compression)) is None


def test_mdf_3(tmp_path):
    speed = read_drive(written(tmp_path, "3.30")).signals["vehicle_speed"]
    assert_allclose(speed.time, STAMPS)
    assert_allclose(speed.values, RISING)


@pytest.mark.parametrize(
    ("at", "form", "value", "says"),
    [
        (lambda raw: group_3(raw) + 4, "<I", None, "log.mdf 1238"),
        (lambda raw: struct.unpack_from("<I", raw, group_3(raw) + 8)[0] + 22, "<I", 1 << 31,
         "log.mdf 34359738368 598"),
        (lambda raw: raw.index(b"CN", group_3(raw)) + 186, "<H", 4000, "log.mdf 16"),
        (lambda raw: raw.index(b"CN", group_3(raw)) + 226, "<H", 4000, "log.mdf 16"),
    ],
)  # fmt: skip
def test_damaged_mdf_3(tmp_path, at, form, value, says):
    path = written(tmp_path, "3.30")
    raw = path.read_bytes()
    patched(path, form, at, group_3(raw) if value is None else value)
    with error(DriveError, says):
        read_drive(path)


@pytest.mark.parametrize(("kind", "link"), [(b"##DG", 0), (b"##CG", 0), (b"##CN", 0), (b"##FH", 0),
                                            (b"##CN", 1), (b"##DL", 0)])  # fmt: skip
def test_links_in_a_circle(tmp_path, kind, link):
    raw = bytearray(log("lists"))
    struct.pack_into("<Q", raw, place(raw, kind, link), place(raw, kind))
    path = tmp_path / "log.mf4"
    path.write_bytes(raw)
    if kind == b"##CN":
        with error(DriveError, "log.mf4 200"):
            read_drive(path)
        return
    drive = read_drive(path)
    assert drive.problems[0].id == "file.ends_short"
    assert_allclose(drive.signals["vehicle_speed"].values * 3.6, SPEEDS)


@pytest.mark.parametrize(
    ("form", "at", "value"),
    [
        ("<Q", lambda raw: body(raw, b"##CA") + 16, 1 << 20),
        ("<I", lambda raw: body(raw, b"##CN", 1) + 4, 1 << 24),
        ("<II", lambda raw: body(raw, b"##CN", 1) + 12, (2, 900)),
    ],
)
def test_channels_beyond_their_record(tmp_path, form, at, value):
    rows = np.zeros(COUNT, [("vehicle_speed_mps", "<f8", (2, 3))])
    path = written(tmp_path, values=rows)
    assert corrected(path) is None
    raw = bytearray(path.read_bytes())
    struct.pack_into(form, raw, at(raw), *(value if isinstance(value, tuple) else (value,)))
    path.write_bytes(raw)
    with error(DriveError, "log.mf4 40"):
        read_drive(path)


def test_start_in_no_calendar(tmp_path):
    path = written(tmp_path)
    patched(path, "<Q", lambda raw: body(raw, b"##HD"), (1 << 61) + 1)
    drive = read_drive(path)
    assert drive.info.start_time is None
    assert_allclose(drive.signals["vehicle_speed"].values, RISING)


def test_packed_data_without_records_end(tmp_path):
    path = written(tmp_path, compression=1)
    patched(path, "<Q", lambda raw: body(raw, b"##CG") + 8, 0)
    with error(DriveError, "log log.mf4 vehicle_speed"):
        read_drive(path)


@pytest.mark.parametrize("cycles", [1, 1 << 20, 1 << 40])
@pytest.mark.parametrize("length", [None, 1 << 31])
def test_records_beyond_the_data_take_no_memory(tmp_path, cycles, length):
    path = written(tmp_path, compression=0 if length is None else 1)
    patched(path, "<Q", lambda raw: body(raw, b"##CG") + 8, cycles)
    if length is not None:
        patched(path, "<I", lambda raw: body(raw, b"##CG") + 28, length)
    tracemalloc.start()
    if length is None:
        speed = read_drive(path).signals["vehicle_speed"]
        assert_allclose(speed.values, RISING[:cycles])
    else:
        with error(DriveError, "log.mf4"):
            read_drive(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1 << 25


@pytest.mark.parametrize("layout", ["sorted", "lists", "unsorted"])
def test_counters_beyond_the_data_take_no_memory(tmp_path, layout):
    raw = bytearray(log(layout))
    struct.pack_into("<Q", raw, body(raw, b"##CG") + 8, 1 << 33)
    # What reading imports is no memory of the file.
    read_drive(written(tmp_path))
    path = tmp_path / "log.mf4"
    path.write_bytes(raw)
    tracemalloc.start()
    drive = read_drive(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1 << 25
    assert has(drive.problems[:1], "file.ends_short")
    assert_allclose(drive.signals["vehicle_speed"].values, SPEEDS / 3.6)


def test_identifier_that_is_no_number(tmp_path):
    raw = bytearray(log("sorted"))
    # The third channel; its data type becomes bytes.
    raw[body(raw, b"##CN", 2) + 2] = 10
    path = tmp_path / "log.mf4"
    path.write_bytes(raw)
    with error(DriveError, "log.mf4 ID"):
        read_drive(path)


@pytest.mark.parametrize("length", [9, 1 << 20, (1 << 32) - 4])
def test_values_of_variable_length_beyond_their_data(tmp_path, length):
    raw = bytearray(log("sorted"))
    at = body(raw, b"##SD") + 199 * 12
    assert raw[at : at + 4] == b"\x08\0\0\0"
    struct.pack_into("<I", raw, at, length)
    path = tmp_path / "log.mf4"
    path.write_bytes(raw)
    with error(DriveError, "log.mf4"):
        read_drive(path)


@pytest.mark.parametrize("offset", [12 * 200, (1 << 63) - 1, (1 << 64) - 2])
def test_places_of_values_beyond_their_data(tmp_path, offset):
    raw = bytearray(log("sorted"))
    size = len(blocks("sorted")["data"][2]) // 200
    struct.pack_into("<Q", raw, body(raw, b"##DT") + 100 * size + 13, offset)
    path = tmp_path / "log.mf4"
    path.write_bytes(raw)
    with error(DriveError, "log.mf4"):
        read_drive(path)


def test_one_long_value_does_not_fill_the_memory():
    from asammdf.blocks import mdf_v4

    guard()
    guard()
    data = b"".join(struct.pack("<I", k) + bytes([k] * k) for k in (1, 3, 2))
    rows = mdf_v4.extract(data, True, np.array([0, 5, 12], np.uint64))
    assert_array_equal(rows, [[1, 0, 0], [3, 3, 3], [2, 2, 0]])
    long = 1 << 22
    data = struct.pack("<I", long) + bytes(long) + bytes(4)
    offsets = np.full(10_000, long + 4, np.uint64)
    offsets[0] = 0
    with error(ValueError, long):
        mdf_v4.extract(data, True, offsets)


@pytest.mark.parametrize("layout", LAYOUTS)
@settings(
    max_examples=15,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    cut=st.floats(0.1, 1.0),
    edits=st.lists(st.tuples(st.floats(0.0, 1.0), st.binary(min_size=1, max_size=9)), max_size=3),
)
def test_links_that_lead_astray(tmp_path, layout, cut, edits):
    raw = log(layout)
    for where, content in edits:
        # Most of what can go wrong stands in the blocks that describe the others.
        at = 64 + int(where * 1800)
        raw = raw[:at] + content + raw[at + len(content) :]
    path = tmp_path / "log.mf4"
    path.write_bytes(raw[: int(cut * len(raw))])
    told = ""
    try:
        drive = read_drive(path)
    except WeighbridgeError as error:
        told = str(error)
    assert 10 < len(told) < 1000 if told else drive.signals
    assert "\n" not in told
