"""A log of openpilot, written by its published schema: packed, plain, cut off."""

import bz2
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from make_openpilot_log import AGE, START, STEP, STEPS, truth
from numpy.testing import assert_allclose
from tests.noted import error, has

from weighbridge import DriveError, MissingExtraError, read_drive
from weighbridge.io import draft_bus, format_of, load_dbcs

pytest.importorskip("capnp")
zstandard = pytest.importorskip("zstandard")

LOG = Path(__file__).with_name("openpilot_rlog.bz2")
TIME = np.arange(STEPS) * STEP
PLAIN = bz2.decompress(LOG.read_bytes())
DBC = """VERSION ""
BU_: A
BO_ 2024 Answer: 8 A
 SG_ Revs : 31|16@0+ (0.25,0) [0|16000] "rpm" A
"""


@pytest.fixture(params=["rlog.bz2", "rlog.zst", "route--0--qlog.zst", "rlog"])
def log(request, tmp_path):
    data = {"bz2": bz2.compress, "zst": zstandard.ZstdCompressor().compress}
    path = tmp_path / request.param
    path.write_bytes(data.get(path.suffix[1:], bytes)(PLAIN))
    return path


def test_what_was_written_is_read(log):
    drive = read_drive(log)
    speed = drive.signals["vehicle_speed"]
    assert_allclose(speed.values, truth("vEgoRaw", TIME), rtol=1e-6)
    assert_allclose(speed.time, START + TIME, atol=1e-9)
    assert_allclose(
        drive.signals["engine_speed"].values * 30 / np.pi, truth("engineRpm", TIME), rtol=1e-6
    )
    assert_allclose(drive.signals["accelerator_pedal"].values, truth("gas", TIME))
    assert_allclose(drive.signals["brake_switch"].values, truth("brake", TIME))
    assert "clutch_switch" not in drive.signals
    accel = drive.signals["accel_x"]
    assert_allclose(accel.values, truth("accel", TIME), rtol=1e-6)
    assert_allclose(accel.time, START + TIME - AGE, atol=1e-9)
    assert_allclose(drive.signals["gyro_x"].values, truth("gyro", TIME), atol=1e-6)
    # The first fix is none.
    assert_allclose(
        np.degrees(drive.signals["latitude"].values), truth("latitude", TIME[10::10]), rtol=1e-12
    )
    assert_allclose(drive.signals["gnss_course"].values, np.pi / 2)
    assert f"{STEPS} CAN frames" in " ".join(drive.contents)
    assert has(drive.problems, "bus.of_another_table", signal="engine_speed", values=60)


def test_a_dbc_names_what_is_in_the_frames(tmp_path):
    (tmp_path / "car.dbc").write_text(DBC)
    mapping = {"signals": {"engine_speed": {"column": "Revs", "factor": 2}}}
    drive = read_drive(LOG, mapping, tmp_path / "car.dbc")
    revs = drive.signals["engine_speed"].values * 30 / np.pi
    assert_allclose(revs, 2 * truth("engineRpm", TIME), rtol=1e-9)
    assert drive.has("vehicle_speed")


def test_map_drafts_what_a_dbc_names_in_the_frames(tmp_path):
    (tmp_path / "car.dbc").write_text(DBC.replace(" Revs ", " EngSpd "))
    assert format_of(LOG).holds_frames
    found = draft_bus(LOG, load_dbcs([tmp_path / "car.dbc"]))
    assert [(c.name, c.quantity) for c in found.known] == [("Answer.EngSpd", "engine_speed")]


def test_a_channel_can_be_mapped_to_another_quantity():
    mapping = {"signals": {"throttle": {"column": "carState.gas", "unit": "ratio"}}}
    assert_allclose(read_drive(LOG, mapping).signals["throttle"].values, truth("gas", TIME))


@pytest.mark.parametrize(
    "pack", [bytes, bz2.compress, zstandard.ZstdCompressor().compress], ids=["plain", "bz2", "zst"]
)
def test_a_log_that_broke_off_is_read_to_there(tmp_path, pack):
    data = b"".join(pack(PLAIN) for _ in range(10))
    path = tmp_path / "rlog"
    path.write_bytes(data[: int(0.777 * len(data))])
    drive = read_drive(path)
    assert_allclose(drive.signals["vehicle_speed"].values[:60], truth("vEgoRaw", TIME), rtol=1e-6)
    assert has(drive.problems, "file.breaks_off")


@pytest.mark.parametrize("package", ["capnp", "zstandard"])
def test_missing_package_names_the_extra(tmp_path, monkeypatch, package):
    (tmp_path / "rlog.zst").write_bytes(zstandard.ZstdCompressor().compress(PLAIN))
    monkeypatch.setitem(__import__("sys").modules, package, None)
    with pytest.raises(MissingExtraError, match=r"weighbridge\[openpilot\]"):
        read_drive(tmp_path / "rlog.zst")


@pytest.mark.parametrize("data", [b"", b"BZh9nothing", b"\x28\xb5\x2f\xfdnothing", b"\xff" * 4000])
def test_no_log_is_one_sentence(tmp_path, data):
    (tmp_path / "rlog").write_bytes(data)
    with error(DriveError, "rlog"):
        read_drive(tmp_path / "rlog")


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(part=st.floats(0.0, 1.0), at=st.floats(0.0, 1.0), junk=st.binary(min_size=0, max_size=16))
@example(part=0.5919228560132325, at=0.98, junk=15 * b"\x00" + b"_")
def test_damage_leaves_signals_or_one_sentence(assert_damage_is_told, part, at, junk):
    assert_damage_is_told("rlog", PLAIN, part, at, junk)
