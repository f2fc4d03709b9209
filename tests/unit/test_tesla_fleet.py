"""Tesla Fleet Telemetry: the payload as protobuf writes it, and the lines of Tesla's logger."""

import datetime as dt
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from tests.noted import error

from weighbridge import DriveError, read_drive

START = dt.datetime(2026, 5, 1, 10, tzinfo=dt.UTC)
MAPPING = {"signals": {"vehicle_speed": {"column": "VehicleSpeed", "unit": "mph"}}}


def stamp(k):
    return (START + dt.timedelta(seconds=k)).isoformat().replace("+00:00", "Z")


def payload(k, vin="5YJ3"):
    data = [
        {"key": "VehicleSpeed", "value": {"doubleValue": 30.0 + k}},
        {"key": "PackVoltage", "value": {"stringValue": "390.5"}},
        {"key": "Gear", "value": {"shiftStateValue": "ShiftStateD"}},
        {"key": "Odometer", "value": {"invalid": True}},
    ]
    if k % 2 == 0:
        place = {"latitude": 37.0 + 1e-4 * k, "longitude": -122.0}
        data.append({"key": "Location", "value": {"locationValue": place}})
    return {"data": data, "createdAt": stamp(k), "vin": vin}


def logged(k):
    data = {"Vin": "5YJ3", "CreatedAt": stamp(k), "IsResend": False, "VehicleSpeed": 30.0 + k}
    data["PackVoltage"] = {"stringValue": "390.5"}
    if k % 2 == 0:
        data["Location"] = {"latitude": 37.0 + 1e-4 * k, "longitude": -122.0}
    return {"context": "fleet-telemetry", "msg": "record_payload", "data": data, "vin": "5YJ3"}


def lines(make, count=20):
    return "\n".join(json.dumps(make(k)) for k in range(count)) + "\n"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.jsonl", lines(payload)),
        ("b.json", lines(logged)),
        ("c.json", json.dumps([payload(k) for k in range(20)])),
    ],
)
def test_records_are_read(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    drive = read_drive(path, MAPPING)
    speed = drive.signals["vehicle_speed"]
    assert_allclose(speed.values, (30.0 + np.arange(20)) * 0.44704)
    assert_allclose(speed.time, np.arange(20), atol=1e-6)
    assert drive.info.start_time == START.isoformat()
    place = drive.signals["latitude"]
    assert_allclose(np.degrees(place.values), 37.0 + 1e-4 * np.arange(0, 20, 2))
    assert_allclose(place.time, np.arange(0, 20, 2), atol=1e-6)
    signals = {"battery_voltage": {"column": "PackVoltage", "unit": "v"}}
    assert_allclose(read_drive(path, {"signals": signals}).signals["battery_voltage"].values, 390.5)


def test_another_json_beside_a_drive_is_no_log(tmp_path):
    (tmp_path / "obd.csv").write_text("time_s,vehicle_speed_kmh\n0,36\n1,36\n")
    (tmp_path / "result.json").write_text("{}")
    assert read_drive(tmp_path).has("vehicle_speed")
    with pytest.raises(DriveError, match=r"'\.json' cannot be read"):
        read_drive(tmp_path / "result.json")


def test_a_long_first_record_is_recognised(tmp_path):
    first = payload(0)
    first["data"] += [{"key": f"Field{k}", "value": {"intValue": k}} for k in range(200)]
    path = tmp_path / "a.json"
    path.write_text(json.dumps(first) + "\n" + lines(payload))
    assert read_drive(path, MAPPING).has("vehicle_speed")


def test_of_a_location_only_the_position_is_a_quantity(tmp_path):
    path = tmp_path / "a.jsonl"

    def strange(k):
        record = payload(k)
        record["data"].append({"key": "Location.foo", "value": {"doubleValue": 1.0}})
        return record

    path.write_text(lines(strange))
    drive = read_drive(path, MAPPING)
    assert drive.has("vehicle_speed", "latitude", "longitude")
    assert "foo" not in drive.signals
    # A channel that the mapping takes is not told as one that is ignored.
    ignored = " ".join(p.text for p in drive.problems if p.id == "file.unknown")
    assert "'Location.foo'" in ignored
    assert "VehicleSpeed" not in ignored


def test_two_vehicles_are_refused(tmp_path):
    path = tmp_path / "a.jsonl"
    path.write_text(lines(payload) + json.dumps(payload(21, "7SAY")) + "\n")
    with error(DriveError, "a.jsonl 2") as refused:
        read_drive(path)
    assert "7SAY" not in str(refused.value)


@pytest.mark.parametrize("text", ["{}\n", '[{"createdAt"', '{"createdAt": 1, "data": []}\n'])
def test_no_record_is_one_sentence(tmp_path, text):
    path = tmp_path / "a.jsonl"
    path.write_text(text)
    with error(DriveError, "a.jsonl"):
        read_drive(path)


@settings(max_examples=40, deadline=None)
@given(cut=st.integers(0, 6000), junk=st.binary(max_size=8), old=st.booleans())
def test_damage_leaves_signals_or_one_sentence(tmp_path_factory, assert_salvaged, cut, junk, old):
    path = tmp_path_factory.mktemp("cut") / "a.jsonl"
    path.write_bytes(lines(logged if old else payload).encode()[:cut] + junk)
    assert_salvaged(path)
