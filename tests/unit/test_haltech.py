"""Haltech's logs: channels above rows of whole numbers, in the form of a public log."""

import tomllib

import numpy as np
from numpy.testing import assert_allclose
from tests.noted import error, has

from weighbridge import DriveError, read_drive
from weighbridge.io import format_of, mapping_text

T = 0.02 * np.arange(300)
SPEED = 60.0 + 20.0 * np.sin(T)
ENGINE = np.round(2000.0 + 500.0 * np.sin(T))


def lines():
    head = ["%DataLog%", "DataLogVersion : 1.1", "Software : Haltech NSP"]
    for name, kind in (
        ("RPM", "EngineSpeed"),
        ("Vehicle Speed", "Speed"),
        ("Manifold Pressure", "Pressure"),
        ("Coolant Temperature", "Temperature"),
        ("Trigger Count", "Raw"),
    ):
        head += [f"Channel : {name}", "ID : 384", f"Type : {kind}", "DisplayMaxMin : 20000,0"]
    head.append("Log : 20260305 17:42:00")
    rows = [
        f"17:42:{t:06.3f},{n:.0f},{round(10 * v)},{round(450 + 2 * v)},3631,{k}"
        for k, (t, n, v) in enumerate(zip(T, ENGINE, SPEED, strict=True))
    ]
    return head, rows


def test_counts_become_values(tmp_path):
    path = tmp_path / "log.csv"
    head, rows = lines()
    path.write_text("\n".join([*head, *rows]) + "\n")
    assert format_of(path).name == "Haltech CSV"
    found = format_of(path).draft(path)
    units = {c.quantity: c.unit for c in found.known if c.stated}
    assert units == {
        "engine_speed": "rpm",
        "vehicle_speed": "kmh",
        "intake_pressure": "kpa",
        "coolant_temperature": "k",
    }
    rows[40] = rows[40][:20]
    path.write_text("\n".join([*head, *rows]) + "\n")
    drive = read_drive(path, tomllib.loads(mapping_text([found])))
    speed = drive.signals["vehicle_speed"]
    at = speed.time - speed.time[0]
    assert_allclose(3.6 * speed.values, 60.0 + 20.0 * np.sin(at), atol=0.051)
    assert_allclose(drive.signals["coolant_temperature"].values, 363.1)
    assert len(speed) == T.size - 1
    assert has(drive.problems, "file.rows_cut", count=1)


def test_a_head_alone_is_one_sentence(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines()[0]) + "\n")
    with error(DriveError, "log.csv CSV NSP"):
        format_of(path).draft(path)
