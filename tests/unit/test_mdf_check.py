"""MDF files whose links and lengths lie: one sentence, without a hang, a crash or much memory."""

import struct
import tracemalloc

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from test_mdf_salvage import LAYOUTS, blocks, log
from test_mdf_salvage import SPEEDS as SPEEDS_OF_LOG

from weighbridge.errors import DriveError
from weighbridge.io import read_drive
from weighbridge.io.mdf_check import check_links, guard

COUNT = 40
TIMES = 0.1 * np.arange(COUNT)
SPEEDS = np.linspace(0.0, 20.0, COUNT)


def place(raw, kind, link=None, number=0):
    """Where a block stands, or one of its links."""
    at = -1
    for _ in range(number + 1):
        at = raw.index(kind, at + 1)
    return at if link is None else at + 24 + 8 * link


def body(raw, kind, number=0):
    at = place(raw, kind, number=number)
    return at + 24 + 8 * struct.unpack_from("<Q", raw, at + 16)[0]


def written(tmp_path, version="4.10", compression=0, values=SPEEDS):
    from asammdf import MDF, Signal

    path = tmp_path / ("log.mf4" if version[0] == "4" else "log.mdf")
    with MDF(version=version) as file:
        file.append([Signal(values, TIMES, name="vehicle_speed_mps", unit="mps")])
        file.save(path, compression=compression)
    return path


@pytest.mark.parametrize("layout", LAYOUTS)
def test_whole_files_pass(layout):
    assert check_links(log(layout))


@pytest.mark.parametrize("compression", [0, 1, 2])
def test_whole_files_of_asammdf_pass(tmp_path, compression):
    assert check_links(written(tmp_path, compression=compression))


def test_mdf_3(tmp_path):
    speed = read_drive(written(tmp_path, "3.30")).signals["vehicle_speed"]
    assert_allclose(speed.time, TIMES)
    assert_allclose(speed.values, SPEEDS)


def test_circle_of_mdf_3(tmp_path):
    path = written(tmp_path, "3.30")
    raw = bytearray(path.read_bytes())
    group = struct.unpack_from("<I", raw, 68)[0]
    struct.pack_into("<I", raw, group + 4, group)
    path.write_bytes(raw)
    with pytest.raises(DriveError, match=f"two links lead to the block at byte {group}"):
        read_drive(path)


def test_cycles_of_mdf_3(tmp_path):
    path = written(tmp_path, "3.30")
    raw = bytearray(path.read_bytes())
    group = struct.unpack_from("<I", raw, 68)[0]
    struct.pack_into("<I", raw, struct.unpack_from("<I", raw, group + 8)[0] + 22, 1 << 31)
    path.write_bytes(raw)
    with pytest.raises(DriveError, match="are more than there are"):
        read_drive(path)


@pytest.mark.parametrize(("kind", "link"), [(b"##DG", 0), (b"##CG", 0), (b"##CN", 0), (b"##FH", 0),
                                            (b"##CN", 1), (b"##DL", 0)])  # fmt: skip
def test_links_in_a_circle(tmp_path, kind, link):
    raw = bytearray(log("lists"))
    at = place(raw, kind)
    struct.pack_into("<Q", raw, place(raw, kind, link), at)
    path = tmp_path / "log.mf4"
    path.write_bytes(raw)
    with pytest.raises(ValueError, match=f"two links lead to the block at byte {at}"):
        check_links(path)
    # Groups in a circle are taken once, as those of a file that was cut off.
    if kind in (b"##DG", b"##CG"):
        drive = read_drive(path)
        assert drive.problems[0].id == "file.ends_short"
        assert_allclose(drive.signals["vehicle_speed"].values * 3.6, SPEEDS_OF_LOG)
    else:
        with pytest.raises(DriveError, match=f"block at byte {at}"):
            read_drive(path)


def test_array_beyond_its_record(tmp_path):
    rows = np.zeros(COUNT, [("vehicle_speed_mps", "<f8", (2, 3))])
    path = written(tmp_path, values=rows)
    raw = bytearray(path.read_bytes())
    assert check_links(bytes(raw))
    struct.pack_into("<Q", raw, body(raw, b"##CA") + 16, 1 << 20)
    path.write_bytes(raw)
    with pytest.raises(DriveError, match=r"array at byte \d+ does not fit in a record"):
        read_drive(path)


def test_start_in_no_calendar(tmp_path):
    path = written(tmp_path)
    raw = bytearray(path.read_bytes())
    struct.pack_into("<Q", raw, body(raw, b"##HD"), (1 << 61) + 1)
    path.write_bytes(raw)
    drive = read_drive(path)
    assert drive.info.start_time is None
    assert_allclose(drive.signals["vehicle_speed"].values, SPEEDS)


def test_packed_data_without_records_end(tmp_path):
    path = written(tmp_path, compression=1)
    raw = bytearray(path.read_bytes())
    struct.pack_into("<Q", raw, body(raw, b"##CG") + 8, 0)
    path.write_bytes(raw)
    with pytest.raises(DriveError, match="no samples"):
        read_drive(path)


def test_records_beyond_the_data_take_no_memory(tmp_path):
    path = written(tmp_path)
    raw = bytearray(path.read_bytes())
    struct.pack_into("<Q", raw, body(raw, b"##CG") + 8, 1 << 40)
    path.write_bytes(raw)
    assert not check_links(path)
    tracemalloc.start()
    speed = read_drive(path).signals["vehicle_speed"]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert_allclose(speed.values, SPEEDS)
    assert peak < 1 << 25


def test_identifier_that_is_no_number(tmp_path):
    raw = bytearray(log("sorted"))
    # The third channel; its data type becomes bytes.
    raw[body(raw, b"##CN", 2) + 2] = 10
    path = tmp_path / "log.mf4"
    path.write_bytes(raw)
    with pytest.raises(DriveError, match="field ID of the frames is no number"):
        read_drive(path)


@pytest.mark.parametrize("cycles", [1, 1 << 20])
def test_record_longer_than_the_data_takes_no_memory(tmp_path, cycles):
    path = written(tmp_path, compression=1)
    raw = bytearray(path.read_bytes())
    group = body(raw, b"##CG")
    struct.pack_into("<Q", raw, group + 8, cycles)
    struct.pack_into("<I", raw, group + 28, 1 << 31)
    path.write_bytes(raw)
    tracemalloc.start()
    with pytest.raises(DriveError, match="no samples"):
        read_drive(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1 << 25


@pytest.mark.parametrize("length", [9, 1 << 20, (1 << 32) - 4])
def test_values_of_variable_length_beyond_their_data(tmp_path, length):
    raw = bytearray(log("sorted"))
    at = body(raw, b"##SD") + 199 * 12
    assert raw[at : at + 4] == b"\x08\0\0\0"
    struct.pack_into("<I", raw, at, length)
    path = tmp_path / "log.mf4"
    path.write_bytes(raw)
    with pytest.raises(DriveError, match="stands outside its data"):
        read_drive(path)


@pytest.mark.parametrize("offset", [12 * 200, (1 << 63) - 1, (1 << 64) - 2])
def test_places_of_values_beyond_their_data(tmp_path, offset):
    raw = bytearray(log("sorted"))
    size = len(blocks("sorted")["data"][2]) // 200
    struct.pack_into("<Q", raw, body(raw, b"##DT") + 100 * size + 13, offset)
    path = tmp_path / "log.mf4"
    path.write_bytes(raw)
    with pytest.raises(DriveError, match="stands outside its data"):
        read_drive(path)


def test_guarded_functions_give_what_they_gave():
    from asammdf.blocks import mdf_v4

    guard()
    guard()
    records = np.arange(60, dtype=np.uint8).reshape(10, 6)
    taken = mdf_v4.get_channel_raw_bytes(records.tobytes(), 6, 2, 3)
    assert_array_equal(np.frombuffer(taken, np.uint8).reshape(10, 3), records[:, 2:5])
    data = b"".join(struct.pack("<I", k) + bytes([k] * k) for k in (1, 3, 2))
    rows = mdf_v4.extract(data, True, np.array([0, 5, 12], np.uint64))
    assert_array_equal(rows, [[1, 0, 0], [3, 3, 3], [2, 2, 0]])


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("get_channel_raw_bytes", (bytes(60), 6, 7, 1)),
        ("get_channel_raw_bytes", (bytes(60), 6, 2, 5)),
        ("get_channel_raw_bytes", (bytes(60), 6, -1, 2)),
        ("get_invalidation_bits_array", (bytes(10), 1, 8, 10, True)),
        ("extract", (bytes(8), True, None)),
        ("extract", (bytes(8), True, np.array([5]))),
        ("get_vlsd_max_sample_size", (bytes(8), np.array([1 << 62], np.uint64), 1)),
    ],
)
def test_guarded_functions_refuse_bytes_outside_the_data(name, arguments):
    from asammdf.blocks import mdf_v4

    guard()
    with pytest.raises(ValueError, match=r"outside|no places"):
        getattr(mdf_v4, name)(*arguments)


def test_one_long_value_does_not_fill_the_memory():
    from asammdf.blocks import mdf_v4

    guard()
    long = 1 << 22
    data = struct.pack("<I", long) + bytes(long) + bytes(4)
    offsets = np.full(10_000, long + 4, np.uint64)
    offsets[0] = 0
    with pytest.raises(ValueError, match=f"claims {long} bytes"):
        mdf_v4.extract(data, True, offsets)
