"""A file of a measuring system with a control unit's short names: from `map` to a way to weigh."""

from dataclasses import replace

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.simulation import make_scenario, simulate_car

NAMES = {
    "accel_x": ("IMU_AccelX", 1.0, "m/s^2"),
    "accel_y": ("IMU_AccelY", 1.0, "m/s^2"),
    "accel_z": ("IMU_AccelZ", 1.0, "m/s^2"),
    "gyro_x": ("IMU_RateX", 180.0 / np.pi, "deg/s"),
    "gyro_y": ("IMU_RateY", 180.0 / np.pi, "deg/s"),
    "gyro_z": ("IMU_RateZ", 180.0 / np.pi, "deg/s"),
    "latitude": ("GNSS_Latitude", 180.0 / np.pi, "deg"),
    "longitude": ("GNSS_Longitude", 180.0 / np.pi, "deg"),
    "altitude": ("GNSS_Altitude", 1.0, "m"),
    "vehicle_speed": ("VehSpd", 3.6, "km/h"),
    "engine_speed": ("MotSpd", 30.0 / np.pi, "1/min"),
    "engine_torque": ("MotTrq", 1.0, "Nm"),
}


@pytest.fixture(scope="module")
def drive():
    return simulate_car(replace(make_scenario("electric", seed=41), duration=120.0)).drive


@pytest.fixture
def recording(drive, tmp_path):
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "drive.mf4"
    with asammdf.MDF(version="4.10") as file:
        for quantity, (name, factor, unit) in NAMES.items():
            s = drive.signals[quantity]
            file.append(asammdf.Signal(factor * s.values, s.time, name=name, unit=unit))
        speed = drive.signals["vehicle_speed"]
        for name in ("WhlSpdFL", "WhlSpdRR", "VehSpdTrgt"):
            file.append(asammdf.Signal(3.6 * speed.values, speed.time, name=name, unit="km/h"))
        file.save(path)
    return path


def test_short_names_are_mapped_and_the_drive_can_be_weighed(weighbridge, recording, drive):
    mapping = recording.with_name("map.toml")
    assert weighbridge("map", recording, "-o", mapping).code == 0
    read = wb.read_drive(recording, mapping)
    assert set(read.signals) == set(NAMES)
    for quantity in NAMES:
        np.testing.assert_allclose(
            read.signals[quantity].values, drive.signals[quantity].values, atol=1e-9
        )
    ran = weighbridge("inspect", recording, "--mapping", mapping)
    assert "IMU with speed and torque in N m" in ran.out
    assert ran.out.strip().splitlines()[-1].startswith("next: weighbridge calibrate")
