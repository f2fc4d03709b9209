"""The code on the pages of the methods runs as it stands."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from website import running

from weighbridge.io import write_drive
from weighbridge.simulation import TRUCK, RideScenario, simulate_ride

HOME = Path(__file__).parents[2]


def test_the_live_example_of_inertia_finds_the_load(tmp_path, monkeypatch):
    page = HOME / "docs" / "methods" / "nguyen2024.md"
    (example,) = [b for b in running.blocks(page) if b.language == "python"]
    made = simulate_ride(
        RideScenario(
            vehicle=TRUCK.loaded(1.3), duration=14.0, zero_mass=TRUCK.sprung_mass, seed=196_090
        )
    )
    write_drive(made.drive, tmp_path / "ride")
    shutil.copy(HOME / "examples" / "ride-truck" / "vehicle.toml", tmp_path / "truck.toml")
    monkeypatch.chdir(tmp_path)
    found = {}
    exec(compile(example.code, page.name, "exec"), found)
    true = made.inertias[-1]
    assert found["mass"] == pytest.approx(1.3 * 5394.0, rel=0.03)
    assert (found["roll_inertia"], found["pitch_inertia"]) == pytest.approx(true[1:], rel=0.05)
    # Springs and dampers are the file's to the last digit: the filter alone counts.
    assert np.all((found["low"] < true) & (true < found["high"]))
