"""Every format of raw CAN logs gives the same drive."""

from pathlib import Path

import numpy as np
import pytest
from make_can_logs import STEPS, SUFFIXES, truth
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import error, refused, says

from weighbridge import ConfigError, DriveError, read_drive

HERE = Path(__file__).parent
DBC = HERE / "golden.dbc"
MAPPING = {
    "signals": {
        "accel_x": {"column": "Sensor.Forward", "valid": "Valid"},
        "accel_y": {"column": "Lateral", "valid": "Valid"},
        "altitude": {"column": "Height"},
    }
}
ANSWERED = (
    "vehicle_speed", "engine_speed", "engine_torque_fraction", "throttle", "ambient_temperature",
)  # fmt: skip


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".mf4"])
def test_formats(suffix):
    drive = read_drive(HERE / f"can{suffix}", MAPPING, DBC)
    assert set(drive.signals) == {*ANSWERED, "accel_x", "accel_y", "altitude"}
    assert drive.info.start_time == "2020-09-13T12:26:40+00:00"
    for name in ANSWERED:
        # An answer of two frames is as old as the first of them.
        assert_allclose(drive.signals[name].time, 0.5 * STEPS + 0.01, atol=1e-4)
        assert_allclose(drive.signals[name].values, truth(name, STEPS), rtol=1e-12)
    valid = STEPS[STEPS != 3]
    for name in ("accel_x", "accel_y"):
        assert_allclose(drive.signals[name].time, 0.5 * valid + 0.1, atol=1e-4)
        assert_allclose(drive.signals[name].values, truth(name, valid), rtol=1e-12)
    assert drive.signals["accel_x"].time is drive.signals["accel_y"].time
    assert_allclose(drive.signals["altitude"].values, truth("altitude", STEPS), rtol=1e-12)
    told = "\n".join(drive.contents)
    assert "160 CAN frames" in told
    assert "PIDs 0C (20), 0D (20), 11 (20), 46 (20), 62 (20)" in told
    assert "not known: 20 frames" in told


def test_without_dbc_the_answers_are_read():
    drive = read_drive(HERE / "can.blf")
    assert set(drive.signals) == set(ANSWERED)
    assert "CAN 2 18FF1234 (40)" in drive.contents[-1]


def test_dbc_of_another_bus_is_not_used():
    drive = read_drive(HERE / "can.mf4", MAPPING, f"1:{DBC}")
    assert not drive.has("accel_x")
    told = " | ".join(p.text for p in drive.problems)
    assert says(told, "none_in_log", messages="2 messages", database="golden.dbc")
    assert read_drive(HERE / "can.mf4", MAPPING, f"2:{DBC}").has("accel_x")


def test_what_a_mapping_names_goes_before_answers():
    mapping = {"signals": {"throttle": {"column": "Kind", "unit": "%"}}}
    drive = read_drive(HERE / "can.mf4", mapping, DBC)
    assert_allclose(drive.signals["throttle"].values, 0.01 * (np.arange(40) % 2))
    assert len(drive.signals["engine_speed"]) == 20


def test_ambiguous_and_missing_validity_are_refused():
    mapping = {"signals": {"altitude": {"column": "Height", "valid": "HeightOk"}}}
    with error(ConfigError, "altitude HeightOk Sensor Valid Kind"):
        read_drive(HERE / "can.mf4", mapping, DBC)


def test_files_of_one_drive_are_joined_by_time(tmp_path):
    lines = (HERE / "can.log").read_text().splitlines(keepends=True)
    # Cut between the two frames of an answer: the message goes on in the second file.
    cut = next(k for k, line in enumerate(lines) if k > 70 and "7E8#21" in line)
    (tmp_path / "b-first.log").write_text("".join(lines[:cut]))
    (tmp_path / "a-second.log").write_text("".join(lines[cut:]))
    whole, joined = read_drive(HERE / "can.log"), read_drive(tmp_path)
    for name in ANSWERED:
        assert_array_equal(joined.signals[name].time, whole.signals[name].time)
        assert_array_equal(joined.signals[name].values, whole.signals[name].values)


def test_pieces_whose_dates_are_rounded_are_joined(tmp_path):
    # The second piece begins at a date cut to whole milliseconds: 0.4 ms too early.
    for name, start, first in (("a", "12:26:40.0", 0), ("b", "12:26:44.999", 50)):
        lines = [
            f" {0.1 * k:.6f} 1  7E8             Rx   d 8 03 41 0D {first + k:02X} 00 00 00 00\n"
            for k in range(50)
        ]
        lines.append(
            f" 4.999400 1  7E8             Rx   d 8 03 41 0D {first + 49:02X} 00 00 00 00\n"
        )
        head = f"date Sun Sep 13 {start} 2020\nbase hex  timestamps absolute\n"
        (tmp_path / f"{name}.asc").write_text(head + "".join(lines))
    drive = read_drive(tmp_path)
    speed = drive.signals["vehicle_speed"]
    assert len(speed) == 102
    assert np.all(np.diff(speed.time) > 0.0)
    assert speed.values[-1] == pytest.approx(99 / 3.6)


def test_the_same_frames_twice_are_refused(tmp_path):
    with error(DriveError, "can.asc can.blf"):
        read_drive([HERE / "can.asc", HERE / "can.blf"])
    # A piece shorter than dates may be off by is no rounding where it lies inside another.
    lines = (HERE / "can.log").read_text().splitlines(keepends=True)
    (tmp_path / "piece.log").write_text("".join(lines[20:26]))
    with error(DriveError, "can.log piece.log"):
        read_drive([HERE / "can.log", tmp_path / "piece.log"])


def test_unknown_identifiers_only_give_one_sentence(tmp_path):
    rows = [f"({100 + 0.1 * k:.6f}) can0 {0x100 + k % 3:03X}#0102" for k in range(30)]
    (tmp_path / "x.log").write_text("\n".join(rows))
    with refused("bus.unknown", file="x.log") as told:
        read_drive(tmp_path / "x.log")
    assert told.value.problem.values["frames"].startswith("30 frames: CAN 0 100 (10)")
    assert "\n" not in str(told.value)
    with refused("bus.nothing_mapped") as told:
        read_drive(tmp_path / "x.log", MAPPING, DBC)
    assert says(str(told.value), "none_in_log", messages="2 messages", database="golden.dbc")


@pytest.mark.parametrize(("suffix", "share"), [(".blf", 0.7), (".asc", 0.5), (".trc", 0.5)])
def test_cut_off_logs_are_salvaged(tmp_path, suffix, share):
    raw = (HERE / f"can{suffix}").read_bytes()
    cut = tmp_path / f"cut{suffix}"
    cut.write_bytes(raw[: int(share * len(raw))])
    drive = read_drive(cut)
    assert 5 < len(drive.signals["engine_speed"]) < 20
    got = drive.signals["engine_speed"].values
    assert_allclose(got, truth("engine_speed", np.arange(got.size)), rtol=1e-12)


def test_cut_off_mf4_is_one_sentence_or_what_is_left(tmp_path):
    raw = (HERE / "can.mf4").read_bytes()
    for share in (0.1, 0.4, 0.6, 0.9):
        cut = tmp_path / "cut.mf4"
        cut.write_bytes(raw[: int(share * len(raw))])
        try:
            drive = read_drive(cut)
        except DriveError as error:
            told = str(error)
        else:
            told = f"{len(drive.signals['engine_speed'])} values"
        assert "\n" not in told
        assert not told.startswith("0 ")
