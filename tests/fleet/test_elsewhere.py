"""Drives in an S3 store, results as Delta tables, the same function on Ray and Spark."""

import importlib.util
import re
import shutil
import subprocess
import sys
import time

import polars as pl
import pytest

import weighbridge as wb
from tests.fleet.fleets import compared, tiny_fleet
from tests.noted import error
from weighbridge import ConfigError, DriveError, MissingExtraError
from weighbridge.fleet.inputs import recordings


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """A local S3 store, by moto's server, with nine tiny drives; their folder and vehicle files.

    The server takes 150 MB: in a process of its own, they are free again when it ends.
    """
    if importlib.util.find_spec("moto") is None:
        pytest.skip("moto is not installed")
    fsspec = pytest.importorskip("fsspec")
    pytest.importorskip("s3fs")
    drives, cars = tiny_fleet(tmp_path_factory.mktemp("store"), 9)
    lone = drives / "van1-lone.csv"
    lone.write_text("time_s,vehicle_speed_kmh\n0,10\n1,11\n2,12\n")
    words = (sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", "0")
    log = tmp_path_factory.mktemp("server") / "log"
    with (
        log.open("w") as file,
        subprocess.Popen(words, stdout=file, stderr=file) as running,
        pytest.MonkeyPatch.context() as patch,
    ):
        until = time.monotonic() + 60.0
        while not (address := re.search(r"Running on (http://\S+:\d+)", log.read_text())):
            assert time.monotonic() < until, log.read_text()
            time.sleep(0.05)
        for name, value in (
            ("AWS_ACCESS_KEY_ID", "test"),
            ("AWS_SECRET_ACCESS_KEY", "test"),
            ("AWS_DEFAULT_REGION", "us-east-1"),
            ("AWS_ENDPOINT_URL", address[1]),
        ):
            patch.setenv(name, value)
        files = fsspec.filesystem("s3", skip_instance_cache=True)
        files.mkdir("fleet")
        files.put(str(drives), "fleet/drives", recursive=True)
        yield drives, cars
        running.kill()


def test_drives_are_listed_as_in_a_folder(store):
    drives, _ = store
    here = [r.source.removeprefix(str(drives)) for r in recordings([str(drives)])]
    for url in ("s3://fleet/drives", "s3://fleet/drives/**", "s3://fleet/dri*"):
        found = [r.source for r in recordings([url])]
        assert sorted(found) == sorted(f"s3://fleet/drives{name}" for name in here)
    assert len(list(recordings(["s3://fleet/drives/van1/**"]))) == 3


def test_a_store_without_drives_is_told(store):
    with error(DriveError, "s3://fleet/nothing/**"):
        list(recordings(["s3://fleet/nothing/**"]))
    with error(DriveError, "s3://no-such-bucket/**"):
        list(recordings(["s3://no-such-bucket/**"]))


def test_rows_of_a_store_are_those_of_a_folder(store, scheduler, tmp_path):
    drives, cars = store
    here = wb.fleet.weigh_drives(drives, cars, tmp_path / "here", scheduler=scheduler)
    there = wb.fleet.weigh_drives("s3://fleet/**", cars, tmp_path / "there", scheduler=scheduler)
    here, there = compared(here.collect()), compared(there.collect())
    assert there["source"].str.starts_with("s3://fleet/drives/").all()
    assert there.drop("source").equals(here.drop("source"))
    assert there.height == 10


def test_results_go_to_a_store_and_duckdb_reads_them_there(store, scheduler, tmp_path, monkeypatch):
    import duckdb
    import fsspec

    _, cars = store
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    url = "s3://fleet/results"
    here = wb.fleet.weigh_drives("s3://fleet/drives/**", cars, url, scheduler=scheduler)
    base = duckdb.connect()
    base.register_filesystem(fsspec.filesystem("s3"))
    there = base.sql(f"select * from read_parquet('{url}/drives/*/*.parquet')").pl()
    assert sorted(there["key"]) == sorted(here.collect()["key"])
    assert there.height == 10
    with error(ConfigError, "s3://no-such-bucket/r"):
        wb.fleet.weigh_drives("s3://fleet/drives/**", cars, "s3://no-such-bucket/r")


def test_what_a_store_lists_as_before_is_not_brought_again(store, tmp_path, monkeypatch):
    import fsspec

    from weighbridge.fleet.job import weigh_job
    from weighbridge.fleet.run import FleetSettings, prepared

    drives, cars = store
    files = fsspec.filesystem("s3")
    files.put(str(drives / "van0"), "fleet/again/van0", recursive=True)
    brought = {}
    get = files.get_file

    def get_file(path, *args, **named):
        brought[path.split("/")[3]] = True
        return get(path, *args, **named)

    monkeypatch.setattr(files, "get_file", get_file)

    def run():
        brought.clear()
        how = FleetSettings()
        with prepared(["s3://fleet/again/**"], cars, tmp_path / "results", how) as jobs:
            for job in jobs:
                weigh_job(job)
        return list(brought)

    assert run() == ["trip-0000", "trip-0003", "trip-0006"]
    assert run() == []
    place = "fleet/again/van0/trip-0003/obd.csv"
    files.pipe(place, files.cat(place).replace(b"4,", b"5,"))
    assert run() == ["trip-0003"]
    assert run() == []


def test_a_drive_that_left_the_store_is_tried_again(store, tmp_path):
    _, cars = store
    import fsspec

    from weighbridge.fleet.inputs import Recording
    from weighbridge.fleet.job import Job, weigh_job
    from weighbridge.fleet.store import Results, part_path, read_parts
    from weighbridge.fleet.vehicles import Vehicles

    files = fsspec.filesystem("s3")
    url = "s3://fleet/drives/van0/trip-9999"
    recording = Recording((url,))
    job = Job(
        recording=recording,
        assigned=Vehicles(cars).of(recording.paths),
        results=str(Results.begun(tmp_path / "results").folder),
    )
    (row,) = read_parts([part_path(tmp_path / "results", weigh_job(job).key)]).to_dicts()
    assert (row["outcome"], row["tries"]) == ("failed", 3)
    files.copy("fleet/drives/van0/trip-0000/obd.csv", f"{url}/obd.csv")
    files.invalidate_cache()
    assert weigh_job(job).outcome == "weighed"


def test_a_reason_names_the_store_and_no_path_of_this_machine(store, tmp_path):
    import tempfile

    import fsspec

    from weighbridge.fleet.job import weigh_job
    from weighbridge.fleet.run import FleetSettings, prepared

    _, cars = store
    files = fsspec.filesystem("s3")
    files.pipe("fleet/bad/van0/trip/obd.csv", b"time_s,vehicle_speed_kmh\n")
    files.pipe("fleet/bad/van0/lone.csv", b"no,log\n1,2\n")
    with prepared(["s3://fleet/bad/**"], cars, tmp_path / "results", FleetSettings()) as jobs:
        for job in jobs:
            weigh_job(job)
    reasons = wb.fleet.read_drives(tmp_path / "results").collect()["reason"].sort()
    assert not any(tempfile.gettempdir() in reason for reason in reasons)
    assert reasons.str.contains("s3://fleet/bad/van0/lone.csv", literal=True).sum() == 1
    assert reasons.len() == 2


def test_delta_tables_hold_each_row_once(tiny, scheduler, tmp_path):
    deltalake = pytest.importorskip("deltalake")
    drives, cars = tiny
    cars = shutil.copytree(cars, tmp_path / "cars")
    results, place = tmp_path / "results", tmp_path / "delta"

    def rows():
        return pl.from_arrow(deltalake.DeltaTable(str(place / "drives")).to_pyarrow_table())

    for part in ("van0", "van1", "van1"):
        wb.fleet.weigh_drives(drives / part, cars, results, scheduler=scheduler)
        wb.fleet.write_delta(results, place)
    assert rows().height == 27
    car = cars / "van0.toml"
    car.write_text(car.read_text().replace("2000", "2100"))
    wb.fleet.weigh_drives(drives / "van0", cars, results, scheduler=scheduler)
    wb.fleet.write_delta(results, place)
    assert rows().height == 27
    assert rows().filter(vehicle_id="van0")["tare_kg"].unique().to_list() == [2100.0]


def test_without_ray_the_remedy_is_its_own_package(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingExtraError, match=r"needs the package 'ray'.*: pip install ray$"):
        wb.fleet.weigh_on_ray(tmp_path, tmp_path, tmp_path / "results")


@pytest.mark.filterwarnings("ignore::FutureWarning:ray")
def test_ray_gives_the_same_rows(tiny, scheduler, tmp_path):
    ray = pytest.importorskip("ray", reason="ray is not installed")
    drives, cars = tiny
    some = drives / "van0"
    here = wb.fleet.weigh_drives(some, cars, tmp_path / "here", scheduler=scheduler)
    ray.init(num_cpus=2, include_dashboard=False)
    try:
        there = wb.fleet.weigh_on_ray(some, cars, tmp_path / "there")
    finally:
        ray.shutdown()
    assert compared(there.collect()).equals(compared(here.collect()))


@pytest.mark.filterwarnings("ignore:.*PySpark does not yet fully support pandas")
def test_spark_gives_the_same_rows(tiny, scheduler, tmp_path, monkeypatch):
    sql = pytest.importorskip("pyspark.sql", reason="pyspark is not installed")
    if shutil.which("java") is None:
        pytest.skip("Spark needs Java, and there is none")
    drives, cars = tiny
    some = drives / "van0"
    here = wb.fleet.weigh_drives(some, cars, tmp_path / "here", scheduler=scheduler)
    # Its workers take another Python otherwise, which may lack the package.
    monkeypatch.setenv("PYSPARK_PYTHON", sys.executable)
    spark = sql.SparkSession.builder.master("local[2]").getOrCreate()
    try:
        there = wb.fleet.weigh_on_spark(spark, some, cars, tmp_path / "there")
    finally:
        spark.stop()
    assert compared(there.collect()).equals(compared(here.collect()))
