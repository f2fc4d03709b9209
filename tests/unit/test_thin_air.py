"""A load is a part of what the engine can give there: in other air it stands for another torque."""

from dataclasses import replace

import numpy as np
import pytest

import weighbridge as wb
from weighbridge import Signal
from weighbridge.simulation import Sensors, make_scenario, simulate_car
from weighbridge.vehicle import Air, identify_air

UP = 1600.0
"""By how much the drive is lifted [m]."""

STEP = 1.0 / 255.0
"""Of PID 04 [-]."""


def pressure_at(height):
    """Pressure of the standard atmosphere at heights [m] (ISO 2533), over that at the sea [-]."""
    return (1.0 - 0.0065 * height / 288.15) ** 5.2559


OTHERS = ("engine_torque", "engine_torque_fraction", "reference_torque", "lambda_1")


def lifted(drive, power, height=UP):
    """Return the drive at another height; its load grows as its torque falls with the charge."""
    ground = drive.signals["altitude"]
    low, high = (float(np.median(pressure_at(ground.values + h))) for h in (0.0, height))
    load, pressure = drive.signals["engine_load"], drive.signals["barometric_pressure"]
    seen = np.clip(load.values * (low / high) ** power, 0.0, 1.0)
    return drive.with_signals(
        Signal("altitude", ground.time, ground.values + height),
        Signal("barometric_pressure", pressure.time, pressure.values * high / low),
        Signal("engine_load", load.time, np.round(seen / STEP) * STEP),
    )


@pytest.fixture(scope="module")
def low():
    """Two drives of one car at 60 m, with their masses."""
    made = [
        simulate_car(replace(scenario, sensors=Sensors(imu_rate=50.0)))
        for payload, seed in ((60.0, 71), (330.0, 72))
        for scenario in [make_scenario("car-short", payload=payload, seed=seed)]
    ]
    return [(m.drive.without(*OTHERS), float(m.truth.mass[0])) for m in made]


@pytest.fixture(scope="module")
def car(low):
    """Return the car as the first drive calibrates it, air flow left out."""
    drive, mass = low[0]
    return wb.calibrate([drive.without("mass_air_flow")], mass=mass)


@pytest.mark.parametrize("power", [0.0, 1.0])
def test_the_interval_holds_at_another_height_whatever_the_engine_does(low, car, power):
    drive, mass = low[1]
    there = wb.weigh(drive.without("mass_air_flow"), car)
    up = wb.weigh(lifted(drive.without("mass_air_flow"), power), car)
    bottom, top = up.interval(0.95)
    assert bottom < mass < top
    assert up.std > 2.0 * there.std
    assert "torque.air" in {p.id for p in up.problems}
    assert "torque.air" not in {p.id for p in there.problems}


@pytest.mark.parametrize("power", [0.0, 1.0])
def test_air_flow_shows_what_the_load_stands_for(low, power):
    (first, known), (drive, mass) = low
    car = wb.calibrate([first], mass=known, settings=wb.CalibrationSettings(source="load"))
    assert "mass_air_flow" in {w.signal for w in car.witnesses}
    up = wb.weigh(lifted(drive, power), car)
    exponent, std = up.seen.torque.in_thin_air
    assert abs(exponent - power) < 2.0 * std < 0.5
    alone = wb.weigh(lifted(drive.without("mass_air_flow"), power), car)
    assert abs(up.mass - mass) < 0.6 * abs(alone.mass - mass)
    assert up.std < 0.7 * alone.std


@pytest.mark.parametrize("power", [0.0, 1.0])
def test_drives_at_two_heights_calibrate_it(low, power):
    (first, known), (second, mass) = low
    drives = [first.without("mass_air_flow"), lifted(second.without("mass_air_flow"), power)]
    car = wb.calibrate(drives, mass=[known, mass])
    exponent, std = car.torque.in_thin_air
    assert abs(exponent - power) < abs(exponent - (1.0 - power))
    assert std < 0.15


def test_a_vehicle_file_keeps_the_air_of_its_calibration(car, tmp_path):
    car.save(tmp_path / "car.toml")
    again = wb.Vehicle.load(tmp_path / "car.toml")
    assert again.torque.charge == pytest.approx(car.torque.charge, rel=1e-5)
    assert 0.9 < car.torque.charge < 1.05


def test_charge_is_that_of_sae_j1979():
    air = Air(temperature=298.0, pressure_ratio=1.0)
    assert air.charge(np.zeros(1))[0] == pytest.approx(1.0, abs=1e-3)
    assert air.charge(np.array([UP]))[0] == pytest.approx(83.5 / 101.3, abs=2e-3)
    cold = replace(air, temperature=268.0)
    assert cold.charge(np.zeros(1))[0] == pytest.approx(np.sqrt(298.0 / 268.0), abs=1e-3)


def test_the_manifold_before_the_start_shows_the_pressure():
    time = np.arange(0.0, 20.0)
    running = time >= 5.0
    drive = wb.Drive(
        name="start",
        signals={
            "engine_speed": Signal("engine_speed", time, np.where(running, 80.0, 0.0)),
            "intake_pressure": Signal("intake_pressure", time, np.where(running, 3e4, 8.4e4)),
        },
    )
    air = identify_air(drive, np.full(3, np.nan))
    assert air.known
    assert air.charge(np.zeros(1))[0] == pytest.approx(0.829 * np.sqrt(298.0 / 288.15), rel=2e-3)
    nothing = identify_air(drive.without("intake_pressure"), np.full(3, np.nan))
    assert not nothing.known
