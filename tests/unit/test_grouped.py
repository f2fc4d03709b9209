"""Tables with several clocks side by side."""

import tomllib

import numpy as np
import pytest
from numpy.testing import assert_allclose

from weighbridge import DriveError, read_drive
from weighbridge.io import format_of, mapping_text

ROWS = 40
T = 0.9 * np.arange(ROWS)


def speed(t):
    return 40.0 + t


def engine(t):
    return 1500.0 + 30.0 * t


HEADS = {
    # Names of one line, a place above each.
    "places": [
        "Monday,02,March,2026,08:00:00,VCDS Version: X",
        "A12 345,ADV,4 cyl,",
        ",,G023,F0,G035,F0,",
        "",
        "Marker,TIME,Group 23 - Field 0,TIME,Group 35 - Field 0,",
        ",STAMP,Vehicle speed,STAMP,Engine Speed,",
        ",, km/h,, /min,",
    ],
    # Names in two lines, in German; one group is not asked for.
    "two lines": [
        "Montag,02,März,2026",
        "",
        ",Block A:,'002,Block B:,'007,Block C:, Läuft nicht",
        ",,Fahrzeug-,,Motor-,,",
        ",Zeit,geschwindigkeit,Zeit,drehzahl,Zeit,",
        "Markierung,MARKE, km/h,MARKE, /min,MARKE,",
    ],
}


def written(path, head):
    rows = [("", f"{t:.2f}", speed(t), f"{t + 0.4:.2f}", engine(t + 0.4), "") for t in T]
    lines = [*head, *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("head", HEADS.values(), ids=HEADS)
def test_each_column_has_the_stamps_to_its_left(tmp_path, head):
    path = written(tmp_path / "log.csv", head)
    assert format_of(path).name == "grouped CSV"
    found = format_of(path).draft(path)
    units = {c.quantity: (c.unit, c.stated) for c in found.known}
    assert units == {"vehicle_speed": ("kmh", True), "engine_speed": ("rpm", True)}
    drive = read_drive(path, tomllib.loads(mapping_text([found])))
    assert not drive.problems
    v, n = drive.signals["vehicle_speed"], drive.signals["engine_speed"]
    assert_allclose(v.time, T)
    assert_allclose(n.time, T + 0.4)
    assert_allclose(3.6 * v.values, speed(v.time))
    assert_allclose(n.values * 30.0 / np.pi, engine(n.time))


def test_sheets_of_two_rates(tmp_path):
    lines = ["Time 1 [s];Speed [km/h];Time 2 [ms];RPM;Torque [Nm]"]
    for k in range(ROWS):
        fast = f"{20 * k};{900 + k};{k % 7}" if k < 25 else ";;"
        lines.append(f"{k / 10:.1f};{k % 9};{fast}")
    path = tmp_path / "sheet.csv"
    path.write_text("\n".join(lines) + "\n")
    found = format_of(path).draft(path)
    drive = read_drive(path, tomllib.loads(mapping_text([found])))
    assert_allclose(drive.signals["vehicle_speed"].time, np.arange(ROWS) / 10)
    assert_allclose(drive.signals["engine_torque"].time, 0.02 * np.arange(25))


def test_a_mapping_that_says_how_the_text_is_written_reads_a_plain_table(tmp_path):
    path = written(tmp_path / "log.csv", HEADS["places"])
    plain = {
        "csv": {"skip_rows": 5, "skip_after_header": 1},
        "time": {"column": "STAMP"},
        "signals": {"engine_speed": {"column": "Engine Speed", "unit": "rpm"}},
    }
    drive = read_drive(path, plain)
    assert_allclose(drive.signals["engine_speed"].time, T)


def test_a_time_that_is_none_of_them_is_named(tmp_path):
    path = written(tmp_path / "log.csv", HEADS["places"])
    mapping = {"time": {"column": "Clock"}, "signals": {"engine_speed": {"column": "Engine Speed"}}}
    with pytest.raises(DriveError, match="'STAMP'"):
        read_drive(path, mapping)


@pytest.mark.parametrize(
    "text",
    [
        "GPS Time,Device Time,Speed,RPM\n1,2,3,4\n2,3,4,5\n3,4,5,6\n",
        "time,speed,accuracy,fix time,course\n1,2,3,4,5\n2,3,4,5,6\n3,4,5,6,7\n",
        "Time,Speed,Time,Dwell\n1,2,5,4\n2,3,4,5\n3,4,6,6\n",
        "",
        "\n\n\n",
    ],
)
def test_other_tables_are_none(tmp_path, text):
    path = tmp_path / "log.csv"
    path.write_text(text)
    assert format_of(path).name != "grouped CSV"
