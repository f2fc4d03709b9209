"""Results behind a URL: the rows of a folder, whole after a kill between any two sendings."""

import fsspec
import polars as pl
import pytest

import weighbridge as wb
from tests.fleet.fleets import compared, tiny_fleet
from tests.noted import error
from weighbridge import ConfigError
from weighbridge.fleet.bucket import Bucket, brought, kept_at, place_of_results
from weighbridge.fleet.job import weigh_job
from weighbridge.fleet.run import FleetSettings, prepared

URL = "memory://bucket/results"


class Killed(BaseException):
    """Ends a process wherever it is."""


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """Return what takes this process to another machine: it has nothing but the store."""
    fsspec.filesystem("memory").store.clear()

    def move(name):
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / name))

    move("first")
    yield move
    fsspec.filesystem("memory").store.clear()


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    return tiny_fleet(tmp_path_factory.mktemp("fleet"), 6, vehicles=2)


def run(drives, cars, place=URL) -> list[str]:
    """Weigh in this process; return how each recording ended."""
    results = place_of_results(place)
    with (
        kept_at(results),
        prepared([str(drives)], cars, results.folder, FleetSettings()) as jobs,
    ):
        return [weigh_job(job).outcome for job in jobs]


def rows(table: str = "drives", url: str = URL) -> pl.DataFrame:
    """Rows of a table as a stranger's program finds them in the store."""
    files = fsspec.filesystem(url.partition(":")[0])
    found = sorted(f for f in files.find(f"{url}/{table}") if f.endswith(".parquet"))
    return pl.concat([pl.read_parquet(files.cat_file(f)) for f in found])


def test_the_store_has_what_a_folder_would(machine, fleet, tmp_path):
    run(*fleet, tmp_path / "here")
    run(*fleet)
    here = wb.fleet.read_drives(tmp_path / "here").collect()
    assert compared(rows()).equals(compared(here))
    legs = pl.read_parquet(str(tmp_path / "here/legs/**/*.parquet"), hive_partitioning=False)
    assert rows("legs").sort("source").equals(legs.sort("source"))
    machine("second")
    assert run(*fleet) == ["there"] * 6
    assert wb.fleet.read_drives(brought(URL)).collect().height == 6


def test_nothing_is_lost_nor_twice_after_a_kill_between_any_two_sendings(
    machine, fleet, monkeypatch
):
    drives, cars = fleet
    real = Bucket._put
    run(drives / "van0", cars)
    before, kills = rows(), 0
    start = dict(fsspec.filesystem("memory").store)
    while True:
        left = [kills]

        def put(self, name, data, left=left):
            left[0] -= 1
            if left[0] < 0:
                raise Killed
            real(self, name, data)

        machine(f"killed-{kills}")
        monkeypatch.setattr(Bucket, "_put", put)
        try:
            run(*fleet)
        except Killed:
            monkeypatch.setattr(Bucket, "_put", real)
        else:
            break
        there = rows()
        assert set(before["key"]) <= set(there["key"]), kills
        assert there.height == there["key"].n_unique(), kills
        machine(f"next-{kills}")
        run(*fleet)
        assert sorted(rows()["source"]) == sorted(set(rows()["source"])), kills
        assert rows().height == rows("legs").height == 6, kills
        # Again from what the first run left.
        files = fsspec.filesystem("memory")
        files.store.clear()
        files.store.update(start)
        kills += 2
    assert kills >= 8


def test_what_others_count_is_sent_first(machine, monkeypatch):
    results, sent = place_of_results(URL), []
    real = Bucket._put

    def put(self, name, data):
        sent.append(name)
        real(self, name, data)

    names = ["seen/1.parquet", "segments/day=a/s.parquet", "drives/day=b/grows.parquet",
             "drives/day=a/shrinks.parquet", "legs/day=a/l.parquet", "fleet.json"]  # fmt: skip
    with kept_at(results):
        for name in names:
            (results.folder / name).parent.mkdir(parents=True, exist_ok=True)
            (results.folder / name).write_bytes(b"four")
        results.send()
        for name in names:
            (results.folder / name).write_bytes(b"two" if "shrinks" in name else b"seven")
        monkeypatch.setattr(Bucket, "_put", put)
        results.send()
        assert sent == [*names, "sent.json"]
        (results.folder / "legs/day=a/l.parquet").unlink()
    left = fsspec.filesystem("memory").find("/bucket/results")
    assert "/bucket/results/legs/day=a/l.parquet" not in left
    assert len(left) == len(names)


def test_a_run_that_another_overtook_says_so(machine, fleet):
    results = place_of_results(URL)
    with results.locked():
        results.bring()
        results.claim()
        how = FleetSettings()
        with prepared([str(fleet[0])], fleet[1], results.folder, how) as jobs:
            for job in jobs:
                weigh_job(job)
        machine("second")
        run(*fleet)
        with error(ConfigError, "memory://bucket/results"):
            results.send()
    assert rows().height == 6


def test_places_that_cannot_be(machine, fleet):
    fsspec.filesystem("memory").pipe("/bucket/other/notes.txt", b"mine")
    with error(ConfigError, "memory://bucket/other"):
        run(*fleet, "memory://bucket/other")
    with error(ConfigError, "memory://bucket/nothing"):
        brought("memory://bucket/nothing")
    with error(ConfigError, URL, "tcp://10.0.0.5:8786"):
        wb.fleet.weigh_drives(*fleet, URL, scheduler="tcp://10.0.0.5:8786")
    with (
        place_of_results(URL).locked(),
        error(ConfigError, URL),
    ):
        run(*fleet)
