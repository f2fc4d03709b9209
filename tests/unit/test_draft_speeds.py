"""Whether map doubts the unit of a vehicle speed beside that of satellites."""

import numpy as np
import polars as pl
import pytest

from weighbridge.io.draft import draft
from weighbridge.io.draft_speeds import with_compared_speeds

TIME = np.arange(0.0, 600.0, 0.5)
SPEED = 12.0 + 10.0 * np.sin(TIME / 40.0)  # [m/s]


def doubt(tmp_path, name, values, ground="GPS speed (m/s)", shown=SPEED):
    """Doubt of the vehicle speed of a table, of which the satellites are a second one."""
    obd, gnss = tmp_path / "obd.csv", tmp_path / "gnss.csv"
    rpm = 900.0 + 50.0 * SPEED
    pl.DataFrame({"t_s": TIME, name: values, "engine_rpm": rpm}).write_csv(obd)
    pl.DataFrame({"t_s": TIME, ground: shown, "latitude": 48.0 + 1e-5 * TIME}).write_csv(gnss)
    drafts = with_compared_speeds([draft(obd), draft(gnss)])
    (speed,) = (c for one in drafts for c in one.columns if c.quantity == "vehicle_speed")
    return speed.question


@pytest.mark.parametrize(
    ("name", "values", "ratio", "meant"),
    [
        ("Vehicle speed (mph)", 3.6 * SPEED, "1.61", "kmh"),
        ("Vehicle speed (km/h)", SPEED / 0.44704, "0.62", "mph"),
        ("Vehicle speed (m/s)", 3.6 * SPEED, "3.60", "kmh"),
    ],
)
def test_a_speed_in_another_unit_than_its_name_says_is_doubted(
    tmp_path, name, values, ratio, meant
):
    told = doubt(tmp_path, name, values)
    assert f"reads {ratio} times the speed of 'GPS speed (m/s)'" in told
    assert f'write unit = "{meant}" for it' in told


@pytest.mark.parametrize("scale", [0.98, 1.0, 1.06])
def test_speeds_that_agree_are_not_doubted(tmp_path, scale):
    assert doubt(tmp_path, "Vehicle speed (km/h)", 3.6 * scale * SPEED) == ""


def test_a_spike_or_a_parked_receiver_decides_nothing(tmp_path):
    spiked = 3.6 * SPEED
    spiked[100] *= 1.609
    assert doubt(tmp_path, "Vehicle speed (km/h)", spiked) == ""
    assert doubt(tmp_path, "Vehicle speed (km/h)", 3.6 * SPEED, shown=0.02 * SPEED) == ""
