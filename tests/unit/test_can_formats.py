"""Frames of every kind, written by python-can, come back as they were."""

import sys

import can
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import error, has, refused

from weighbridge import DriveError, MissingExtraError, read_drive
from weighbridge.io import format_of
from weighbridge.io.frame_text import read_candump

START = 1_600_000_000.0


def messages(fd):
    """Data frames of all lengths and some CAN FD, remote frames among them."""
    rng = np.random.default_rng(11)
    made = []
    for k in range(600):
        is_fd = fd and k % 5 == 2
        length = int(rng.choice([8, 12, 20, 64])) if is_fd else int(rng.integers(0, 9))
        remote = not is_fd and k % 17 == 3
        data = bytes(rng.integers(0, 256, length, dtype=np.uint8))
        # The mark of a BLF object must not be taken for one inside a frame.
        if length >= 8 and k % 3 == 0:
            data = b"LOBJ" + data[4:]
        made.append(
            can.Message(
                timestamp=START + 0.01 * k,
                arbitration_id=int(rng.integers(0, 0x1FFFFFFF if k % 2 else 0x7FF)),
                is_extended_id=bool(k % 2),
                is_fd=is_fd,
                is_remote_frame=remote,
                data=b"" if remote else data,
                dlc=4 if remote else None,
                channel=k % 2,
            )
        )
    return made


@pytest.mark.parametrize(
    ("suffix", "fd"),
    [(".blf", True), (".asc", True), (".asc", False), (".log", True), (".log", False),
     (".trc", False), (".csv", False), (".csv", True)],
)  # fmt: skip
def test_frames_come_back(tmp_path, suffix, fd):
    sent = messages(fd)
    path = tmp_path / f"log{suffix}"
    with can.Logger(path) as logger:
        for message in sent:
            logger(message)
    log = format_of(path).read(path, None, None)
    expected = [m for m in sent if not m.is_remote_frame]
    frames = log.frames
    assert log.absolute
    assert log.problems == []
    assert_allclose(frames.time - START, [m.timestamp - START for m in expected], atol=1.1e-3)
    assert_array_equal(frames.id, [m.arbitration_id for m in expected])
    assert_array_equal(frames.extended, [m.is_extended_id for m in expected])
    assert [bytes(d[:n]) for d, n in zip(frames.data, frames.length, strict=True)] == [
        bytes(m.data) for m in expected
    ]
    if suffix != ".csv":
        buses = frames.channel - frames.channel.min()
        assert_array_equal(buses, [m.channel for m in expected])


def test_candump_as_shown_on_a_terminal(tmp_path):
    path = tmp_path / "shown.log"
    path.write_text(
        " (000.000000)  can0  18FCF200   [8]  E1 FF FF FF FF FF FF FF\r\n"
        " (000.005001)  vcan7  7E8   [3]  02 41 0D   '.A.'\r\n"
        " (000.006000)  can0  123   [4]  remote request\n"
        "some other line\n"
        " (000.007000)  can0  20000080   [8]  00 00 00 00 00 00 00 00\n"
    )
    log = read_candump(path, None, None)
    assert_array_equal(log.frames.id, [0x18FCF200, 0x7E8])
    assert_array_equal(log.frames.length, [8, 3])
    assert_array_equal(log.frames.channel, [0, 7])
    assert not log.absolute
    assert log.problems[0].id == "file.lines_left_out"
    assert log.problems[0].values["count"] == 1
    assert log.problems[0].values["lines"] == "5 lines"


def test_every_spelling_of_candump(tmp_path):
    path = tmp_path / "spelled.log"
    long = bytes(range(64))
    path.write_text(
        "(1436509052.249713) vcan0 123##1" + long.hex() + "\n"
        "(1436509052.249714123) can3 12345678#0102 R\r\n"
        "(1436509053.5)  can0  RX - -  7E8   [2]  01 0D\n"
        "(1436509053.6)  can0  TX B E  7E0  [12]  " + long[:12].hex(" ") + "\n"
        "(1436509054) can0 123#R8\n"
        "(1436509054.1) can0 123#1122334455667788_9\n"
        "(1436509054.2) can0 123#112\n"
        "(1436509054.2) can0 1234#11\n"
        "() can0 123#11\n"
        "(1436509054.3) can0 123#GG"
    )
    log = read_candump(path, None, None)
    frames = log.frames
    start = 1436509052.0
    assert_allclose(frames.time - start, [0.249713, 0.249714, 1.5, 1.6, 2.1], atol=1e-6)
    assert_array_equal(frames.id, [0x123, 0x12345678, 0x7E8, 0x7E0, 0x123])
    assert_array_equal(frames.extended, [False, True, False, False, False])
    assert_array_equal(frames.channel, [0, 3, 1, 1, 1])
    assert [bytes(d[:n]) for d, n in zip(frames.data, frames.length, strict=True)] == [
        long, bytes((1, 2)), bytes((1, 13)), long[:12], bytes.fromhex("1122334455667788"),
    ]  # fmt: skip
    (note,) = log.problems
    assert has([note], "file.lines_left_out", file="spelled.log", count=4)
    assert "line 7: '(1436509054.2) can0 123#112'" in note.values["example"]


def test_text_of_another_kind_says_what_is_expected(tmp_path):
    path = tmp_path / "x.log"
    path.write_text("2024-01-01 server started\n")
    with refused("file.not_understood"):
        read_drive(path)


def test_python_can_csv_is_told_from_a_table(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text(
        "timestamp,arbitration_id,extended,remote,error,dlc,data\n"
        "1.5,0x7e8,0,0,0,8,A0ENMgAAAAA=\nnonsense\n2.5,0x7e8,0,0,0,8,A0ENMgAAAAA=\n"
    )
    drive = read_drive(path)
    assert_allclose(drive.signals["vehicle_speed"].values, 50 / 3.6)
    assert any(p.id == "file.lines_left_out" for p in drive.problems)


def test_missing_package_names_its_extra(tmp_path, monkeypatch):
    path = tmp_path / "x.log"
    path.write_text("(1.0) can0 7E8#03410D32\n")
    monkeypatch.setitem(sys.modules, "cantools", None)
    with pytest.raises(MissingExtraError, match=r'pip install "weighbridge\[can\]"'):
        read_drive(path, None, "a.dbc")


def same_frames(frames, expected):
    assert_allclose(frames.time, [m.timestamp for m in expected], atol=1e-6)
    assert_array_equal(frames.id, [m.arbitration_id for m in expected])
    assert_array_equal(frames.extended, [m.is_extended_id for m in expected])
    assert [bytes(d[:n]) for d, n in zip(frames.data, frames.length, strict=True)] == [
        bytes(m.data) for m in expected
    ]
    return True


TRACES = {
    "1.0": (
        ";   PCAN, version 1.0\n",
        "     1)      17   07E8 8 03 41 0D 32 00 00 00 00\n"
        "     2)      18 FFFFFFFF 4 00 00 00 08\n"
        "     3)     119 18FEF100 3 0A FD 0C\n"
        "     4)     120   0100 4 RTR\n"
        "     5)     121   0101 0\n",
    ),
    "1.1": (
        ";$FILEVERSION=1.1\n;$STARTTIME=44087.5185185185\n;\n",
        "     1)      17.1  Rx         07E8  8  03 41 0D 32 00 00 00 00\n"
        "     2)      18.4  Warng  FFFFFFFF  4  00 00 00 08  BUSHEAVY\n"
        "     3)     119.7  Tx     18FEF100  3  0A FD 0C\n"
        "     4)     120.0  Rx         0100  4  RTR\n",
    ),
    "1.3": (
        ";$FILEVERSION=1.3\n;$STARTTIME=44087.5185185185\n",
        "     1)      17.1 1  Rx        07E8 -  8    03 41 0D 32 00 00 00 00\n"
        "     2)     119.7 2  Tx    18FEF100 -  3    0A FD 0C\n"
        "     3)     119.8 2  Error     0100 -  2    00 01\n"
        "     4)     120.0 1  Rx        0100 -  4    RTR\n",
    ),
    "2.0": (
        ";$FILEVERSION=2.0\n;$STARTTIME=44087.5185185185\n;$COLUMNS=N,O,T,I,d,l,D\n",
        "      1      1059.900 DT     07E8 Rx 8  03 41 0D 32 00 00 00 00\n"
        "      2      1283.231 FD     0300 Rx 12 FD 01 02 03 04 05 06 07 08 09 0A 0B\n"
        "      3      1298.945 ST          Rx    00 00 00 00\n"
        "      4      1298.945 RR     0301 Rx 4\n"
        "      5      1323.201 FB 18FEF100 Tx 3  0A FD 0C\n",
    ),
    "2.1": (
        ";$FILEVERSION=2.1\n;$STARTTIME=44087.5185185185\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n",
        "      1      1059.900 DT 1     07E8 Rx -  8    03 41 0D 32 00 00 00 00\n"
        "      2      1283.231 FE 1     0300 Rx -  9    FD 01 02 03 04 05 06 07 08 09 0A 0B\n"
        "      3      1298.945 RR 1     0301 Rx -  4\n"
        "      4      1323.201 BI 2 18FEF100 Tx -  3    0A FD 0C\n",
    ),
}  # fmt: skip


@pytest.mark.parametrize("version", TRACES)
def test_traces_of_every_version_as_python_can_reads_them(tmp_path, version):
    path = tmp_path / "log.trc"
    path.write_text("".join(TRACES[version]))
    log = format_of(path).read(path, None, None)
    with can.TRCReader(path) as reader:
        expected = [m for m in reader if not m.is_remote_frame]
    assert log.problems == []
    assert same_frames(log.frames, expected)
    assert_array_equal(log.frames.channel, [m.channel for m in expected])
    assert_array_equal(log.frames.length, [8, *((12,) if "2." in version else ()), 3,
                                           *((0,) if version == "1.0" else ())])  # fmt: skip


def test_a_trace_of_another_version_is_refused(tmp_path):
    path = tmp_path / "log.trc"
    path.write_text(";$FILEVERSION=3.0\n 1 2 3\n")
    with error(DriveError, "log.trc TRC 3.0 1.0 1.1 1.3"):
        read_drive(path)


ASC_LINES = """   0.0172 1  7E8             Rx   d 8 03 41 0D 32 00 00 00 00  Length = 234910 BitCount = 121
   0.0180 1  Statistic: D 0 R 0 XD 88 XR 0 E 0 O 0 B 1.04%
   0.0181 CAN 1 Status:chip status error active
   0.0190 2  18FEF100x       Tx   d 3 0A FD 0C
   0.0200 1  100             Rx   r 4
   0.0210 1  ErrorFrame
   0.0300 CANFD   1 Rx        300                                   1 0 9 12 FD 01 02 03 04 05 06 07 08 09 0A 0B   130000  130 0 0 0 0 0 0
   0.0310 CANFD   2 Tx        18FF0001x  Some_Name                  1 0 2  2 11 22   130000  130 0 0 0 0 0 0
   0.0320 Li 2  10  Rx 2 00 00
"""  # noqa: E501


def test_vector_lines_as_python_can_reads_them(tmp_path):
    path = tmp_path / "log.asc"
    path.write_text(
        "date Tue Mar 3 03:04:05.250 pm 2020\nbase hex  timestamps absolute\n"
        f"internal events logged\n// version 9.0.0\n{ASC_LINES}"
    )
    log = format_of(path).read(path, None, None)
    with can.ASCReader(path, relative_timestamp=False) as reader:
        expected = [m for m in reader if not (m.is_remote_frame or m.is_error_frame)]
    assert log.problems == []
    assert same_frames(log.frames, expected)
    assert_array_equal(log.frames.channel, [1, 2, 1, 2])
    assert_array_equal(log.frames.length, [8, 3, 12, 2])


def test_vector_lines_in_decimals_on_relative_clocks(tmp_path):
    path = tmp_path / "log.asc"
    path.write_text(
        "date Tue Mar 3 03:04:05 2020\nbase dec  timestamps relative\n"
        "   0.5 1  2024  Rx d 2 255 16\n   0.25 1  Statistic: D 0\n   0.25 1  2025  Rx d 1 9\n"
    )
    frames = format_of(path).read(path, None, None).frames
    assert_allclose(np.diff(frames.time), 0.5)
    assert_array_equal(frames.id, [2024, 2025])
    assert_array_equal(frames.data[:, :2], [[255, 16], [9, 0]])


def test_one_damaged_line_does_not_cost_those_behind_it(tmp_path):
    for suffix, head, line in (
        (".asc", "base hex\n", "   {:.3f} 1  7E8  Rx  d 8 03 41 0D {} 0 0 0 0\n"),
        (".trc", TRACES["1.1"][0], "  1)  {:.3f}  Rx  07E8  8  03 41 0D {} 00 00 00 00\n"),
    ):  # fmt: skip
        path = tmp_path / f"log{suffix}"
        bytes_ = ["10", "20", "G?", "30", "40"]
        path.write_text(head + "".join(line.format(k, b) for k, b in enumerate(bytes_)))
        drive = read_drive(path)
        assert_allclose(drive.signals["vehicle_speed"].values * 3.6, [16, 32, 48, 64])
        assert drive.problems[0].id == "file.lines_left_out"
        assert drive.problems[0].values["count"] == 1
        assert drive.problems[0].values["lines"] == "5 lines"


def test_fd_frames_of_mf4(tmp_path):
    from asammdf import MDF, Signal, Source

    sent = [m for m in messages(True) if not m.is_remote_frame]
    kinds = [("BusChannel", "u1"), ("ID", "<u4"), ("IDE", "u1"), ("DLC", "u1"),
             ("DataLength", "u1"), ("EDL", "u1"), ("DataBytes", "(64,)u1")]  # fmt: skip
    rows = np.array(
        [(m.channel + 1, m.arbitration_id, m.is_extended_id, can.util.len2dlc(len(m.data)),
          len(m.data), m.is_fd, list(bytes(m.data).ljust(64, b"\0"))) for m in sent],
        [(f"CAN_DataFrame.{n}", k) for n, k in kinds],
    )  # fmt: skip
    times = np.array([m.timestamp for m in sent]) - START
    source = Source("CAN", "CAN", "", Source.SOURCE_BUS, Source.BUS_TYPE_CAN)
    path = tmp_path / "log.mf4"
    with MDF(version="4.11") as file:
        file.append(Signal(rows, times, name="CAN_DataFrame", source=source), acq_source=source)
        file.save(path)
    frames = format_of(path).read(path, None, None).frames
    assert_array_equal(frames.id, [m.arbitration_id for m in sent])
    assert [bytes(d[:n]) for d, n in zip(frames.data, frames.length, strict=True)] == [
        bytes(m.data) for m in sent
    ]


@pytest.mark.parametrize("name", ["drive.txt", "drive.dump"])
@pytest.mark.parametrize(
    "line", ["(1436509052.249713) can0 1A0#0102", " (003.5)  vcan1  18FEF100   [2]  01 02"]
)
def test_candump_is_known_by_its_first_line(tmp_path, name, line):
    (tmp_path / name).write_text(f"{line}\n")
    found = format_of(tmp_path / name)
    assert found.name == "candump text"
    assert len(found.read(tmp_path / name, None, None).frames) == 1
