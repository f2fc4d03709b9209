"""Trips of a recorded BMW i3: what battery power says of its torque and of its interval."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.vehicle import find_power_balance

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "bmw-i3"


@pytest.fixture(scope="module")
def car():
    return wb.Vehicle.load(EXAMPLE / "vehicle.toml")


@pytest.fixture(scope="module")
def trip(shared_data):
    def read(name):
        path = shared_data / "bmw-i3" / f"{name}.csv"
        if not path.exists():
            pytest.skip(f"{path} is absent: the recorded trips are not part of the project")
        return wb.read_drive(path, EXAMPLE / "mapping.toml")

    return read


def test_the_battery_says_that_the_torque_is_right(trip, car):
    found = [find_power_balance(trip(n), car) for n in ("TripA02", "TripA11", "TripB03", "TripB33")]
    assert all(f.possible and f.charging_positive for f in found)
    assert [f.scale for f in found] == pytest.approx([1.0] * 4, abs=0.02)
    assert max(f.noise_std for f in found) < 0.005


def test_battery_power_narrows_the_interval(trip, car):
    drive = trip("TripB03")
    told = wb.weigh(drive, car)
    signals = {n: s for n, s in drive.signals.items() if not n.startswith("battery")}
    blind = wb.weigh(replace(drive, signals=signals), car)
    assert any(n.id == "battery.divided" for n in told.problems)
    low, high = told.interval(0.95)
    assert (high - low) / 2.0 < 0.08 * told.mass
    assert told.std < 0.85 * blind.std
    # The torque moves within what a data sheet leaves open.
    assert abs(np.log(told.mass / blind.mass)) < 0.03


def test_a_short_trip_is_heavier_by_what_is_noted(trip, car):
    """160 kg are noted; of the longer trips of December the first nine minutes, as long as it."""
    loaded = wb.weigh(trip("TripB33"), car).mass
    bare = []
    for name in ("TripB03", "TripB05", "TripB06"):
        drive = trip(name)
        kept = {
            n: replace(s, time=s.time[: (few := np.searchsorted(s.time, s.time[0] + 550.0))],
                       values=s.values[:few])
            for n, s in drive.signals.items()
        }  # fmt: skip
        bare.append(wb.weigh(replace(drive, signals=kept), car).mass)
    assert 0.8 < (loaded - np.mean(bare)) / 160.0 < 1.3
