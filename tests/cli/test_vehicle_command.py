"""``weighbridge vehicle``: written from papers, told in words."""

import re
import shutil
from pathlib import Path

import polars as pl
import pytest
from tests.noted import named, says

from weighbridge import Vehicle
from weighbridge.vehicle import TORQUE_SOURCES


def test_a_file_from_papers_is_told_and_names_the_next_command(weighbridge, tmp_path):
    path = tmp_path / "van.toml"
    ran = weighbridge(
        "vehicle", "new", "--class", "van", "--tare", 2150, "--gross", 3500, "--tyre", "235/65 R16",
        "-o", path,
    )  # fmt: skip
    assert ran.code == 0
    assert f"next: weighbridge calibrate DRIVE --mass KG --vehicle {path}" in ran.out
    assert Vehicle.load(path).tare == 2150.0
    again = weighbridge("vehicle", "new", "-o", path)
    assert again.code == 2
    assert "--force" in again.err
    assert weighbridge("vehicle", "new", "-o", path, "--force").code == 0


def test_what_a_calibration_made_is_told_in_words(weighbridge, car):
    ran = weighbridge("vehicle", "show", car)
    assert ran.code == 0
    text = " ".join(ran.out.split())
    for words in (
        "gears",
        "from engine load (PID 04)",
        "the highest the calibration saw",
        "kW",
    ):
        assert words in text
    assert f"next: weighbridge weigh DRIVE --vehicle {car}" in text


def test_a_mistake_is_one_line(weighbridge, tmp_path):
    ran = weighbridge("vehicle", "new", "--gear-ratios", "3.8;2.1", "-o", tmp_path / "v.toml")
    assert ran.code == 2
    assert ran.err.count("\n") == 1
    assert "--gear-ratios" in ran.err


def test_all_mistakes_are_told_at_once(weighbridge, tmp_path):
    ran = weighbridge(
        "vehicle", "new", "--gear-ratios", "3.8;2.1", "--final-drive", 3.9, "--tare", 50,
        "--engine", "steam", "-o", tmp_path / "v.toml",
    )  # fmt: skip
    assert ran.code == 2
    assert not (tmp_path / "v.toml").exists()
    for words in ("--gear-ratios", "tare of 50 kg", "engine must be petrol"):
        assert words in ran.err
    assert "needs gear ratios" not in ran.err


def test_a_load_means_nothing_before_a_calibration(weighbridge, loaded, tmp_path):
    path = tmp_path / "car.toml"
    made = weighbridge("vehicle", "new", "--torque", "load", "--tyre", "205/55 R16", "-o", path)
    assert made.code == 0
    ran = weighbridge("weigh", loaded.folder, "--vehicle", path)
    assert ran.code == 1
    text = " ".join(ran.out.split())
    assert says(text, "vehicle.not_calibrated")
    assert "DRIVE --torque load --mass KG --vehicle FILE" in text


@pytest.mark.parametrize("words", [("vehicle", "new"), ("calibrate",)])
def test_help_names_every_torque_source(weighbridge, words):
    ran = weighbridge(*words, "--help")
    assert ran.code == 0
    told = "".join(c for c in ran.out if c.isalnum() or c in "_()")
    for source in TORQUE_SOURCES.values():
        title = "".join(c for c in source.title if c.isalnum())
        assert f"{source.name}({title})" in told


@pytest.mark.parametrize("name", TORQUE_SOURCES)
def test_a_vehicle_file_is_made_for_every_torque_source(weighbridge, tmp_path, name):
    path = tmp_path / "v.toml"
    more = ("--reference-torque", 300) if TORQUE_SOURCES[name].needs_reference else ()
    assert weighbridge("vehicle", "new", "--torque", name, *more, "-o", path).code == 0
    told = weighbridge("vehicle", "show", path)
    assert told.code == 0
    assert name in path.read_text() or name.replace("_", " ") in path.read_text()


def test_a_mapping_is_kept_in_the_file_and_both_ways_on_are_told(weighbridge, tmp_path):
    (tmp_path / "map.toml").write_text('[time]\ncolumn = "t"\n')
    (tmp_path / "files").mkdir()
    path = tmp_path / "files" / "truck.toml"
    ran = weighbridge(
        "vehicle", "new", "--class", "truck", "--torque", "percent", "--radius", 0.49,
        "--driven", "rear", "--mapping", tmp_path / "map.toml", "-o", path,
    )  # fmt: skip
    assert ran.code == 0
    assert Vehicle.load(path).mapping == "../map.toml"
    assert f"next: weighbridge weigh DRIVE --vehicle {path}" in ran.out
    assert f"better: weighbridge calibrate DRIVE --mass KG --vehicle {path}" in ran.out


def test_a_calibration_keeps_the_mapping_it_read_with(weighbridge, known, tmp_path):
    day = tmp_path / "day.parquet"
    speed = pl.read_parquet(known.folder / "obd.parquet").drop_nulls("vehicle_speed_kmh")
    slope = 0.01 * pl.col("time_s").mul(0.02).sin()
    speed.select(t="time_s", Tacho="vehicle_speed_kmh", Slope=slope).write_parquet(day)
    (tmp_path / "map.toml").write_text(
        '[time]\ncolumn = "t"\n[signals.vehicle_speed]\ncolumn = "Tacho"\nunit = "kmh"\n'
        '[signals.grade]\ncolumn = "Slope"\nunit = "rad"\n'
    )
    (tmp_path / "files").mkdir()
    path = tmp_path / "files" / "car.toml"
    words = ("--mapping", tmp_path / "map.toml", "--method", "speed-ekf", "--mass", 1580)
    ran = weighbridge("calibrate", day, *words, "-o", path)
    assert ran.code == 0, ran.err
    assert Vehicle.load(path).mapping == "../map.toml"


def test_a_mapping_that_a_vehicle_file_names_and_is_gone(weighbridge, loaded, car, tmp_path):
    path = tmp_path / "named.toml"
    path.write_text(car.read_text().replace("[vehicle]", '[vehicle]\nmapping = "gone.toml"', 1))
    for words in (("weigh", loaded.folder), ("inspect", loaded.folder)):
        ran = weighbridge(*words, "--vehicle", path)
        assert ran.code == 2
        assert named(ran.err, path, tmp_path / "gone.toml", "--mapping")
    assert "drives are read by gone.toml" in " ".join(
        weighbridge("vehicle", "show", path).out.split()
    )


def test_the_next_command_names_the_dbc_of_the_calibration(weighbridge, known, tmp_path):
    dbc = tmp_path / "bus" / "golden.dbc"
    dbc.parent.mkdir()
    shutil.copy(Path(__file__).parents[1] / "golden" / "golden.dbc", dbc)
    (tmp_path / "files").mkdir()
    path = tmp_path / "files" / "car.toml"
    ran = weighbridge("calibrate", known.folder, "--dbc", f"1:{dbc}", "-o", path)
    assert ran.code == 0, ran.err
    assert Vehicle.load(path).provenance.dbc == ("1:../bus/golden.dbc",)
    said = weighbridge("vehicle", "show", path).out
    asked = re.search(r"^next: (.*)$", said, re.MULTILINE).group(1).split()
    assert asked[:5] == ["weighbridge", "weigh", "DRIVE", "--vehicle", str(path)]
    assert asked[5] == "--dbc"
    assert asked[6].startswith("1:")
    assert Path(asked[6][2:]).resolve() == dbc


def test_without_a_dbc_none_is_named(weighbridge, car):
    assert "--dbc" not in weighbridge("vehicle", "show", car).out


def test_a_file_by_load_is_calibrated_first_whatever_else_is_known(weighbridge, tmp_path):
    path = tmp_path / "car.toml"
    ran = weighbridge(
        "vehicle", "new", "--tyre", "195/65R15", "--gear-ratios", "3.6,2.0,1.3,1.0",
        "--final-drive", 3.9, "--tare", 1300, "--torque", "load", "-o", path,
    )  # fmt: skip
    assert ran.code == 0
    text = " ".join(ran.out.split())
    assert "by engine load; a calibration finds what that is worth" in text
    assert "next: weighbridge calibrate" in text
    assert "weigh DRIVE" not in text
    assert Vehicle.load(path).torque.source == "load"
