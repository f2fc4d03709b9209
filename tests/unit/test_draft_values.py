"""What columns are, judged by their values beside their names."""

import numpy as np
import pytest

from weighbridge.io import draft_table

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
    found = draft_table(path)
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


PULL = np.gradient(SPEED, DT)
"""Acceleration along the vehicle [m/s^2]."""

SHAKE = 0.2 * RNG.normal(size=(3, T.size))


def units(whole):
    return {c.quantity: c.unit for c in whole.known}


def test_a_voltage_and_a_current_without_more_words(tmp_path):
    amps = 60.0 * PULL * SPEED / 15.0 + 5.0
    columns = {"Speed (km/h)": 3.6 * SPEED, "voltage": 390.0 - 0.1 * amps, "current": amps}
    found, _ = drafted(tmp_path, columns)
    assert (found["battery_voltage"], found["battery_current"]) == ("voltage", "current")
    # What does not load the battery is none of its current.
    fan = {**columns, "current": 3.0 * (T % 40.0 > 20.0)}
    found, _ = drafted(tmp_path, fan)
    assert "battery_current" not in found
    # What stands for a speed, a tracker's cell and lights are none of its voltage.
    for volts in (3.6 * SPEED, 4.0 + 0.0 * T, 14.0 + 0.0 * T):
        assert "battery_voltage" not in drafted(tmp_path, {**columns, "voltage": volts})[0]


def test_what_slows_the_vehicle_down_is_the_brake_s_switch(tmp_path):
    columns = {"Speed (km/h)": 3.6 * SPEED, "BrkDrv2": (PULL < -0.6).astype(float)}
    assert drafted(tmp_path, columns)[0]["brake_switch"] == "BrkDrv2"
    for other in ((T % 50.0 > 25.0).astype(float), 0.0 * T):
        assert "brake_switch" not in drafted(tmp_path, {**columns, "BrkDrv2": other})[0]
    # A pressure or a position is no switch.
    pressure = {"Speed (km/h)": 3.6 * SPEED, "brake": np.clip(-20.0 * PULL, 0.0, None)}
    assert "brake_switch" not in drafted(tmp_path, pressure)[0]


LOAD = 1600.0 + 200.0 * (T > 120.0) + 600.0 * (T > 300.0)
"""What a car makes of its mass, in steps; 120 kg more than it weighs at the end."""


@pytest.mark.parametrize(
    ("name", "values", "taken"),
    [
        ("TSK_Fahrzeugmasse_02 [kg]", LOAD, True),
        ("Gross Combination Vehicle Weight (t)", 0.001 * LOAD, True),
        # Before it knows one, it sends none.
        ("vehicle mass [kg]", np.where(T < 60.0, 0.0, LOAD), True),
        ("vehicle mass [kg]", np.full(T.size, 1500.0), False),
        ("vehicle mass [kg]", 1500.0 * (1.0 + 0.1 * SPEED), False),
        ("vehicle mass [kg]", 0.01 * LOAD, False),
        ("max. vehicle mass [kg]", LOAD, False),
        ("trailer weight [kg]", LOAD, False),
    ],
)
def test_a_mass_that_a_vehicle_reports_stays_as_a_load_does(tmp_path, name, values, taken):
    found, _ = drafted(tmp_path, {"Speed (km/h)": 3.6 * SPEED, name: values})
    assert found.get("maker_mass") == (name if taken else None)


@pytest.mark.parametrize(
    ("name", "values", "taken"),
    [
        ("AAG_Anhaenger_erkannt", T > 200.0, True),
        ("CGM_TrailerPresent", T > 200.0, True),
        ("Trailer connected", 13.8 * (T > 200.0), False),
        ("AAG_Anhaenger_abgesteckt", T > 200.0, False),
        ("Trailer mode", T > 200.0, False),
    ],
)
def test_a_bit_says_that_a_trailer_is_connected(tmp_path, name, values, taken):
    found, _ = drafted(tmp_path, {"Speed (km/h)": 3.6 * SPEED, name: values.astype(float)})
    assert found.get("trailer_connected") == (name if taken else None)


def test_the_rated_power_is_no_power(tmp_path):
    columns = {"Speed (km/h)": 3.6 * SPEED, "ENGINE_POWER": np.full(T.size, 85.0)}
    assert "engine_power" not in drafted(tmp_path, columns)[0]
    columns["ENGINE_POWER"] = 20.0 * np.clip(PULL, 0.0, None) * SPEED
    assert "engine_power" in drafted(tmp_path, columns)[0]


@pytest.mark.parametrize("factor", [1.0, 1.0 / 9.80665])
def test_the_speed_shows_the_unit_of_an_acceleration(tmp_path, factor):
    columns = {"Speed (km/h)": 3.6 * SPEED, "Long Acc": factor * (PULL + SHAKE[0])}
    whole = drafted(tmp_path, columns)[1]
    assert units(whole)["longitudinal_accel"] == ("mps2" if factor == 1.0 else "g")


@pytest.mark.parametrize("name", ["G-{}", "/imu/linear_acceleration.{}", "Axis {}"])
@pytest.mark.parametrize("gravity", [True, False])
def test_gravity_shows_a_raw_acceleration(tmp_path, name, gravity):
    size = 9.80665 if name.startswith("/") else 1.0
    axes = size * (0.05 * SHAKE + np.array([[0.1], [0.0], [float(gravity)]]))
    columns = {name.format(a.upper() if "-" in name else a.lower()): x
               for a, x in zip("xyz", axes, strict=True)}  # fmt: skip
    found, whole = drafted(tmp_path, {"Speed (km/h)": 3.6 * SPEED, **columns})
    assert ({"accel_x", "accel_y", "accel_z"} <= set(found)) == gravity
    assert not gravity or units(whole)["accel_z"] == ("g" if size == 1.0 else "mps2")


def test_positions_at_sea_are_in_radians(tmp_path):
    east = np.cumsum(SPEED) * DT / 6.37e6
    columns = {"lat": np.full(T.size, np.radians(47.0)), "lon": np.radians(8.0) + east}
    assert units(drafted(tmp_path, columns)[1])["latitude"] == "rad"
    assert units(drafted(tmp_path, {q: np.degrees(x) for q, x in columns.items()})[1])[
        "latitude"
    ] == "deg"  # fmt: skip


def test_a_motor_s_speed_in_radians(tmp_path):
    columns = {"Speed (km/h)": 3.6 * SPEED, "MotSpd": 25.0 * SPEED}
    assert units(drafted(tmp_path, columns)[1])["engine_speed"] == "radps"
    columns["MotSpd"] = 25.0 * SPEED * 30.0 / np.pi
    assert units(drafted(tmp_path, columns)[1])["engine_speed"] == "rpm"
    # A speed of some thousand is none of a vehicle.
    found, _ = drafted(tmp_path, {"speed": 25.0 * SPEED * 30.0 / np.pi})
    assert (found["engine_speed"], found.get("vehicle_speed")) == ("speed", None)
