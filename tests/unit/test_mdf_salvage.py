"""MF4 files cut off at any byte: what is whole is read, and said; else one sentence."""

import struct
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import has

from weighbridge.errors import DriveError, WeighbridgeError
from weighbridge.io import read_drive
from weighbridge.io.mdf_salvage import salvage
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
    assert salvage(path) is None
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
    with pytest.raises(DriveError, match="of its 200 records none is whole"):
        read_drive(path)
    path.write_bytes(raw[:300])
    with pytest.raises(DriveError, match="ends early and nothing is whole"):
        read_drive(path)


@pytest.mark.parametrize("layout", LAYOUTS)
@settings(
    max_examples=25,
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
