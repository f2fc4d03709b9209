"""Every kind of bad input: a mass that is right, or one sentence; never a traceback.

The sentence goes to standard error with exit status 2 where the input cannot be
so, and into the result with exit status 1 where it cannot carry a mass.
"""

import json

import numpy as np
import polars as pl
import pytest
from tests.noted import named, says

import weighbridge as wb

ACCEL = [f"accel_{a}_mps2" for a in "xyz"]
GYRO = [f"gyro_{a}_radps" for a in "xyz"]


def weighed(ran, truth, within):
    """Check that a command gave a mass, and the right one."""
    assert ran.code == 0, ran.err
    result = json.loads(ran.out)
    assert result["status"] == "converged"
    assert result["mass_kg"] == pytest.approx(truth, rel=within)
    low, high = result["interval95_kg"]
    assert low < result["mass_kg"] < high
    return result


def refused(ran, *words, ids=()):
    """Check that a command ended with one line that names the values, or a message of these ids."""
    assert ran.code == 2
    assert ran.out == ""
    assert ran.err.startswith("weighbridge: ")
    assert ran.err.count("\n") == 1
    for word in words:
        assert named(ran.err, word)
    assert not ids or any(says(ran.err, id) for id in ids), ran.err


def without_mass(ran, status, *words):
    """Check that a command said why there is no mass."""
    assert ran.code == 1
    result = json.loads(ran.out)
    assert result["status"] == status
    assert result["mass_kg"] is None
    assert result["interval95_kg"] == [None, None]
    for word in words:
        assert word in result["reason"]
    return result


@pytest.fixture
def weigh(weighbridge, car):
    return lambda folder: weighbridge("weigh", folder, "--vehicle", car, "--json", "-")


@pytest.fixture(scope="module")
def plain(loaded, car):
    """Mass of the drive as it was recorded [kg]."""
    return wb.weigh(loaded.folder, car).mass


def times(columns, factor):
    return lambda frame: frame.with_columns(pl.col(columns) * factor)


def swapped(a, b):
    return lambda frame: frame.with_columns(pl.col(b).alias(a), pl.col(a).alias(b))


def held(column, value):
    """Make a column constant where it has a value."""
    return lambda frame: frame.with_columns(
        pl.when(pl.col(column).is_not_null()).then(pl.lit(value)).alias(column)
    )


def test_as_recorded(weigh, loaded):
    weighed(weigh(loaded.folder), loaded.mass, 0.05)


def test_no_gnss(weigh, loaded, changed):
    result = weighed(weigh(changed(gnss=None)), loaded.mass, 0.05)
    assert any(p["id"] == "gnss.none" for p in result["problems"])


def test_no_imu(weigh, loaded, changed):
    weighed(weigh(changed(imu=None)), loaded.mass, 0.10)


def test_neither_imu_nor_gnss(weigh, loaded, changed):
    result = weighed(weigh(changed(imu=None, gnss=None)), loaded.mass, 0.10)
    assert any(p["id"] == "motion.level" for p in result["problems"])


def test_no_accelerometer_beside_the_gyro(weigh, loaded, changed):
    weighed(weigh(changed(imu=lambda f: f.drop(ACCEL))), loaded.mass, 0.10)


def test_imu_and_gnss_without_vehicle_speed(weigh, loaded, changed):
    folder = changed(obd=lambda f: f.drop("vehicle_speed_kmh"))
    weighed(weigh(folder), loaded.mass, 0.05)


def test_no_load(weigh, weighbridge, known, loaded, changed, tmp_path):
    folder = changed(obd=lambda f: f.drop("engine_load_pct"))
    without_mass(weigh(folder), "missing_signals", "engine_load", "--torque air_flow")
    # The way the sentence names.
    by_air = tmp_path / "air.toml"
    done = weighbridge("calibrate", known.folder, "--torque", "air_flow", "-o", by_air)
    assert done.code == 0
    ran = weighbridge("weigh", folder, "--vehicle", by_air, "--json", "-")
    weighed(ran, loaded.mass, 0.08)


def test_no_obd_at_all(weigh, changed):
    without_mass(weigh(changed(obd=None)), "missing_signals", "engine_load", "engine_speed")


@pytest.mark.parametrize("gone", [(), ("gnss",), ("imu",), ("imu", "gnss")])
def test_speed_in_mph_under_a_kmh_header(weigh, changed, gone):
    mph = times("vehicle_speed_kmh", 1.0 / 1.609344)
    ran = weigh(changed(obd=mph, **dict.fromkeys(gone)))
    refused(ran, "vehicle_speed_mph", ids=["speed.unit"])
    pair = {"unit": "mph", "stem": "vehicle_speed", "suffix": "kmh"}
    assert says(ran.err, "speed_unit_pair", **pair)


def test_calibrating_with_speed_in_mph(weighbridge, changed, tmp_path):
    folder = changed(obd=times("vehicle_speed_kmh", 1.0 / 1.609344), gnss=None)
    output = tmp_path / "car.toml"
    refused(weighbridge("calibrate", folder, "-o", output), ids=["speed.unit"])
    assert not output.exists()


def test_accelerometer_in_g(weigh, changed_often):
    refused(weigh(changed_often(imu=times(ACCEL, 1.0 / 9.81))), ids=["imu.accel_in_g"])


def test_gyro_in_degrees(weigh, changed_often):
    refused(weigh(changed_often(imu=times(GYRO, 180.0 / np.pi))), ids=["imu.gyro_degrees"])


def test_positions_in_radians(weigh, changed):
    folder = changed(gnss=times(["latitude_deg", "longitude_deg"], np.pi / 180.0))
    refused(weigh(folder), "latitude_rad", ids=["position.radians"])


@pytest.mark.parametrize("gone", [(), ("gnss",)])
@pytest.mark.parametrize("axes", ["xy", "xz", "yz"])
@pytest.mark.parametrize("kind", ["accel_{}_mps2", "gyro_{}_radps"])
def test_swapped_axes(weigh, changed_often, kind, axes, gone):
    a, b = (kind.format(axis) for axis in axes)
    ran = weigh(changed_often(imu=swapped(a, b), **dict.fromkeys(gone)))
    swapped_axes = ("axes_differ", "axes_mirrored", "axes_swapped", "gyro_axes_swapped")
    refused(ran, ids=[f"imu.{name}" for name in swapped_axes])


@pytest.mark.parametrize("gone", [(), ("gnss",)])
@pytest.mark.parametrize(
    "columns",
    [*([c] for c in ACCEL), ["gyro_x_radps"], ["gyro_y_radps"], ["gyro_z_radps"], GYRO],
)
def test_wrong_sign(weigh, changed_often, columns, gone):
    ran = weigh(changed_often(imu=times(columns, -1.0), **dict.fromkeys(gone)))
    refused(ran, ids=["imu.axes_swapped", "imu.gyro_sign"])


@pytest.mark.parametrize("gone", [(), ("gnss",)])
def test_accelerometer_reversed(weigh, often, changed_often, gone):
    # A reversed accelerometer is the mirror image of one turned half around: what is along
    # the road stays right, so a right mass with the note that it was moved is an answer too.
    ran = weigh(changed_often(imu=times(ACCEL, -1.0), **dict.fromkeys(gone)))
    if ran.code == 0:
        told = json.loads(ran.out)
        low, high = told["interval95_kg"]
        assert low < often.mass < high
        assert abs(told["mass_kg"] / often.mass - 1.0) < 0.08
        assert any(p["id"] == "imu.mounting_moved" for p in told["problems"])
    else:
        assert ran.code in (1, 2)


def test_latitude_and_longitude_swapped(weigh, changed):
    folder = changed(gnss=swapped("latitude_deg", "longitude_deg"))
    refused(weigh(folder), ids=["position.swapped"])


@pytest.mark.parametrize(
    ("table", "column", "value"),
    [
        *(("imu", f"accel_{a}_mps2", v) for a in "xyz" for v in (0.0, -9.81)),
        *(("imu", f"gyro_{a}_radps", v) for a in "xyz" for v in (0.0, 0.01)),
        ("obd", "vehicle_speed_kmh", 0.0),
        ("obd", "vehicle_speed_kmh", 48.0),
        ("obd", "engine_speed_rpm", 1800.0),
        ("obd", "engine_load_pct", 30.0),
        ("gnss", "latitude_deg", 56.0),
        ("gnss", "speed_mps", 13.0),
    ],
)
def test_constant_signal(weigh, changed, changed_often, table, column, value):
    name = {"speed_mps": "gnss_speed"}.get(column, column.rpartition("_")[0])
    made = changed_often if table == "imu" else changed
    refused(weigh(made(**{table: held(column, value)})), name, ids=["range.stuck"])


def test_constant_altitude_is_a_level_road(weigh, loaded, changed):
    weighed(weigh(changed(gnss=held("altitude_m", 20.0))), loaded.mass, 0.06)


def standing_hour(frame):
    """Repeat the first 20 s, at rest, for an hour before the drive."""
    rest = frame.filter(pl.col("time_s") < 20.0)
    hour = [rest.with_columns(pl.col("time_s") + 20.0 * k) for k in range(180)]
    return pl.concat([*hour, frame.with_columns(pl.col("time_s") + 3600.0)])


def test_an_hour_of_standstill_before_the_drive(weigh, loaded, changed, plain):
    folder = changed(imu=standing_hour, obd=standing_hour, gnss=standing_hour)
    result = weighed(weigh(folder), loaded.mass, 0.05)
    assert result["mass_kg"] == pytest.approx(plain, rel=0.01)
    assert any(p["id"] == "speed.standstill" for p in result["problems"])


def test_nothing_but_an_hour_of_standstill(weigh, changed):
    def only(frame):
        return standing_hour(frame).filter(pl.col("time_s") < 3600.0)

    result = without_mass(weigh(changed(imu=only, obd=only, gnss=only)), "not_excited", "standing")
    assert any(p["id"] == "speed.stands" for p in result["problems"])


def test_one_empty_table(weigh, loaded, changed):
    result = weighed(weigh(changed(imu=lambda f: f.head(0))), loaded.mass, 0.10)
    assert any(p["id"] == "file.no_rows" and "imu" in p["text"] for p in result["problems"])


def test_all_tables_empty(weigh, changed):
    folder = changed(imu=pl.DataFrame.clear, obd=pl.DataFrame.clear, gnss=pl.DataFrame.clear)
    refused(weigh(folder), "empty")


def test_files_of_no_bytes(weigh, tmp_path):
    (tmp_path / "imu.csv").touch()
    (tmp_path / "obd.csv").touch()
    refused(weigh(tmp_path), "imu.csv")


def test_a_folder_without_a_drive(weigh, tmp_path):
    refused(weigh(tmp_path), str(tmp_path), "imu.csv")


def twice(frame):
    return pl.concat([frame, frame]).sort("time_s")


def blocks_reversed(frame):
    """Turn the order of the rows around in blocks of seven."""
    block = pl.int_range(pl.len()) // 7
    return frame.with_columns(block.alias("b")).select(pl.all().exclude("b").reverse().over("b"))


def backwards(frame):
    return frame.reverse()


@pytest.mark.parametrize("disorder", [twice, blocks_reversed, backwards])
def test_duplicate_and_reversed_time_stamps(weigh, loaded, changed, plain, disorder):
    ran = weigh(changed(imu=disorder, obd=disorder, gnss=disorder))
    if ran.code == 2:
        refused(ran, "time")
        return
    result = weighed(ran, loaded.mass, 0.05)
    assert result["mass_kg"] == pytest.approx(plain, rel=0.02)
    assert any(p["id"].startswith("clock.") for p in result["problems"])


@pytest.mark.parametrize("tables", [("imu",), ("obd",), ("gnss",), ("imu", "obd", "gnss")])
def test_blocks_of_nan(weigh, loaded, changed, tables):
    def holes(frame):
        hole = pl.col("time_s").is_between(200.0, 260.0) | pl.col("time_s").is_between(400, 430)
        return frame.with_columns(
            pl.when(hole).then(float("nan")).otherwise(pl.all().exclude("time_s")).name.keep()
        )

    weighed(weigh(changed(**dict.fromkeys(tables, holes))), loaded.mass, 0.06)


def test_time_stamps_of_nan(weigh, loaded, changed):
    def holes(frame):
        late = pl.col("time_s").is_between(200.0, 230.0)
        return frame.with_columns(
            pl.when(late).then(float("nan")).otherwise(pl.col("time_s")).alias("time_s")
        )

    weighed(weigh(changed(imu=holes, obd=holes)), loaded.mass, 0.06)


@pytest.mark.parametrize("table", ["imu", "obd", "gnss"])
def test_truncated_parquet(weigh, changed, table):
    folder = changed()
    path = folder / f"{table}.parquet"
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    refused(weigh(folder), f"{table}.parquet")


def test_truncated_csv_keeps_what_is_whole(weigh, loaded, changed):
    folder = changed()
    for table in ("imu", "obd", "gnss"):
        path = folder / f"{table}.parquet"
        pl.read_parquet(path).write_csv(folder / f"{table}.csv")
        path.unlink()
    path = folder / "obd.csv"
    text = path.read_text()
    path.write_text(text[: int(0.9 * len(text)) + 3])
    weighed(weigh(folder), loaded.mass, 0.06)


def test_text_in_place_of_numbers(weigh, changed):
    folder = changed(gnss=None)
    (folder / "gnss.csv").write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" * 20)
    refused(weigh(folder), "gnss.csv")
