"""Logs of apps and devices by their published headers: drafted, and read as what was driven."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from weighbridge import read_drive
from weighbridge.io import draft_table, mapping_text
from weighbridge.signals import QUANTITIES, to_si

FOLDER = Path(__file__).parent
HEADERS = tomllib.loads((FOLDER / "logger_headers.toml").read_text("utf-8"))
HEADERS |= tomllib.loads((FOLDER / "app_headers.toml").read_text("utf-8"))
TIME = 0.25 * np.arange(400)
SPEED = 60.0 + 25.0 * np.sin(0.1 * TIME)
DRIVEN = {
    "vehicle_speed": SPEED,
    "engine_speed": 1800.0 + 700.0 * np.sin(0.13 * TIME),
    "engine_load": 40.0 + 30.0 * np.sin(0.3 * TIME),
    "throttle": 30.0 + 20.0 * np.sin(0.3 * TIME),
    "latitude": 48.0 + 2e-5 * TIME,
    "longitude": 11.0 + 2e-5 * TIME,
    "altitude": 500.0 + 0.1 * TIME,
    "gnss_speed": SPEED / 3.6,
    "accel_x": -0.15 + 0.05 * np.sin(TIME),
    "accel_y": 0.52 + 0.05 * np.cos(TIME),
    "accel_z": 0.85 + 0.02 * np.sin(2.0 * TIME),
}
AUTOPI = {
    "obd.speed.value": "vehicle_speed",
    "obd.rpm.value": "engine_speed",
    "obd.engine_load.value": "engine_load",
    "track.pos.loc.lat": "latitude",
    "track.pos.loc.lon": "longitude",
    "track.pos.alt": "altitude",
    "track.pos.sog": "gnss_speed",
    "acc.xyz.x": "accel_x",
    "acc.xyz.y": "accel_y",
    "acc.xyz.z": "accel_z",
}


def log(folder, columns, stamps):
    """Write a log of these columns, names and what they are; others are filled with a counter."""
    counter = np.arange(TIME.size) % 7
    values = [stamps if q == "time" else DRIVEN.get(q, counter) for q in columns.values()]
    rows = [",".join(str(cell) for cell in row) for row in zip(*values, strict=True)]
    names = ",".join(f'"{name}"' for name in columns)
    path = folder / "log.csv"
    path.write_text("\n".join([names, *rows]) + "\n", encoding="utf-8")
    return path


def read(path):
    """Read a log by the mapping that is drafted for it."""
    mapping = path.with_name("map.toml")
    mapping.write_text(mapping_text([draft_table(path)]), encoding="utf-8")
    return read_drive(path, mapping)


@pytest.mark.parametrize(
    ("app", "unit"), [("obd_fusion", "mph"), ("car_scanner", "kmh"), ("obd_auto_doctor", "kmh")]
)
def test_the_log_of_an_app_is_read_by_its_draft(app, unit, tmp_path):
    columns = {name: quantity for name, quantity, *_ in HEADERS[app]["columns"]}
    drive = read(log(tmp_path, columns, TIME))
    speed, engine = drive.signals["vehicle_speed"], drive.signals["engine_speed"]
    assert np.allclose(speed.values, to_si(SPEED, unit), rtol=1e-6)
    assert np.allclose(engine.values, to_si(DRIVEN["engine_speed"], "rpm"), rtol=1e-6)
    assert np.allclose(np.diff(speed.time), 0.25)


def test_the_fields_of_an_autopi_are_read_with_their_units(tmp_path):
    stamps = [f"2026-11-10T16:04:{s // 4 % 60:02d}.{s % 4 * 25:02d}0000Z" for s in range(240)]
    stamps += [f"2026-11-10T16:05:{s // 4 % 60:02d}.{s % 4 * 25:02d}0000Z" for s in range(160)]
    drive = read(log(tmp_path, {"@ts": "time", **AUTOPI}, stamps))
    units = dict.fromkeys(("accel_x", "accel_y", "accel_z"), "g") | {"gnss_speed": "mps"}
    for quantity in AUTOPI.values():
        signal = drive.signals[quantity]
        true = to_si(DRIVEN[quantity], units.get(quantity, QUANTITIES[quantity].suffix))
        assert np.allclose(signal.values, np.interp(signal.time, TIME, true), rtol=1e-6)
