"""Frames of every kind, written by python-can, come back as they were."""

import sys

import can
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from weighbridge.errors import DriveError, MissingExtraError
from weighbridge.io.candump import read_candump
from weighbridge.io.read import READERS, read_drive

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
    [(".blf", True), (".asc", True), (".log", True), (".log", False), (".trc", False),
     (".csv", False)],
)  # fmt: skip
def test_frames_come_back(tmp_path, suffix, fd):
    sent = messages(fd)
    path = tmp_path / f"log{suffix}"
    with can.Logger(path) as logger:
        for message in sent:
            logger(message)
    log = READERS[suffix](path, None, None)
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
    assert "1 of 5 lines" in log.problems[0].text


def test_text_of_another_kind_says_what_is_expected(tmp_path):
    path = tmp_path / "x.log"
    path.write_text("2024-01-01 server started\n")
    with pytest.raises(DriveError, match="no line reads like candump's"):
        read_drive(path)


def test_python_can_csv_is_told_from_a_table(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text(
        "timestamp,arbitration_id,extended,remote,error,dlc,data\n"
        "1.5,0x7e8,0,0,0,8,A0ENMgAAAAA=\nnonsense\n2.5,0x7e8,0,0,0,8,A0ENMgAAAAA=\n"
    )
    drive = read_drive(path)
    assert_allclose(drive.signals["vehicle_speed"].values, 50 / 3.6)
    assert any("1 of 3 lines" in p.text for p in drive.problems)


@pytest.mark.parametrize(
    ("module", "suffix", "dbc"), [("can", ".asc", ()), ("cantools", ".log", "a.dbc")]
)
def test_missing_package_names_its_extra(tmp_path, monkeypatch, module, suffix, dbc):
    path = tmp_path / f"x{suffix}"
    path.write_text("(1.0) can0 7E8#03410D32\n")
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=r'pip install "weighbridge\[can\]"'):
        read_drive(path, None, dbc)
