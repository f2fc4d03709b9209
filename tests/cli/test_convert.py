"""``weighbridge convert``: what is written reads back as the same drive."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import named, says

from weighbridge import read_drive

GOLDEN = Path(__file__).parents[1] / "golden"
MAP = """
[signals.accel_x]
column = "Sensor.Forward"
valid = "Valid"
[signals.altitude]
column = "Height"
"""


@pytest.fixture
def mapping(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(MAP)
    return path


@pytest.mark.parametrize(
    ("out", "more"), [("drive", ()), ("drive", ("--format", "csv")), ("drive.mf4", ())]
)
def test_round_trip_loses_nothing(weighbridge, tmp_path, mapping, out, more):
    dbc = GOLDEN / "golden.dbc"
    ran = weighbridge(
        "convert", GOLDEN / "can.blf", tmp_path / out, "--mapping", mapping, "--dbc", dbc, *more
    )
    assert ran.code == 0
    assert "not known: 20 frames" in ran.out
    assert "7 signals" in ran.out
    first = read_drive(GOLDEN / "can.blf", mapping, dbc)
    again = read_drive(tmp_path / out)
    assert set(again.signals) == set(first.signals)
    assert again.info == first.info
    assert again.problems == ()
    for name, signal in first.signals.items():
        assert_array_equal(again.signals[name].time, signal.time)
        assert_allclose(again.signals[name].values, signal.values, rtol=1e-14, atol=1e-14)


def test_what_is_known_of_the_drive_goes_along(weighbridge, tmp_path):
    assert weighbridge("convert", GOLDEN / "csv", tmp_path / "a.mf4").code == 0
    assert weighbridge("convert", tmp_path / "a.mf4", tmp_path / "b").code == 0
    first, again = read_drive(GOLDEN / "csv"), read_drive(tmp_path / "b")
    assert again.info == first.info
    assert again.info.mass == 1580.0
    assert set(again.signals) == set(first.signals)
    assert np.array_equal(again.signals["accel_z"].values, first.signals["accel_z"].values)


def test_nothing_is_overwritten_unasked(weighbridge, tmp_path):
    out = tmp_path / "drive"
    assert weighbridge("convert", GOLDEN / "csv", out, "--format", "csv").code == 0
    refused = weighbridge("convert", GOLDEN / "can.blf", out)
    assert refused.code == 2
    assert named(refused.err, "drive --force")
    assert weighbridge("convert", GOLDEN / "can.blf", out, "--force").code == 0
    # Tables of the drive that was there are gone: both could not be one drive.
    assert sorted(p.name for p in out.iterdir()) == ["drive.toml", "obd.parquet"]
    assert not read_drive(out).has("accel_z")


def test_impossible_outputs_are_one_line(weighbridge, tmp_path):
    log = GOLDEN / "can.blf"
    for out, said in (("a.blf", ".mf4 .blf"), ("no/a.mf4", tmp_path / "no")):
        ran = weighbridge("convert", log, tmp_path / out)
        assert ran.code == 2
        assert named(ran.err, said)
    ran = weighbridge("convert", log, log)
    assert ran.code == 2
    assert named(ran.err, log)
    ran = weighbridge("convert", log, tmp_path / "x", "--format", "xlsx")
    assert ran.code == 2


def test_a_serious_doubt_is_not_converted_away(weighbridge, tmp_path):
    rows = []
    for k in range(60):
        for bus, speed in ((0, 20), (1, 90)):
            rows.append(f"({100 + 0.5 * k + 0.1 * bus:.6f}) can{bus} 7E8#03410D{speed:02X}00000000")
    (tmp_path / "two.log").write_text("\n".join(rows))
    ran = weighbridge("convert", tmp_path / "two.log", tmp_path / "out")
    assert ran.code == 2
    assert says(ran.err, "vehicle.two_units", signal="vehicle_speed")
    assert not (tmp_path / "out").exists()


def test_inspect_tells_what_a_raw_log_holds(weighbridge, mapping):
    ran = weighbridge(
        "inspect", GOLDEN / "can.blf", "--mapping", mapping, "--dbc", GOLDEN / "golden.dbc"
    )
    assert ran.code == 0
    for said in (
        "160 CAN frames",
        "golden.dbc: Sensor (40): accel_x, altitude",
        "PIDs 0C (20)",
        "not known: 20 frames: CAN 2 456 (20)",
        "vehicle_speed (20 for 20)",
    ):
        assert said in ran.out


def test_dbc_that_is_not_there_is_one_line(weighbridge):
    ran = weighbridge("inspect", GOLDEN / "can.blf", "--dbc", "nowhere.dbc")
    assert ran.code == 2
    assert named(ran.err, "--dbc nowhere.dbc")
