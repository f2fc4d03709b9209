"""What speed and grade alone say: a bound that holds, and drag over mass whatever the wind."""

import math

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.errors import ConfigError, DriveError
from weighbridge.signals import Drive, Signal
from weighbridge.vehicle.model import Driveline, RoadLoad, Vehicle

G, DENSITY, AREA, ROLLING, RADIUS = 9.80665, 1.225, 0.66, 0.011, 0.3
CAR = Vehicle(
    driveline=Driveline(wheel_radius=RADIUS, wheel_inertia=2.0),
    road_load=RoadLoad(
        drag_area=AREA, drag_area_std=0.02, rolling_coefficient=ROLLING,
        rolling_coefficient_std=0.001,
    ),
)  # fmt: skip
TURNING = 2.0 / RADIUS**2


def made(speed, grade, rate=10.0, seed=0):
    rng = np.random.default_rng(seed)
    time = np.arange(speed.size) / rate
    return Drive(
        name="climb",
        signals={
            "vehicle_speed": Signal(
                "vehicle_speed", time, speed + rng.normal(scale=0.03, size=speed.size)
            ),
            "grade": Signal("grade", time[::10], grade[::10]),
            "altitude": Signal("altitude", time[::10], np.zeros(time[::10].size)),
        },
    )


def climb(mass, power, *, throttle=1.0, seed=0, seconds=240.0):
    """Climb and level in turn, at a part of the full power wherever it is not too fast."""
    dt = 0.1
    n = int(seconds / dt)
    speed, grade = np.empty(n), np.empty(n)
    v, way = 8.0, 0.0
    for k in range(n):
        grade[k] = 0.03 * (1.0 + math.sin(way / 250.0))
        asked = throttle * power / max(v, 3.0) if v < 28.0 else 0.0
        resisting = 0.5 * DENSITY * AREA * v * v
        resisting += mass * G * (math.sin(grade[k]) + ROLLING * math.cos(grade[k]))
        v = max(v + dt * (asked - resisting) / (mass + TURNING), 0.5)
        way += v * dt
        speed[k] = v
    return made(speed, grade, seed=seed)


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
    with pytest.raises(DriveError, match="no grade and no altitude"):
        wb.mass_bound(drive, CAR, 60e3)
    with pytest.raises(ConfigError, match="power must be a positive number of W"):
        wb.mass_bound(climb(1400.0, 60e3), CAR, 0.0)


def coasting(mass, wind, *, runs=3, seed=3):
    """Coast from 30 m/s to 10 m/s out of gear, there and back; between them the speed rises."""
    dt, parts, spans = 0.1, [], ([], [])
    rng = np.random.default_rng(seed)
    now = 0.0
    for run in range(2 * runs):
        way = 1.0 if run % 2 == 0 else -1.0
        v, course = 30.0, []
        while v > 10.0:
            air = v + way * wind
            force = 0.5 * DENSITY * AREA * air * abs(air) + mass * G * ROLLING
            v -= dt * force / (mass + TURNING)
            course.append(v)
        up = np.linspace(course[-1], 30.0, 150)
        spans[run % 2].append((now + 2.0, now + dt * len(course) - 2.0))
        parts += [np.array(course), up]
        now += dt * (len(course) + up.size)
    speed = np.concatenate(parts)
    time = dt * np.arange(speed.size)
    read = speed + rng.normal(scale=0.03, size=speed.size)
    signals = (
        Signal("vehicle_speed", time, read),
        Signal("grade", time[::10], rng.normal(scale=0.001, size=time[::10].size)),
        Signal("altitude", time[::10], np.zeros(time[::10].size)),
    )
    return Drive(name="coast", signals={s.name: s for s in signals}), *spans


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
    with pytest.raises(ConfigError, match="3 coast-downs there and 0 back"):
        wb.coast_down(drive, there, [])
    with pytest.raises(ConfigError, match="a coast-down needs 12 s"):
        wb.coast_down(drive, there, [(0.0, 5.0), (1.0, 6.0)])
