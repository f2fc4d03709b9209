"""Text of CAN frames: tables, CRTD, CanKing and BUSMASTER; candump's other stamps."""

import sys
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import error, has

from weighbridge import DriveError, read_drive
from weighbridge.io import format_of

GOLDEN = Path(__file__).parents[1] / "golden"
DAY = datetime(2026, 3, 5, 22, 15)
EPOCH = 1_600_000_000.0


@pytest.fixture(scope="module")
def sent():
    """Frames that the golden CAN logs hold, with times since the first."""
    sys.path.insert(0, str(GOLDEN))
    try:
        from make_can_logs import frames
    finally:
        sys.path.remove(str(GOLDEN))
    found = [m for m in frames() if len(m.data) <= 8][:400]
    first = found[0].timestamp
    return [(m.timestamp - first, m.arbitration_id, m.is_extended_id, bytes(m.data)) for m in found]


def clx(sent):
    lines = ["# Logger type: CAN Logger", '# Value separator: ";"', "Timestamp;Type;ID;Data"]
    for t, number, extended, data in sent:
        at = np.datetime64(DAY, "ms") + np.timedelta64(round(1000 * t), "ms")
        stamp = str(at).replace("-", "").replace(":", "").replace(".", "")
        lines.append(f"{stamp};{int(extended)};{number:x};{data.hex()}")
    return lines


def kvaser(sent):
    lines = ["Time,Channel,ID,Flags,DLC,D0,D1,D2,D3,D4,D5,D6,D7,Counter"]
    for k, (t, number, extended, data) in enumerate(sent):
        told = ",".join(str(data[j]) if j < len(data) else "" for j in range(8))
        lines.append(f"{t:.6f},0,{number},{'X' if extended else ''},{len(data)},{told},{k}")
    return lines


def vehicle_spy(sent):
    names = ["Line", "Abs Time(Sec)", "Rel Time (Sec)", "Status", "Network", "Arb ID", "Xtd"]
    lines = ["File created by a bus tool", ",".join([*names, *(f"B{k}" for k in range(1, 9))])]
    for k, (t, number, extended, data) in enumerate(sent):
        told = [f"{data[j]:02X}" if j < len(data) else "" for j in range(8)]
        row = [k + 1, f"{t:.6f}", 0.1, 64, "HS CAN", f"{number:X}", "T" if extended else "F", *told]
        lines.append(",".join(f'"{x}"' if x == "HS CAN" else str(x) for x in row))
    return lines


def canking(sent):
    lines = ["Chn Identifier Flg   DLC  D0...1...2...3...4...5...6..D7       Time     Dir"]
    for t, number, extended, data in sent:
        told = "  ".join(f"{b:02X}" for b in data)
        mark = "X" if extended else " "
        lines.append(f" 0    {number:08X} {mark}   {len(data)}  {told}  {t:12.6f} R")
    return [*lines, "Logging stopped"]


def busmaster(sent):
    lines = ["***BUSMASTER Ver 3.2.2***", "***PROTOCOL CAN***", "***HEX***", "***SYSTEM MODE***"]
    for t, number, extended, data in sent:
        # The log goes over midnight.
        at = (86_390.0 + t) % 86_400.0
        part = f"{int(at // 3600)}:{int(at // 60) % 60}:{int(at % 60)}:{round(at % 1.0 * 1e4):04d}"
        kind = "x" if extended else "s"
        lines.append(f"{part} Rx 1 0x{number:X} {kind} {len(data)} {data.hex(' ').upper()} ")
    return [*lines, "***[STOP LOGGING SESSION]***"]


def gvret(sent, direction=True):
    lines = [f"Time Stamp,ID,Extended,{'Dir,' * direction}Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8"]
    for t, number, extended, data in sent:
        told = "".join(f"{b:02X}," for b in data)
        lines.append(
            f"{round((EPOCH + t) * 1e6)},{number:08X},{str(extended).lower()},"
            f"{'Rx,' * direction}0,{len(data)},{told}"
        )
    return lines


def absolute(sent):
    lines = ['"Bus";"Time (abs)";"ID (hex)";"Ext";"DLC";"Data (hex)"']
    for t, number, extended, data in sent:
        row = ("CAN1", f"{t:.6f}", f"{number:X}", int(extended), len(data), data.hex(" "))
        lines.append(";".join(f'"{cell}"' for cell in row))
    return lines


def crtd(sent):
    lines = [f"{EPOCH:.6f} CXX Info Type:crtd; Path:'/sd/drive.crtd'; Filter:off;"]
    for k, (t, number, extended, data) in enumerate(sent):
        kind = f"1{'T' if k % 7 == 0 else 'R'}{29 if extended else 11}"
        lines.append(f"{EPOCH + t:.6f} {kind} {number:X} {data.hex(' ').upper()}")
        if k % 10 == 0:
            lines.append(f"{EPOCH + t:.6f} CEV Event vehicle.on")
    return lines


def candump_by(stamps):
    def lines(sent):
        times = stamps([t for t, *_ in sent])
        return [
            f" ({stamp})  can0  {number:0{8 if extended else 3}X}   [{len(data)}]  "
            f"{data.hex(' ').upper()}"
            for stamp, (_, number, extended, data) in zip(times, sent, strict=True)
        ]

    return lines


def dates(times):
    return [str(np.datetime64(DAY) + np.timedelta64(round(1e6 * t), "us")).replace("T", " ")
            for t in times]  # fmt: skip


def steps(times):
    return [f"{b - a:010.6f}" for a, b in zip([times[0], *times], times, strict=False)]


FORMS = {
    "clx000.txt": ("table of CAN frames", clx, 1e-3),
    "kvaser.csv": ("table of CAN frames", kvaser, 1e-6),
    "spy.csv": ("table of CAN frames", vehicle_spy, 1e-6),
    "gvret.csv": ("table of CAN frames", gvret, 1e-6),
    "old.csv": ("table of CAN frames", lambda sent: gvret(sent, direction=False), 1e-6),
    "abs.csv": ("table of CAN frames", absolute, 1e-6),
    "drive.crtd": ("OVMS CRTD", crtd, 1e-6),
    "crtd.log": ("OVMS CRTD", crtd, 1e-6),
    "king.txt": ("CanKing", canking, 1e-6),
    "master.log": ("BUSMASTER", busmaster, 1e-4),
    "dates.log": ("candump", candump_by(dates), 1e-5),
    "dates.txt": ("candump text", candump_by(dates), 1e-5),
    "steps.txt": ("candump text", candump_by(steps), 1e-3),
}


@pytest.mark.parametrize("name", FORMS)
def test_frames_come_back(tmp_path, sent, name):
    form, write, step = FORMS[name]
    path = tmp_path / name
    path.write_text("\n".join(write(sent)) + "\n")
    assert format_of(path).name == form
    log = format_of(path).read(path, None, None)
    assert log.problems == []
    frames = log.frames
    assert_allclose(frames.time - frames.time[0], [t for t, *_ in sent], atol=1.1 * step)
    assert_array_equal(frames.id, [number for _, number, *_ in sent])
    assert_array_equal(frames.extended, [extended for _, _, extended, _ in sent])
    held = zip(frames.data, frames.length, strict=True)
    assert [bytes(d[:n]) for d, n in held] == [data for *_, data in sent]
    if form.startswith("candump") and "dates" in name:
        assert frames.time[0] == pytest.approx(DAY.timestamp())


def test_fd_frames_and_lines_that_are_none(tmp_path, sent):
    path = tmp_path / "log.csv"
    text = "\n".join(gvret(sent[:5]))
    long = ",".join(f"{k:02X}" for k in range(64))
    path.write_text(
        f"{text}\n1600000100000000,00000123,false,Rx,1,64,{long},\n7,xyz,false,Rx,0,8,1\n"
    )
    log = format_of(path).read(path, None, None)
    assert log.frames.length[-1] == 64
    assert_array_equal(log.frames.data[-1], np.arange(64))
    assert has(log.problems, "file.lines_left_out", count=1, lines="7 lines")
    path = tmp_path / "log.crtd"
    bad = "1600000100.0 1R11 12 0 1\n1600000100.0 1R29 FFFFFFFF 00\n"
    path.write_text("\n".join([*crtd(sent[:5]), bad]))
    log = format_of(path).read(path, None, None)
    assert len(log.frames) == 5
    assert has(log.problems, "file.lines_left_out", count=2, lines="7 lines")


@pytest.mark.parametrize("name", ["gvret.csv", "drive.crtd", "clx000.txt", "king.txt"])
def test_no_frame_is_one_sentence(tmp_path, name):
    path = tmp_path / name
    path.write_text("\n".join(FORMS[name][1]([])) + "\n")
    with pytest.raises(DriveError, match="holds no CAN frame"):
        read_drive(path)


def test_frames_without_times_are_refused_by_that_cause(tmp_path):
    path = tmp_path / "bare.txt"
    path.write_text("  can0  100   [8]  11 22 33 44 55 66 77 88\n" * 20)
    with error(DriveError, "bare.txt -l"):
        format_of(path).read(path, None, None)


@settings(max_examples=60, deadline=None)
@given(
    name=st.sampled_from([*FORMS]), part=st.floats(0.0, 1.0), at=st.floats(0.0, 1.0),
    junk=st.binary(max_size=16),
)  # fmt: skip
def test_damage_leaves_signals_or_one_sentence(sent, assert_damage_is_told, name, part, at, junk):
    assert_damage_is_told(name, "\n".join(FORMS[name][1](sent)).encode(), part, at, junk)
