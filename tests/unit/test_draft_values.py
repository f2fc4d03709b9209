"""What columns are, judged by their values beside their names."""

import numpy as np
import pytest

from weighbridge.io.draft import draft

DT = 0.5
T = np.arange(0.0, 400.0, DT)
SPEED = np.clip(15.0 + 12.0 * np.sin(0.05 * T) + 4.0 * np.sin(0.31 * T), 0.0, None)
GEAR = np.select([SPEED < 6.0, SPEED < 12.0, SPEED < 20.0], [40.0, 26.0, 18.0], 12.0)
ENGINE = np.maximum(SPEED * GEAR, 85.0) * 30.0 / np.pi
FLOW = 3.0 + 0.01 * ENGINE
RNG = np.random.default_rng(5)


def drafted(tmp_path, columns):
    """Draft a table of these columns beside a time and an engine load."""
    columns = {"Time (s)": T, "Load (%)": 30.0 + 10.0 * np.sin(T), **columns}
    lines = [",".join(columns)]
    rows = zip(*columns.values(), strict=True)
    lines += [",".join(f"{x:.6g}" for x in row) for row in rows]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    found = draft(path)
    return {c.quantity: c.name for c in found.known}, found


def test_the_battery_of_the_lights_drives_nothing(tmp_path):
    volts = 13.9 + 0.1 * RNG.normal(size=T.size)
    amps = 5.0 * RNG.normal(size=T.size)
    found, whole = drafted(tmp_path, {"Battery Voltage (V)": volts, "Battery Current (A)": amps})
    assert found["module_voltage"] == "Battery Voltage (V)"
    assert not {"battery_voltage", "battery_current"} & set(found)
    assert any("Battery Current" in doubt for doubt in whole.all_questions)
    found, _ = drafted(tmp_path, {"Battery Voltage (V)": 28 * volts, "Battery Current (A)": amps})
    assert {"battery_voltage", "battery_current"} <= set(found)


@pytest.mark.parametrize("offset", [-101.3, 0.0])
def test_a_pressure_over_that_of_the_air_is_not_the_manifold_s(tmp_path, offset):
    pressure = 45.0 + 0.01 * ENGINE + offset
    found, _ = drafted(tmp_path, {"Manifold Pressure (kPa)": pressure})
    assert ("intake_pressure" in found) == (offset == 0.0)


def test_the_number_of_a_map_is_no_pressure(tmp_path):
    found, _ = drafted(tmp_path, {"map": np.full(T.size, 1.0)})
    assert "intake_pressure" not in found


def test_what_only_its_unit_tells_is_found_by_how_it_moves(tmp_path):
    columns = {
        "zz1 [km/h]": 3.6 * SPEED,
        "zz2 [rpm]": ENGINE,
        "zz3 [g/s]": FLOW,
        "idle target [rpm]": np.full(T.size, 800.0),
        "mean [km/h]": np.cumsum(3.6 * SPEED) / np.arange(1, T.size + 1),
        "purge [g/s]": np.abs(RNG.normal(size=T.size)),
        "fan [rpm]": 900.0 + 300.0 * (T % 60.0 > 30.0),
    }
    found, whole = drafted(tmp_path, columns)
    assert found["vehicle_speed"] == "zz1 [km/h]"
    assert found["engine_speed"] == "zz2 [rpm]"
    assert found["mass_air_flow"] == "zz3 [g/s]"
    # What was found without a name is asked about.
    assert all(c.unsure and c.question for c in whole.known if c.name.startswith("zz"))


def test_two_that_fit_and_differ_are_none(tmp_path):
    columns = {"zz1 [km/h]": 3.6 * SPEED, "zz2 [km/h]": 2.0 * SPEED}
    found, _ = drafted(tmp_path, columns)
    assert "vehicle_speed" not in found
    found, _ = drafted(tmp_path, {"zz1 [km/h]": 3.6 * SPEED, "zz2 [mph]": SPEED / 0.44704})
    assert found["vehicle_speed"] == "zz1 [km/h]"


@pytest.mark.parametrize(
    "values",
    [
        np.full(T.size, 50.0),
        50.0 + 50.0 * (T > 200.0),
        np.cumsum(3.6 * SPEED) / np.arange(1, T.size + 1),
        150.0 * np.abs(RNG.normal(size=T.size)),
    ],
    ids=["constant", "set", "average", "noise"],
)
def test_no_speed_of_a_vehicle(tmp_path, values):
    found, _ = drafted(tmp_path, {"zz [km/h]": values})
    assert "vehicle_speed" not in found
