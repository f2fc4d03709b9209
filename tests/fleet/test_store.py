"""Results on the disk: each row once, whatever was cut off."""

import os
import re
import shutil
from datetime import UTC, date, datetime
from pathlib import Path

import polars as pl
import pytest

from tests.noted import error
from weighbridge import ConfigError
from weighbridge.fleet import read_drives, read_segments, report
from weighbridge.fleet import store as store_module
from weighbridge.fleet.schema import FAILED, PART, UNREAD, WEIGHED
from weighbridge.fleet.store import Results, part_path, read_parts, write_part

NOW = datetime(2026, 5, 1, tzinfo=UTC)


def row(key, part=0, *, day=1, outcome=WEIGHED, source=None, at=NOW, segments=2):
    found = dict.fromkeys(PART)
    return found | {
        "key": key,
        "part": part,
        "date": date(2026, 5, day) if day else None,
        "source": source or key,
        "outcome": outcome,
        "weighed_at": at,
        "segments": [{"segment": k, "mass_kg": 1000.0 + k} for k in range(segments)],
    }


def keys(results):
    drives = read_drives(results.folder).collect()
    segments = read_segments(results.folder).collect()
    of_segments = segments.select("key", "part", "segment").rows()
    assert len(set(of_segments)) == len(of_segments) == 2 * drives.height
    return sorted(drives.select("key", "part").rows())


@pytest.fixture
def results(tmp_path):
    return Results.begun(tmp_path / "results")


def test_rows_are_the_same_before_and_after_gathering(results):
    write_part(results.folder, "aa", [row("aa"), row("aa", 1, day=2)])
    write_part(results.folder, "bb", [row("bb", day=None)])
    before = keys(results)
    results.gather()
    assert keys(results) == before == [("aa", 0), ("aa", 1), ("bb", 0)]
    assert results.part_files() == []
    write_part(results.folder, "cc", [row("cc")])
    results.gather()
    assert keys(results) == [*before, ("cc", 0)]
    assert [f.parent.name for f in results.table_files("drives")] == [
        "day=2026-05-01",
        "day=2026-05-02",
        "day=unknown",
    ]
    assert results.known_keys() == ["aa", "bb", "cc"]


def test_the_tables_are_hive_tables(results):
    write_part(results.folder, "aa", [row("aa"), row("aa", 1, day=None)])
    results.gather()
    frame = pl.scan_parquet(results.folder / "drives", hive_partitioning=True).collect()
    assert sorted(frame["date"].to_list(), key=str) == [date(2026, 5, 1), None]


@pytest.mark.parametrize("step", range(5))
def test_a_kill_while_gathering_loses_and_doubles_nothing(results, monkeypatch, step):
    for key in ("aa", "bb", "cc"):
        write_part(results.folder, key, [row(key), row(key, 1, day=2)])
    left = [step]

    class Killed(BaseException):
        pass

    def dies(real):
        def run(*given, **named):
            if left[0] == 0:
                raise Killed
            left[0] -= 1
            return real(*given, **named)

        return run

    with monkeypatch.context() as patch:
        patch.setattr(Results, "_add", dies(Results._add))
        patch.setattr(store_module.Path, "unlink", dies(store_module.Path.unlink))
        with pytest.raises(Killed):
            results.gather()
    expected = [(key, part) for key in ("aa", "bb", "cc") for part in (0, 1)]
    assert keys(results) == expected
    results.gather()
    assert keys(results) == expected
    gathered = pl.concat(pl.read_parquet(f) for f in results.table_files("drives"))
    assert gathered.height == 6


def test_a_full_file_is_left_alone_and_another_begun(results, monkeypatch):
    monkeypatch.setattr(store_module, "FULL", 2)
    for number in range(5):
        write_part(results.folder, f"{number:02}", [row(f"{number:02}")])
        results.gather()
        write_part(results.folder, f"{number:02}", [row(f"{number:02}")])
        results.gather()
    assert len(results.table_files("drives")) == 3
    assert len(keys(results)) == 5


def test_what_killed_writers_left_is_removed_and_never_read(results):
    write_part(results.folder, "aa", [row("aa")])
    home = part_path(results.folder, "aa").parent
    (home / ".aa-1234.weighbridge-part").write_bytes(b"half")
    (results.folder / ".x-1.weighbridge-part").mkdir()
    assert keys(results) == [("aa", 0)]
    results.clean()
    assert os.listdir(home) == ["aa.arrow"]  # noqa: PTH208
    assert not (results.folder / ".x-1.weighbridge-part").exists()


def test_a_failed_drive_is_tried_again_and_its_row_gives_way(results):
    write_part(results.folder, "f1", [row("f1", outcome=FAILED, source="trip")])
    write_part(results.folder, "u1", [row("u1", outcome=UNREAD)])
    results.gather()
    assert results.known_keys() == ["u1"]
    write_part(results.folder, "f1", [row("f1", outcome=FAILED, source="trip")])
    results.gather()
    assert keys(results) == [("f1", 0), ("u1", 0)]
    later = datetime(2026, 5, 2, tzinfo=UTC)
    write_part(results.folder, "aa", [row("aa", source="trip", at=later)])
    assert keys(results) == [("aa", 0), ("u1", 0)]
    results.gather()
    assert keys(results) == [("aa", 0), ("u1", 0)]


def test_a_part_gathered_meanwhile_is_left_out(results):
    write_part(results.folder, "aa", [row("aa")])
    gone = part_path(results.folder, "bb")
    assert read_parts([part_path(results.folder, "aa"), gone])["key"].to_list() == ["aa"]


def test_a_table_that_has_no_room_is_told_and_its_parts_stay(results):
    resource = pytest.importorskip("resource")
    write_part(results.folder, "aa", [row("aa")])
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(ConfigError, match=r"drives-0000\.parquet.* cannot be written"):
            results.gather()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert len(results.part_files()) == 1
    results.gather()
    assert keys(results) == [("aa", 0)]


def _damage(path, how):
    data = path.read_bytes()
    middle = len(data) // 2
    path.write_bytes({"cut": data[:middle], "empty": b"", "spoilt": b"\xff" * middle}[how]
                     + (data[middle:] if how == "spoilt" else b""))  # fmt: skip


@pytest.mark.parametrize("how", ["cut", "empty", "spoilt"])
@pytest.mark.parametrize("table", ["drives", "segments"])
def test_a_damaged_table_is_told_and_its_date_is_weighed_again(results, table, how):
    for key, day in (("aa", 1), ("bb", 1), ("cc", 2)):
        write_part(results.folder, key, [row(key, day=day)])
    results.gather()
    hurt = results.table_files(table)[0]
    _damage(hurt, how)
    with error(ConfigError, "day=2026-05-01") as told:
        report(results.folder)
    assert str(hurt) in str(told.value)
    removed = re.findall(r"\S+/day=\S+?(?=,| and )", str(told.value).partition("remove")[2])
    assert [Path(p).parent.name for p in removed] == ["drives", "segments"]
    for folder in removed:
        shutil.rmtree(folder)
    assert results.known_keys() == ["cc"]
    for key in ("aa", "bb"):
        write_part(results.folder, key, [row(key)])
    results.gather()
    assert keys(results) == [("aa", 0), ("bb", 0), ("cc", 0)]


@pytest.mark.parametrize("how", ["cut", "empty"])
def test_a_damaged_part_is_told(results, how):
    write_part(results.folder, "aa", [row("aa")])
    _damage(part_path(results.folder, "aa"), how)
    for use in (results.gather, lambda: read_drives(results.folder)):
        with error(ConfigError, "aa.arrow"):
            use()
    part_path(results.folder, "aa").unlink()
    results.gather()
    assert results.known_keys() == []


def test_a_folder_of_something_else_is_left_alone(tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    with error(ConfigError, tmp_path):
        Results.begun(tmp_path)
    with error(ConfigError, tmp_path):
        read_drives(tmp_path)
    assert [f.name for f in tmp_path.iterdir()] == ["letter.txt"]


def test_results_of_another_version_are_refused(results):
    (results.folder / "fleet.json").write_text('{"format_version": 99}')
    with pytest.raises(ConfigError, match="format 99"):
        Results.begun(results.folder)


def test_one_run_at_a_time(results):
    other = Results(results.folder)
    assert not other.running
    with results.locked():
        assert other.running
        with error(ConfigError, "results"), other.locked():
            pass
    assert not other.running


@pytest.mark.parametrize("version", [2, 3, 4])
def test_results_of_earlier_versions_are_read_and_not_written_to(results, version):
    begun = datetime(2026, 5, 1, 6, 30, tzinfo=UTC)
    write_part(results.folder, "aa", [row("aa") | {"start": begun, "vehicle_id": "van1"}])
    results.gather()
    (file,) = results.table_files("drives")
    lacks = ["content", "copies", "also_vehicles", "vehicle_digest"]
    lacks += ["reason_id", "problem_ids"] * (version == 2)
    text = pl.lit("2026-05-01T08:30:00.000+02:00").alias("start")
    pl.read_parquet(file).drop(lacks).with_columns(text).write_parquet(file)
    (file,) = results.table_files("segments")
    pl.read_parquet(file).drop("vehicle_id").write_parquet(file)
    for table in ("drives", "segments"):
        home = results.folder / table
        (home / "day=2026-05-01").rename(home / "date=2026-05-01")
    mark = results.folder / store_module.MARK
    mark.write_text(f'{{"format_version": {version}}}\n')
    (found,) = read_drives(results.folder).collect().to_dicts()
    assert (found["key"], found["start"]) == ("aa", begun)
    assert (found["reason_id"], found["problem_ids"], found["copies"]) == (None, None, [])
    segments = read_segments(results.folder).collect()
    assert segments["vehicle_id"].to_list() == ["van1", "van1"]
    with pytest.raises(ConfigError, match=f"results of format {version}"):
        Results.begun(results.folder)
