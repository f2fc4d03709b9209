"""GVRET CSV of SavvyCAN and CRTD of OVMS: frames of the golden logs in their documented forms."""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from weighbridge.errors import DriveError
from weighbridge.io import read_drive
from weighbridge.io.bus_text import read_crtd, read_gvret
from weighbridge.io.formats import format_of

GOLDEN = Path(__file__).parents[1] / "golden"


@pytest.fixture(scope="module")
def sent():
    """Frames that the golden CAN logs hold."""
    sys.path.insert(0, str(GOLDEN))
    try:
        from make_can_logs import frames
    finally:
        sys.path.remove(str(GOLDEN))
    return list(frames())


def gvret(sent, direction=True):
    lines = [f"Time Stamp,ID,Extended,{'Dir,' * direction}Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8"]
    for m in sent:
        data = "".join(f"{b:02X}," for b in m.data)
        lines.append(
            f"{round(m.timestamp * 1e6)},{m.arbitration_id:08X},{str(m.is_extended_id).lower()},"
            f"{'Rx,' * direction}{m.channel},{len(m.data)},{data}"
        )
    return "\n".join(lines) + "\n"


def crtd(sent):
    lines = [f"{sent[0].timestamp:.6f} CXX Info Type:crtd; Path:'/sd/drive.crtd'; Filter:off;"]
    for k, m in enumerate(sent):
        kind = f"{m.channel + 1}{'T' if k % 7 == 0 else 'R'}{29 if m.is_extended_id else 11}"
        data = m.data.hex(" ").upper()
        lines.append(f"{m.timestamp:.6f} {kind} {m.arbitration_id:X} {data}")
        if k % 10 == 0:
            lines.append(f"{m.timestamp:.6f} CEV Event vehicle.on")
    return "\n".join(lines) + "\n"


WRITTEN = {
    "gvret.csv": gvret,
    "old.csv": lambda sent: gvret(sent, direction=False),
    "drive.crtd": crtd,
    "crtd.log": crtd,
}


def written(folder, name, sent):
    path = folder / name
    path.write_text(WRITTEN[name](sent))
    return path


@pytest.mark.parametrize("name", WRITTEN)
def test_frames_come_back(tmp_path, sent, name):
    path = written(tmp_path, name, sent)
    log = format_of(path).read(path, None, None)
    assert log.absolute
    assert log.problems == []
    np.testing.assert_allclose(log.frames.time, [m.timestamp for m in sent], atol=1e-6)
    assert_array_equal(log.frames.id, [m.arbitration_id for m in sent])
    assert_array_equal(log.frames.extended, [m.is_extended_id for m in sent])
    shift = 1 if read_crtd is format_of(path).read else 0
    assert_array_equal(log.frames.channel, [m.channel + shift for m in sent])
    held = zip(log.frames.data, log.frames.length, strict=True)
    assert [bytes(d[:n]) for d, n in held] == [bytes(m.data) for m in sent]


@pytest.mark.parametrize("name", WRITTEN)
def test_signals_are_those_of_the_golden_logs(tmp_path, sent, name):
    mapping = {"signals": {"accel_x": {"column": "AccX", "unit": "mps2", "optional": True}}}
    found = read_drive(written(tmp_path, name, sent), mapping, GOLDEN / "golden.dbc")
    golden = read_drive(GOLDEN / "can.log", mapping, GOLDEN / "golden.dbc")
    assert set(found.signals) == set(golden.signals)
    for signal, expected in golden.signals.items():
        assert_array_equal(found.signals[signal].values, expected.values)


def test_fd_frames_and_lines_that_are_none(tmp_path, sent):
    path = tmp_path / "log.csv"
    text = gvret(sent[:5])
    long = ",".join(f"{k:02X}" for k in range(64))
    path.write_text(
        f"{text}1600000100000000,00000123,false,Rx,1,64,{long},\n7,xyz,false,Rx,0,8,1\n"
    )
    log = read_gvret(path, None, None)
    assert log.frames.length[-1] == 64
    assert_array_equal(log.frames.data[-1], np.arange(64))
    assert log.problems[0].id == "file.lines_left_out"
    assert log.problems[0].values["count"] == 1
    assert log.problems[0].values["lines"] == "7 lines"
    path = tmp_path / "log.crtd"
    path.write_text(crtd(sent[:5]) + "1600000100.0 1R11 12 0 1\n1600000100.0 1R29 FFFFFFFF 00\n")
    log = read_crtd(path, None, None)
    assert len(log.frames) == 5
    assert log.problems[0].id == "file.lines_left_out"
    assert log.problems[0].values["count"] == 2
    assert log.problems[0].values["lines"] == "7 lines"


@pytest.mark.parametrize("name", WRITTEN)
def test_no_frame_is_one_sentence(tmp_path, sent, name):
    path = tmp_path / name
    path.write_text(WRITTEN[name](sent[:1]).splitlines()[0] + "\n")
    with pytest.raises(DriveError, match="holds no CAN frame"):
        read_drive(path)


@pytest.mark.parametrize("name", ["gvret.csv", "drive.crtd"])
@settings(max_examples=40, deadline=None)
@given(part=st.floats(0.0, 1.0), at=st.floats(0.0, 1.0), junk=st.binary(max_size=16))
def test_damage_leaves_signals_or_one_sentence(sent, assert_damage_is_told, name, part, at, junk):
    assert_damage_is_told(name, WRITTEN[name](sent).encode(), part, at, junk)
