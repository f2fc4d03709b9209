"""A fleet through a cluster: all rows, once, in whatever order and after whatever went wrong."""

import importlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import dask
import polars as pl
import pytest

import weighbridge as wb
from tests.fleet.fleets import compared, copy_of
from tests.noted import error
from weighbridge import ConfigError, DriveError
from weighbridge.fleet.engine import Count
from weighbridge.fleet.job import Receipt
from weighbridge.fleet.store import Results

KEPT = ("MALLOC_TRIM_THRESHOLD_", "MALLOC_MMAP_THRESHOLD_")
"""How much memory a worker keeps for its next arrays: by Dask itself each comes anew."""


def weigh(tiny, results, scheduler, **how):
    drives, cars = tiny
    found = wb.fleet.weigh_drives(f"{drives}/**", cars, results, scheduler=scheduler, **how)
    return compared(found.collect())


@pytest.fixture(scope="module")
def whole(tiny, scheduler, tmp_path_factory):
    """Rows of the tiny fleet, weighed in one go."""
    return weigh(tiny, tmp_path_factory.mktemp("whole") / "results", scheduler)


def test_every_drive_has_its_row_and_a_second_run_weighs_none(tiny, scheduler, tmp_path, whole):
    assert whole.height == 40
    assert whole["vehicle_id"].value_counts().sort("vehicle_id").rows() == [
        ("van0", 14),
        ("van1", 13),
        ("van2", 13),
    ]
    results = tmp_path / "results"
    told = []
    first = weigh(tiny, results, scheduler, progress=lambda *counts: told.append(counts))
    assert first.equals(whole)
    assert told[-1] == (40, 40)
    files = {f: f.stat().st_mtime_ns for f in Results(results).table_files("drives")}
    assert weigh(tiny, results, scheduler).equals(whole)
    assert {f: f.stat().st_mtime_ns for f in Results(results).table_files("drives")} == files


def test_new_drives_are_added(tiny, scheduler, tmp_path, whole):
    drives, cars = tiny
    some = [str(drives / "van0"), str(drives / "van1")]
    results = tmp_path / "results"
    part = wb.fleet.weigh_drives(some, cars, results, scheduler=scheduler).collect()
    assert part.height == 27
    assert weigh(tiny, results, scheduler).equals(whole)


def test_a_drive_there_twice_has_one_row(tiny, scheduler, tmp_path):
    drives, cars = tiny
    home = copy_of(drives / "van0", tmp_path / "drives" / "van0")
    copy_of(home / "trip-0000", home / "trip-0000 (copy)")
    rows = weigh((tmp_path / "drives", cars), tmp_path / "results", scheduler)
    assert rows.height == 14


def test_a_changed_vehicle_file_weighs_its_drives_again(tiny, scheduler, tmp_path, whole):
    drives, cars = tiny
    own = copy_of(cars, tmp_path / "cars")
    weigh((drives, own), tmp_path / "results", scheduler)
    path = own / "van0.toml"
    path.write_text(path.read_text().replace("2000", "2100"))
    rows = weigh((drives, own), tmp_path / "results", scheduler)
    assert rows.select("source").equals(whole.select("source"))
    assert set(rows.filter(vehicle_id="van0")["tare_kg"]) == {2100.0}
    assert set(rows.filter(vehicle_id="van1")["tare_kg"]) == {2000.0}


def test_parts_are_gathered_while_a_run_goes_on(tiny, scheduler, tmp_path, whole, monkeypatch):
    from weighbridge.fleet import run

    monkeypatch.setattr(run, "_GATHER", 3)
    monkeypatch.setattr(run, "_REPORTED", 0.0)
    gathered = []
    real = Results.gather
    monkeypatch.setattr(Results, "gather", lambda self: gathered.append(real(self)))
    assert weigh(tiny, tmp_path / "results", scheduler).equals(whole)
    assert len(gathered) > 3


def test_mistakes_are_told_before_the_work(tiny, tmp_path, scheduler, monkeypatch):
    monkeypatch.setattr("weighbridge.fleet.cluster._CONNECT", 0.3)
    drives, cars = tiny
    with error(ConfigError, "magic"):
        weigh(tiny, tmp_path / "r", scheduler, method="magic")
    with error(ConfigError, "Dask tcp://127.0.0.1:1"):
        weigh(tiny, tmp_path / "r", "tcp://127.0.0.1:1")
    with error(ConfigError):
        weigh(tiny, tmp_path / "r", scheduler, workers=2)
    with error(DriveError, drives / "nowhere"):
        wb.fleet.weigh_drives([drives, drives / "nowhere"], cars, tmp_path / "s")
    with error(ConfigError, drives / "nowhere"):
        wb.fleet.weigh_drives(drives, drives / "nowhere", tmp_path / "s")
    with error(ConfigError, tmp_path / "nowhere.dbc"):
        wb.fleet.weigh_drives(drives, cars, tmp_path / "s", dbc=[f"{tmp_path}/nowhere.dbc"])
    with error(ConfigError, "bucket/results"):
        wb.fleet.weigh_drives(drives, cars, Path("s3://bucket/results"))
    assert not (tmp_path / "s").exists()


def test_time_left_follows_the_rate(monkeypatch):
    now = [105.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    count = Count(found=130, began=100.0)
    assert count.left is None
    for _ in range(100):
        count.add(Receipt("k", "there", 1, 1, 0.1))
    count.complete = True
    # What was there already came at once, and tells nothing of the rest.
    assert (count.rate, count.left) == (0.0, None)
    count.complete = False
    for _ in range(10):
        count.add(Receipt("k", "weighed", 1, 1, 0.1))
    assert count.left is None
    count.complete = True
    assert (count.rate, count.left) == (2.0, 10.0)
    for _ in range(20):
        count.add(Receipt("k", "there", 1, 1, 0.1))
    assert count.left == 0.0


COMMAND = [sys.executable, "-m", "weighbridge", "fleet"]


def started(tiny, results, *more):
    drives, cars = tiny
    words = [f"{drives}/**", "--vehicles", str(cars), "-o", str(results), *more]
    return subprocess.Popen(
        [*COMMAND, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def wait_for_rows(results: Path, count: int, process) -> None:
    """Wait until so many drives have a part file."""
    until = time.monotonic() + 120.0
    while process.poll() is None and time.monotonic() < until:
        if len(Results(results).part_files()) >= count:
            return
        time.sleep(0.002)


def test_a_killed_command_goes_on_where_it_was(tiny, tmp_path, whole, scheduler):
    results = tmp_path / "results"
    process = started(tiny, results, "--workers", "2")
    wait_for_rows(results, 9, process)
    process.kill()
    process.communicate()
    there = wb.fleet.read_drives(results).collect()
    assert 0 < there.height < 40
    assert there.height == there.unique(["key", "part"]).height
    rows = weigh(tiny, results, scheduler)
    assert rows.equals(whole)
    kept = wb.fleet.read_drives(results).collect()
    assert there.join(kept, on=["key", "part", "weighed_at"], how="anti").is_empty()


def test_an_interruption_ends_cleanly(tiny, tmp_path, whole, scheduler):
    results = tmp_path / "results"
    process = started(tiny, results, "--workers", "1")
    wait_for_rows(results, 5, process)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (130, "")
    assert Results(results).part_files() == []
    assert 0 < wb.fleet.read_drives(results).collect().height < 40
    assert out == ""
    assert weigh(tiny, results, scheduler).equals(whole)


def test_a_drive_that_kills_its_worker_has_a_row(tiny, tmp_path):
    # Its defaults are there before one of them is set for a while.
    importlib.import_module("distributed")
    drives, cars = tiny
    home = copy_of(drives / "van0", tmp_path / "drives" / "van0")
    (home / "trip-0003").rename(home / "deadly")
    fault = tmp_path / "fault.py"
    fault.write_text(
        "import os, signal\n"
        "from weighbridge.fleet import job\n"
        "read = getattr(job.content_digest, 'read', job.content_digest)\n"
        "def digest(paths):\n"
        "    if paths[0].name == 'deadly':\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    return read(paths)\n"
        "digest.read = read\n"
        "job.content_digest = digest\n"
    )
    with dask.config.set({"distributed.worker.preload": [str(fault)]}):
        rows = wb.fleet.weigh_drives(home, cars, tmp_path / "results", workers=1).collect()
    assert rows.height == 14
    (row,) = rows.filter(pl.col("outcome") != "weighed").to_dicts()
    assert (Path(row["source"]).name, row["outcome"]) == ("deadly", "failed")
    assert row["reason_id"] == "fleet.worker_died"


def test_workers_that_do_not_end_in_time_lose_nothing(tiny, tmp_path, monkeypatch):
    from distributed import Client, LocalCluster

    drives, cars = tiny
    home = copy_of(drives / "van0" / "trip-0003", tmp_path / "drives" / "van0" / "trip-0003")
    close, late, kept = LocalCluster.close, ["timed out after 10 s."], []

    def slow(cluster, timeout=None):
        if not kept:
            with Client(cluster) as client:
                kept.extend(client.run(lambda: [os.environ.get(name) for name in KEPT]).values())
        close(cluster, timeout=timeout)
        if late:
            raise TimeoutError(late.pop())

    monkeypatch.setattr(LocalCluster, "close", slow)
    found = wb.fleet.weigh_drives(home.parent, cars, tmp_path / "results", workers=1).collect()
    assert found["outcome"].to_list() == ["weighed"]
    assert not late
    assert kept == [["67108864"] * 2]
    document = (Path(__file__).parents[2] / "docs" / "fleet.md").read_text(encoding="utf-8")
    assert f"export {KEPT[0]}=67108864 {KEPT[1]}=67108864" in document
