"""``weighbridge simulate ride`` and ``weighbridge inertia``."""

import json
import re
from pathlib import Path

import polars as pl
import pytest
from tests.noted import named

EXAMPLE = Path(__file__).parents[2] / "examples" / "ride-truck" / "vehicle.toml"


@pytest.fixture
def ride(weighbridge, tmp_path):
    folder = tmp_path / "ride"
    made = weighbridge("simulate", "ride", "-o", folder, "--mass", 8000, "--road", "b",
                       "--speed", 70, "--format", "csv")  # fmt: skip
    assert made.code == 0, made.err
    return folder


def test_ride_is_simulated_and_weighed(weighbridge, ride, tmp_path):
    track, report = tmp_path / "track.parquet", tmp_path / "ride.html"
    ran = weighbridge("inertia", ride, "--vehicle", EXAMPLE, "--track", track, "--report", report)
    assert ran.code == 0, ran.err
    assert "sprung mass" in ran.out
    assert "payload" in ran.out
    assert re.search(r"^mass \d+ kg, 95 % between \d+ and \d+ kg$", ran.out, re.M)
    assert re.search(r"^rear axle \d+ kg, 95 % between \d+ and \d+ kg$", ran.out, re.M)
    assert pl.read_parquet(track).height > 1000
    assert report.stat().st_size > 10_000

    assert "weighbridge inertia" in weighbridge("inspect", ride).out

    ran = weighbridge("inertia", ride, "--vehicle", EXAMPLE, "--json", "-")
    told = json.loads(ran.out)
    low, high = told["sprung_mass_interval95_kg"]
    assert low < 8000.0 - 693.0 < high
    assert abs(told["mass_kg"] - 8000.0) < 80.0
    assert told["interval95_kg"] == pytest.approx([low + 693.0, high + 693.0])


def test_ride_without_a_signal_exits_with_1(weighbridge, ride):
    table = pl.read_csv(ride / "ride.csv").drop("roll_rate_radps")
    table.write_csv(ride / "ride.csv")
    ran = weighbridge("inertia", ride, "--vehicle", EXAMPLE)
    assert ran.code == 1
    assert "roll_rate" in ran.out


def test_nothing_that_is_read_is_replaced(weighbridge, ride):
    table = ride / "ride.csv"
    before = table.read_bytes()
    ran = weighbridge("inertia", ride, "--vehicle", EXAMPLE, "--track", table)
    assert ran.code == 2
    assert "in the folder of a drive" in ran.err
    assert table.read_bytes() == before
    ran = weighbridge("inertia", ride, "--vehicle", EXAMPLE, "--json", EXAMPLE)
    assert ran.code == 2
    assert "is an input" in ran.err


def test_bad_input_exits_with_2(weighbridge, ride, tmp_path):
    car = tmp_path / "car.toml"
    car.write_text('[vehicle]\nname = "a car"\n')
    for words, told in (
        (("inertia", ride, "--vehicle", car), "[ride]"),
        (("inertia", tmp_path / "nowhere", "--vehicle", EXAMPLE), "nowhere"),
        (("inertia", ride, "--vehicle", EXAMPLE, "--track", tmp_path / "a.txt"), ".parquet"),
        (("inertia", ride, "--vehicle", EXAMPLE, "--method", "ekf"), "ekf kalman-bucy"),
        (("simulate", "ride", "-o", tmp_path / "r2", "--road", "Z"), "road class"),
        (("simulate", "ride", "-o", tmp_path / "r2", "--wind", "3"), "--wind"),
        (("simulate", "car", "-o", tmp_path / "r2", "--speed", "3"), "--speed"),
    ):
        ran = weighbridge(*words)
        assert ran.code == 2, words
        assert named(ran.err, told)
