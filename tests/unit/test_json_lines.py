"""JSON lines: a value with its name on each, or a row of values."""

import json
import tomllib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from tests.noted import error, has

from weighbridge import DriveError, read_drive
from weighbridge.io import format_of, mapping_text

T = 0.25 * np.arange(200)
START = 1_772_732_520.0


def speed(t):
    return 50.0 + 30.0 * np.sin(t / 9.0)


def engine(t):
    return 900.0 + 35.0 * speed(t)


def openxc():
    for t in T:
        for name, value in (
            ("vehicle_speed", speed(t)),
            ("engine_speed", engine(t)),
            ("brake_pedal_status", bool(t > 30)),
            ("ignition_status", "run"),
        ):
            yield {"name": name, "value": value, "timestamp": START + t}


def telemetry_obd():
    for t in T:
        stamp = f"2026-03-05T17:42:{t % 60:09.6f}+00:00"
        told = {"SPEED": f"{speed(t):.2f} kilometer_per_hour", "FUEL_STATUS": "no response",
                "RPM": f"{engine(t):.2f} revolutions_per_minute"}  # fmt: skip
        for name, value in told.items():
            yield {"command_name": name, "obd_response_value": value, "iso_ts_pre": stamp,
                   "iso_ts_post": stamp}  # fmt: skip


def rows():
    for t in T:
        told = {"speed_kmh": speed(t), "engine": {"rpm": engine(t)}, "mode": "D"}
        yield {"time": t, "car": told}


FORMS = {"openxc": openxc, "telemetry_obd": telemetry_obd, "rows": rows}


def written(path, records):
    path.write_text("".join(json.dumps(record) + "\n" for record in records))
    return path


@pytest.mark.parametrize("name", ["drive.jsonl", "drive.json", "list.json"])
@pytest.mark.parametrize("form", FORMS)
def test_from_records_to_signals(tmp_path, form, name):
    path = written(tmp_path / name, FORMS[form]())
    if name == "list.json":
        path.write_text(json.dumps([*FORMS[form]()]))
    assert format_of(path).name == "JSON lines"
    found = format_of(path).draft(path)
    drive = read_drive(path, tomllib.loads(mapping_text([found])))
    v, n = drive.signals["vehicle_speed"], drive.signals["engine_speed"]
    assert len(v) == len(n) == T.size
    at = v.time - v.time[0]
    assert_allclose(at, T, atol=1e-6)
    assert_allclose(3.6 * v.values, speed(at), atol=0.006)
    assert_allclose(n.values * 30.0 / np.pi, engine(at), atol=0.006)
    if form == "openxc":
        assert drive.signals["brake_switch"].values.sum() == np.count_nonzero(T > 30)
    if form == "telemetry_obd":
        assert {c.unit for c in found.known if c.stated} == {"kmh", "rpm"}


def test_a_damaged_line_costs_itself_and_is_told(tmp_path):
    path = written(tmp_path / "drive.jsonl", openxc())
    lines = path.read_text().splitlines()
    lines[40] = lines[40][:25]
    path.write_text("\n".join(lines))
    found = format_of(path).draft(path)
    drive = read_drive(path, tomllib.loads(mapping_text([found])))
    assert has(drive.problems, "file.lines_left_out", count=1)
    assert len(drive.signals["vehicle_speed"]) == T.size - 1


def test_records_without_a_time_are_refused(tmp_path):
    path = written(tmp_path / "drive.jsonl", [{"speed": 1.0 * k, "rpm": 900} for k in range(50)])
    with error(DriveError, "drive.jsonl speed"):
        format_of(path).draft(path)


@settings(max_examples=30, deadline=None)
@given(form=st.sampled_from([*FORMS]), cut=st.integers(0, 3000), junk=st.binary(max_size=9))
def test_damage_leaves_signals_or_one_sentence(tmp_path_factory, assert_salvaged, form, cut, junk):
    path = written(tmp_path_factory.mktemp("cut") / "drive.jsonl", FORMS[form]())
    whole = path.read_bytes()
    path.write_bytes(whole[:cut] + junk + whole[cut + 20 :])
    assert_salvaged(path)
