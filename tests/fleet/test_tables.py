"""The tables that a run writes are read as they are by what others use, and join."""

import re
import shutil
import sys
from datetime import UTC, date, datetime
from pathlib import Path

import polars as pl
import pytest

from tests.fleet.made_rows import drive, segment
from weighbridge.fleet import report
from weighbridge.fleet.kept import keep_legs
from weighbridge.fleet.schema import DRIVES, LEGS, PART, SEGMENTS
from weighbridge.fleet.store import Results, write_part

BEGUN = datetime(2026, 5, 4, 6, tzinfo=UTC)
INNER = [f.name for f in PART["segments"].inner.fields]
JOINT = ["key", "part", "vehicle_id"]
PAGE = Path(__file__).parents[2] / "docs" / "fleet_queries.md"
SUMS = {"truck1": 60.0, "truck2": 20.0, "truck3": 20.0}  # km of the segments of each vehicle


def written(results, row, masses):
    """Write a drive with a segment for each mass, ten minutes long, and ten kilometres."""
    told = [
        segment(row["key"], k, 600.0 * k, 600.0 * (k + 1), mass, 500.0, moving_s=550.0,
                start_latitude_deg=48.0 + k, start_longitude_deg=11.0 + k)
        for k, mass in enumerate(masses)
    ]  # fmt: skip
    inner = [{name: one[name] for name in INNER} for one in told]
    write_part(results.folder, row["key"], [row | {"segments": inner}])


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """Folder of the tables of five drives on two days and one without a date."""
    results = Results.begun(tmp_path_factory.mktemp("tables") / "results")
    monday, tuesday = date(2026, 5, 4), date(2026, 5, 5)
    late = {"start": "2026-05-05T06:00:00Z", "date": tuesday}
    none = {"reason_id": "motion.not_excited"}
    for row, masses in (
        (drive("a" * 32, mass=20000.0, std=500.0, date=monday), [20000.0] * 2),
        (drive("b" * 32, start="2026-05-04T09:00:00Z", mass=12000.0, std=500.0, date=monday,
               load_changed=True, warnings=["x"]), [16000.0, 8100.0]),
        (drive("c" * 32, **none, **late), [None] * 2),
        (drive("d" * 32, "truck2", mass=19000.0, std=500.0, vehicle_file=None, gross_kg=None,
               **late), [19000.0] * 2),
        (drive("e" * 32, "truck3", start=None, **none), [None] * 2),
    ):  # fmt: skip
        written(results, row, masses)
    results.gather()
    results.settle()
    keep_legs(results)
    return results.folder


def test_no_column_is_both_in_the_path_and_in_the_file(home):
    for table, columns in (("drives", DRIVES), ("segments", SEGMENTS), ("legs", LEGS)):
        paths = Results(home).table_files(table)
        assert len(paths) == 3
        for path in paths:
            inside = pl.read_parquet_schema(path)
            assert dict(inside) == {name: column.type for name, column in columns.items()}
            assert path.parent.name.partition("=")[0] not in inside


def test_pandas_reads_and_joins_them(home):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    drives, segments = (pandas.read_parquet(home / name) for name in ("drives", "segments"))
    assert (len(drives), len(segments)) == (5, 10)
    assert (drives["day"] == "2026-05-05").sum() == 2
    for column in ("start", "weighed_at"):
        assert str(drives[column].dtype).startswith("datetime64[")
        assert str(drives[column].dtype).endswith(", UTC]")
    assert drives["start"].min() == pandas.Timestamp(BEGUN)
    assert set(drives["date"].dropna()) == {date(2026, 5, 4), date(2026, 5, 5)}
    assert len(pandas.read_parquet(home / "legs").merge(drives, on=JOINT)) == 6
    both = segments.merge(drives, on=JOINT)
    assert both.groupby("vehicle_id")["distance_km_x"].sum().to_dict() == SUMS


def test_pyarrow_reads_them(home):
    dataset = pytest.importorskip("pyarrow.dataset")
    import pyarrow as pa

    for partitioning in (None, "hive"):
        found = dataset.dataset(home / "drives", format="parquet", partitioning=partitioning)
        table = found.to_table()
        assert table.num_rows == 5
        assert table.schema.field("start").type == pa.timestamp("us", "UTC")
        assert table.schema.field("date").type == pa.date32()
        segments = dataset.dataset(home / "segments", partitioning=partitioning).to_table()
        sums = segments.group_by("vehicle_id").aggregate([("distance_km", "sum")])
        assert dict(zip(*sums.to_pydict().values(), strict=True)) == SUMS
    found = dataset.dataset(home / "drives", partitioning="hive")
    assert found.to_table(filter=dataset.field("day") == "2026-05-05").num_rows == 2


@pytest.mark.parametrize("hive", [None, True, False])
def test_polars_reads_them(home, hive):
    drives = pl.scan_parquet(home / "drives", hive_partitioning=hive)
    segments = pl.scan_parquet(home / "segments", hive_partitioning=hive)
    found = drives.select(list(DRIVES)).collect()
    assert dict(found.schema) == {name: column.type for name, column in DRIVES.items()}
    assert pl.scan_parquet(home / "legs").join(drives, on=JOINT).collect().height == 6
    both = segments.join(drives, on=JOINT)
    sums = both.group_by("vehicle_id").agg(pl.col("distance_km").sum()).collect()
    assert dict(sums.iter_rows()) == SUMS


def test_duckdb_reads_them(home):
    duckdb = pytest.importorskip("duckdb")
    drives, segments = (f"read_parquet('{home / t}/*/*.parquet')" for t in ("drives", "segments"))
    types = dict(duckdb.sql(f"SELECT * FROM (DESCRIBE SELECT * FROM {drives})").df()
                 [["column_name", "column_type"]].itertuples(index=False))  # fmt: skip
    assert types["start"] == types["weighed_at"] == "TIMESTAMP WITH TIME ZONE"
    assert types["date"] == "DATE"
    sums = duckdb.sql(
        f"SELECT vehicle_id, sum(s.distance_km) FROM {drives} d "
        f"JOIN {segments} s USING (key, part, vehicle_id) GROUP BY vehicle_id"
    ).fetchall()
    assert dict(sums) == SUMS
    day = duckdb.sql(f"SELECT count(*) FROM {drives} WHERE day = '2026-05-05'").fetchall()
    assert day == [(2,)]


def test_spark_reads_and_joins_them(home):
    sql = pytest.importorskip("pyspark.sql", reason="pyspark is not installed")
    if shutil.which("java") is None:
        pytest.skip("Spark needs Java, and there is none")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYSPARK_PYTHON", sys.executable)
        session = sql.SparkSession.builder.master("local[1]").config("spark.ui.enabled", "false")
        spark = session.config("spark.sql.session.timeZone", "UTC").getOrCreate()
        try:
            drives, segments, kept = (
                spark.read.parquet(str(home / name)) for name in ("drives", "segments", "legs")
            )
            assert {drives.schema[n].dataType.typeName() for n in ("start", "weighed_at")} == {
                "timestamp"
            }
            assert drives.where("day = '2026-05-05'").count() == 2
            assert kept.join(drives, JOINT).count() == 6
            sums = segments.groupBy("vehicle_id").sum("distance_km").collect()
            assert {row[0]: row[1] for row in sums} == SUMS
        finally:
            spark.stop()


def test_the_legs_are_those_of_the_drives_and_only_days_that_changed_are_made_anew(home, tmp_path):
    results = Results.opened(Path(shutil.copytree(home, tmp_path / "results")))
    by = ["key", "part", "leg"]

    def same():
        told = report(results.folder).legs
        files = results.table_files("legs")
        found = pl.concat(pl.read_parquet(f, hive_partitioning=False) for f in files)
        assert found.sort(by).equals(told.sort(by))
        return {f: f.stat().st_mtime_ns for f in files}

    keep_legs(results)
    before = same()
    keep_legs(results)
    assert same() == before
    tuesday = {"start": "2026-05-05T06:00:00Z", "date": date(2026, 5, 5)}
    written(results, drive("f" * 32, mass=9000.0, std=300.0, **tuesday), [9000.0])
    results.gather()
    keep_legs(results)
    after = same()
    assert [f.parent.name for f in after if after[f] != before[f]] == ["day=2026-05-05"]
    for table in ("drives", "segments"):
        shutil.rmtree(results.folder / table / "day=2026-05-05")
    keep_legs(results)
    assert len(same()) == 2


def test_the_five_questions_of_the_page_are_answered(home, monkeypatch):
    duckdb = pytest.importorskip("duckdb", reason="duckdb is not installed")
    monkeypatch.chdir(home.parent)
    asked = re.findall(r"```sql\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    with duckdb.connect() as base:
        base.sql("SET TimeZone = 'UTC'")
        who, why, carried, now, changed = (base.sql(query).fetchall() for query in asked)
    assert who == [("truck1", BEGUN, 20000.0, 980.0, 18000.0, 100.0)]
    assert [row[:4] for row in why] == [
        ("mass", "motion.not_excited", 2, ["truck1", "truck3"]),
        ("overload", "fleet.no_file", 1, ["truck2"]),
    ]
    assert carried[0] == (date(2026, 5, 4), "truck1", pytest.approx(321.0), 40.0, 10.0)
    assert [row[:2] for row in carried[1:]] == [
        (date(2026, 5, 5), "truck1"), (date(2026, 5, 5), "truck2"), (None, "truck3"),
    ]  # fmt: skip
    assert now == [
        ("truck1", datetime(2026, 5, 4, 9, 10, tzinfo=UTC), 8100.0, 500.0),
        ("truck2", datetime(2026, 5, 5, 6, tzinfo=UTC), 19000.0, 500.0),
    ]
    assert changed == [
        ("truck1", datetime(2026, 5, 4, 9, 10, tzinfo=UTC), 49.0, 12.0, 8100.0)
    ]  # fmt: skip
