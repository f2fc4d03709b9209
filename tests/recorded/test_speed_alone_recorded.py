"""The speed column of recorded trips: the answer is what the calibration was told."""

from pathlib import Path

import pytest

import weighbridge as wb

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "bmw-i3"


@pytest.fixture(scope="module")
def trips(shared_data):
    return [
        wb.read_drive(shared_data / "bmw-i3" / f"{name}.csv", EXAMPLE / "mapping.toml")
        for name in ("TripA01", "TripA04")
    ]


def test_two_masses_told_are_two_masses_found(trips):
    known, other = trips
    graded = known.without("engine_torque", "longitudinal_accel")
    alone = other.without(*(name for name in other.signals if name != "vehicle_speed"))
    base = wb.Vehicle.load(EXAMPLE / "vehicle.toml")
    settings = wb.CalibrationSettings(method="speed-ekf")
    found = []
    for told in (1270.0, 1580.0):
        car = wb.calibrate(graded, mass=told, vehicle=base, settings=settings)
        assert car.torque == base.torque
        weighed = wb.weigh(alone, car, method="speed-ekf")
        assert weighed.status == "not_excited"
        found.append(weighed.result.mass / told)
    assert found == pytest.approx([1.0, 1.0], abs=0.02)
