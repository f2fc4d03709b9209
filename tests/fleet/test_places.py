"""Every recording counts once for its vehicle, at the place where the last run found it."""

import os
import shutil
from datetime import UTC, date, datetime
from pathlib import Path

import polars as pl
import pytest

from tests.fleet.fleets import compared, copy_of, tiny_drive, tiny_fleet
from tests.noted import error
from weighbridge import ConfigError
from weighbridge.fleet import read_drives, read_segments, write_delta
from weighbridge.fleet.job import weigh_job
from weighbridge.fleet.run import FleetSettings, prepared
from weighbridge.fleet.schema import PART
from weighbridge.fleet.store import Results, write_part


def run(home: Path, *given, vehicles="vehicles", **how) -> pl.DataFrame:
    """Weigh the drives of a folder in this process; return the rows of the results."""
    named = [str(home / name) for name in given or ["drives"]]
    with prepared(named, home / vehicles, home / "results", FleetSettings(**how)) as jobs:
        for job in jobs:
            weigh_job(job)
    rows = read_drives(home / "results").collect()
    written = Results(home / "results").table_files("drives")
    table = pl.concat(pl.read_parquet(f, hive_partitioning=False) for f in written)
    assert table.sort("key", "part").equals(rows.sort("key", "part"))
    return rows


def places(rows):
    shown = rows.with_columns(pl.col("source").str.split("drives/").list.last())
    return sorted(shown.select("vehicle_id", "source").rows())


def files_of(home):
    return {f: f.stat().st_mtime_ns for f in (home / "results").glob("*/day=*/*.parquet")}


def test_one_log_of_five_vans_counts_for_each_and_each_says_so(tmp_path):
    tiny_fleet(tmp_path, 0, 5)
    for path in (tmp_path / "vehicles").glob("*.toml"):
        path.write_bytes((tmp_path / "vehicles" / "van0.toml").read_bytes())
    for k in range(5):
        tiny_drive(tmp_path / "drives" / f"van{k}" / "trip-1", 1)
        tiny_drive(tmp_path / "drives" / f"van{k}" / "trip-2", 10 + k)
    rows = run(tmp_path)
    assert rows.height == 10
    assert rows["vehicle_id"].value_counts()["count"].to_list() == [2] * 5
    shared = rows.filter(pl.col("source").str.ends_with("trip-1"))
    for row in shared.to_dicts():
        others = [f"van{k}" for k in range(5) if f"van{k}" != row["vehicle_id"]]
        assert row["also_vehicles"] == others
        assert row["problem_ids"][0] == "fleet.shared"
        assert ", ".join(others[:3]) in row["warnings"][0]
        assert len(row["warnings"]) == len(row["problem_ids"])
    rest = rows.filter(pl.col("source").str.ends_with("trip-2"))
    assert rest["also_vehicles"].list.len().sum() == 0
    before = files_of(tmp_path)
    assert run(tmp_path).equals(rows)
    assert files_of(tmp_path) == before
    for k in range(1, 5):
        shutil.rmtree(tmp_path / "drives" / f"van{k}" / "trip-1")
    rows = run(tmp_path)
    assert rows.height == 6
    assert "fleet.shared" not in rows["problem_ids"].explode().to_list()


@pytest.mark.parametrize("given", ["drives", "drives/van1"])
def test_a_drive_moved_to_another_vehicle_counts_there_alone(tmp_path, given):
    drives, _ = tiny_fleet(tmp_path, 4, 2)
    run(tmp_path)
    (drives / "van0" / "trip-0000").rename(drives / "van1" / "trip-0000")
    rows = run(tmp_path, given)
    assert places(rows) == [
        ("van0", "van0/trip-0002"),
        ("van1", "van1/trip-0000"),
        ("van1", "van1/trip-0001"),
        ("van1", "van1/trip-0003"),
    ]
    assert rows["also_vehicles"].list.len().sum() == 0
    (drives / "van1" / "trip-0000").rename(drives / "van0" / "trip-0000")
    assert ("van0", "van0/trip-0000") in places(run(tmp_path))
    assert run(tmp_path).height == 4


def test_a_copy_within_a_vehicle_counts_once_and_is_named(tmp_path):
    drives, _ = tiny_fleet(tmp_path, 4, 2)
    first = run(tmp_path)
    copy = copy_of(drives / "van0" / "trip-0000", drives / "van0" / "trip-0000 copy")
    rows = run(tmp_path)
    assert places(rows) == places(first)
    (row,) = rows.filter(pl.col("source").str.ends_with("trip-0000")).to_dicts()
    assert row["copies"] == [str(copy)]
    assert row["problem_ids"][0] == "fleet.copied"
    assert str(copy) in row["warnings"][0]
    before = files_of(tmp_path)
    assert run(tmp_path).equals(rows)
    assert files_of(tmp_path) == before
    shutil.rmtree(copy)
    assert run(tmp_path).equals(first)


def test_copies_that_are_new_at_once_count_once(tmp_path):
    drives, _ = tiny_fleet(tmp_path, 1, 1)
    copy_of(drives / "van0" / "trip-0000", drives / "van0" / "again")
    (row,) = run(tmp_path).to_dicts()
    assert (Path(row["source"]).name, len(row["copies"])) == ("again", 1)


def read_again(home, *, places=None):
    """Run once more; return the names of the recordings whose content was read."""
    given = str(places or home / "drives")
    with prepared([given], home / "vehicles", home / "results", FleetSettings()) as jobs:
        left = [job for job in jobs if not job.there]
        for job in left:
            weigh_job(job)
    return [job.recording.source.rpartition("/")[2] for job in left]


def test_what_is_as_it_was_is_not_read_again(tmp_path):
    drives, cars = tiny_fleet(tmp_path, 4, 2)
    copy_of(drives / "van0" / "trip-0000", drives / "van0" / "trip-0000 copy")
    first = run(tmp_path)
    assert read_again(tmp_path) == []
    home = drives / "van0" / "trip-0002"
    (home / "obd.csv").touch()
    assert read_again(tmp_path) == ["trip-0002"]
    assert read_again(tmp_path) == []
    # The same size and the old times, but other bytes.
    times = (home / "drive.toml").stat()
    (home / "drive.toml").write_text((home / "drive.toml").read_text().replace("06:02", "07:02"))
    os.utime(home / "drive.toml", ns=(times.st_atime_ns, times.st_mtime_ns))
    assert read_again(tmp_path) == ["trip-0002"]
    rows = read_drives(tmp_path / "results").collect()
    assert rows.filter(~pl.col("start").is_in(first["start"].implode())).height == 1
    home.rename(home.with_name("moved"))
    assert read_again(tmp_path) == ["moved"]
    car = cars / "van1.toml"
    car.write_text(car.read_text() + "\n")
    assert read_again(tmp_path) == ["trip-0001", "trip-0003"]
    assert read_again(tmp_path) == []
    for table in ("drives", "segments", "legs"):
        shutil.rmtree(tmp_path / "results" / table / "day=2026-05-01", ignore_errors=True)
    assert read_again(tmp_path) == ["trip-0000", "trip-0000 copy"]


def test_what_a_killed_run_weighed_is_not_read_again(tmp_path):
    tiny_fleet(tmp_path, 4, 2)
    given = [str(tmp_path / "drives")]
    cars, results = tmp_path / "vehicles", tmp_path / "results"
    with (
        pytest.MonkeyPatch.context() as patch,
        prepared(given, cars, results, FleetSettings()) as jobs,
    ):
        # Nothing is gathered any more, as where the command is gone.
        for name in ("gather", "settle"):
            patch.setattr(Results, name, lambda self: None)
        for _ in range(3):
            weigh_job(next(jobs))
    assert len(Results(results).part_files()) == 3
    assert read_again(tmp_path) == ["trip-0003"]


def test_a_drive_that_failed_is_tried_again(tmp_path, monkeypatch):
    tiny_fleet(tmp_path, 2, 1)
    monkeypatch.setattr("weighbridge.fleet.job._PAUSE", 0.0)
    with monkeypatch.context() as patch:
        patch.setattr("weighbridge.fleet.job.content_digest", lambda paths: 1 / 0)
        assert read_again(tmp_path) == ["trip-0000", "trip-0001"]
    assert read_again(tmp_path) == ["trip-0000", "trip-0001"]
    assert read_again(tmp_path) == []


def test_drives_that_change_places_keep_their_results(tmp_path):
    drives, _ = tiny_fleet(tmp_path, 2, 1)
    first = run(tmp_path)
    home = drives / "van0"
    (home / "trip-0000").rename(home / "aside")
    (home / "trip-0001").rename(home / "trip-0000")
    (home / "aside").rename(home / "trip-0001")
    rows = run(tmp_path)
    assert dict(zip(rows["key"], rows["source"], strict=True)) == dict(
        zip(first["key"], reversed(first["source"].to_list()), strict=True)
    )
    assert rows["weighed_at"].to_list() == first["weighed_at"].to_list()
    assert rows["copies"].list.len().sum() == 0


def test_a_table_that_names_another_vehicle_moves_the_drive(tmp_path):
    tiny_fleet(tmp_path, 1, 2)
    for vehicle in ("van0", "van1", "van0"):
        table = tmp_path / "drives.csv"
        table.write_text(f"files,vehicle\ndrives/van0/trip-0000,{vehicle}\n")
        rows = run(tmp_path, "drives.csv")
        assert rows["vehicle_id"].to_list() == [vehicle]


def test_a_vehicle_file_that_is_as_it_was_gives_the_results_of_then(tmp_path):
    tiny_fleet(tmp_path, 2, 1)
    path = tmp_path / "vehicles" / "van0.toml"
    text = path.read_text()
    for tare in ("2000", "2100", "2000"):
        path.write_text(text.replace("2000", tare))
        rows = run(tmp_path)
        assert set(rows["tare_kg"]) == {float(tare)}
        assert rows.height == 2
        assert read_segments(tmp_path / "results").collect().height == 0


def test_a_drive_that_is_gone_keeps_its_result(tmp_path):
    drives, _ = tiny_fleet(tmp_path, 4, 2)
    first = run(tmp_path)
    shutil.rmtree(drives / "van0" / "trip-0000")
    assert compared(run(tmp_path)).equals(compared(first))


def test_a_try_that_failed_leaves_the_result_of_before(tmp_path, monkeypatch):
    tiny_fleet(tmp_path, 1, 2)
    table = tmp_path / "drives.csv"
    table.write_text("files,vehicle\ndrives/van0/trip-0000,van0\n")
    first = run(tmp_path, "drives.csv")
    place = tmp_path / "drives" / "van0" / "trip-0000"
    place.rename(tmp_path / "away")
    monkeypatch.setattr("weighbridge.fleet.job._PAUSE", 0.0)
    assert run(tmp_path, "drives.csv").equals(first)
    table.write_text("files,vehicle\ndrives/van0/trip-0000,van1\n")
    (row,) = run(tmp_path, "drives.csv").to_dicts()
    assert (row["vehicle_id"], row["outcome"]) == ("van1", "failed")


def test_a_kill_before_the_tables_are_settled_is_made_good_by_the_next_run(tmp_path, monkeypatch):
    drives, _ = tiny_fleet(tmp_path, 4, 2)
    run(tmp_path)
    (drives / "van0" / "trip-0000").rename(drives / "van1" / "trip-0000")
    copy_of(drives / "van1" / "trip-0001", drives / "van1" / "copy")
    with monkeypatch.context() as patch:
        patch.setattr(Results, "settle", lambda self: None)
        with prepared(
            [str(drives)], tmp_path / "vehicles", tmp_path / "results", FleetSettings()
        ) as jobs:
            for job in jobs:
                weigh_job(job)
    assert read_drives(tmp_path / "results").collect().height == 5
    rows = run(tmp_path, "drives/van0")
    assert rows.height == 4
    assert rows["copies"].list.len().sum() == 1


def test_delta_tables_follow_the_results(tmp_path):
    """A lake has what counts, also of segments and of other results."""
    deltalake = pytest.importorskip("deltalake")
    results = {name: Results.begun(tmp_path / name) for name in ("one", "two")}
    lake = tmp_path / "lake"

    def put(name, key, content, vehicle, place, *, at):
        day = date(2026, 5, at)
        row = dict.fromkeys(PART) | {
            "key": key, "part": 0, "content": content, "vehicle_id": vehicle, "date": day,
            "source": str(tmp_path / place), "outcome": "weighed",
            "weighed_at": datetime(2026, 5, at, tzinfo=UTC),
            "segments": [{"segment": k, "mass_kg": 1000.0} for k in range(2)],
        }  # fmt: skip
        (tmp_path / place).touch()
        write_part(results[name].folder, key, [row])

    def written(name):
        results[name].gather()
        results[name].settle()
        write_delta(tmp_path / name, lake)
        found = [
            pl.from_arrow(deltalake.DeltaTable(str(lake / table)).to_pyarrow_table())
            for table in ("drives", "segments")
        ]
        assert sorted(found[1]["key"]) == sorted([*found[0]["key"]] * 2)
        assert found[0].schema["date"] == pl.Date
        return sorted(found[0].select("key", "vehicle_id").rows())

    put("one", "a1", "a", "van1", "a", at=1)
    put("one", "b1", "b", "van1", "b", at=1)
    assert written("one") == [("a1", "van1"), ("b1", "van1")]
    put("two", "c1", "c", "van1", "c", at=1)
    assert written("two") == [("a1", "van1"), ("b1", "van1"), ("c1", "van1")]
    (tmp_path / "a").unlink()
    put("one", "a2", "a", "van2", "moved", at=2)
    put("one", "b2", "b", "van1", "b", at=3)
    for _ in range(2):
        assert written("one") == [("a2", "van2"), ("b2", "van1"), ("c1", "van1")]
    put("one", "b3", "b", "van3", "other", at=4)
    written("one")
    rows = pl.from_arrow(deltalake.DeltaTable(str(lake / "drives")).to_pyarrow_table())
    assert rows.filter(key="b2")["also_vehicles"].to_list() == [["van3"]]
    shutil.rmtree(lake)
    old = read_drives(tmp_path / "one").drop("content").collect()
    deltalake.write_deltalake(str(lake / "drives"), old)
    with error(ConfigError, "lake/drives Delta content"):
        write_delta(tmp_path / "one", lake)


def test_a_folder_without_a_file_of_the_fleet_is_refused(tmp_path):
    _, cars = tiny_fleet(tmp_path, 6, 6)
    (tmp_path / "wrong").mkdir()
    shutil.copy(cars / "van0.toml", tmp_path / "wrong" / "bus.toml")
    (tmp_path / "empty").mkdir()
    with error(ConfigError, "van0 van1 van2 3 bus --class"):
        run(tmp_path, vehicles="wrong")
    with error(ConfigError, "van0 van1 van2 3 none --class"):
        run(tmp_path, vehicles="empty")
    assert not (tmp_path / "results").exists()
    assert set(run(tmp_path, vehicles="wrong", kind="van")["vehicle_class"]) == {"van"}


def test_one_vehicle_with_a_file_or_a_class_of_a_table_is_enough(tmp_path):
    _, cars = tiny_fleet(tmp_path, 2, 2)
    (cars / "van0.toml").unlink()
    rows = run(tmp_path)
    assert rows.sort("vehicle_id")["vehicle_file"].to_list() == [None, "van1.toml"]
    (cars / "van1.toml").unlink()
    (tmp_path / "drives.csv").write_text("files,class\ndrives/van0/trip-0000,bus\n")
    rows = run(tmp_path, "drives.csv").filter(vehicle_id="van0")
    assert rows["vehicle_class"].to_list() == ["bus"]
