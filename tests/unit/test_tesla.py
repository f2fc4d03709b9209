"""Tesla's Track Mode: units, laps whose time begins anew, damage."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from tests.noted import error

from weighbridge import DriveError, read_drive
from weighbridge.io import format_of

HEAD = (
    "Lap,Elapsed Time (ms),Speed (MPH),Latitude (decimal),Longitude (decimal),"
    "Lateral Acceleration (m/s^2),Longitudinal Acceleration (m/s^2),Throttle Position (%),"
    "Brake Pressure (bar),Power Level (KW)"
)


def text(laps=3, rows=20, head=HEAD):
    lines = [head]
    for lap in range(laps):
        for k in range(rows):
            place = "0,0" if lap == 0 and k < 5 else f"{36.5 + 1e-5 * k},-121.7"
            lines.append(f"{lap},{50 * k},{30 + k},{place},0.1,0.2,{4 * k},0.0,12")
    return "\n".join(lines) + "\n"


def written(folder, content):
    path = folder / "telemetry-v1-2026-05-01-10_00_00.csv"
    path.write_text(content)
    return path


def test_laps_are_one_drive(tmp_path):
    path = written(tmp_path, text())
    assert format_of(path).name == "Tesla Track Mode CSV"
    drive = read_drive(path)
    speed = drive.signals["vehicle_speed"]
    assert_allclose(speed.time, 0.05 * np.arange(60), atol=1e-9)
    assert_allclose(speed.values, np.tile(30.0 + np.arange(20), 3) * 0.44704)
    assert_allclose(drive.signals["accelerator_pedal"].values[:20], 0.04 * np.arange(20))
    assert len(drive.signals["latitude"]) == 55
    assert not drive.has("longitudinal_accel")


def test_kilometres_an_hour(tmp_path):
    drive = read_drive(written(tmp_path, text(head=HEAD.replace("MPH", "KPH"))))
    assert_allclose(drive.signals["vehicle_speed"].values[0], 30.0 / 3.6)


def test_a_mapping_reads_it_as_a_plain_table(tmp_path):
    mapping = {
        "time": {"column": "Elapsed Time (ms)"},
        "signals": {"longitudinal_accel": {"column": "Longitudinal Acceleration (m/s^2)"}},
    }
    drive = read_drive(written(tmp_path, text(laps=1)), mapping)
    assert_allclose(drive.signals["longitudinal_accel"].values, 0.2)


def test_no_known_column_is_one_sentence(tmp_path):
    content = "Lap,Elapsed Time (ms),Speed (furlong)\n0,0,1\n0,50,1\n"
    with error(DriveError, "telemetry-v1-2026-05-01-10_00_00.csv"):
        read_drive(written(tmp_path, content))


@settings(max_examples=40, deadline=None)
@given(cut=st.integers(0, 3000), junk=st.binary(max_size=8))
def test_damage_leaves_signals_or_one_sentence(tmp_path_factory, assert_salvaged, cut, junk):
    path = tmp_path_factory.mktemp("cut") / "telemetry.csv"
    path.write_bytes(text().encode()[:cut] + junk)
    assert_salvaged(path)
