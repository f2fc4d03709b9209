"""Whether map doubts the unit of a vehicle speed beside that of satellites."""

import re

import numpy as np
import polars as pl
import pytest

TIME = np.arange(0.0, 600.0, 0.5)
SPEED = 12.0 + 10.0 * np.sin(TIME / 40.0)  # [m/s]


@pytest.fixture
def doubt(tmp_path, weighbridge):
    """Doubt of the vehicle speed of a table, of which the satellites are a second one."""

    def found(name, values, shown=SPEED):
        obd, gnss, out = (tmp_path / n for n in ("obd.csv", "gnss.csv", "map.toml"))
        rpm = 900.0 + 50.0 * SPEED
        pl.DataFrame({"t_s": TIME, name: values, "engine_rpm": rpm}).write_csv(obd)
        columns = {"t_s": TIME, "GPS speed (m/s)": shown, "latitude": 48.0 + 1e-5 * TIME}
        pl.DataFrame(columns).write_csv(gnss)
        assert weighbridge("map", obd, gnss, "-o", out, "--force").code == 0
        section = re.search(r"signals\.vehicle_speed\]\n(.*?)\ncolumn", out.read_text(), re.DOTALL)
        return "".join(section[1].splitlines(keepends=True)[1:])

    return found


@pytest.mark.parametrize(
    ("name", "values", "ratio", "meant"),
    [
        ("Vehicle speed (mph)", 3.6 * SPEED, "1.61", "kmh"),
        ("Vehicle speed (km/h)", SPEED / 0.44704, "0.62", "mph"),
        ("Vehicle speed (m/s)", 3.6 * SPEED, "3.60", "kmh"),
    ],
)
def test_a_speed_in_another_unit_than_its_name_says_is_doubted(doubt, name, values, ratio, meant):
    told = doubt(name, values)
    assert ratio in told
    assert "'GPS speed (m/s)'" in told
    assert f'unit = "{meant}"' in told


@pytest.mark.parametrize("scale", [0.98, 1.0, 1.06])
def test_speeds_that_agree_are_not_doubted(doubt, scale):
    assert doubt("Vehicle speed (km/h)", 3.6 * scale * SPEED) == ""


def test_a_spike_or_a_parked_receiver_decides_nothing(doubt):
    spiked = 3.6 * SPEED
    spiked[100] *= 1.609
    assert doubt("Vehicle speed (km/h)", spiked) == ""
    assert doubt("Vehicle speed (km/h)", 3.6 * SPEED, shown=0.02 * SPEED) == ""
