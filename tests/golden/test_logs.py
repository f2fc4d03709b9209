"""Every log format gives the same drive."""

import math
from pathlib import Path

import pytest
from make_logs import truth
from numpy.testing import assert_allclose
from tests.noted import has

from weighbridge import read_drive
from weighbridge.io import format_of

HERE = Path(__file__).parent


@pytest.mark.parametrize("folder", ["csv", "parquet"])
def test_canonical_folder(folder):
    drive = read_drive(HERE / folder)
    assert drive.name == folder
    assert drive.problems == ()
    assert len(drive.signals) == 13
    assert drive.signals["accel_x"].time is drive.signals["gyro_z"].time
    assert {n: len(s) for n, s in drive.signals.items() if n in ("accel_x", "altitude")} == {
        "accel_x": 251,
        "altitude": 6,
    }
    for name, signal in drive.signals.items():
        assert_allclose(signal.values, truth(name, signal.time), rtol=1e-12, atol=1e-12)
    assert drive.info.vehicle == "golden"
    assert drive.info.mass == 1580.0
    assert drive.info.ambient_temperature == 293.15
    assert drive.info.wind_from == pytest.approx(math.pi / 2)


def test_foreign_csv():
    drive = read_drive(HERE / "foreign.csv", HERE / "foreign.toml")
    assert drive.problems == ()
    assert set(drive.signals) == {
        "vehicle_speed",
        "engine_speed",
        "longitudinal_accel",
        "altitude",
    }
    speed = drive.signals["vehicle_speed"]
    assert_allclose(speed.time[[0, 1, -1]], [0.0, 0.25, 5.0])
    for name in ("vehicle_speed", "engine_speed", "altitude"):
        signal = drive.signals[name]
        assert_allclose(signal.values, truth(name, signal.time), rtol=1e-9, atol=1e-9)
    assert_allclose(drive.signals["longitudinal_accel"].values, 1.5, rtol=1e-9)


def test_mf4_by_canonical_names_keeps_every_clock():
    pytest.importorskip("asammdf")
    drive = read_drive(HERE / "log.mf4")
    assert set(drive.signals) == {"vehicle_speed", "engine_speed", "accel_x", "accel_y", "accel_z"}
    assert len(drive.signals["vehicle_speed"]) == 21
    assert len(drive.signals["accel_x"]) == 251
    assert drive.signals["accel_x"].time is drive.signals["accel_z"].time
    for name, signal in drive.signals.items():
        assert_allclose(signal.values, truth(name, signal.time), rtol=1e-12, atol=1e-12)


def test_mf4_by_mapping():
    pytest.importorskip("asammdf")
    mapping = {
        "time": {"offset_s": 10},
        "signals": {
            "engine_torque": {"column": "MotTrq"},
            "vehicle_speed": {"column": "Vehicle_Speed", "factor": 2},
            "gear": {"column": "Gang"},
        },
    }
    drive = read_drive(HERE / "log.mf4", mapping)
    assert_allclose(drive.signals["engine_torque"].values, 80.0)
    assert_allclose(drive.signals["engine_torque"].time[[0, -1]], [10.0, 15.0])
    assert_allclose(drive.signals["vehicle_speed"].values[-1], 2 * 1.5 * 5.0)
    assert has(drive.problems, "file.column_missing", column="Gang", signal="gear")


def test_formats_of_one_drive_can_be_joined():
    pytest.importorskip("asammdf")
    gnss = HERE / "csv" / "gnss.csv"
    drive = read_drive([HERE / "log.mf4", gnss])
    assert drive.name == "log+1"
    assert drive.has("accel_x", "latitude", "gnss_speed")


def test_a_draft_tells_the_rate_of_each_clock():
    path = HERE / "log.mf4"
    assert {column.rate for column in format_of(path).draft(path).columns} == {4.0, 50.0}
