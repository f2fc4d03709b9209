"""The unit of a speed that states none, by positions, other speeds and its own steps."""

import json

import numpy as np
import polars as pl
import pytest

from weighbridge import read_drive
from weighbridge.io import draft_table, format_of, mapping_text
from weighbridge.signals import UNITS

TIME = np.arange(0.0, 900.0, 0.5)
SPEED = 9.0 + 8.0 * np.sin(TIME / 35.0)  # [m/s], slow enough for any unit
WAY = np.cumsum(SPEED) * 0.5 / 6.371e6


def unit_of(path):
    found = format_of(path).draft(path)
    (speed,) = (c for c in found.columns if c.quantity == "vehicle_speed")
    return speed.unit


@pytest.mark.parametrize("unit", ["mph", "kmh", "mps"])
def test_positions_show_the_unit(tmp_path, unit):
    shown = np.round(SPEED / UNITS[unit].factor + 0.003, 2)
    table = {"time_s": TIME, "Vehicle speed": shown, "RPM": 900 + 50 * SPEED}
    table |= {"Latitude": -33.9 + np.degrees(WAY), "Longitude": np.full(TIME.size, 151.2)}
    pl.DataFrame(table).write_csv(tmp_path / "t.csv")
    assert unit_of(tmp_path / "t.csv") == unit


@pytest.mark.parametrize("unit", ["mph", "kmh", "mps"])
def test_the_speed_of_a_wheel_shows_the_unit(tmp_path, unit):
    shown = np.round(SPEED / UNITS[unit].factor + 0.003, 2)
    table = {"time_s": TIME, "Vehicle speed": shown, "Wheel speed FL (km/h)": 3.6 * SPEED}
    pl.DataFrame({**table, "RPM": 900 + 50 * SPEED}).write_parquet(tmp_path / "t.parquet")
    assert unit_of(tmp_path / "t.parquet") == unit


@pytest.mark.parametrize(("unit", "whole"), [("mph", "kmh"), ("mps", "kmh"), ("kmh", "mph")])
def test_whole_numbers_of_another_unit_show_the_unit(tmp_path, unit, whole):
    steps = np.round(SPEED / UNITS[whole].factor)
    shown = np.round(steps * UNITS[whole].factor / UNITS[unit].factor, 3)
    pl.DataFrame({"time_s": TIME, "Vehicle speed": shown, "RPM": 900 + 50 * SPEED}).write_csv(
        tmp_path / "t.csv"
    )
    assert unit_of(tmp_path / "t.csv") == unit


def test_whole_numbers_of_its_own_show_nothing(tmp_path):
    shown = np.round(3.6 * SPEED)
    pl.DataFrame({"time_s": TIME, "Vehicle speed": shown}).write_csv(tmp_path / "t.csv")
    assert "its highest is" in draft_table(tmp_path / "t.csv").columns[0].question


def test_fleet_telemetry_with_positions_is_in_mph(tmp_path):
    records = []
    for t, v, way in zip(TIME, SPEED, WAY, strict=True):
        place = {"latitude": 52.0, "longitude": 4.0 + np.degrees(way) / np.cos(np.radians(52.0))}
        stamp = f"2026-03-01T10:{int(t // 60):02d}:{t % 60:06.3f}Z"
        data = {"VehicleSpeed": round(v / 0.44704, 1), "Location": place, "CreatedAt": stamp}
        records.append(json.dumps({"data": data}))
    (tmp_path / "t.jsonl").write_text("\n".join(records))
    assert unit_of(tmp_path / "t.jsonl") == "mph"


E7, SEMICIRCLE = 1e7, 2**31 / 180.0


@pytest.mark.parametrize(
    ("names", "factor", "unit"),
    [
        (("pos_lat_e7", "pos_lon_e7"), E7, "dege7"),
        (("latitudeE7", "longitudeE7"), E7, "dege7"),
        (("Lat (deg*1e7)", "Lon (deg*1e7)"), E7, "dege7"),
        (("lat", "lon"), E7, "dege7"),
        (("position_lat [semicircles]", "position_long [semicircles]"), SEMICIRCLE, "semicircle"),
        (("position_lat", "position_long"), SEMICIRCLE, "semicircle"),
    ],
)
def test_whole_numbers_of_positions_are_read(tmp_path, names, factor, unit):
    place = (-33.9 + np.degrees(WAY), np.full(TIME.size, 151.2))
    table = {"time_s": TIME, "Vehicle speed (km/h)": 3.6 * SPEED, "RPM": 900 + 50 * SPEED}
    table |= {n: np.round(factor * v).astype(int) for n, v in zip(names, place, strict=True)}
    pl.DataFrame(table).write_csv(tmp_path / "t.csv")
    found = draft_table(tmp_path / "t.csv")
    (tmp_path / "m.toml").write_text(mapping_text([found]), encoding="utf-8")
    drive = read_drive(tmp_path / "t.csv", tmp_path / "m.toml")
    assert [c.unit for c in found.columns if c.quantity in ("latitude", "longitude")] == [unit] * 2
    for name, true in zip(("latitude", "longitude"), place, strict=True):
        np.testing.assert_allclose(np.degrees(drive.signals[name].values), true, atol=1e-6)
