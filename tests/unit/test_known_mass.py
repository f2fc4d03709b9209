"""The mass of a calibration must be one that the vehicle can have."""

from dataclasses import replace

import pytest
from tests.noted import error, refused

import weighbridge as wb
from weighbridge import ConfigError, Drive, DriveInfo, Vehicle
from weighbridge.calibration.known_mass import POUND, check_mass, drag_finding, scale_finding
from weighbridge.simulation import Sensors, make_scenario, simulate_car
from weighbridge.vehicle import RoadLoad, TorqueModel

DRIVE = Drive("drive", {})


@pytest.mark.parametrize("known", [{"tare": 1500.0}, {"tare": 1500.0, "gross": 2100.0}, {}])
def test_pounds_are_told_in_kilograms(known):
    car = Vehicle(kind="car", **known)
    check_mass(DRIVE, 1580.0, car)
    if not known:
        check_mass(DRIVE, 3483.0, car)  # below what a car may have
        with pytest.raises(ConfigError, match=r"3968 lb are 1800 kg"):
            check_mass(DRIVE, 3968.0, car)
        return
    with pytest.raises(ConfigError, match=r"3483 lb are 1580 kg"):
        check_mass(DRIVE, 3483.0, car)


def test_pounds_by_what_the_drive_states():
    stated = replace(DRIVE, info=DriveInfo(mass=1580.0))
    with pytest.raises(ConfigError, match=r"3483 lb are 1580 kg"):
        check_mass(stated, 3483.0, Vehicle(kind="car", tare=1500.0))


def test_a_mass_below_the_tare_is_refused():
    with pytest.raises(ConfigError, match="is not between 1350 and 2700 kg, as tare 1500 kg"):
        check_mass(DRIVE, 1264.0, Vehicle(kind="car", tare=1500.0))
    check_mass(DRIVE, 1400.0, Vehicle(kind="car", tare=1500.0))


def test_a_trailer_is_stated_as_gross():
    with pytest.raises(ConfigError, match="gross_kg"):
        check_mass(DRIVE, 3000.0, Vehicle(kind="car", tare=1500.0))
    check_mass(DRIVE, 3000.0, Vehicle(kind="car", tare=1500.0, gross=3600.0))
    check_mass(DRIVE, 39_000.0, Vehicle(kind="truck", tare=7500.0))


@pytest.mark.parametrize(("slope", "told"), [(0.93, False), (1.12, True), (0.76, True)])
def test_the_torque_of_a_calibration_tells_of_its_mass(slope, told):
    vehicle = Vehicle(kind="van", torque=TorqueModel(source="measured", coefficients=(0.0, slope)))
    found = scale_finding(vehicle, [2100.0], "drive")
    assert (found is not None) is told
    assert found is None or found.id == "calibration.scale"


def test_a_torque_twice_too_strong_is_pounds():
    vehicle = Vehicle(kind="van", torque=TorqueModel(source="percent", coefficients=(0.0, 2.05)))
    with refused("calibration.scale_wrong") as found:
        scale_finding(vehicle, [4630.0], "drive")
    assert "2100 kg" in found.value.problem.values["hint"]
    load = replace(vehicle, torque=TorqueModel(source="load", coefficients=(0.0, 205.0)))
    assert scale_finding(load, [4630.0], "drive") is None


def test_a_mass_of_a_truck_leads_to_its_class():
    for kg in (10_203.0, 4000.0):
        with error(ConfigError, "drive car", f"{kg:.0f}", "--class truck --vehicle base.toml"):
            check_mass(DRIVE, kg, Vehicle(kind="car"))
    check_mass(DRIVE, 10_203.0, Vehicle(kind="truck"))


def test_a_mass_in_pounds_is_doubted_by_fuel_and_at_each_weighing():
    """An engine load has no scale of its own: the fuel burnt checks it."""
    made = make_scenario("compact-calibration", seed=63)
    known = simulate_car(replace(made, duration=1000.0, sensors=Sensors(imu_rate=50.0)))
    mass = float(known.truth.mass[0])
    bare = replace(known.drive, info=replace(known.drive.info, mass=None))
    assert wb.calibrate([bare], mass=mass).provenance.doubts == ()
    heavy = wb.calibrate([bare], mass=mass / POUND)
    said = {p.id for p in heavy.provenance.problems}
    assert "calibration.fuel" in said
    assert set(heavy.provenance.problems) <= set(wb.weigh(bare, heavy).problems)


@pytest.mark.parametrize(
    ("area", "source", "word"),
    [
        (1.4, "load", "heavy"),
        (0.02, "load", "light"),
        (0.9, "load", None),
        (1.4, "measured", None),
    ],
)
def test_a_drag_area_that_no_car_has_is_told(area, source, word):
    car = Vehicle(
        kind="car",
        road_load=RoadLoad(drag_area=area),
        torque=TorqueModel(source=source, coefficients=(0.0, 1.0)),
    )
    told = drag_finding(car, [2568.0])
    assert (told.values["word"] if told is not None else None) == word


@pytest.mark.parametrize("stated", [False, True])
def test_masses_a_fifth_too_heavy_are_refused_by_permitted_mass_and_torque(stated):
    scenario = make_scenario("electric", payload=400.0, seed=911)
    made = simulate_car(replace(scenario, duration=600.0, sensors=Sensors(imu_rate=50.0)))
    true = float(made.truth.mass[0])
    base = Vehicle(kind="car", tare=true - 400.0, gross=1.05 * true if stated else None)
    if not stated:
        doubted = wb.calibrate(made.drive, 1.2 * true, vehicle=base)
        assert any(p.id == "calibration.scale" for p in doubted.provenance.problems)
        return
    right = wb.calibrate(made.drive, true, vehicle=base)
    assert not any("gross" in p.values for p in right.provenance.problems)
    with refused("calibration.too_heavy"):
        wb.calibrate(made.drive, 1.2 * true, vehicle=base)
