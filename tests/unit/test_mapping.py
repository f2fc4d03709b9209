"""Mapping TOML: foreign names, units, signs, clocks; mistakes are told with their line."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from tests.noted import error

from weighbridge import ConfigError, DriveError, read_drive
from weighbridge.io import load_mapping
from weighbridge.io.columns import unit_suffix


def write(path, content, encoding="utf-8"):
    path.write_text(content, encoding=encoding)
    return path


SPEED = {"vehicle_speed": {"column": "v", "unit": "kmh"}}


def test_names_units_signs_and_offsets(tmp_path):
    log = write(tmp_path / "log.csv", "t,v,ax,T\n0,36,1,20\n100,72,-2,21\n")
    mapping = write(
        tmp_path / "map.toml",
        """
        format_version = 1
        [time]
        column = "t"
        unit = "ms"
        offset_s = 5
        [signals.vehicle_speed]
        column = "v"
        unit = "km/h"
        [signals.longitudinal_accel]
        column = "ax"
        unit = "g"
        factor = -1
        offset = 0.5
        [signals.ambient_temperature]
        column = "T"
        unit = "degc"
        """,
    )
    drive = read_drive(log, mapping)
    assert drive.name == "log"
    assert drive.problems == ()
    speed = drive.signals["vehicle_speed"]
    assert_allclose(speed.time, [5.0, 5.1])
    assert_allclose(speed.values, [10.0, 20.0])
    # Factor first, then the offset in the column's unit, then to SI.
    assert_allclose(drive.signals["longitudinal_accel"].values, [-0.5 * 9.80665, 2.5 * 9.80665])
    assert_allclose(drive.signals["ambient_temperature"].values, [293.15, 294.15])


def test_unit_is_taken_from_the_brackets_of_the_column(tmp_path):
    log = write(tmp_path / "log.csv", "Time [ms];Speed [m/s]\n0;10\n500;20\n")
    mapping = {
        "time": {"column": "Time [ms]"},
        "signals": {"vehicle_speed": {"column": "speed [m/s] "}},
    }
    speed = read_drive(log, mapping).signals["vehicle_speed"]
    assert_allclose(speed.time, [0.0, 0.5])
    assert_allclose(speed.values, [10.0, 20.0])


def test_separator_encoding_decimal_comma_and_lines_to_skip(tmp_path):
    text = (
        "made by a logger\nv1\nZeit;Geschw. [km/h];Höhe [m]\ns;km/h;m\n0,5;36,0;400\n1,5;54,0;-\n"
    )
    log = write(tmp_path / "log.csv", text, "latin-1")
    mapping = {
        "csv": {
            "separator": ";",
            "encoding": "latin-1",
            "decimal": ",",
            "skip_rows": 2,
            "skip_after_header": 1,
        },
        "time": {"column": "Zeit"},
        "signals": {
            "vehicle_speed": {"column": "Geschw. [km/h]"},
            "altitude": {"column": "Höhe [m]"},
        },
    }
    drive = read_drive(log, mapping)
    assert_allclose(drive.signals["vehicle_speed"].time, [0.5, 1.5])
    assert_allclose(drive.signals["vehicle_speed"].values, [10.0, 15.0])
    assert_allclose(drive.signals["altitude"].values, [400.0])


def test_file_without_header(tmp_path):
    log = write(tmp_path / "log.csv", "0,36\n1,72\n")
    mapping = {"csv": {"columns": ["t", "v"]}, "time": {"column": "t"}, "signals": SPEED}
    assert_allclose(read_drive(log, mapping).signals["vehicle_speed"].values, [10.0, 20.0])


def test_time_of_day_runs_over_midnight(tmp_path):
    log = write(tmp_path / "log.csv", "t,v\n23:59:59.500,36\n00:00:00.250,72\n0:00:02,36\n")
    mapping = {"time": {"column": "t", "format": "clock"}, "signals": SPEED}
    time = read_drive(log, mapping).signals["vehicle_speed"].time
    assert_allclose(time - time[0], [0.0, 0.75, 2.5])


@pytest.mark.parametrize(
    ("stamps", "time_format", "start"),
    [
        (("2026-01-31T12:00:00.5", "2026-01-31T12:00:02"), "iso", "2026-01-31T12:00:00"),
        (("2026-01-31 12:00:00.5Z", "2026-01-31 12:00:02Z"), "iso", "2026-01-31T12:00:00"),
        (
            ("2026-01-31T12:00:00.5+01:00", "2026-01-31T12:00:02+01:00"),
            "iso",
            "2026-01-31T11:00:00",
        ),
        (("31.01.2026 12:00:00.5", "31.01.2026 12:00:02.0"), "%d.%m.%Y %H:%M:%S%.f", "2026-01-31"),
    ],
)
def test_dates_count_from_the_first_full_second(tmp_path, stamps, time_format, start):
    log = write(tmp_path / "log.csv", f"t,v\n{stamps[0]},36\n{stamps[1]},72\n")
    mapping = {"time": {"column": "t", "format": time_format}, "signals": SPEED}
    drive = read_drive(log, mapping)
    assert_allclose(drive.signals["vehicle_speed"].time, [0.5, 2.0], atol=1e-6)
    assert drive.info.start_time is not None
    assert drive.info.start_time.startswith(start)


def test_absent_column_is_refused_unless_optional_or_in_another_file(tmp_path):
    log = write(tmp_path / "log.csv", "t,v\n0,36\n1,72\n")
    extra = {"throttle": {"column": "vv", "unit": "pct"}}
    mapping = {"time": {"column": "t"}, "signals": {**SPEED, **extra}}
    (problem,) = read_drive(log, mapping).problems
    assert problem.signal == "throttle"
    assert problem.values["column"] == "vv"
    assert problem.id == "file.column_missing"
    assert problem.serious
    other = write(tmp_path / "later.csv", "t,v,vv\n2,36,10\n3,72,20\n")
    assert [p.serious for p in read_drive([log, other], mapping).problems] == [False]
    extra["throttle"]["optional"] = True
    assert read_drive(log, mapping).problems == ()


def test_text_format_beside_tables_says_where_it_belongs(tmp_path):
    mapping = {"csv": {"decimal": ","}, "tables": {"a": {"files": "a*.csv", "signals": SPEED}}}
    with pytest.raises(ConfigError, match=r"as \[tables\.a\.csv\]"):
        read_drive(write(tmp_path / "a.csv", "t,v\n0,36\n"), mapping)


def test_several_kinds_of_file_in_one_folder(tmp_path):
    write(tmp_path / "a_fast.csv", "ms,x\n0,1\n10,2\n")
    write(tmp_path / "b_slow.csv", "s;v\n0;36\n1;72\n")
    write(tmp_path / "other.csv", "who,knows\n1,2\n")
    mapping = {
        "tables": {
            "fast": {
                "files": "*_fast.csv",
                "time": {"column": "ms", "unit": "ms"},
                "signals": {"accel_x": {"column": "x", "unit": "mps2"}},
            },
            "slow": {"files": "*_slow.csv", "time": {"column": "s"}, "signals": SPEED},
        }
    }
    drive = read_drive(tmp_path, mapping)
    assert set(drive.signals) == {"accel_x", "vehicle_speed"}
    assert_array_equal(drive.signals["accel_x"].time, [0.0, 0.01])


def test_first_pattern_that_fits_is_taken(tmp_path):
    accel = {"accel_x": {"column": "x", "unit": "mps2"}}
    mapping = {
        "tables": {"imu": {"time": {"column": "t"}, "signals": accel}},
        "time": {"column": "t"},
        "signals": SPEED,
    }
    assert [m.files for m in load_mapping(mapping)] == ["imu.*", "*"]
    write(tmp_path / "IMU.csv", "t,x,v\n0,1,1\n1,2,2\n")
    write(tmp_path / "obd.csv", "t,x,v\n0,3,36\n1,4,72\n")
    drive = read_drive(tmp_path, mapping)
    assert_array_equal(drive.signals["accel_x"].values, [1.0, 2.0])
    assert_allclose(drive.signals["vehicle_speed"].values, [10.0, 20.0])


def test_wrong_separator_is_told_with_the_right_one(tmp_path):
    log = write(tmp_path / "log.csv", "t;v\n0;36\n")
    mapping = {"csv": {"separator": ","}, "time": {"column": "t"}, "signals": SPEED}
    with error(DriveError, "log.csv t;v separator ;"):
        read_drive(log, mapping)


@pytest.mark.parametrize("separator", [";", ","])
def test_a_mapping_of_canonical_columns_is_told_to_be_left_out(tmp_path, separator):
    log = write(tmp_path / "log.csv", "time_s,vehicle_speed_kmh\n0,36\n")
    mapping = {"csv": {"separator": separator}, "time": {"column": "t"}, "signals": SPEED}
    with pytest.raises(DriveError, match="these names need no mapping; leave out --mapping"):
        read_drive(log, mapping)


@pytest.mark.parametrize(
    ("text", "separator"),
    [
        ("0;36,5;800\n1;37,5;900\n", ";"),
        ("0;36,5;800\n1;37,5;900\n", ","),
        ("0,36.5,800\n1,37.5,900\n", ","),
        ("10:00:01.5,36.5,800,\n10:00:02.5,37.5,900,\n", ","),
    ],
)
def test_a_text_without_a_header_is_told_as_such(tmp_path, text, separator):
    log = write(tmp_path / "log.csv", text)
    mapping = {"csv": {"separator": separator}, "time": {"column": "t"}, "signals": SPEED}
    with pytest.raises(DriveError, match="it has no header: name its") as caught:
        read_drive(log, mapping)
    assert "set separator" not in str(caught.value)
    assert f"weighbridge map {log} --columns NAMES" in str(caught.value)
    names = {"separator": text[1] if text[1] in ";," else ",", "columns": ["t", "v", "-", "-"]}
    names["columns"] = names["columns"][: text.split("\n")[0].count(names["separator"]) + 1]
    names["decimal"] = "," if names["separator"] == ";" else "."
    time = {"column": "t", **({"format": "clock"} if ":" in text else {})}
    read = read_drive(log, {"csv": names, "time": time, "signals": SPEED})
    assert list(read.signals["vehicle_speed"].values * 3.6) == pytest.approx([36.5, 37.5])


def test_absent_time_column_is_told(tmp_path):
    log = write(tmp_path / "log.csv", "t,v\n0,36\n")
    with error(DriveError, "log.csv clock t v"):
        read_drive(log, {"time": {"column": "clock"}, "signals": SPEED})
    with error(DriveError, "log.csv t rate_hz"):
        read_drive(log, {"signals": SPEED})


def test_times_in_another_format_are_told(tmp_path):
    log = write(tmp_path / "log.csv", "t,v\n12.5,36\n13.5,37\n")
    with error(DriveError, "log.csv 12.5 t clock"):
        read_drive(log, {"time": {"column": "t", "format": "clock"}, "signals": SPEED})


def test_other_encoding_is_told(tmp_path):
    log = write(tmp_path / "log.csv", "t,v [°]\n0,36\n", "latin-1")
    mapping = {"csv": {"encoding": "utf-8"}, "time": {"column": "t"}, "signals": SPEED}
    with error(DriveError, "log.csv utf-8 byte 5"):
        read_drive(log, mapping)


def test_column_without_any_unit_is_told(tmp_path):
    log = write(tmp_path / "log.csv", "t,v\n0,36\n")
    mapping = {"time": {"column": "t"}, "signals": {"vehicle_speed": {"column": "v"}}}
    with error(ConfigError, "mapping vehicle_speed v kmh"):
        read_drive(log, mapping)


@pytest.mark.parametrize(
    ("content", "line", "words"),
    [
        ("[signals.vehicle_sped]\ncolumn = 'v'", 1, "did you mean vehicle_speed"),
        ("[signals.vehicle_speed]\nunit = 'kmh'", 1, "column is missing"),
        ("[signals.vehicle_speed]\ncolumn = 'v'\nunit = 'rpm'", 3, "is no unit of vehicle_speed"),
        ("[signals.vehicle_speed]\ncolumn = 'v'\nfactor = 0", 3, "must not be 0"),
        ("[signals.vehicle_speed]\ncolumn = 'v'\nfaktor = 1", 3, "did you mean factor"),
        ("[csv]\nseparator = ';;'\n[signals]", 2, "must be one character"),
        ("[csv]\ndecimal = ':'\n[signals]", 2, 'must be "." or ","'),
        ("[csv]\nencoding = 'klingon'\n[signals]", 2, "is not a text encoding"),
        ("[csv]\nseparator = ','\ndecimal = ','\n[signals]", 3, "cannot both be a comma"),
        ("[time]\nunit = 'km'\n[signals]", 2, "no unit of time"),
        ("[time]\nformat = 'swatch'\n[signals]", 2, "clock"),
        ("[time]\noffset = 3\n[signals]", 2, "write it as offset_s"),
        ("format_version = 7", 1, "this program reads 1"),
        ("[signals]", 1, "is missing: name at least one column"),
        ("[singals]\nx = 1", None, "signals is missing"),
    ],
)
def test_mistakes_are_told_with_their_line(tmp_path, content, line, words):
    path = write(tmp_path / "map.toml", content)
    with pytest.raises(ConfigError) as caught:
        load_mapping(path)
    assert "map.toml" in str(caught.value)
    assert words in str(caught.value)
    if line is not None:
        assert f"line {line}:" in str(caught.value)


def test_units_as_people_write_them():
    assert unit_suffix("km/h") == "kmh"
    assert unit_suffix("1/min") == "rpm"
    assert unit_suffix("°C") == "degc"
    assert unit_suffix("m/s²") == "mps2"
    assert unit_suffix("N·m") == "nm"
    assert unit_suffix("furlong") is None


def test_a_mapping_vouches_for_a_signal(tmp_path):
    text = "time_s,v,m\n" + "".join(f"{k},{k},{k % 7}\n" for k in range(20))
    (tmp_path / "log.csv").write_text(text)
    mapping = {
        "time": {"column": "time_s"},
        "signals": {
            "vehicle_speed": {"column": "v", "unit": "m/s", "trusted": True},
            "engine_torque_fraction": {"column": "m", "unit": "%"},
        },
    }
    assert read_drive(tmp_path / "log.csv", mapping).info.trusted == ("vehicle_speed",)


def test_mapped_parquet(tmp_path):
    import polars as pl

    pl.DataFrame({"t": [0, 1], "v": [36.0, None]}).write_parquet(tmp_path / "log.parquet")
    drive = read_drive(tmp_path / "log.parquet", {"time": {"column": "t"}, "signals": SPEED})
    assert_array_equal(drive.signals["vehicle_speed"].values, np.array([10.0]))


def test_decimal_commas_without_a_mapping_name_the_remedy(tmp_path):
    log = write(tmp_path / "log.csv", "time_s;vehicle_speed_kmh\n0,0;10,5\n0,5;11,5\n")
    with pytest.raises(DriveError, match='set decimal = "," in'):
        read_drive(log)
    mapping = {"csv": {"decimal": ","}, "signals": {"vehicle_speed": {
        "column": "vehicle_speed_kmh", "unit": "kmh"}}}  # fmt: skip
    assert_allclose(read_drive(log, mapping).signals["vehicle_speed"].values * 3.6, [10.5, 11.5])


def test_canonical_names_need_no_more_than_how_the_text_is_written(tmp_path):
    (tmp_path / "d").mkdir()
    write(tmp_path / "d" / "obd.csv", "time_s;vehicle_speed_kmh\n0,5;36,0\n1,5;72,0\n")
    write(tmp_path / "d" / "gnss.csv", "time_s;speed_kmh\n0,5;36,0\n1,5;72,0\n")
    mapping = write(tmp_path / "map.toml", '[csv]\ndecimal = ","\n[time]\noffset_s = 2\n')
    with pytest.raises(DriveError, match=r'set decimal = "," in \[csv\] of a mapping'):
        read_drive(tmp_path / "d")
    for drive in (read_drive(tmp_path / "d", mapping), read_drive(tmp_path / "d/obd.csv", mapping)):
        assert_allclose(drive.signals["vehicle_speed"].time, [2.5, 3.5])
        assert_allclose(drive.signals["vehicle_speed"].values, [10.0, 20.0])
    assert_allclose(read_drive(tmp_path / "d", mapping).signals["gnss_speed"].values, [10.0, 20.0])


def test_a_mapping_in_another_encoding_is_told_with_its_line(tmp_path):
    path = write(tmp_path / "m.toml", '[signals.vehicle_speed]\ncolumn = "Größe"\n', "latin-1")
    with pytest.raises(ConfigError, match=r"m\.toml is not UTF-8 \(line 2\): save it as UTF-8"):
        load_mapping(path)


def test_all_mistakes_of_a_mapping_are_told_at_once(tmp_path):
    (tmp_path / "map.toml").write_text(
        """[csv]
separatr = ";"
decimals = ","
[time]
unit = "fortnight"
[signals.vehicle_sped]
column = "v"
[signals.engine_speed]
column = "n"
unit = "kmh"
[signals.engine_load]
unit = "pct"
"""
    )
    with pytest.raises(ConfigError) as told:
        load_mapping(tmp_path / "map.toml")
    for words in (
        "line 2: csv.separatr is not known; did you mean",
        "line 3: csv.decimals is not known",
        "line 5: time.unit 'fortnight' is no unit of time",
        "line 6: signals.vehicle_sped is no quantity; did you mean",
        "line 10: signals.engine_speed.unit 'kmh' is no unit of engine_speed",
        "line 11: signals.engine_load.column is missing",
    ):
        assert words in str(told.value)


def test_all_units_that_are_lacking_are_told_at_once(tmp_path):
    (tmp_path / "x.csv").write_text("t,v,n\n0,1,2\n1,2,3\n")
    signals = {"vehicle_speed": {"column": "v"}, "engine_speed": {"column": "n"}}
    with error(ConfigError, "vehicle_speed v engine_speed n"):
        read_drive(tmp_path / "x.csv", {"time": {"column": "t"}, "signals": signals})
