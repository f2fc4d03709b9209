"""Mappings drafted from logs as loggers write them, read back with what was drafted."""

import tomllib

import numpy as np
import polars as pl
import pytest
from tests.noted import error

from weighbridge import ConfigError, DriveError, WeighbridgeError, read_drive
from weighbridge.io import draft_table, load_mapping, mapping_text

ROWS = 400
T = 0.25 * np.arange(ROWS)
SPEED = 60.0 + 25.0 * np.sin(0.1 * T)
RPM = np.round(1800.0 + 700.0 * np.sin(0.13 * T))
LOAD = np.round(40.0 + 30.0 * np.sin(0.3 * T), 1)


def german(value):
    return f"{value:.2f}".replace(".", ",")


def written(path, lines, encoding="utf-8"):
    path.write_bytes("\n".join(lines).encode(encoding) + b"\n")
    return path


def car_scanner(folder):
    head = (
        "time,Vehicle speed (km/h),Engine RPM (rpm),Calculated engine load value (%),"
        "Average speed (km/h),"
    )
    rows = [
        f"10:{int(t // 60):02d}:{t % 60:06.3f},{v:.0f},{n:.0f},{x:.1f},33,"
        for t, v, n, x in zip(T, SPEED, RPM, LOAD, strict=True)
    ]
    return written(folder / "car.csv", [head, *rows])


def german_sheet(folder):
    head = (
        "Messung vom Montag\n\n"
        "Zeit [s];Geschwindigkeit [km/h];Motordrehzahl [1/min];Berechneter Lastwert [%]"
    )
    rows = [";".join(map(german, row)) for row in zip(T, SPEED, RPM, LOAD, strict=True)]
    return written(folder / "blatt.csv", [head, *rows], "cp1252")


def unit_row(folder):
    head = ["Timestamp\tVehicle Speed\tEngine Speed\tEngine Load", "ms\tmph\trpm\t%"]
    rows = [
        f"{1000 * t:.0f}\t{v / 1.609344:.3f}\t{n:.0f}\t{x:.1f}"
        for t, v, n, x in zip(T, SPEED, RPM, LOAD, strict=True)
    ]
    return written(folder / "units.txt", [*head, *rows])


def no_units(folder):
    head = "Date,VEHICLE_SPEED,ENGINE_RPM,ENGINE_LOAD,comment"
    rows = [
        f"05/13/2024 11:{int(t) // 60:02d}:{t % 60:06.3f} PM,{v:.0f},{n:.0f},{x / 100.0:.3f},ok"
        for t, v, n, x in zip(T, SPEED, RPM, LOAD, strict=True)
    ]
    return written(folder / "plain.csv", [head, *rows])


def epoch(folder):
    frame = pl.DataFrame(
        {
            "ts": (1.7e12 + 1000.0 * T).astype(np.int64),
            "v_ego": SPEED / 3.6,
            "rpm": RPM,
            "load": LOAD,
        }
    )
    frame.write_parquet(folder / "fleet.parquet")
    return folder / "fleet.parquet"


@pytest.mark.parametrize("make", [car_scanner, german_sheet, unit_row, no_units, epoch])
def test_what_was_drafted_reads_the_log(make, tmp_path):
    path = make(tmp_path)
    found = draft_table(path)
    mapping = tmp_path / "map.toml"
    mapping.write_text(mapping_text([found]), encoding="utf-8")
    drive = read_drive(path, mapping)
    assert not any(p.serious for p in drive.problems)
    for name, true in (("vehicle_speed", SPEED / 3.6), ("engine_speed", RPM * np.pi / 30.0)):
        signal = drive.signals[name]
        assert len(signal) == ROWS
        assert np.abs(signal.values - true).max() < 0.02 * true.max()
        assert signal.duration == pytest.approx(T[-1], abs=0.01)
    assert np.abs(drive.signals["engine_load"].values - 0.01 * LOAD).max() < 0.002


def test_units_that_the_log_states_are_not_doubted_and_others_are(tmp_path):
    assert draft_table(car_scanner(tmp_path)).all_questions == ()
    doubts = " ".join(draft_table(no_units(tmp_path)).all_questions)
    assert "'VEHICLE_SPEED': states no unit; its highest is" in doubts
    assert "taken as ratio" in doubts


def test_columns_that_nobody_needs_are_left_out(tmp_path):
    found = draft_table(no_units(tmp_path))
    assert {c.quantity for c in found.known} == {"vehicle_speed", "engine_speed", "engine_load"}
    assert "comment" not in mapping_text([found])


def phone(folder, gravity, name, unit=""):
    rng = np.random.default_rng(1)
    axes = rng.normal(0.0, 0.03, (ROWS, 3)) * gravity + [0.0, 0.1 * gravity, gravity]
    head = f"Time (s),ax{unit},ay{unit},az{unit}"
    rows = [f"{t:.2f},{x:.4f},{y:.4f},{z:.4f}" for t, (x, y, z) in zip(T, axes, strict=True)]
    return written(folder / name, [head, *rows])


def test_gravity_tells_the_unit_of_an_accelerometer(tmp_path):
    units = [{c.unit for c in draft_table(phone(tmp_path, g, "a.csv")).known} for g in (9.81, 1.0)]
    assert units == [{"mps2"}, {"g"}]
    gone = draft_table(phone(tmp_path, 1e-3, "b.csv", " (m/s^2)"))
    assert "gravity was taken out of it" in " ".join(gone.all_questions)


def test_several_files_of_a_drive_get_a_table_each(tmp_path):
    obd, imu = car_scanner(tmp_path), phone(tmp_path, 9.81, "imu [1].csv")
    text = mapping_text([draft_table(obd), draft_table(imu)])
    (tmp_path / "map.toml").write_text(text, encoding="utf-8")
    tables = load_mapping(tmp_path / "map.toml")
    assert len(tables) == 2
    drive = read_drive([obd, imu], tmp_path / "map.toml")
    assert {"vehicle_speed", "accel_z"} <= set(drive.signals)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([""], "x.csv"),
        (["hello world"], "x.csv"),
        (["a,b", "1,2", "3,4"], "no column that can be its time"),
        (["time,b", "1,2", "3,4"], "no column that is known by its name"),
        (["1,2,3", "2,3,4"], "x.csv 1,2,3 --columns"),
        (["time,Speed (km/h)"], "x.csv"),
    ],
)
def test_what_cannot_be_drafted_is_one_sentence(lines, words, tmp_path):
    path = written(tmp_path / "x.csv", lines)
    with error(DriveError, words) as told:
        draft_table(path)
    assert str(told.value).startswith(str(path))
    assert "\n" not in str(told.value)


def test_a_unit_that_is_not_known_is_told_and_the_column_left_out(tmp_path):
    rows = [f"{t:.2f},{2.0 + 0.01 * t:.3f},50,7" for t in T]
    head = "Time (s),MAF air flow rate (lb/day),Vehicle speed (km/h),Wheel speed FL (km/h)"
    found = draft_table(written(tmp_path / "maf.csv", [head, *rows]))
    assert [c.quantity for c in found.known] == ["vehicle_speed"]
    assert "its unit 'lb/day' is not known" in " ".join(found.all_questions)


def test_empty_columns_and_text_are_told(tmp_path):
    rows = [f"{t:.2f},,about 2100,50" for t in T]
    head = "Time (s),Engine Torque (Nm),Engine RPM,Vehicle speed (km/h)"
    doubts = " ".join(draft_table(written(tmp_path / "x.csv", [head, *rows])).all_questions)
    assert "not taken for engine_torque: it has no values" in doubts
    assert "not taken for engine_speed: its cells are no numbers" in doubts


def test_a_head_that_ends_within_a_character_is_still_utf_8(tmp_path):
    # Long cells of two bytes each fill the piece that is looked at, and one more byte shifts it.
    for shift in ("", "x"):
        rows = [f"{k},{v:.1f},{shift}{'ü' * 5000}" for k, v in enumerate(SPEED)]
        path = written(tmp_path / "log.csv", ["time_s,Geschwindigkeit [km/h],Länge", *rows])
        found = draft_table(path)
        assert {c.name: c.quantity for c in found.columns} == {
            "Geschwindigkeit [km/h]": "vehicle_speed",
            "Länge": "",
        }


def test_cells_longer_than_a_csv_reader_takes_are_one_sentence_or_a_draft(tmp_path):
    rows = [f'{k},{v:.1f},"{"y" * 140_000}"' for k, v in enumerate(SPEED[:40])]
    path = written(tmp_path / "log.csv", ["time_s,Vehicle speed (km/h),Text", *rows])
    assert [c.quantity for c in draft_table(path).known] == ["vehicle_speed"]


def test_a_name_with_a_line_end_stays_in_its_comment(tmp_path):
    names = ["Time (s)", "Vehicle speed\n(km/h)", "RPM\r\n[rpm]"]
    frame = pl.DataFrame(dict(zip(names, (T, SPEED, RPM), strict=True)))
    frame.write_parquet(tmp_path / "log.parquet")
    text = mapping_text([draft_table(tmp_path / "log.parquet")])
    (tmp_path / "map.toml").write_text(text)
    drive = read_drive(tmp_path / "log.parquet", tmp_path / "map.toml")
    np.testing.assert_allclose(drive.signals["vehicle_speed"].values, SPEED / 3.6)


def test_decimal_commas_in_a_sparse_table(tmp_path):
    path = tmp_path / "obd.csv"
    rows = [f"13:45:{k:02d}.0;" + (f"{k},5;;;" if k % 2 else f";{800 + k},5;;") for k in range(50)]
    header = "Zeit;Geschwindigkeit (OBD) (km/h);Motordrehzahl (U/min);Last;Öl"
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    found = draft_table(path)
    assert found.text.decimal == ","
    assert {c.quantity for c in found.known} == {"vehicle_speed", "engine_speed"}


def clock_rows(stamps, rest):
    return [f"{t // 60 + 8:02d}:{t % 60:02d}:02,610;{rest}" for t in stamps]


@pytest.mark.parametrize("name", ["Uur", "Godzina", "Godz.", "Czas lokalny"])
def test_a_clock_of_any_name_is_the_time(tmp_path, name):
    rows = clock_rows(range(90), "0;820,5")
    path = written(tmp_path / "obd.csv", [f"{name};Speed [km/h];Obroty [obr/min]", *rows])
    found = draft_table(path)
    assert (found.time, found.time_format, found.row_rate) == (name, "clock", None)
    assert found.duration == pytest.approx(89 * 60.0)
    assert any("rises as one" in d for d in found.questions) == (name == "Uur")


@pytest.mark.parametrize("stamps", [[7] * 40, [50 - k for k in range(40)]])
def test_a_clock_that_does_not_rise_is_not_the_time(tmp_path, stamps):
    rows = clock_rows(stamps, "0;820,5")
    found = draft_table(written(tmp_path / "obd.csv", ["Start;Speed [km/h];RPM", *rows]))
    assert found.time == ""
    assert found.rate_unknown


@pytest.mark.parametrize("name", ["event_time", "ts_ecu", "EventTs", "x"])
def test_a_time_of_another_name_is_found(tmp_path, name):
    path = tmp_path / "trip.parquet"
    stamps = 1_741_000_000_000 + 200 * np.arange(100)
    columns = {"speed_kmh": np.arange(100.0), name: stamps, "count": np.arange(100) % 7}
    pl.DataFrame(columns).write_parquet(path)
    found = draft_table(path)
    assert (found.time, found.time_unit) == (name, "ms")
    assert found.known[0].rate == pytest.approx(5.0)
    assert any("rises as one" in d for d in found.questions)


@pytest.mark.parametrize(("sign", "doubted"), [(-1.0, False), (1.0, True)])
def test_the_torque_of_a_retarder_is_taken_and_its_sign_doubted(tmp_path, sign, doubted):
    path = tmp_path / "day.parquet"
    columns = {
        "timestamp_ms": 1_741_000_000_000 + 200 * np.arange(100),
        "WheelBasedVehicleSpeed": np.linspace(0.0, 80.0, 100),
        "ActualRetarderPercentTorque": sign * np.clip(np.arange(100.0) - 60.0, 0.0, 50.0),
    }
    pl.DataFrame(columns).write_parquet(path)
    found = {c.quantity: c for c in draft_table(path).known}["retarder_torque"]
    assert found.unit == "pct"
    assert ("factor = -1" in found.question) == doubted


@pytest.mark.parametrize(
    ("unit", "step", "seconds"), [("ms", 10.0, 0.01), ("s", 0.1, 0.1), ("µs", 1e4, 0.01)]
)
def test_a_row_of_units_tells_that_of_the_time(tmp_path, unit, step, seconds):
    path = tmp_path / "log.csv"
    rows = [f"{k * step:.1f},{20 + k % 5},{1500 + k % 7}" for k in range(300)]
    path.write_text("\n".join(["Time,Speed,RPM", f"{unit},km/h,1/min", *rows]), encoding="utf-8")
    (tmp_path / "map.toml").write_text(mapping_text([draft_table(path)]), encoding="utf-8")
    drive = read_drive(path, tmp_path / "map.toml")
    assert drive.signals["vehicle_speed"].period == pytest.approx(seconds)


def test_parquet_by_its_short_suffix_is_drafted(tmp_path):
    frame = pl.DataFrame({"time": np.arange(100) * 0.1, "Speed [km/h]": np.full(100, 30.0)})
    texts = []
    for suffix in (".parquet", ".pq"):
        path = tmp_path / f"log{suffix}"
        frame.write_parquet(path)
        texts.append(mapping_text([draft_table(path)]).replace(suffix, ""))
    assert texts[0] == texts[1]


def counted(folder, name="Sample", above=(), lost=()):
    head = [*above, f"{name},Vehicle Speed (km/h),Engine RPM (rpm),Engine Load (%)"]
    rows = [
        f"{k + 7},{v:.2f},{n:.0f},{x:.1f}"
        for k, (v, n, x) in enumerate(zip(SPEED, RPM, LOAD, strict=True))
        if k not in lost
    ]
    return written(folder / "counted.csv", [*head, *rows])


def test_rows_that_are_counted_are_a_clock_once_their_rate_is_known(tmp_path):
    path = counted(tmp_path, lost=(50, 51, 52))
    found = draft_table(path)
    assert found.time == "Sample"
    assert found.rate_unknown
    assert "does not state how many there are per second" in found.questions[0]
    mapping = tmp_path / "map.toml"
    mapping.write_text(mapping_text([found]), encoding="utf-8")
    with pytest.raises(ConfigError, match="rate_hz is not known yet: write how many rows"):
        read_drive(path, mapping)
    mapping.write_text(mapping.read_text().replace('"unknown"', "4.0"), encoding="utf-8")
    speed = read_drive(path, mapping).signals["vehicle_speed"]
    assert len(speed) == ROWS - 3
    # Rows that were lost leave a gap: the counter goes on over them.
    assert speed.duration == pytest.approx(T[-1])


def test_a_rate_above_the_header_is_taken(tmp_path):
    for line in ("Sample Rate: 4 Hz", '"Sample Rate","4.000"', "Logging rate = 4,0 Hz;"):
        found = draft_table(counted(tmp_path, above=["Session,12", line]))
        assert (found.row_rate, found.known[0].rate) == (4.0, pytest.approx(4.0))
        assert found.duration == pytest.approx(T[-1])
        text = mapping_text([found])
        assert "rate_hz = 4.0" in text
        assert load_mapping(tomllib.loads(text))[0].time.rate == 4.0


def test_a_table_without_any_time_has_the_number_of_its_rows(tmp_path):
    rows = [f"{v:.2f},{n:.0f}" for v, n in zip(SPEED, RPM, strict=True)]
    path = written(tmp_path / "x.csv", ["Vehicle Speed (km/h),Engine RPM", *rows])
    found = draft_table(path)
    assert (found.time, found.rate_unknown, found.rows) == ("", True, ROWS)
    assert "no column can be its time" in found.questions[0]
    signals = {"vehicle_speed": {"column": "Vehicle Speed (km/h)"}}
    drive = read_drive(path, {"time": {"rate_hz": 4.0}, "signals": signals})
    assert drive.signals["vehicle_speed"].duration == pytest.approx(T[-1])
    with error(DriveError, "x.csv [time] rate_hz"):
        read_drive(path, {"signals": signals})


def test_a_clock_goes_before_a_counter(tmp_path):
    rows = [f"{k},{t},{v:.1f}" for k, (t, v) in enumerate(zip(T, SPEED, strict=True))]
    found = draft_table(written(tmp_path / "x.csv", ["Index,Time (s),Speed (km/h)", *rows]))
    assert found.time == "Time (s)"
    assert found.row_rate is None


def test_a_date_goes_before_milliseconds_since_the_start(tmp_path):
    rows = [
        f"{1000 * t:.0f},2026-05-04 10:{int(t // 60):02d}:{t % 60:06.3f},{v:.0f}"
        for t, v in zip(T, SPEED, strict=True)
    ]
    path = written(tmp_path / "log.csv", ["time_ms,date,Vehicle speed (km/h)", *rows])
    assert draft_table(path).time == "date"


def test_a_counter_that_falls_or_leaps_counts_no_rows(tmp_path):
    for numbers in (np.arange(ROWS) % 256, 3 * np.arange(ROWS)):
        rows = [f"{k},{v:.1f}" for k, v in zip(numbers, SPEED, strict=True)]
        found = draft_table(written(tmp_path / "x.csv", ["Counter,Speed (km/h)", *rows]))
        assert found.time == ""


@pytest.mark.parametrize(
    ("time", "words"),
    [
        ({"column": "Sample", "rate_hz": 0}, "must be more than 0 rows per second, got 0"),
        ({"column": "Sample", "rate_hz": 4, "unit": "ms"}, "rate_hz"),
        ({"column": "Sample", "rate_hz": 4, "format": "iso"}, "rate_hz"),
        ({"column": "Samples", "rate_hz": 4}, "counted.csv Samples Sample"),
    ],
)
def test_a_rate_that_cannot_be_is_refused(time, words, tmp_path):
    signals = {"vehicle_speed": {"column": "Vehicle Speed (km/h)"}}
    with error(WeighbridgeError, words):
        read_drive(counted(tmp_path), {"time": time, "signals": signals})


def test_the_speed_of_a_table_with_positions_is_doubted_where_its_name_does_not_tell(tmp_path):
    rows = [f"{t},{v:.1f},48.1,11.5,1500" for t, v in zip(T, SPEED, strict=True)]
    for name, doubts in (("Speed", True), ("GPS Speed", False), ("OBD Speed", False)):
        head = f"Time (s),{name} (km/h),Latitude (deg),Longitude (deg),Engine RPM"
        found = draft_table(written(tmp_path / "x.csv", [head, *rows]))
        assert any("does not say which" in d for d in found.all_questions) == doubts
    head = "Time (s),Speed (km/h),Latitude (deg),Longitude (deg),comment"
    # Of a table that has nothing else of the vehicle it is the satellites'.
    found = draft_table(written(tmp_path / "x.csv", [head, *rows]))
    assert "gnss_speed" in {c.quantity for c in found.known}
    assert not found.all_questions


def hp_tuners(folder):
    """As VCM Scanner writes it: numbers of the channels above their names, marks below."""
    head = [
        "HP Tuners CSV Log File", "Version: 1.0", "", "[Log Information]", "Notes: ", "",
        "[Channel Information]", "0,12,13,4,50050",
        "Offset,Engine RPM (SAE),Vehicle Speed (SAE),Calculated Load (SAE),Mass Airflow Sensor",
        "s,rpm,mph,%,Hz", "", "[Channel Data]",
    ]  # fmt: skip
    rows = [
        f"{t:.2f},{n:.0f},{v / 1.609344:.3f},{x:.1f},2301"
        for t, v, n, x in zip(T, SPEED, RPM, LOAD, strict=True)
    ]
    return written(folder / "vcm.csv", [*head, *rows])


def aim_race_studio(folder):
    """As Race Studio exports it: what is known of the session, names, units, a blank line."""
    head = [
        '"Format","AiM CSV File"', '"Venue","Fuji"', '"Sample Rate","4"', '"Duration","99.75"', "",
        '"Time","Speed OBD","RPM","Engine Load","GPS Nsat"', '"s","km/h","rpm","%","#"', "",
    ]  # fmt: skip
    rows = [
        f'"{t:.2f}","{v:.2f}","{n:.0f}","{x:.1f}","9"'
        for t, v, n, x in zip(T, SPEED, RPM, LOAD, strict=True)
    ]
    return written(folder / "aim.csv", [*head, *rows])


@pytest.mark.parametrize("make", [hp_tuners, aim_race_studio])
def test_what_stands_around_the_names_is_left_out(make, tmp_path):
    path = make(tmp_path)
    found = draft_table(path)
    assert "mass_air_flow" not in {c.quantity for c in found.known}
    (tmp_path / "map.toml").write_text(mapping_text([found]), encoding="utf-8")
    drive = read_drive(path, tmp_path / "map.toml")
    assert not drive.problems
    for name, true in (("vehicle_speed", SPEED / 3.6), ("engine_speed", RPM * np.pi / 30.0)):
        assert np.abs(drive.signals[name].values - true).max() < 0.02 * true.max()
    assert drive.signals["engine_load"].duration == pytest.approx(T[-1])


def test_columns_of_a_text_without_a_header_are_named_in_their_order(tmp_path):
    rows = [f"{v:.2f};{1000.0 * t:.0f};7;{n:.0f}" for t, v, n in zip(T, SPEED, RPM, strict=True)]
    path = written(tmp_path / "bare.csv", rows)
    with error(DriveError, "bare.csv 60.00;0;7;1800 4 --columns"):
        draft_table(path)
    found = draft_table(path, ["speed_kmh", "time_ms", "-", "rpm"])
    assert found.rows == ROWS
    mapping = tmp_path / "map.toml"
    mapping.write_text(mapping_text([found]), encoding="utf-8")
    drive = read_drive(path, mapping)
    np.testing.assert_allclose(drive.signals["vehicle_speed"].values, SPEED / 3.6, atol=0.002)
    np.testing.assert_allclose(np.diff(drive.signals["engine_speed"].time), 0.25, atol=1e-6)


def test_a_first_row_of_a_clock_and_empty_cells_is_no_header(tmp_path):
    rows = [row + ";;" for row in clock_rows(range(90), "0")]
    with error(DriveError, "obd.csv 08:00:02,610;0;; 4 --columns"):
        draft_table(written(tmp_path / "obd.csv", rows))


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["time_s", "speed"], "bare.csv 2 3 1,2,3"),
        (["time_s", "rpm", "rpm"], "bare.csv rpm"),
    ],
)
def test_names_that_do_not_fit_the_columns_are_refused(tmp_path, names, said):
    path = written(tmp_path / "bare.csv", [f"{k},2,3" for k in range(1, 30)])
    with error(DriveError, said):
        draft_table(path, names)


def test_names_given_by_hand_go_in_place_of_a_header(tmp_path):
    path = no_units(tmp_path)
    found = draft_table(path, ["Date", "speed_kmh", "rpm", "-", "-"])
    assert [c.quantity for c in found.known] == ["vehicle_speed", "engine_speed"]
    assert found.rows == ROWS


def test_each_column_has_the_rate_that_reading_finds(tmp_path):
    """Two rows of each second, one quantity in every fourth row."""
    rows = [f"{k // 2},{50 + k % 9},{'' if k % 4 else 60}" for k in range(2400)]
    path = written(tmp_path / "log.csv", ["Time [s],Speed [km/h],Engine load [%]", *rows])
    found = draft_table(path)
    mapping = tmp_path / "map.toml"
    mapping.write_text(mapping_text([found]), encoding="utf-8")
    drive = read_drive(path, mapping)
    for column, rate in zip(found.known, (2.0, 0.5), strict=True):
        signal = drive.signals[column.quantity]
        assert column.rate == pytest.approx(1.0 / signal.period, rel=1e-6)
        assert column.rate == pytest.approx(rate, rel=0.01)


def test_a_gap_does_not_lower_the_rate(tmp_path):
    """Ten values a second for two minutes, with an hour between."""
    rows = [f"{k / 10 + 3600 * (k >= 600)},{50 + k % 9}" for k in range(1200)]
    found = draft_table(written(tmp_path / "log.csv", ["Time [s],Speed [km/h]", *rows]))
    assert found.known[0].rate == pytest.approx(10.0)


MINUTES = np.arange(4 * 900) / 4.0


def driven(folder, clocks, rows=MINUTES):
    """Write 15 minutes of a drive in a town, four rows a second, with these clocks."""
    speed = np.abs(50.0 * np.sin(0.05 * rows))
    names = ",".join(["Speed (km/h)", "RPM", "Load (%)", *clocks])
    told = zip(speed, zip(*clocks.values(), strict=True), strict=True)
    lines = [
        ",".join(map(str, [round(v), round(1500 + 10 * v), round(20 + v / 5, 1), *stamps]))
        for v, stamps in told
    ]
    return written(folder / "town.csv", [names, *lines])


def test_a_counter_of_minutes_is_no_clock_beside_one(tmp_path):
    clocks = {
        "4E-TimeSinceCodesCleared": (MINUTES // 60 + 310).astype(int),
        "Runtime ECU": np.floor(MINUTES).astype(int) + 7,
        "Distance": np.floor(10 * MINUTES).astype(int),
    }
    found = draft_table(driven(tmp_path, clocks))
    assert (found.time, found.time_unit) == ("Runtime ECU", "s")
    assert found.duration == pytest.approx(899.0)


@pytest.mark.parametrize(
    "name", ["Time run with MIL on", "TIME_SINCE_DTC_CLEARED", "Time since reset"]
)
def test_a_counter_of_minutes_alone_is_told(tmp_path, name):
    """By its name, or by the speed that no vehicle changes so fast."""
    found = draft_table(driven(tmp_path, {name: (MINUTES // 60 + 7).astype(int)}))
    assert (found.time, found.time_unit) == (name, "min")
    assert any("minutes" in doubt for doubt in found.questions)


@pytest.mark.parametrize("unit", ["s", "min"])
def test_a_counter_of_minutes_that_a_mapping_names_is_serious(tmp_path, unit):
    name = "TIME_SINCE_DTC_CLEARED"
    path = driven(tmp_path, {name: (MINUTES // 60 + 7).astype(int)})
    named = {"time": {"column": name, "unit": unit}, "signals": {"engine_speed": {"column": "RPM"}}}
    named["signals"]["engine_speed"]["unit"] = "rpm"
    serious = {p.id for p in read_drive(path, named).problems if p.serious}
    assert serious == {"clock.minutes_named", *(["clock.minutes"] if unit == "min" else [])}


def test_of_two_clocks_the_one_in_which_a_vehicle_moves_is_taken(tmp_path):
    clocks = {"Time (s)": np.round(MINUTES / 100.0, 4), "Timestamp (s)": np.round(MINUTES, 2)}
    found = draft_table(driven(tmp_path, clocks))
    assert found.time == "Timestamp (s)"


NAMES = "Time (s),Speed (km/h),RPM,Load (%),"
BODY = [f"{t:.2f},{v:.0f},{n:.0f},{x}," for t, v, n, x in zip(T, SPEED, RPM, LOAD, strict=True)]


@pytest.mark.parametrize(
    "head",
    [
        # A preamble of settings, some of them rows of numbers.
        ["Tool,Map,Fuel,Boost,", "3/1//2,Sport,E10,1.2,", "1,2,3,4,", NAMES],
        # Of keys and values in quotes, parted from the names by blank lines.
        ['"Format","Logger file",,,', '"Date","05/03/2026",,,"Workbook"', '"Rate","4.0","Hz",,',
         "", "", '"Time","Speed","RPM","Load",', '"s","km/h","rpm","%",', "", ""],
        # The same as a spreadsheet saves it again: separators alone for blank lines.
        ["Format,Logger file,,,", "Date,05/03/2026,,,", "Rate,4.0,Hz,,", ",,,,", ",,,,",
         "Time,Speed,RPM,Load,", "s,km/h,rpm,%,", ",,,,", ",,,,"],
        # One line of the session, and units in brackets.
        ["Session 12,,,,", "time,Speed,RPM,Load,", "(sec),(km/h),(1/min),(%),"],
        # Groups above names above units.
        ["Monday,02,March,2026,", "A12 345,ADV,4 cyl,,", ",G1,G2,G3,", "",
         "Marker,Group 1,Group 2,Group 3,",
         "STAMP,Vehicle speed,Engine Speed,Engine load,", "s, km/h, /min, %,"],
        # Longer than what is looked at first.
        [f"Setting {k},{k},on,," for k in range(90)] + [NAMES],
    ],
)  # fmt: skip
def test_a_preamble_with_the_separator_of_the_table_hides_no_header(tmp_path, head):
    path = written(tmp_path / "log.csv", [*head, *BODY])
    found = draft_table(path)
    known = {c.quantity: c.unit for c in found.known}
    assert known == {"vehicle_speed": "kmh", "engine_speed": "rpm", "engine_load": "pct"}
    drive = read_drive(path, tomllib.loads(mapping_text([found])))
    assert len(drive.signals["vehicle_speed"]) == ROWS
    assert not [p for p in drive.problems if p.id == "file.rows_strange"]


def test_units_behind_the_numbers_of_cells(tmp_path):
    """As python-OBD writes its quantities; a request without an answer is empty."""
    lines = ["timestamp,RPM,SPEED,LOAD"]
    for k, (t, v, n, x) in enumerate(zip(T, SPEED, RPM, LOAD, strict=True)):
        speed = "None" if k % 50 == 7 else f"{v / 1.609344:.2f} mile_per_hour"
        lines.append(f"{t:.2f},{n:.1f} revolutions_per_minute,{speed},{x} percent")
    path = written(tmp_path / "obd.csv", lines)
    found = draft_table(path)
    units = {c.quantity: (c.unit, c.stated) for c in found.known}
    assert units == {
        "engine_speed": ("rpm", True),
        "vehicle_speed": ("mph", True),
        "engine_load": ("pct", True),
    }
    drive = read_drive(path, tomllib.loads(mapping_text([found])))
    speed = drive.signals["vehicle_speed"]
    assert len(speed) == ROWS - len(range(7, ROWS, 50))
    assert np.allclose(3.6 * speed.values, np.interp(speed.time, T, SPEED), atol=0.01)


def test_cells_of_two_units_are_no_numbers(tmp_path):
    lines = ["timestamp,RPM,SPEED (km/h)"]
    lines += [
        f"{t:.2f},{n:.0f} {'rpm' if t < 9 else 'Hz'},{v}"
        for t, n, v in zip(T, RPM, SPEED, strict=True)
    ]
    found = draft_table(written(tmp_path / "obd.csv", lines))
    assert "engine_speed" not in {c.quantity for c in found.known}
