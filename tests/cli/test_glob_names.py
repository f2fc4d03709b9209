"""Names of folders and files are names, never patterns."""

import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.noted import named

from weighbridge import read_drive
from weighbridge.io import read_table

GOLDEN = Path(__file__).parent.parent / "golden"


def drive(folder: Path, speed: float) -> Path:
    folder.mkdir()
    time = np.arange(0.0, 10.0)
    for suffix, write in (("parquet", "write_parquet"), ("csv", "write_csv")):
        name = "obd" if suffix == "parquet" else "gnss"
        column = "vehicle_speed_kmh" if name == "obd" else "speed_mps"
        frame = pl.DataFrame({"time_s": time, column: np.full(10, speed)})
        getattr(frame, write)(folder / f"{name}.{suffix}")
    return folder


@pytest.mark.parametrize(
    ("name", "neighbour"),
    [("a?", "ab"), ("drive [2]", "drive 2"), ("*", "x"), ("a[b", "ab"), ("{a,b}", "a"), ("~", "b")],
)
def test_a_neighbour_is_never_read(tmp_path, monkeypatch, name, neighbour):
    drive(tmp_path / neighbour, 90.0)
    own = drive(tmp_path / name, 36.0)
    monkeypatch.chdir(tmp_path)
    for path in (own, Path(name), Path(name) / "obd.parquet"):
        speed = read_drive(path).signals["vehicle_speed"]
        assert speed.values.tolist() == [10.0] * 10
    assert read_table(own / "obd.parquet")["vehicle_speed_kmh"].tolist() == [36.0] * 10


def test_a_name_with_an_equals_sign_is_no_partition(tmp_path):
    own = drive(tmp_path / "vehicle_speed_kmh=5", 36.0)
    assert read_drive(own).signals["vehicle_speed"].values[0] == 10.0


def test_results_named_like_patterns(weighbridge, tmp_path):
    frame = pl.DataFrame({"time_s": [0.0], "mass_kg": [1.0], "std_kg": [1.0]})
    frame.write_parquet(tmp_path / "ab.parquet")
    other, car = tmp_path / "a?.parquet", tmp_path / "car.toml"
    other.write_bytes((tmp_path / "ab.parquet").read_bytes())
    car.write_text("[vehicle]\nname = 'x'\n")
    words = ("weigh", GOLDEN / "csv", "--vehicle", car, "--track", other)
    assert not named(weighbridge(*words).err, "--track")
    pl.DataFrame({"time_s": [0.0]}).write_parquet(other)
    ran = weighbridge(*words)
    assert ran.code == 2
    assert named(ran.err, other.name, "--track")


def test_the_command_reads_the_folder_named(weighbridge, tmp_path):
    shutil.copytree(GOLDEN / "parquet", tmp_path / "a?")
    alone = weighbridge("inspect", tmp_path / "a?")
    shutil.copytree(GOLDEN / "parquet", tmp_path / "ab")
    assert weighbridge("inspect", tmp_path / "a?") == alone
    assert alone.code == 0
