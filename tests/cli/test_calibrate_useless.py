"""A calibration that cannot weigh what it was made from says so aloud, then and ever after."""

from dataclasses import replace

import pytest
from tests.noted import says

from weighbridge import Vehicle, read_drive
from weighbridge.cli.calibrate import own_masses
from weighbridge.io import write_drive
from weighbridge.simulation import make_scenario, simulate_car

AXES = ("accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z")


@pytest.fixture(scope="module")
def cruise(tmp_path_factory):
    """Return 240 s without inertial sensor: enough for a fit, too little for a mass."""
    made = simulate_car(replace(make_scenario("car", payload=0.0, seed=4711), duration=3045.0))
    folder = tmp_path_factory.mktemp("cruise") / "cruise"
    part = made.drive.between(made.drive.start + 2760.0, made.drive.start + 3000.0)
    write_drive(part.without(*AXES), folder)
    return folder


def test_a_file_that_weighs_none_of_its_drives_tells_it_of_each_it_weighs(
    weighbridge, cruise, loaded, tmp_path
):
    output = tmp_path / "car.toml"
    ran = weighbridge("calibrate", cruise, "--mass", "1580", "-o", output)
    assert ran.code == 1
    assert ran.err.count("car.toml: ") == 1
    assert says(ran.err, "calibration.own_unweighed", drive="cruise")
    assert ran.err.count("\n") == 1
    assert "cruise: no mass (not_excited)" in ran.out
    (doubt,) = [
        d for d in Vehicle.load(output).provenance.doubts if "calibration.own_unweighed" in d
    ]
    assert doubt.partition(": ")[2] in ran.err
    ran = weighbridge("weigh", loaded.folder, "--vehicle", output)
    assert says(ran.out, "calibration.own_unweighed", drive="cruise")


def test_quiet_does_not_hide_it(weighbridge, cruise, tmp_path):
    ran = weighbridge("calibrate", cruise, "--mass", "1580", "-o", tmp_path / "a.toml", "--quiet")
    assert ran.code == 1
    assert says(ran.err, "calibration.own_unweighed")


def test_one_drive_of_several_without_a_mass_is_told_and_no_failure(car, known):
    drive = read_drive(known.folder)
    vehicle = Vehicle.load(car)
    made = replace(vehicle.provenance, masses=(*vehicle.provenance.masses, 1580.0))
    brief = drive.between(drive.start, drive.start + 60.0)
    own = own_masses(replace(vehicle, provenance=made), [drive, brief])
    assert not own.useless
    assert own.doubt.id == "calibration.some_unweighed"
    assert (own.doubt.values["count"], own.doubt.values["drives"]) == (1, 2)


def test_a_known_mass_outside_what_the_file_weighs_is_told(car, known):
    drive, vehicle = read_drive(known.folder), Vehicle.load(car)
    assert own_masses(vehicle, [drive]).doubt is None
    heavier = replace(vehicle.provenance, masses=(1.2 * vehicle.provenance.masses[0],))
    doubt = own_masses(replace(vehicle, provenance=heavier), [drive]).doubt
    assert doubt.id == "calibration.outside"
    assert (doubt.values["count"], doubt.values["drives"]) == (1, 1)
    assert "in place of 1896 kg" in doubt.values["words"]


def test_loads_that_change_in_a_drive_of_one_known_mass_are_told(car):
    made = make_scenario("car-loading", payload=0.0, seed=3)
    drive = simulate_car(replace(made, duration=1500.0)).drive
    vehicle = Vehicle.load(car)
    one = replace(vehicle.provenance, masses=(1580.0,))
    doubt = own_masses(replace(vehicle, provenance=one), [drive]).doubt
    assert "its load seems to change" in doubt.values["words"]
