"""What speed and grade alone say: a bound that holds, and drag over mass whatever the wind."""

import math

import numpy as np
import pytest
from tests.graded import AREA, CAR, RADIUS, ROLLING, climb, coasting, made
from tests.noted import error

import weighbridge as wb
from weighbridge import ConfigError, DriveError, Vehicle
from weighbridge.vehicle import Driveline


@pytest.mark.parametrize("mass", [1200.0, 1700.0])
def test_a_climb_at_full_power_bounds_the_mass_closely(mass):
    found = wb.mass_bound(climb(mass, 60e3), CAR, 60e3, power_std=0.03)
    assert mass < found.mass < 1.3 * mass
    assert found.nearest == pytest.approx(mass, rel=0.08)
    assert found.status == "not_excited"
    assert "at most" in found.reason


def test_a_bound_at_part_load_holds_and_is_wide():
    found = wb.mass_bound(climb(1400.0, 60e3, throttle=0.5), CAR, 60e3)
    assert found.mass > 1.6 * 1400.0


def test_the_bound_holds_in_19_drives_of_20():
    held = [
        wb.mass_bound(climb(1400.0, 60e3, seed=s, seconds=120.0), CAR, 60e3).mass > 1400.0
        for s in range(20)
    ]
    assert sum(held) >= 19


def test_a_cruise_downhill_bounds_nothing():
    speed = np.full(1200, 15.0)
    found = wb.mass_bound(made(speed, np.full(1200, -0.03)), CAR, 60e3)
    assert math.isnan(found.mass)
    assert found.windows == 0
    assert found.status == "not_excited"


def test_without_a_grade_nothing_is_bounded():
    drive = climb(1400.0, 60e3).without("grade", "altitude")
    with error(DriveError, "climb grade_pct altitude_m"):
        wb.mass_bound(drive, CAR, 60e3)
    with error(ConfigError, "0.0"):
        wb.mass_bound(climb(1400.0, 60e3), CAR, 0.0)


@pytest.mark.parametrize("wind", [0.0, 3.0])
def test_coasting_both_ways_tells_drag_over_mass_whatever_the_wind(wind):
    mass = 1400.0
    car = Vehicle(tare=mass, driveline=Driveline(wheel_radius=RADIUS, wheel_inertia=2.0))
    drive, there, back = coasting(mass, wind)
    found = wb.coast_down(drive, there, back, vehicle=car)
    assert found.drag_over_mass == pytest.approx(AREA / mass, rel=0.06)
    assert found.rolling == pytest.approx(ROLLING, abs=0.0025)
    low, high = found.interval()
    assert low < AREA / mass < high
    assert found.status == "not_excited"


def test_coasting_one_way_only_is_refused():
    drive, there, _ = coasting(1400.0, 3.0)
    with error(ConfigError, "coast 3 0"):
        wb.coast_down(drive, there, [])
    with error(ConfigError, "coast 0 5 12"):
        wb.coast_down(drive, there, [(0.0, 5.0), (1.0, 6.0)])
