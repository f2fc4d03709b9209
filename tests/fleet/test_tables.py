"""The tables that a run writes are read as they are by what others use, and join."""

from datetime import UTC, date, datetime

import polars as pl
import pytest

from tests.fleet.made_rows import drive, segment
from weighbridge.fleet.schema import DRIVES, PART, SEGMENTS
from weighbridge.fleet.store import Results, write_part

BEGUN = datetime(2026, 5, 4, 6, tzinfo=UTC)
INNER = [f.name for f in PART["segments"].inner.fields]
SUMS = {"truck1": 60.0, "truck2": 20.0, "truck3": 20.0}  # km of the segments of each vehicle


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """Folder of the tables of five drives on two days and one without a date."""
    results = Results.begun(tmp_path_factory.mktemp("tables") / "results")
    rows = [
        drive("a" * 32, mass=20000.0, std=500.0, date=date(2026, 5, 4)),
        drive("b" * 32, mass=20000.0, std=500.0, date=date(2026, 5, 4), warnings=["x"]),
        drive("c" * 32, start="2026-05-05T06:00:00Z", date=date(2026, 5, 5)),
        drive("d" * 32, "truck2", start="2026-05-05T06:00:00Z", date=date(2026, 5, 5)),
        drive("e" * 32, "truck3", start=None),
    ]
    for row in rows:
        told = [segment(row["key"], k, 0.0, 600.0, row["mass_kg"], 1.0) for k in range(2)]
        inner = [{name: one[name] for name in INNER} for one in told]
        write_part(results.folder, row["key"], [row | {"segments": inner}])
    results.gather()
    results.settle()
    return results.folder


def test_no_column_is_both_in_the_path_and_in_the_file(home):
    for table, columns in (("drives", DRIVES), ("segments", SEGMENTS)):
        paths = Results(home).table_files(table)
        assert len(paths) == 3
        for path in paths:
            inside = pl.read_parquet_schema(path)
            assert list(inside) == list(columns)
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
    both = segments.merge(drives, on=["key", "part", "vehicle_id"])
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
    both = segments.join(drives, on=["key", "part", "vehicle_id"])
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
