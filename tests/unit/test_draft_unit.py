"""The unit of a speed that states none, by positions, other speeds and its own steps."""

import json

import numpy as np
import polars as pl
import pytest

from weighbridge.io.draft import draft
from weighbridge.io.formats import format_of
from weighbridge.signals.units import UNITS

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
    assert "its highest is" in draft(tmp_path / "t.csv").columns[0].question


def test_fleet_telemetry_with_positions_is_in_mph(tmp_path):
    records = []
    for t, v, way in zip(TIME, SPEED, WAY, strict=True):
        place = {"latitude": 52.0, "longitude": 4.0 + np.degrees(way) / np.cos(np.radians(52.0))}
        stamp = f"2026-03-01T10:{int(t // 60):02d}:{t % 60:06.3f}Z"
        data = {"VehicleSpeed": round(v / 0.44704, 1), "Location": place, "CreatedAt": stamp}
        records.append(json.dumps({"data": data}))
    (tmp_path / "t.jsonl").write_text("\n".join(records))
    assert unit_of(tmp_path / "t.jsonl") == "mph"
