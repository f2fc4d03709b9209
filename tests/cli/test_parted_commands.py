"""Recordings of several drives, as every command that reads them takes them."""

import re
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.noted import error, named

from weighbridge import ConfigError, Drive, Signal
from weighbridge.cli.calibrate import masses_of_parts
from weighbridge.simulation import make_scenario, simulate_car

PAUSE = 900.0


@pytest.fixture(scope="module")
def day(tmp_path_factory):
    """Return a folder of two trips with a pause between them, on one clock."""
    trips = [
        simulate_car(replace(make_scenario("car-short", seed=seed), duration=240.0))
        for seed in (31, 32)
    ]
    folder = tmp_path_factory.mktemp("day") / "day"
    begins = [0.0, trips[0].drive.duration + PAUSE]
    for k, trip in enumerate(trips):
        trip.write(folder.parent / f"trip{k}")
    folder.mkdir()
    for name in ("imu", "obd", "gnss"):
        tables = [
            pl.read_parquet(folder.parent / f"trip{k}" / f"{name}.parquet").with_columns(
                pl.col("time_s") + begin
            )
            for k, begin in enumerate(begins)
        ]
        pl.concat(tables).write_parquet(folder / f"{name}.parquet")
    return folder


def drives(*counts):
    """Recordings that hold so many drives each."""
    time = np.array([0.0, 1.0])
    made = Drive("day", {"vehicle_speed": Signal("vehicle_speed", time, time)})
    return [[made] * n for n in counts]


def test_inspect_tells_of_each_part_unless_it_is_to_take_the_whole(weighbridge, day):
    parted = weighbridge("inspect", day)
    assert re.findall(r"^day.*: 4\.\d min", parted.out, re.M) == [
        f"day part {k} of 2: 4.0 min" for k in (1, 2)
    ]
    assert parted.out.strip().endswith("--mass KG1 --mass KG2 -o vehicle.toml")
    whole = weighbridge("inspect", day, "--whole")
    assert "day: 23.0 min" in whole.out
    assert whole.out.strip().endswith("--mass KG -o vehicle.toml --whole")


def test_a_file_that_cannot_weigh_yet_is_to_be_calibrated_first(weighbridge, day, tmp_path):
    base = tmp_path / "base.toml"
    assert weighbridge("vehicle", "new", "--tare", 1500, "-o", base).code == 0
    last = weighbridge("inspect", day, "--vehicle", base).out.strip().splitlines()[-1]
    assert "weighbridge calibrate" in last
    assert last.endswith(f"-o vehicle.toml --vehicle {base}")


def test_calibrate_says_which_drives_it_wants_the_masses_of(weighbridge, day, tmp_path):
    masses = ("--mass", 1580, "--mass", 1700, "--mass", 1800)
    ran = weighbridge("calibrate", day, *masses, "-o", tmp_path / "car.toml")
    assert ran.code == 2
    assert named(ran.err, "3 2 1 --mass")
    assert "day holds 2 drives: 0 to 240 s, 1140 to 1380 s" in ran.err


def test_masses_are_of_all_or_of_each_recording_or_of_each_drive():
    assert masses_of_parts(drives(2, 1), None) is None
    assert masses_of_parts(drives(2, 1), [9e3]) == [9e3, 9e3, 9e3]
    assert masses_of_parts(drives(2, 1), [9e3, 8e3]) == [9e3, 9e3, 8e3]
    assert masses_of_parts(drives(2, 1), [9e3, 8e3, 7e3]) == [9e3, 8e3, 7e3]
    with error(ConfigError, "4 3 2 --mass"):
        masses_of_parts(drives(2, 1), [9e3, 8e3, 7e3, 6e3])
