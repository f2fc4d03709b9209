"""Reading drives: names, units, joins; and one test for every bad input."""

import sys

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import error, has, refused, says

from weighbridge import Drive, DriveError, DriveInfo, MissingExtraError, Signal, read_drive
from weighbridge.io import read_table, write_drive, write_table
from weighbridge.signals import QUANTITIES

OBD = "time_s,vehicle_speed_kmh,engine_speed_rpm\n0,36,600\n0.5,54,\n1,72,1200\n"


def write(path, content=OBD):
    path.parent.mkdir(exist_ok=True, parents=True)
    path.write_text(content, encoding="utf-8")
    return path


# What is read


def test_empty_cells_leave_each_signal_its_own_clock(tmp_path):
    write(tmp_path / "drive" / "obd.csv")
    drive = read_drive(tmp_path / "drive")
    assert drive.name == "drive"
    assert drive.problems == ()
    assert_array_equal(drive.signals["vehicle_speed"].time, [0.0, 0.5, 1.0])
    assert_allclose(drive.signals["vehicle_speed"].values, [10.0, 15.0, 20.0])
    assert_array_equal(drive.signals["engine_speed"].time, [0.0, 1.0])
    assert_allclose(drive.signals["engine_speed"].values, [20 * np.pi, 40 * np.pi])


@pytest.mark.parametrize(
    ("column", "cell", "name", "value"),
    [
        ("vehicle_speed_mph", "10", "vehicle_speed", 4.4704),
        ("Vehicle_Speed_MPS", "10", "vehicle_speed", 10.0),
        ("accel_x_g", "-1", "accel_x", -9.80665),
        ("gyro_z_degps", "180", "gyro_z", np.pi),
        ("engine_torque_nm", "50", "engine_torque", 50.0),
        ("engine_torque_pct", "50", "engine_torque_fraction", 0.5),
        ("engine_torque_ratio", "0.5", "engine_torque_fraction", 0.5),
        ("engine_load_ratio", "0.3", "engine_load", 0.3),
        ("lambda_1", "1.02", "lambda_1", 1.02),
        ("gear", "3", "gear", 3.0),
        ("altitude_ft", "1000", "altitude", 304.8),
        ("gnss_speed_mps", "7", "gnss_speed", 7.0),
        ("intake_pressure_hpa", "1000", "intake_pressure", 1e5),
        ("ambient_temperature_degf", "32", "ambient_temperature", 273.15),
        ("suspension_travel_fl_m", "0.01", "suspension_travel_fl", 0.01),
    ],
)
def test_any_unit_of_the_dimension_is_taken(tmp_path, column, cell, name, value):
    drive = read_drive(write(tmp_path / "log.csv", f"time_s,{column}\n0,{cell}\n1,{cell}\n"))
    assert set(drive.signals) == {name}
    assert drive.signals[name].values == pytest.approx([value, value], rel=1e-12)


def test_short_names_of_the_gnss_table(tmp_path):
    write(
        tmp_path / "gnss.csv",
        "time_ms,latitude_deg,longitude_deg,speed_mps,course_deg\n0,48,11,3,90\n",
    )
    drive = read_drive(tmp_path)
    assert set(drive.signals) == {"latitude", "longitude", "gnss_speed", "gnss_course"}
    assert drive.signals["gnss_course"].values == pytest.approx([np.pi / 2])


def test_short_names_elsewhere_are_not_guessed(tmp_path):
    drive = read_drive(write(tmp_path / "obd.csv", "time_s,speed_kmh,gear\n0,36,1\n"))
    assert set(drive.signals) == {"gear"}
    assert any("'speed_kmh' (did you mean vehicle_speed_kmh?)" in p.text for p in drive.problems)


def test_truth_and_other_files_are_not_read(tmp_path):
    write(tmp_path / "obd.csv")
    write(tmp_path / "truth.csv", "time_s,mass_kg\n0,1580\n")
    write(tmp_path / "readme.md", "hello")
    assert set(read_drive(tmp_path).signals) == {"vehicle_speed", "engine_speed"}
    assert_array_equal(read_table(tmp_path / "truth.csv")["mass_kg"], [1580.0])


def test_unknown_columns_are_told(tmp_path):
    write(tmp_path / "obd.csv", "time_s,vehicle_speed_kmh,coolant_degc,vehicle_sped_kmh\n0,1,2,3\n")
    (problem,) = read_drive(tmp_path).problems
    assert not problem.serious
    assert "'coolant_degc'" in problem.text
    assert "did you mean vehicle_speed_kmh?" in problem.text


def test_second_column_of_a_quantity_is_told(tmp_path):
    write(tmp_path / "obd.csv", "time_s,vehicle_speed_kmh,vehicle_speed_mps\n0,36,99\n")
    drive = read_drive(tmp_path)
    assert drive.signals["vehicle_speed"].values == pytest.approx([10.0])
    twice = {"name": "vehicle_speed_mps", "first": "vehicle_speed_kmh"}
    assert has(drive.problems, "file.column_twice", **twice)


def test_pieces_of_one_recording_are_joined(tmp_path):
    b = write(tmp_path / "part2.csv", "time_s,vehicle_speed_mps\n2,3\n3,4\n")
    a = write(tmp_path / "part1.csv", "time_s,vehicle_speed_mps\n0,1\n1,2\n")
    drive = read_drive([b, a])
    assert_array_equal(drive.signals["vehicle_speed"].time, [0.0, 1.0, 2.0, 3.0])
    assert_array_equal(drive.signals["vehicle_speed"].values, [1.0, 2.0, 3.0, 4.0])


def test_recordings_over_each_other_are_refused(tmp_path):
    a, b = write(tmp_path / "a.csv"), write(tmp_path / "b.csv")
    with error(DriveError, "vehicle_speed a.csv b.csv"):
        read_drive([a, b])


@pytest.mark.parametrize("table_format", ["csv", "parquet"])
def test_written_drive_is_read_again(tmp_path, table_format):
    rng = np.random.default_rng(3)
    fast, slow = np.arange(0.0, 2.0, 0.005), np.arange(0.0, 2.0, 0.3)
    signals = {}
    for name, q in QUANTITIES.items():
        time = fast if q.table == "imu" else slow + 0.01 * rng.integers(0, 3)
        low, high = max(q.low, -50.0), min(q.high, 300.0)
        signals[name] = Signal(name, time, rng.uniform(low, max(high, low + 1.0), time.size))
    info = DriveInfo(
        vehicle="x", mass=1500.0, wind_from=1.0, ambient_temperature=290.0, notes="a",
        trusted=("vehicle_speed", "engine_load"),
    )  # fmt: skip
    write_drive(Drive("d", signals, info), tmp_path / "d", table_format, truth={"time_s": fast})
    drive = read_drive(tmp_path / "d")
    assert drive.info == info
    assert drive.problems == ()
    assert set(drive.signals) == set(signals)
    for name, s in signals.items():
        assert_array_equal(drive.signals[name].time, s.time)
        assert_allclose(drive.signals[name].values, s.values, rtol=1e-12, atol=1e-12)
    assert drive.signals["accel_x"].time is drive.signals["gyro_z"].time


def test_arrays_can_be_written_to(tmp_path):
    write_table({"time_s": np.arange(4.0), "gear": np.ones(4)}, tmp_path / "obd.parquet")
    signal = read_drive(tmp_path).signals["gear"]
    assert signal.values.flags.writeable
    assert signal.time.flags.writeable


def test_whole_numbers_and_small_floats_become_doubles(tmp_path):
    pl.DataFrame(
        {
            "time_s": pl.Series([0, 1, 2], dtype=pl.Int32),
            "gear": pl.Series([1, None, 3], dtype=pl.UInt8),
            "vehicle_speed_mps": pl.Series([0.5, 1.5, 2.5], dtype=pl.Float32),
            "brake_switch": [True, False, True],
        }
    ).write_parquet(tmp_path / "obd.parquet")
    drive = read_drive(tmp_path)
    assert all(s.values.dtype == np.float64 for s in drive.signals.values())
    assert_array_equal(drive.signals["gear"].values, [1.0, 3.0])
    assert_array_equal(drive.signals["brake_switch"].values, [1.0, 0.0, 1.0])


def test_byte_order_mark_line_ends_and_quotes(tmp_path):
    (tmp_path / "obd.csv").write_bytes(
        b'\xef\xbb\xbf"time_s";"vehicle_speed_kmh"\r\n"0";"36"\r\n"1";"72"\r\n'
    )
    drive = read_drive(tmp_path)
    assert drive.problems == ()
    assert_allclose(drive.signals["vehicle_speed"].values, [10.0, 20.0])


# Bad input


def test_no_such_file(tmp_path):
    with error(DriveError, "nowhere"):
        read_drive(tmp_path / "nowhere")


def test_no_files_at_all():
    with error(DriveError):
        read_drive([])


def test_folder_without_tables(tmp_path):
    with error(DriveError, "imu.csv obd.csv"):
        read_drive(tmp_path)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("log.xlsx", b"PK", "save its sheet as CSV"),
        ("log.cvs", b"a,b\n1,2\n3,4\n", "it is a text: name it \\.csv"),
        ("log.parket", bytes(range(256)), r"the nearest that is known is \.parquet"),
        ("log.odd", bytes(range(256)), r"known are \.csv"),
    ],
)
def test_an_unknown_suffix_is_told_the_nearest_or_what_to_export(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DriveError, match=f"cannot be read; .*{said}"):
        read_drive(tmp_path / name)


def test_one_table_in_two_formats(tmp_path):
    write(tmp_path / "obd.csv")
    write_table({"time_s": np.arange(3.0), "gear": np.ones(3)}, tmp_path / "obd.parquet")
    with error(DriveError, "obd.csv obd.parquet"):
        read_drive(tmp_path)


def test_missing_unit(tmp_path):
    with error(DriveError, "obd.csv vehicle_speed vehicle_speed_kmh"):
        read_drive(write(tmp_path / "obd.csv", "time_s,vehicle_speed\n0,1\n"))


def test_unknown_unit(tmp_path):
    with pytest.raises(DriveError, match=r"'vehicle_speed_knots' ends in 'knots', which is not"):
        read_drive(write(tmp_path / "obd.csv", "time_s,vehicle_speed_knots\n0,1\n"))


def test_unit_of_another_dimension(tmp_path):
    with pytest.raises(DriveError, match=r"'accel_x_radps' ends in 'radps'.*accel_x_mps2"):
        read_drive(write(tmp_path / "imu.csv", "time_s,accel_x_radps\n0,1\n"))


def test_missing_time_column(tmp_path):
    with pytest.raises(DriveError, match=r"has no time column; name it time_s"):
        read_drive(write(tmp_path / "obd.csv", "vehicle_speed_kmh,gear\n1,1\n"))


def test_foreign_columns_without_a_mapping(tmp_path):
    said = r"it has 'Zeit', 'Tempo': name them by a mapping: weighbridge map .*log.csv -o map.toml$"
    with pytest.raises(DriveError, match=said):
        read_drive(write(tmp_path / "log.csv", "Zeit;Tempo\n0;1\n"))


def test_empty_file(tmp_path):
    with error(DriveError, "obd.csv"):
        read_drive(write(tmp_path / "obd.csv", ""))


def test_tables_with_headers_only(tmp_path):
    write(tmp_path / "obd.csv", "time_s,vehicle_speed_kmh\n")
    with error(DriveError, "obd.csv") as caught:
        read_drive(tmp_path)
    assert says(str(caught.value), "file.no_rows", file="obd.csv")


def test_one_empty_table_beside_others_is_a_note(tmp_path):
    write(tmp_path / "obd.csv")
    write(tmp_path / "gnss.csv", "time_s,latitude_deg,longitude_deg\n")
    drive = read_drive(tmp_path)
    assert drive.has("vehicle_speed")
    assert has(drive.problems, "file.no_rows", file="gnss.csv")


def test_empty_parquet(tmp_path):
    pl.DataFrame(
        {"time_s": [], "gear": []}, schema={"time_s": pl.Float64, "gear": pl.Float64}
    ).write_parquet(tmp_path / "obd.parquet")
    with error(DriveError, "obd.parquet"):
        read_drive(tmp_path)


def test_duplicate_and_reversed_stamps_are_left_out_and_counted(tmp_path):
    write(
        tmp_path / "obd.csv",
        "time_s,vehicle_speed_mps\n0,0\n1,1\n1,9\n2,2\n1.5,9\n3,3\n4,4\n",
    )
    drive = read_drive(tmp_path)
    assert_array_equal(drive.signals["vehicle_speed"].values, [0.0, 1.0, 2.0, 3.0, 4.0])
    assert has(drive.problems, "clock.repeated", count=1, rows=7)
    assert has(drive.problems, "clock.backwards", source="obd.csv", back="0.5 s")


def test_block_of_nan_is_left_out_and_counted(tmp_path):
    values = np.arange(100.0)
    values[20:60] = np.nan
    pl.DataFrame({"time_s": np.arange(100.0), "accel_x_mps2": values}).write_parquet(
        tmp_path / "imu.parquet"
    )
    drive = read_drive(tmp_path)
    assert len(drive.signals["accel_x"]) == 60
    assert has(drive.problems, "file.cells_nan", count=40, cells=100, name="accel_x_mps2")


def test_infinite_values_are_left_out_and_counted(tmp_path):
    write(tmp_path / "imu.csv", "time_s,accel_x_mps2\n0,1\n1,inf\n2,-inf\n3,2\n")
    drive = read_drive(tmp_path)
    assert_array_equal(drive.signals["accel_x"].values, [1.0, 2.0])
    assert has(drive.problems, "file.infinite", count=2, samples=4, signal="accel_x")


def test_cells_that_are_no_numbers_are_left_out_and_counted(tmp_path):
    write(tmp_path / "obd.csv", "time_s,gear\n0,1\n1,oops\n2,n/a\n3,4\n4,5\n")
    drive = read_drive(tmp_path)
    assert_array_equal(drive.signals["gear"].values, [1.0, 4.0, 5.0])
    told = {"count": 1, "filled": 4, "name": "gear", "example": "oops", "row": 2}
    assert has(drive.problems, "file.cells_text", **told)


def test_column_of_text_is_refused(tmp_path):
    write(tmp_path / "obd.csv", "time_s,gear\n0,first\n1,second\n2,3\n")
    with error(DriveError, "obd.csv gear first 1"):
        read_drive(tmp_path)


def test_time_of_text_is_refused(tmp_path):
    with error(DriveError, "obd.csv time_s 12:00:00"):
        read_drive(write(tmp_path / "obd.csv", "time_s,gear\n12:00:00,1\n12:00:01,2\n"))


def test_rows_of_other_lengths(tmp_path):
    write(tmp_path / "obd.csv", "time_s,gear\n0\n1,1\n2,3,99\n3,4\n")
    drive = read_drive(tmp_path)
    assert_array_equal(drive.signals["gear"].time, [1.0, 2.0, 3.0])


def test_last_line_cut_off(tmp_path):
    write(tmp_path / "obd.csv", "time_s,vehicle_speed_mps,gear\n0,1,1\n1,2,1\n2,")
    drive = read_drive(tmp_path)
    assert_array_equal(drive.signals["vehicle_speed"].values, [1.0, 2.0])


def test_zero_bytes_of_a_broken_off_recording(tmp_path):
    (tmp_path / "obd.csv").write_bytes(b"time_s,gear\n0,1\n1,2\n" + bytes(64))
    drive = read_drive(tmp_path)
    assert_array_equal(drive.signals["gear"].values, [1.0, 2.0])
    assert has(drive.problems, "file.zero_bytes", count=64)


@pytest.mark.parametrize("part", [0, 3, 200, -8, -1])
def test_truncated_parquet(tmp_path, part):
    path = tmp_path / "imu.parquet"
    write_table({"time_s": np.arange(1000.0), "accel_x_mps2": np.arange(1000.0)}, path)
    path.write_bytes(path.read_bytes()[:part])
    with error(DriveError, "imu.parquet Parquet") as caught:
        read_drive(tmp_path)
    assert "\n" not in str(caught.value)


def test_parquet_under_a_csv_name(tmp_path):
    path = tmp_path / "imu.parquet"
    write_table({"time_s": np.arange(10.0), "gear": np.arange(10.0)}, path)
    path.rename(tmp_path / "imu.csv")
    with error(DriveError, "imu.csv .parquet .mf4"):
        read_drive(tmp_path)


@pytest.mark.parametrize("content", [b"", b"MDF     4.10", b"nonsense" * 50])
def test_broken_mf4(tmp_path, content):
    pytest.importorskip("asammdf")
    (tmp_path / "log.mf4").write_bytes(content)
    with pytest.raises(DriveError, match=r"log\.mf4 is not a readable MDF file"):
        read_drive(tmp_path / "log.mf4")


def test_a_channel_without_a_unit_is_named_with_those_it_could_be_in(tmp_path):
    from asammdf import MDF
    from asammdf import Signal as Channel

    path, time = tmp_path / "log.mf4", np.arange(0.0, 20.0, 0.1)
    speed = Channel(np.full(time.size, 50.0), time, name="vehicle_speed", unit="")
    engine = Channel(np.full(time.size, 2000.0), time, name="engine_speed", unit="rpm")
    with MDF() as file:
        file.append([speed, engine])
        file.save(path)
    drive = read_drive(path)
    assert set(drive.signals) == {"engine_speed"}
    (note,) = drive.problems
    assert (note.id, note.values["name"]) == ("file.no_unit", "vehicle_speed")
    assert "vehicle_speed_kmh" in note.text
    with MDF() as file:
        file.append([speed])
        file.save(path, overwrite=True)
    with error(DriveError, "vehicle_speed_kmh"):
        read_drive(path)


def test_mf4_without_its_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "asammdf", None)
    (tmp_path / "log.mf4").write_bytes(b"MDF     ")
    with pytest.raises(MissingExtraError, match=r'pip install "weighbridge\[mdf\]"'):
        read_drive(tmp_path / "log.mf4")


def test_clocks_of_two_kinds(tmp_path):
    stamps = pl.Series([0, 1_000_000], dtype=pl.Datetime("us"))
    pl.DataFrame({"time_s": stamps, "gear": [1.0, 2.0]}).write_parquet(tmp_path / "obd.parquet")
    write(tmp_path / "imu.csv", "time_s,accel_x_mps2\n0,1\n1,2\n")
    with refused("clock.nothing_shared") as caught:
        read_drive(tmp_path)
    why = caught.value.problem.values["why"]
    assert says(why, "dates_and_counts", dated="obd.parquet", counted="imu.csv")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("mass_kg = -3", r"line 1: mass_kg must be above 0"),
        ("mass = 1580", r"no unit; write it as mass_kg"),
        ("weight_kg = 3", r"weight_kg is not known"),
        ("vehicle = ", r"is not valid TOML"),
        ('trusted = ["speed"]', r"line 1: trusted names 'speed', no quantity; did you mean"),
    ],
)
def test_bad_drive_toml(tmp_path, content, words):
    write(tmp_path / "obd.csv")
    write(tmp_path / "drive.toml", content)
    with pytest.raises(DriveError, match=rf"drive\.toml.*{words}"):
        read_drive(tmp_path)


def test_table_with_an_unknown_suffix_is_not_written(tmp_path):
    with pytest.raises(DriveError, match=r"\.csv or \.parquet, not '\.xlsx'"):
        write_table({"a": np.arange(2.0)}, tmp_path / "a.xlsx")


@settings(max_examples=80, deadline=None)
@given(st.binary(max_size=200))
def test_no_bytes_give_a_traceback(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("any") / "obd.csv"
    path.write_bytes(b"time_s,gear\n0,1\n" + content)
    try:
        drive = read_drive(path)
    except DriveError:
        return
    for s in drive.signals.values():
        assert np.all(np.diff(s.time) > 0.0)
        assert np.all(np.isfinite(s.values))


def test_a_message_shows_the_begin_of_a_long_name(tmp_path):
    # Text behind a mark of another encoding is one line of many thousand letters.
    (tmp_path / "obd.csv").write_bytes(b"\xfe\xff" + 5000 * "\u4e00".encode("utf-16-be"))
    with pytest.raises(DriveError, match="no canonical columns") as refused:
        read_drive(tmp_path / "obd.csv")
    assert len(str(refused.value)) < 500
