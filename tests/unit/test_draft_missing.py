"""What a draft did not take, and why: units that do not fit, sensors that were left out."""

import numpy as np
import pytest

from weighbridge.io.draft import draft
from weighbridge.io.draft_missing import missing
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
    found = draft(table(tmp_path, ["time_s", name, "Load (%)"]))
    assert {c.quantity for c in found.known} == {"engine_load"}
    doubt = next(d for d in found.all_doubts if name in d)
    assert f"not taken for {quantity}: its unit {unit!r}" in doubt
    assert "it can be in" in doubt


def test_the_unit_of_a_row_of_units_is_named(tmp_path):
    names, units = ["time", "Engine speed", "Engine load", "Speed"], ["s", "beats", "%", "km/h"]
    found = draft(table(tmp_path, names, units=units))
    assert "'Engine speed': not taken for engine_speed: its unit 'beats'" in found.all_doubts[0]


@pytest.mark.parametrize(
    "name", ["Engine RPM x1000 (rpm)", "engine_speed_target", "Average speed (km/h)", "Note"]
)
def test_another_thing_is_not_blamed_on_its_unit(name):
    assert not recognise_all([name])[0].misfit


def test_what_another_column_is_taken_for_is_no_misfit():
    found = recognise_all(["engine_speed_rpm", "engine_speed_pct"])
    assert [f.quantity for f in found] == ["engine_speed", ""]
    assert not found[1].misfit


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["accel vector 1", "accel vector 2"], "taken for the accelerometer, though 'accel vec"),
        (["Linear Acceleration X", "user_acc_y"], "have no gravity in them; record the raw acc"),
        (["turbo rev", "x"], "taken for the engine speed, though 'turbo rev' may be"),
        (["gyro heat", "x"], "taken for the gyroscope, though 'gyro heat' may be"),
    ],
)
def test_a_sensor_that_was_not_taken_is_told(tmp_path, names, words):
    found = draft(table(tmp_path, ["time_s", "Load (%)", *names]))
    assert [words in sentence for sentence in missing([found])] == [True]
    other = draft(table(tmp_path, ["time_s", "ax (g)", "gx_dps", "rpm", *names], name="other.csv"))
    assert list(missing([found, other])) == []


def test_pound_feet_and_thousandths_are_units(tmp_path):
    names = ["time_s", "Engine Torque [lb-ft]", "acc_x [mg]", "gyro_x [mdps]"]
    columns = {c.quantity: c for c in draft(table(tmp_path, names)).known}
    assert {q: c.unit for q, c in columns.items()} == {
        "engine_torque": "lbft", "accel_x": "mg", "gyro_x": "mdegps",
    }  # fmt: skip
    assert all(c.stated for c in columns.values())
    assert np.isclose(columns["engine_torque"].low, 1.0)
