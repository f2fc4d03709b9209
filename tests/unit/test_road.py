"""What is stated counts, also where it is the usual number; what is not is that of the class."""

from dataclasses import replace

import numpy as np
import pytest

from weighbridge import Drive, Signal, Vehicle
from weighbridge.checks import check_drive
from weighbridge.vehicle import Driveline, Provenance, RoadLoad, TorqueModel

VAN = Vehicle(kind="van")


def counted(known):
    """Return a value, its standard deviation, and where it is from."""
    return known.value, known.std, known.origin.name


def test_what_is_not_stated_is_that_of_the_class():
    road = VAN.road
    assert counted(road.drag_area) == (1.30, 0.50, "CLASS")
    assert counted(road.rolling_coefficient) == (0.010, 0.004, "CLASS")
    assert counted(road.engine_inertia) == (0.30, 0.12, "CLASS")
    assert counted(road.wheel_inertia) == (8.0, 1.5, "CLASS")
    # A motor of a van is to its engine as a car's is: 0.045 / 0.15.
    motor = replace(VAN, driveline=Driveline(gearings=(25.0,))).road.engine_inertia
    assert (motor.value, motor.std) == pytest.approx((0.09, 0.04))


@pytest.mark.parametrize("stated", [0.15, 0.30, 0.7])
def test_a_number_that_is_usual_elsewhere_counts_as_stated(stated):
    van = replace(VAN, driveline=Driveline(engine_inertia=stated))
    assert counted(van.road.engine_inertia) == (stated, 0.12, "GIVEN")
    sure = replace(VAN, driveline=Driveline(engine_inertia=stated, engine_inertia_std=0.01))
    assert counted(sure.road.engine_inertia) == (stated, 0.01, "GIVEN")


def test_what_a_calibration_held_has_no_error_of_its_own():
    van = Vehicle(
        kind="van",
        road_load=RoadLoad(drag_area=1.1, rolling_coefficient=0.009, drag_area_std=0.05),
        provenance=Provenance(mass_scale_std=0.01),
    )
    assert counted(van.road.drag_area) == (1.1, 0.05, "FITTED")
    assert counted(van.road.rolling_coefficient) == (0.009, 0.0, "FITTED")
    assert counted(van.road.wheel_inertia)[2] == "CLASS"


def test_a_file_says_what_is_stated_and_no_more(tmp_path):
    path = tmp_path / "van.toml"
    stated = replace(VAN, driveline=Driveline(engine_inertia=0.15))
    stated.save(path)
    text = path.read_text()
    assert "engine_inertia_kgm2 = 0.15" in text
    assert "wheel_inertia" not in text
    assert "drag_area" not in text
    assert Vehicle.load(path) == stated


def test_a_torque_source_that_is_stated_counts_though_it_is_the_usual_one(tmp_path):
    assert not TorqueModel().stated
    assert not TorqueModel(reference_torque=300.0).stated
    stated = replace(VAN, torque=TorqueModel(source="measured"))
    assert stated.torque.stated
    assert stated.torque.of_source == VAN.torque.of_source
    path = tmp_path / "van.toml"
    stated.save(path)
    assert Vehicle.load(path).torque.stated
    VAN.save(path)
    assert not Vehicle.load(path).torque.stated


def test_a_measured_torque_that_is_stated_is_the_one_needed():
    """Without a word in the file the better source of the drive would be taken, with one not."""
    clock = np.arange(0.0, 60.0)
    names = ("engine_torque_fraction", "reference_torque", "engine_speed", "vehicle_speed")
    drive = Drive("d", {name: Signal(name, clock, np.full(60, 40.0)) for name in names})

    def serious(vehicle):
        return {p.signal for p in check_drive(drive, vehicle) if p.serious}

    assert "engine_torque_fraction" in serious(VAN)
    stated = replace(VAN, torque=TorqueModel(source="measured"))
    assert "engine_torque_fraction" not in serious(stated)
