"""What a draft did not take, and why: units that do not fit, sensors that were left out."""

import numpy as np
import pytest
from tests.noted import error

from weighbridge import DriveError, read_drive
from weighbridge.io import draft_table, mapping_text
from weighbridge.io.naming import recognise_all

ROWS = 100


def table(folder, names, name="log.csv", units=()):
    """A log of such columns, each with numbers, and a row of units where some are given."""
    body = [",".join(f"{0.1 * k + j:.2f}" for j in range(len(names))) for k in range(ROWS)]
    head = [",".join(names), *([",".join(units)] if units else [])]
    (folder / name).write_text("\n".join([*head, *body]))
    return folder / name


@pytest.mark.parametrize(
    ("name", "quantity", "unit"),
    [
        ("rpm [%]", "engine_speed", "%"),
        ("engine_speed_pct", "engine_speed", "pct"),
        ("Vehicle speed [%]", "vehicle_speed", "%"),
        ("ax_counts", "accel_x", "counts"),
        ("Altitude [furlong]", "altitude", "furlong"),
        ("Engine Speed [Hz]", "engine_speed", "Hz"),
    ],
)
def test_a_unit_that_does_not_fit_is_named(tmp_path, name, quantity, unit):
    found = draft_table(table(tmp_path, ["time_s", name, "Load (%)"]))
    assert {c.quantity for c in found.known} == {"engine_load"}
    doubt = next(d for d in found.all_questions if name in d)
    assert f"not taken for {quantity}: its unit {unit!r}" in doubt
    assert "it can be in" in doubt


def test_the_unit_of_a_row_of_units_is_named(tmp_path):
    names, units = ["time", "Engine speed", "Engine load", "Speed"], ["s", "beats", "%", "km/h"]
    found = draft_table(table(tmp_path, names, units=units))
    assert "'Engine speed': not taken for engine_speed: its unit 'beats'" in found.all_questions[0]


@pytest.mark.parametrize(
    "name", ["Engine RPM x1000 (rpm)", "engine_speed_target", "Average speed (km/h)", "Note"]
)
def test_another_thing_is_not_blamed_on_its_unit(name):
    assert not recognise_all([name], misfits=True)[0].misfit


def test_what_another_column_is_taken_for_is_no_misfit():
    found = recognise_all(["engine_speed_rpm", "engine_speed_pct"], misfits=True)
    assert [f.quantity for f in found] == ["engine_speed", ""]
    assert not found[1].misfit


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["accel vector 1", "accel vector 2"], ("accel vector 1", "accel_x")),
        (["Linear Acceleration X", "user_acc_y"], ("Linear Acceleration X", "gravity")),
        (["turbo rev", "x"], ("turbo rev", "engine_speed")),
        (["gyro heat", "x"], ("gyro heat", "gyro_x")),
    ],
)
def test_a_sensor_that_was_not_taken_is_told(weighbridge, tmp_path, names, said):
    one = table(tmp_path, ["time_s", "Load (%)", *names])
    output = ("-o", tmp_path / "map.toml", "--force")
    ran = weighbridge("map", one, *output)
    assert any(all(word in line for word in said) for line in ran.err.splitlines())
    others = ["time_s", "ax (g)", "gx_dps", "rpm", *names]
    both = weighbridge("map", one, table(tmp_path, others, name="other.csv"), *output)
    assert not any(all(word in line for word in said) for line in both.err.splitlines())


def test_pound_feet_and_thousandths_are_units(tmp_path):
    names = ["time_s", "Engine Torque [lb-ft]", "acc_x [mg]", "gyro_x [mdps]"]
    columns = {c.quantity: c for c in draft_table(table(tmp_path, names)).known}
    assert {q: c.unit for q, c in columns.items()} == {
        "engine_torque": "lbft", "accel_x": "mg", "gyro_x": "mdegps",
    }  # fmt: skip
    assert all(c.stated for c in columns.values())
    assert np.isclose(columns["engine_torque"].low, 1.0)


def test_words_behind_the_numbers_of_a_column_are_no_unit(tmp_path):
    rows = [f"{k},{50 + k % 2} or so,{k}" for k in range(ROWS)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["Time (s),Speed (km/h),Load (%)", *rows]))
    assert {c.quantity: c.unit for c in draft_table(path).known}["vehicle_speed"] == "kmh"


def test_cells_that_are_no_numbers_are_shown(tmp_path):
    rows = [f"{k},v{50 + k % 2},{k}" for k in range(ROWS)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["Time (s),Speed (km/h),Load (%)", *rows]))
    (doubt,) = (d for d in draft_table(path).all_questions if "Speed" in d)
    assert "its cells are no numbers, such as 'v50'" in doubt


def test_lines_that_end_in_carriage_returns_alone_are_told(tmp_path):
    (tmp_path / "mac.csv").write_bytes(b"time_s,rpm\r0,900\r1,950\r2,980\r")
    with error(DriveError, "mac.csv Macintosh"):
        draft_table(tmp_path / "mac.csv")


@pytest.mark.parametrize("date", ["06.05.2024", "06/05/2024"])
def test_dates_with_a_decimal_comma_are_the_time(tmp_path, date):
    rows = [f"{date} 11:58:{k // 10:02d},{k % 10}00;{50 + k % 9};{900 + k}" for k in range(ROWS)]
    (tmp_path / "x.csv").write_text("\n".join(["Zeit;v [km/h];Drehzahl [1/min]", *rows]))
    found = draft_table(tmp_path / "x.csv")
    assert found.duration == pytest.approx(0.1 * (ROWS - 1))
    (tmp_path / "x.toml").write_text(mapping_text([found]))
    drive = read_drive(tmp_path / "x.csv", tmp_path / "x.toml")
    assert drive.signals["engine_speed"].time[-1] == pytest.approx(0.1 * (ROWS - 1), abs=1e-3)


def test_a_logger_s_name_beside_canonical_ones_is_answered_by_the_canonical_one(tmp_path):
    path = table(tmp_path, ["time_s", "engine_load_pct", "Speed (mph)", "Drehzahl [1/min]"])
    (note,) = read_drive(path).problems
    assert "'Speed (mph)' (did you mean vehicle_speed_mph?)" in note.text
    assert "'Drehzahl [1/min]' (did you mean engine_speed_rpm?)" in note.text
