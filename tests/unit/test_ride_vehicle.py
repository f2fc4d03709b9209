"""The [ride] section of a vehicle file."""

from pathlib import Path

import pytest
from tests.noted import error

from weighbridge import ConfigError, Vehicle
from weighbridge.vehicle import Ride

EXAMPLE = Path(__file__).parents[2] / "examples" / "ride-truck" / "vehicle.toml"


def test_saved_ride_is_loaded_to_the_last_bit(tmp_path):
    truck = Vehicle.load(EXAMPLE)
    truck.save(tmp_path / "truck.toml")

    assert truck.ride is not None
    assert truck.ride.front_stiffness == 177000.0
    assert Vehicle.load(tmp_path / "truck.toml") == truck


def test_units_of_people_are_taken(tmp_path):
    path = tmp_path / "truck.toml"
    text = EXAMPLE.read_text().replace(
        "front_stiffness_npm = 177000.0", "front_stiffness_npmm = 177"
    )
    path.write_text(text.replace("travel_noise_m = 0.0002", "travel_noise_mm = 0.2"))
    assert Vehicle.load(path) == Vehicle.load(EXAMPLE)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("rear_damping_nspm = 9804.0", "", "rear_damping"),
        ("rear_damping_nspm = 9804.0", "rear_damping_nspm = -9804.0", "rear_damping -9804"),
        ("front_track_m = 1.705", "front_track_m = 1705.0", "front_track 1705"),
        ("front_track_m = 1.705", "front_track = 1.705", "front_track front_track_m"),
        ("force_std = 0.02", "force_std = 2.0", "force_std 2.0"),
        ("rate_noise_mps", "rate_nose_mps", "rate_nose_mps rate_noise_mps"),
    ],
)
def test_faults_are_told_with_their_key(tmp_path, old, new, told):
    path = tmp_path / "truck.toml"
    path.write_text(EXAMPLE.read_text().replace(old, new))
    with error(ConfigError, told):
        Vehicle.load(path)


def test_noise_must_be_possible():
    good = Vehicle.load(EXAMPLE).ride
    assert good is not None
    with error(ConfigError, "roll_rate_noise 0.0"):
        Ride(**{name: getattr(good, name) for name in Ride.__slots__ if name != "roll_rate_noise"},
             roll_rate_noise=0.0)  # fmt: skip
