"""Readers of text count the lines that they do not understand, and refuse a text of such lines."""

import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import refused

from weighbridge import read_drive
from weighbridge.io.frame_text import read_asc, read_candump, read_crtd, read_frame_table, read_trc

CANDUMP = "({:.6f}) can1 1A0#0102"
CRTD = "{:.6f} 1R11 1A0 01 02"
ASC = "   {:.6f} 1  1A0             Rx   d 2 01 02"
PEAK = "  {0:.0f})  {0:.1f}  Rx  01A0  2  01 02"
HACKER = "{:.3f}  1A0  2  01 02"
GVRET = "{:.0f},000001A0,false,Rx,0,2,01,02,"
CSV = "{:.6f},0x1a0,0,0,0,2,AQI="

READERS = {
    "a.log": (read_candump, "", CANDUMP),
    "a.crtd": (read_crtd, "", CRTD),
    "a.asc": (read_asc, "base hex timestamps absolute\n", ASC),
    "p.trc": (read_trc, ";$FILEVERSION=1.1\n", PEAK),
    "h.trc": (read_trc, "Time ID DLC Data Comment\n", HACKER),
    "g.csv": (read_frame_table, "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2\n", GVRET),
    "c.csv": (read_frame_table, "timestamp,arbitration_id,extended,remote,error,dlc,data\n", CSV),
}


@pytest.mark.parametrize("name", READERS)
def test_what_is_not_understood_is_told_with_a_line(tmp_path, name):
    read, head, form = READERS[name]
    lines = [form.format(k) for k in range(1, 11)]
    lines[6] = lines[6].replace("1A0", "XYZ").replace("1a0", "xyz")
    (tmp_path / name).write_text(f"{head}{chr(10).join(lines)}\n")
    log = read(tmp_path / name, None, None)
    assert len(log.frames) == 9
    (found,) = log.problems
    assert found.values["count"] == 1
    assert f"line {7 + head.count(chr(10))}" in found.text


@pytest.mark.parametrize("name", READERS)
def test_a_text_of_which_most_is_not_understood_is_refused(tmp_path, name):
    read, head, form = READERS[name]
    lines = [form.format(k) for k in range(1, 11)]
    lines[2:8] = [line.replace("1A0", "XYZ").replace("1a0", "xyz") for line in lines[2:8]]
    (tmp_path / name).write_text(f"{head}{chr(10).join(lines)}\n")
    with refused("file.not_understood") as found:
        read(tmp_path / name, None, None)
    values = found.value.problem.values
    assert (values["count"], values["lines"].split()[0]) == (6, "10")


@pytest.mark.parametrize(
    ("head", "lines"),
    [
        (
            "Time   ID     DLC Data                    Comment",
            ["00,250 18FEF100 8 F3 00 32 C0 FF FF FF FF", "00,260 7E8      2 01 0D"],
        ),
        ("Timestamp DLC CanID Data", ["250 8 18FEF100 F3 00 32 C0 FF FF FF FF", "260 2 7E8 01 0D"]),
    ],
)
def test_a_trace_is_read_by_the_names_of_its_columns(tmp_path, head, lines):
    (tmp_path / "t.trc").write_text("\r\n".join([head, *lines, ""]))
    frames = read_trc(tmp_path / "t.trc", None, None).frames
    assert_allclose(frames.time, [0.25, 0.26])
    assert_array_equal(frames.id, [0x18FEF100, 0x7E8])
    assert_array_equal(frames.extended, [True, False])
    assert_array_equal(frames.length, [8, 2])
    assert_array_equal(frames.data[1, :2], [1, 13])


def test_a_trace_without_names_is_not_taken_for_another_form(tmp_path):
    lines = [f"{k / 100:06.3f} 135 8 84 0E {k:02X} 00 00 24 10 08" for k in range(50)]
    (tmp_path / "t.trc").write_text("\n".join(lines))
    with refused("file.not_understood"):
        read_trc(tmp_path / "t.trc", None, None)


def test_decimal_commas_between_commas_are_refused(tmp_path):
    lines = [f"{k},{k % 10},50,{k % 7}" for k in range(40)]
    (tmp_path / "t.csv").write_text("\n".join(["time_s,vehicle_speed_kmh", *lines]))
    with refused("file.not_understood") as found:
        read_drive(tmp_path / "t.csv")
    assert "such as line 2" in str(found.value)


def test_lines_of_another_form_in_a_table_are_told(tmp_path):
    lines = [f"{k},{k % 10}" for k in range(40)]
    lines[4] = "4,5,77"
    lines[9] = "-- logging paused"
    (tmp_path / "t.csv").write_text("\n".join(["time_s,vehicle_speed_kmh", *lines]))
    found = next(p for p in read_drive(tmp_path / "t.csv").problems if p.id == "file.rows_strange")
    assert (found.values["count"], found.values["lines"]) == (2, "40 lines")
    assert "line 6: '4,5,77'" in found.text


def test_quotes_and_empty_cells_behind_the_last_column_are_no_damage(tmp_path):
    rows = [f'{k},"a,b",{k % 10},,' if k % 2 else f'{k},"c\nd",{k % 10}' for k in range(40)]
    (tmp_path / "t.csv").write_text("\n".join(["time_s,note,vehicle_speed_kmh", *rows, ""]))
    drive = read_drive(tmp_path / "t.csv")
    assert not any(p.id == "file.rows_strange" for p in drive.problems)
    assert len(drive.signals["vehicle_speed"]) == 40
