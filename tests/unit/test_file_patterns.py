"""Patterns of file names: dates and numbers may be others, and kinds of file stay apart."""

import tomllib
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from weighbridge import DriveError, read_drive
from weighbridge.io import draft_table, mapping_text

T = np.arange(0.0, 30.0, 0.1)


def recorded(folder: Path, stamp: str) -> list[Path]:
    """A phone's and an adapter's table, named by the time they were recorded."""
    folder.mkdir()
    phone = {"Time (s)": T} | {f"acc{a} (m/s^2)": np.sin(T) + 9.0 * (a == "Z") for a in "XYZ"}
    car = {"Time (s)": T, "Vehicle speed (km/h)": 50.0 + np.sin(T)}
    paths = [folder / f"phone_{stamp}.csv", folder / f"{stamp}.csv"]
    for path, columns in zip(paths, (phone, car), strict=True):
        pl.DataFrame(columns).write_csv(path)
    return paths


@pytest.fixture
def mapped(weighbridge, tmp_path):
    """Return what the command drafts of some files, and write it as ``map.toml``."""

    def made(*paths):
        output = tmp_path / "map.toml"
        assert weighbridge("map", *paths, "-o", output, "--force").code == 0
        return output.read_text(encoding="utf-8")

    return made


@pytest.mark.parametrize(
    ("names", "patterns"),
    [
        ([["phone_20210305_180000.csv"], ["2021-03-05 18-00.csv"]], ["phone_*.csv", "[0-9]*.csv"]),
        ([["log0012.csv"], ["obd2.csv"]], ["log*.csv", "obd2.csv"]),
        ([["obd_0012.csv", "obd_0013.csv"], ["gps.csv"]], ["obd_*.csv", "gps.csv"]),
        ([["obd monday.csv", "obd friday.csv"], ["gps.csv"]], ["obd *day.csv", "gps.csv"]),
        ([["monday.csv", "x.csv"], ["gps.csv"]], ["monday.csv", "x.csv", "gps.csv"]),
        ([["a [1] 2021-03.csv"], ["b.csv"]], ["a [[]1] *.csv", "b.csv"]),
        ([["known_gps.csv"], ["known_obd.csv"]], ["*gps.csv", "*obd.csv"]),
        ([["gps_2025-03-04.csv"], ["obd_2025-03-04.csv"]], ["gps*.csv", "obd*.csv"]),
        ([["a.csv"], ["b.csv"]], ["a.csv", "b.csv"]),
        ([["trip1.csv"], ["trip1_imu.csv"]], ["trip1.csv", "trip1_imu.csv"]),
        ([["x [1] a.csv"], ["x [1] b.csv"]], ["*a.csv", "*b.csv"]),
    ],
)
def test_dates_and_numbers_may_be_others(mapped, tmp_path, names, patterns):
    """Files of a kind have the same columns."""
    kinds = ({"accX (m/s^2)": np.sin(T)}, {"Vehicle speed (km/h)": 50.0 + np.sin(T)})
    paths = []
    for columns, files in zip(kinds, names, strict=True):
        for name in files:
            paths.append(tmp_path / name)
            pl.DataFrame({"Time (s)": T} | columns).write_csv(paths[-1])
    tables = tomllib.loads(mapped(*paths))["tables"]
    assert [table["files"] for table in tables.values()] == patterns


def test_a_mapping_of_one_drive_reads_another_of_other_dates(mapped, tmp_path):
    mapped(*recorded(tmp_path / "first", "20210305_180000"))
    recorded(tmp_path / "second", "20210306_103000")
    drive = read_drive(tmp_path / "second", tmp_path / "map.toml")
    assert {"accel_z", "vehicle_speed"} <= set(drive.signals)


def test_files_of_two_drives_are_a_table_for_each_kind(mapped, tmp_path):
    paths = recorded(tmp_path / "a", "20210305_180000") + recorded(
        tmp_path / "b", "20210306_103000"
    )
    assert mapped(*paths).count("files = ") == 2


def test_files_whose_names_tell_no_kind_keep_a_table_each(mapped, tmp_path):
    paths = [p for k in ("a", "b") for p in recorded(tmp_path / k, "20210305_180000")]
    paths[0] = paths[0].rename(tmp_path / "a" / "x.csv")
    # The adapter names its files alike; of the phone's two nothing is.
    assert mapped(*paths).count("files = ") == 3


def test_a_table_beside_a_file_that_is_none_is_for_its_own_names(tmp_path):
    phone, notes = recorded(tmp_path / "a", "20210305_180000")
    notes.write_text("hello world")
    (tmp_path / "map.toml").write_text(
        mapping_text([draft_table(phone)], [notes]), encoding="utf-8"
    )
    assert "accel_z" in read_drive(tmp_path / "a", tmp_path / "map.toml").signals


def test_a_mapping_that_is_for_no_file_there_says_so(tmp_path):
    recorded(tmp_path / "a", "20210305_180000")
    signals = {"accel_x": {"column": "accX", "unit": "mps2"}}
    mapping = {"tables": {"phone": {"files": "phone_2020.csv", "signals": signals}}}
    words = r"no pattern in files of mapping.*'phone_2020.csv'.*'20210305_180000.csv'.*map "
    with pytest.raises(DriveError, match=words):
        read_drive(tmp_path / "a", mapping)


def test_vehicles_of_a_fleet_are_told_apart_by_name_where_kinds_are_not(mapped, tmp_path):
    """Two read alike, a third otherwise, and one of its files was cut off."""
    names = [
        f"KA-{v}_2026-03-0{day}.parquet" for v in ("SE-40", "TR-17", "VN-03") for day in (2, 3)
    ]
    paths = []
    for name in names:
        torque = "eng_trq_act_nm" if "VN" in name else "eng_trq_pct"
        columns = {"t_s": T, "eng_spd_rpm": 900.0 + T, torque: 2.0 * T}
        paths.append(tmp_path / name)
        pl.DataFrame(columns).write_parquet(paths[-1])
    cut_off = tmp_path / "KA-VN-03_2026-03-04.parquet"
    cut_off.write_bytes(b"PAR1")
    text = mapped(*paths, cut_off)
    for vehicle in ("SE", "TR", "VN"):
        assert text.count(f'files = "KA-{vehicle}-*.parquet"') == 1
