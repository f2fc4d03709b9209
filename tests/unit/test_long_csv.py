"""Long tables: one row for each value, as Car Scanner exports them."""

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from tests.noted import error, has, refused

from weighbridge import ConfigError, DriveError, read_drive, read_frame
from weighbridge.io import Draft, first_line, format_of, mapping_text

HEAD = '"SECONDS";"PID";"VALUE";"UNITS";"LATITUDE";"LONGTITUDE";'


def scanner(start=48373.0, rows=20):
    """Rows as Car Scanner writes them: values in turn, a position that is held, none at first."""
    lines = [HEAD]
    for k in range(rows):
        t = (start + k) % 86400.0
        place = f'"{45.0 + 1e-4 * (k // 2)}";"15.7";' if k > 3 else '"0.0";"0.0";'
        lines.append(f'"{t}";"Vehicle speed";"{36 + k}";"km/h";{place}')
        lines.append(f'"{t + 0.4}";"Engine RPM";"{800 + 10 * k}";"rpm";{place}')
        lines.append(f'"{t + 0.6}";"Calculated engine load value";"40";"%";{place}')
        lines.append(f'"{t + 0.7}";"Fuel system status";"closed";"";{place}')
    return "\n".join(lines) + "\n"


def mapped(path, tmp_path):
    """Read a log by the mapping that is drafted for it."""
    found = format_of(path).draft(path)
    assert isinstance(found, Draft)
    (tmp_path / "map.toml").write_text(mapping_text([found]), encoding="utf-8")
    return read_drive(path, tmp_path / "map.toml")


def test_from_a_log_of_car_scanner_to_signals(tmp_path):
    path = tmp_path / "trip.csv"
    path.write_text(scanner())
    assert format_of(path).name == "long CSV"
    drive = mapped(path, tmp_path)
    assert_allclose(drive.signals["vehicle_speed"].values * 3.6, np.arange(36.0, 56.0))
    assert_allclose(drive.signals["engine_speed"].time, 48373.4 + np.arange(20))
    assert_allclose(drive.signals["engine_load"].values, 0.4)
    assert_allclose(np.degrees(drive.signals["latitude"].values), 45.0 + 1e-4 * np.arange(2, 10))
    assert_allclose(np.diff(drive.signals["latitude"].time), 2.0)
    (found,) = [p for p in drive.problems if p.id == "file.rows_left_out"]
    assert (found.values["count"], found.values["rows"]) == (20, 80)


@pytest.mark.parametrize("kind", ["polars", "pandas", "categories"])
def test_a_data_frame_is_turned_as_the_file_is(tmp_path, kind):
    path = tmp_path / "trip.csv"
    path.write_text(scanner())
    by_file = mapped(path, tmp_path)
    frame = pl.read_csv(path, separator=";", infer_schema=False).drop("")
    if kind == "categories":
        frame = frame.with_columns(pl.col("PID").cast(pl.Categorical))
    given = frame.to_pandas() if kind == "pandas" else frame
    drive = read_frame(given, tmp_path / "map.toml")
    assert set(drive.signals) == set(by_file.signals)
    for name, signal in by_file.signals.items():
        assert_allclose(drive.signals[name].time, signal.time)
        assert_allclose(drive.signals[name].values, signal.values)


def test_a_data_frame_of_canonical_names_needs_no_mapping():
    time = np.arange(20.0)
    speed = pl.DataFrame({"time_s": time, "name": "vehicle_speed_kmh", "value": 3.6 * time})
    engine = pl.DataFrame({"time_s": time + 0.5, "name": "engine_speed_rpm", "value": 900.0 + time})
    drive = read_frame(pl.concat([speed, engine]).sort("time_s"))
    assert_allclose(drive.signals["vehicle_speed"].values, time)
    assert_allclose(drive.signals["engine_speed"].time, time + 0.5)


def test_a_trip_over_midnight_goes_on(tmp_path):
    path = tmp_path / "trip.csv"
    path.write_text(scanner(start=86390.0))
    assert_allclose(mapped(path, tmp_path).signals["vehicle_speed"].time, 86390.0 + np.arange(20))


def test_other_words_separators_and_times(tmp_path):
    path = tmp_path / "trip.txt"
    rows = "".join(
        f"2026-05-01T10:00:{k:02d}Z,{name},{v},{unit}\n"
        for k in range(10)
        for name, v, unit in (("speed", 10 * k, "km/h"), ("rpm", 900 + k, "rpm"))
    )
    path.write_text(f"timestamp,signal,value,unit\n{rows}")
    drive = mapped(path, tmp_path)
    assert drive.info.start_time == "2026-05-01T10:00:00+00:00"
    assert_allclose(drive.signals["vehicle_speed"].values, np.arange(0, 100, 10) / 3.6)


def test_a_wide_table_is_none(tmp_path):
    path = tmp_path / "wide.csv"
    path.write_text("time_s,vehicle_speed_kmh,gear\n0,36,1\n")
    assert format_of(path).name == "CSV"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"{HEAD}\n", ""),
        (f'{HEAD}\n"1";"Engine RPM";"on";"";"0";"0";\n', ""),
        (scanner(), "Engine RPM map.toml"),
    ],
)
def test_what_cannot_be_read_is_one_sentence(tmp_path, text, said):
    path = tmp_path / "trip.csv"
    path.write_text(text.replace('"45', '"0').replace('"15.7', '"0') if said else text)
    if said:
        path.write_text("\n".join(";".join(x.split(";")[:4]) for x in text.splitlines()))
    with error(DriveError, "trip.csv", said):
        read_drive(path)


def test_a_unit_that_does_not_fit_is_refused(tmp_path):
    path = tmp_path / "trip.csv"
    path.write_text(scanner().replace("km/h", "furlong"))
    with error(ConfigError, "vehicle_speed Vehicle speed kmh"):
        read_drive(path, {"signals": {"vehicle_speed": {"column": "Vehicle speed"}}})


def rows(values, units="km/h"):
    units = [units] * len(values) if isinstance(units, str) else units
    pairs = zip(values, units, strict=True)
    text = "".join(f'"{k}";"Vehicle speed";"{v}";"{u}"\n' for k, (v, u) in enumerate(pairs))
    return f'"SECONDS";"PID";"VALUE";"UNITS"\n{text}'


def speed(path):
    mapping = {"signals": {"vehicle_speed": {"column": "Vehicle speed"}}}
    drive = read_drive(path, mapping)
    return drive.signals["vehicle_speed"].values * 3.6, drive.problems


@pytest.mark.parametrize(
    ("cells", "numbers", "told"),
    [
        (["999", "1,000", "1,001.5", "12"], [999.0, 1000.0, 1001.5, 12.0], True),
        (["36,5", "37,125", "38"], [36.5, 37.125, 38.0], False),
        (["0,125", "1,250"], [0.125, 1.25], False),
        (["1234,567", "1,000"], [1234.567, 1.0], False),
    ],
)
def test_what_a_comma_means_is_settled_once_a_file(tmp_path, cells, numbers, told):
    path = tmp_path / "trip.csv"
    path.write_text(rows(cells))
    values, notes = speed(path)
    assert_allclose(values, numbers)
    assert has(notes, "file.thousands") == told


def test_each_row_counts_in_its_own_unit(tmp_path):
    path = tmp_path / "trip.csv"
    path.write_text(rows([36, 36, 36, 10, 10, 36], ["km/h", "km/h", "km/h", "m/s", "m/s", ""]))
    assert_allclose(speed(path)[0], 36.0)
    path.write_text(rows([36, 36, 36, 10, 36], ["km/h"] * 3 + ["km", "km/h"]))
    values, notes = speed(path)
    assert_allclose(values, [36.0] * 4)
    assert has(notes, "file.row_unit", name="Vehicle speed", unit="km")
    path.write_text(rows([36, 36, 36, 10, 10], ["km/h"] * 3 + ["rpm"] * 2))
    with error(DriveError, "trip.csv Vehicle speed km/h rpm"):
        speed(path)


@settings(max_examples=30, deadline=None)
@given(cut=st.integers(0, 4000), junk=st.binary(max_size=8))
def test_damage_leaves_signals_or_one_sentence(tmp_path_factory, assert_salvaged, cut, junk):
    path = tmp_path_factory.mktemp("cut") / "trip.csv"
    path.write_bytes(scanner().encode()[:cut] + junk)
    assert_salvaged(path)


@pytest.mark.parametrize("start", [48373.0, 86390.0])
@pytest.mark.parametrize(
    "torn",
    [
        '"48380.4";"Engine RPM";"8',
        '"48380.4";"Engine RPM";"870.0"',
        'gine RPM";"870.0";"rpm";"45.0";"15.7";',
        '"1911.5";"rpm";"45.0";"15.7";',
        '"48380.4";"Engine"48381.0";"Vehicle speed";"43";"km/h";"45.0";"15.7";',
    ],
)
def test_a_torn_line_costs_itself_and_is_told(tmp_path, torn, start):
    path = tmp_path / "trip.csv"
    lines = scanner(start, rows=40).splitlines()
    path.write_text("\n".join(lines))
    sound = mapped(path, tmp_path)
    lines[30] = torn
    path.write_text("\n".join(lines))
    found = mapped(path, tmp_path)
    for name in ("vehicle_speed", "engine_speed"):
        before, after = sound.signals[name], found.signals[name]
        assert len(after) >= len(before) - 1
        assert_allclose(after.values, np.interp(after.time, before.time, before.values))
    ids = {p.id for p in found.problems} - {p.id for p in sound.problems}
    left_out = next(p for p in found.problems if p.id == "file.rows_left_out").values["count"]
    assert ids or left_out == 41


@pytest.mark.parametrize("column", [0, 1])
def test_a_torn_name_or_time_of_a_telematics_row(tmp_path, column):
    path = telematics(tmp_path / "s.csv", "Device,Time,Name,Value,Unit")
    lines = path.read_text().splitlines()
    cells = lines[200].split(",")
    cells[column] = cells[column][1:]
    lines[200] = ",".join(cells)
    path.write_text("\n".join(lines))
    drive = mapped(path, tmp_path)
    assert sum(map(len, drive.signals.values())) == 359
    assert drive.problems


def test_a_vertical_tab_stays_out_of_the_sentence():
    assert first_line(ValueError("could not parse \x0b here\nmore")) == r"could not parse \x0b here"


def test_a_datalog_of_wican(tmp_path):
    """In the form of its documentation: milliseconds since boot, source, name, value, unit."""
    lines = ["timestamp_ms,source,name,value,unit"]
    for k in range(50):
        t = 12345 + 200 * k
        lines += [
            f"{t},CANFLT,EngineRPM,{1500 + 10 * k}.000,rpm",
            f"{t + 5},STD,VehicleSpeed,{36 + k}.000,km/h",
            f"{t + 9},STD,CalcEngineLoad,40.000,%",
            f"{t + 11},PID,CoolantTemp,90.000,c",
        ]
    path = tmp_path / "20260101_120000.csv"
    path.write_text("\n".join(lines) + "\n")
    assert format_of(path).name == "long CSV"
    drive = mapped(path, tmp_path)
    assert not drive.problems
    assert_allclose(drive.signals["vehicle_speed"].values * 3.6, 36.0 + np.arange(50))
    assert_allclose(drive.signals["engine_speed"].time, 12.345 + 0.2 * np.arange(50))
    assert drive.has("engine_load", "coolant_temperature")


def test_a_rate_is_no_clock_of_a_long_table(tmp_path):
    (tmp_path / "trip.csv").write_text(scanner())
    mapping = {
        "time": {"rate_hz": 5.0},
        "signals": {"vehicle_speed": {"column": "Vehicle speed"}},
    }
    with error(DriveError, "trip.csv rate_hz [time]"):
        read_drive(tmp_path / "trip.csv", mapping)


def telematics(path, header, names=("Road speed", "Engine speed", "Engine load"), vehicles=("T1",)):
    """Write a long table as telematics export it: the values of one name after the other."""
    lines = [header]
    for k in range(120):
        stamp = f"2026-01-05T07:{k // 60:02d}:{k % 60:02d}.500Z"
        for name, value, unit in zip(names, (50 + k % 9, 1500 + k, 20.5), UNITS, strict=True):
            lines.append(f"{vehicles[k % len(vehicles)]},{stamp},{name},{value},{unit}")
    path.write_text("\n".join(lines) + "\n")
    return path


UNITS = ("km/h", "rpm", "%")


@pytest.mark.parametrize(
    "header",
    [
        "DeviceName,DateTime,DiagnosticName,Data,UnitOfMeasure",
        "vehicle_id,timestamp,measurement,double_value,unit",
        "Asset,Time,What,Number,Units of measure",
    ],
)
def test_a_long_table_is_known_by_what_stands_in_it(tmp_path, header):
    path = telematics(tmp_path / "status.csv", header)
    found = format_of(path).draft(path)
    units = {c.quantity: c.unit for c in found.known}
    assert units == {"vehicle_speed": "kmh", "engine_speed": "rpm", "engine_load": "pct"}
    assert found.duration == pytest.approx(119.0)


def test_a_long_table_of_several_vehicles_is_refused(tmp_path):
    path = telematics(tmp_path / "s.csv", "Device,Time,Name,Value,Unit", vehicles=("T1", "T2"))
    with refused("file.several_vehicles"):
        format_of(path).draft(path)
