"""Which recordings a fleet has, and whose they are."""

from dataclasses import replace

import polars as pl
import pytest

from tests.fleet.fleets import tiny_drive, tiny_fleet
from tests.noted import error
from weighbridge import ConfigError, Drive, DriveError
from weighbridge.fleet.inputs import Recording, recordings
from weighbridge.fleet.store import Results
from weighbridge.fleet.vehicles import Vehicles
from weighbridge.vehicle import Known, describe


def names(*given):
    return [recording.source for recording in recordings(map(str, given))]


@pytest.fixture
def tree(tmp_path):
    tiny_drive(tmp_path / "van0" / "monday", 0)
    tiny_drive(tmp_path / "van0" / "tuesday", 1)
    (tmp_path / "van1").mkdir()
    (tmp_path / "van1" / "day.csv").write_text("time_s,vehicle_speed_kmh\n0,1\n")
    (tmp_path / "van1" / "readme.md").write_text("no log")
    (tmp_path / "van1" / ".hidden.csv").write_text("no drive")
    (tmp_path / "van0" / "tuesday" / "truth.csv").write_text("time_s\n0\n")
    return tmp_path


def test_a_tree_holds_folders_of_tables_and_logs(tree):
    found = [tree / "van0" / "monday", tree / "van0" / "tuesday", tree / "van1" / "day.csv"]
    found = [str(path) for path in found]
    assert names(tree) == names(f"{tree}/**") == found
    assert names(f"{tree}/*") == found
    assert names(f"{tree}/*/*") == names(f"{tree}/van*/**") == found
    assert names(f"{tree}/van0/*day") == found[:2]


def test_each_recording_comes_once(tree):
    one = str(tree / "van0" / "monday")
    assert names(one, f"{tree}/van0/**", one) == [one, str(tree / "van0" / "tuesday")]


def test_a_slash_behind_a_name_changes_nothing_and_behind_a_pattern_makes_drives(tree):
    assert names(f"{tree}/van1/") == names(f"{tree}/van1") == [str(tree / "van1" / "day.csv")]
    assert names(f"{tree}/*/") == [f"{tree}/van0", f"{tree}/van1"]
    assert names(f"file://{tree}/van1/") == names(f"file://{tree}/van1")
    assert names(f"file://{tree}/*/") == [f"file://{tree}/van0", f"file://{tree}/van1"]


def test_a_name_that_is_there_is_no_pattern(tmp_path):
    tiny_drive(tmp_path / "ab" / "trip", 0)
    own = tiny_drive(tmp_path / "a[b]" / "trip", 1)
    star = tiny_drive(tmp_path / "*", 2)
    assert names(tmp_path / "a[b]") == names(f"{tmp_path}/a[b]/**") == [str(own)]
    assert names(star) == [str(star)]


def test_results_are_never_drives(tree):
    Results.begun(tree / "results")
    (tree / "results" / "drives").mkdir()
    pl.DataFrame({"time_s": [0.0]}).write_parquet(tree / "results" / "drives" / "d.parquet")
    assert len(names(tree)) == 3


@pytest.mark.parametrize("name", ["nowhere", "nothing/**", "none*"])
def test_what_is_not_there_is_told(tmp_path, name):
    (tmp_path / "nothing").mkdir()
    with error(DriveError, tmp_path / name):
        names(tmp_path / name)


def test_the_first_recording_comes_before_the_last_is_looked_for(tree):
    found = recordings([str(tree), str(tree / "nowhere")])
    assert next(found).source == str(tree / "van0" / "monday")


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_table_of_drives(tree, suffix):
    table = pl.DataFrame(
        {
            "vehicle": ["van7", None],
            "start": ["2026-05-01T08:00:00+02:00", ""],
            "files": ["van0/monday", "van1/day.csv; s3://bucket/other.csv"],
            "class": ["truck", None],
            "driver": ["A", "B"],
        }
    )
    path = tree / f"drives{suffix}"
    getattr(table, f"write_{suffix[1:]}")(path)
    assert list(recordings([str(path)])) == [
        Recording((f"{tree}/van0/monday",), "van7", "truck", "2026-05-01T08:00:00+02:00"),
        Recording((f"{tree}/van1/day.csv", "s3://bucket/other.csv"), None, None, None),
    ]


def test_a_table_with_lists_and_dates(tmp_path):
    from datetime import datetime

    path = tmp_path / "drives.parquet"
    pl.DataFrame({"files": [["a", "b"]], "start": [datetime(2026, 5, 1, 8)]}).write_parquet(path)
    (found,) = recordings([str(path)])
    assert found.paths == (f"{tmp_path}/a", f"{tmp_path}/b")
    assert found.start == "2026-05-01T08:00:00+00:00"


def test_a_wrong_begin_names_its_row(tmp_path):
    path = tmp_path / "drives.csv"
    path.write_text("files,start\na,2026-05-01\nb,yesterday\n")
    with error(DriveError, "drives.csv row 3 yesterday"):
        names(path)


@pytest.fixture
def shelf(tmp_path):
    for name in ("van1", "van17", "van 17 b"):
        vehicle = describe(Known(name=name, kind="van")).vehicle
        vehicle.save(tmp_path / f"{name}.toml")
    (tmp_path / "map.toml").write_text('[signals.a]\nsignal = "vehicle_speed"\nunit = "km/h"\n')
    return Vehicles(tmp_path, "truck")


@pytest.mark.parametrize(
    ("path", "found"),
    [
        ("drives/van17/2026-05-01/trip", "van17"),
        ("drives/van17_2026-05-01.csv", "van17"),
        ("drives/van1.parquet", "van1"),
        ("drives/van17 b/van1/x.csv", "van1"),
        ("drives/van 17 b/x.csv", "van 17 b"),
        ("s3://bucket/van1/x.csv", "van1"),
    ],
)
def test_the_path_tells_the_vehicle(shelf, path, found):
    assert len(shelf) == 3
    assert shelf.of((path,)).file == f"{found}.toml"


def test_a_column_goes_before_the_path(shelf):
    assert shelf.of(("van17/x.csv",), "van1").id == "van1"


@pytest.mark.parametrize("path", ["drives/van170/x.csv", "drives/van/x.csv", "drives/xvan1.csv"])
def test_a_vehicle_without_a_file_is_one_of_its_class(shelf, path):
    found = shelf.of((path,))
    assert (found.file, found.kind) == (None, "truck")
    assert found.as_vehicle(Drive("empty", {})).kind == "truck"
    assert found.note.id == "vehicle.no_file"
    assert shelf.of((path,), "van99", "bus").note.id == "vehicle.no_file"
    assert shelf.of((path,), "van99", "bus").kind == "bus"


def test_an_impossible_class_is_told(shelf):
    with pytest.raises(ConfigError, match="class must be"):
        shelf.of(("x.csv",), "van99", "boat")


def test_no_folder_of_vehicles(tmp_path):
    with error(ConfigError, tmp_path / "none"):
        Vehicles(tmp_path / "none")


def test_a_mapping_of_many_vehicles_is_read_once_and_its_content_counts(tmp_path, monkeypatch):
    from weighbridge.fleet import vehicles

    text = '[signals.vehicle_speed]\ncolumn = "v"\nunit = "km/h"\n'
    (tmp_path / "map.toml").write_text(text)
    for name in ("van1", "van2"):
        vehicle = describe(Known(name=name, kind="van")).vehicle
        replace(vehicle, mapping="map.toml").save(tmp_path / f"{name}.toml")
    read, real = [], vehicles.load_mapping
    monkeypatch.setattr(vehicles, "load_mapping", lambda path: read.append(path) or real(path))
    first = Vehicles(tmp_path)
    assert read == [tmp_path / "map.toml"]
    found = [first.of((f"{name}.csv",)) for name in ("van1", "van2")]
    for assigned in found:
        assert assigned.mapping == {"signals": {"vehicle_speed": {"column": "v", "unit": "km/h"}}}
    (tmp_path / "map.toml").write_text(text.replace("km/h", "m/s"))
    again = [Vehicles(tmp_path).of((f"{name}.csv",)) for name in ("van1", "van2")]
    assert len({a.digest for a in (*found, *again)}) == 4


@pytest.mark.parametrize(
    ("folders", "vehicle"),
    [
        ("asset_id=TR-17/date=2026-10-08", "TR-17"),
        ("year=2026/month=3/vehicle=B%20202", "B 202"),
        ("date=2026-10-08/TR-17", "TR-17"),
        ("fleet/date=2026-10-08", "fleet"),
    ],
)
def test_a_partition_tells_the_vehicle_and_its_files_are_one_drive(tmp_path, folders, vehicle):
    known = tmp_path / "vehicles"
    known.mkdir()
    (known / "TR-17.toml").write_text('[vehicle]\nname = "x"\nclass = "truck"\n')
    folder = tmp_path / "lake" / folders
    folder.mkdir(parents=True)
    for name in ("part-0.parquet", "part-1.parquet"):
        pl.DataFrame({"time_s": [0.0]}).write_parquet(folder / name)
    found = list(recordings([f"{tmp_path}/lake/**"]))
    assert Vehicles(known).of(found[0].paths).id == vehicle
    if "=" in folder.name:
        assert [len(one.paths) for one in found] == [2]


def test_a_readme_is_no_drive_and_no_vehicle(tmp_path):
    drives, cars = tiny_fleet(tmp_path, 2, 2)
    for folder in (drives, drives / "van0", cars):
        for name in ("readme.txt", "README_first.txt", "LICENSE.txt"):
            (folder / name).write_text("Please read me")
    (drives / "van0" / "readmeter.csv").write_text("time_s\n")
    found = [r.source.rpartition("/")[2] for r in recordings([str(tmp_path)])]
    assert found == ["readmeter.csv", "trip-0000", "trip-0001"]
    assert len(Vehicles(cars)) == 2
