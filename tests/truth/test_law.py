"""Every column of the longitudinal law, by hand and against what the simulator holds for true."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from weighbridge import Vehicle
from weighbridge.balance import ForceTable, law
from weighbridge.simulation import MIDSIZE, Effects, Sensors, make_scenario, simulate_car
from weighbridge.vehicle import Driveline, RoadLoad, TorqueModel

CAR = Vehicle(
    tare=1500.0,
    driveline=Driveline(
        gearings=(10.0, 5.0), wheel_radius=0.3, engine_inertia=0.2, wheel_inertia=4.5,
        efficiency=0.9,
    ),
    road_load=RoadLoad(
        drag_area=0.6, rolling_coefficient=0.01, rolling_speed_coefficient=1e-4
    ),
    torque=TorqueModel(source="load", coefficients=(-20.0, 400.0, 0.1)),
)  # fmt: skip


def rows(**changes):
    """Two rows: 20 m/s uphill in the first gear, 10 m/s on the flat in the second."""
    made = {
        "time": np.array([0.0, 500.0]),
        "traction_force": np.array([2000.0, 500.0]),
        "force_std": np.array([30.0, 15.0]),
        "torque": np.array([200.0, 100.0]),
        "engine_speed": np.array([200.0, 50.0]),
        "speed": np.array([20.0, 10.0]),
        "accel": np.array([0.5, -1.0]),
        "specific_force": np.array([1.2, -1.0]),
        "grade": np.array([0.3, 0.0]),
        "pitch": np.zeros(2),
        "heading": np.array([0.0, np.pi / 2.0]),
        "gear": np.array([1, 2]),
        "gearing": np.array([10.0, 5.0]),
        "air_speed": np.array([25.0, -4.0]),
        "air_density": np.array([1.2, 1.0]),
        "fuel_burnt": np.zeros(2),
        "reason": np.zeros(2, dtype=np.uint8),
    }
    return ForceTable(**{**made, **changes})


VIEW = rows()
MOVING = rows(ratio_rate=np.array([0.02, -0.1]))
NORTH, EAST = law.wind_column(VIEW, 0), law.wind_column(VIEW, 1)


@pytest.mark.parametrize(
    ("column", "by_hand"),
    [
        # 1.2 + 9.81 (0.010 + 0.002) cos 0.3; -1 + 9.81 (0.010 + 0.001).
        (law.mass_column(VIEW, CAR), [1.2 + 0.11772 * 0.9553365, -1.0 + 0.10791]),
        # 1000 kg x 9.81 x cos 0.3.
        (law.rolling_column(VIEW, 1000.0), [9371.851, 9810.0]),
        # 1.2 / 2 x 625 ahead, 1 / 2 x 16 from behind.
        (law.drag_column(VIEW), [375.0, -8.0]),
        (law.engine_inertia_column(VIEW.gearing, VIEW.accel), [100.0 * 0.5, -25.0]),
        # A ratio that moves by 2 % and -10 % per second.
        (MOVING.engine_accel, [0.5 + 0.4, -1.0 - 1.0]),
        (law.road_columns(MOVING, 1000.0, 0.3)[:, 2], [100.0 * 0.9, 25.0 * -2.0]),
        (law.ratio_force(MOVING, CAR), [0.2 * 100.0 * 0.4, 0.2 * 25.0 * -1.0]),
        (law.rotating_force(MOVING, CAR), [70.0 * 0.5 + 8.0, 55.0 * -1.0 - 5.0]),
        (law.wheel_inertia_column(VIEW.accel, 0.3), [0.5 / 0.09, -1.0 / 0.09]),
        # To the north at 20 m/s in air of 1.2 kg/m^3; to the east at 10 m/s.
        (NORTH, [24.0, 0.0]),
        (EAST, [0.0, 10.0]),
        (law.resistance_column(VIEW), [1.0, 1.0]),
        # Half of the variance is there at rest, and gusts as large at 15 m/s.
        (law.gust_column(VIEW), np.sqrt([0.5 + 200.0 / 225.0, 0.5 + 50.0 / 225.0])),
        # An open grade of 0.04 / 9.81 is as large as the disturbance.
        (law.gust_column(rows(speed=np.array([15.0, 0.0])), 0.04 / 9.81), [1.0, np.sqrt(0.75)]),
        # In a gear twice as short as the usual one errors of the torque are twice as large.
        (
            law.gust_column(rows(speed=np.array([0.0, 15.0])), usual_gearing=5.0),
            np.sqrt([0.5 + 4.0, 1.0 + 1.0]),
        ),
        # One time constant after the start.
        (law.cold_torque_column(VIEW), [10.0, 5.0 * 0.36787944]),
        (law.torque_offset_column(VIEW), [10.0, 5.0]),
        # The engine turns at its 200 rad/s, and at a quarter of them.
        (law.torque_growth_column(VIEW), [10.0, 5.0 * 0.25]),
        (law.squat_column(VIEW.accel), [4.905, -9.81]),
        # 4.5 / 0.09 + 0.2 x 100; + 0.2 x 25.
        (law.rotating_mass(CAR, VIEW.gearing), [70.0, 55.0]),
        (law.drag_force(VIEW, CAR), [225.0, -4.8]),
        (law.drag_factor(VIEW, CAR), [0.36, 0.3]),
        # 2000 - 225 - 70 x 0.5; 500 + 4.8 + 55.
        (law.force_on_mass(VIEW, CAR), [1740.0, 559.8]),
        # A dragged engine is dragged through the losses.
        (law.traction_gain(CAR, np.array([50.0, -50.0]), VIEW.gearing), [9.0, 5.0 / 0.9]),
    ],
)  # fmt: skip
def test_columns_by_hand(column, by_hand):
    assert_allclose(column, by_hand, rtol=1e-6, atol=1e-12)


def test_coefficients_of_the_torque_make_its_traction():
    """100 N m at 200 rad/s: -20 + 400 x 0.25 + 0.1 x 200; the load comes back from the torque."""
    table = rows(torque=np.array([100.0, 65.0]))
    columns = law.torque_columns(table, CAR)
    assert_allclose(columns[0], [9.0, 9.0 * 0.25, 9.0 * 200.0])
    assert_allclose(columns[1], [4.5, 4.5 * 0.2, 4.5 * 50.0])
    assert_allclose(columns @ CAR.torque.coefficients, [900.0, 0.9 * 5.0 * 65.0])


def test_the_force_a_motion_takes_is_that_of_the_largest_mass_known():
    needed, weight = law.needed_force(
        CAR, np.array([1.0, -1.0]), np.array([100.0, 0.0]), np.array([70.0, np.nan])
    )
    assert weight == pytest.approx(1500.0 * 9.81)
    assert_allclose(needed, [1570.0 + 147.15 + 60.0, -1500.0 + 147.15])


def test_wind_column_is_the_slope_of_the_drag_over_the_wind():
    """The drag is a parabola of the wind, so that central differences are exact."""
    rng = np.random.default_rng(7)
    heading, speed = rng.uniform(0.0, 2.0 * np.pi, 2), rng.uniform(10.0, 30.0, 2)
    table = rows(heading=heading, speed=speed, air_speed=speed)
    for k, part in enumerate((np.cos, np.sin)):
        ahead, behind = (
            law.drag_force(replace(table, air_speed=speed + wind * part(heading)), CAR)
            for wind in (2.0, -2.0)
        )
        assert_allclose(0.6 * law.wind_column(table, k), (ahead - behind) / 4.0, rtol=1e-12)


@pytest.fixture(scope="module")
def driven():
    """Return a simulated drive in calm air over hills, locked driveline and pedals alone."""
    scenario = replace(
        make_scenario("car-short", payload=220.0, seed=61),
        effects=Effects.only(traffic=1.0, driver_ripple=1.0),
        sensors=Sensors(imu_rate=0.0, gnss_rate=0.0),
        wind_speed=0.0,
        duration=300.0,
    )
    truth = simulate_car(scenario).truth
    free = (truth.phase == 0.0) & (truth.speed > 3.0) & (truth.brake_force == 0.0)
    free[:-1] &= free[1:]
    free[1:] &= free[:-1]
    return scenario, truth, free


def seen(scenario, truth, rows):
    """Table of the true drive."""
    gear = truth.gear[rows].astype(np.int64)
    gearing = np.array(scenario.car.gearings)[gear - 1]
    cold = 287.05 * scenario.ambient_temperature
    height = truth.altitude[rows] - scenario.route.altitude
    density = scenario.pressure / cold * np.exp(-9.81 * height / cold)
    none = np.zeros(gear.size)
    return ForceTable(
        time=truth.time[rows], traction_force=truth.engine_torque[rows] * gearing, force_std=none,
        torque=truth.engine_torque[rows], engine_speed=truth.engine_speed[rows],
        speed=truth.speed[rows], accel=truth.accel[rows],
        specific_force=truth.specific_force[rows], grade=truth.grade[rows], pitch=none,
        heading=truth.heading[rows], gear=gear, gearing=gearing,
        air_speed=truth.speed[rows] - truth.wind_along[rows], air_density=density,
        fuel_burnt=none, reason=np.zeros(gear.size, dtype=np.uint8),
    )  # fmt: skip


def off(force):
    """Size of a force that should be none [N]; the simulator holds forces over a step of 5 ms."""
    return float(np.sqrt(np.mean(force**2)))


def test_each_term_is_that_of_the_simulator(driven):
    scenario, truth, free = driven
    table, car = seen(scenario, truth, free), scenario.car
    mass = truth.mass[free]
    assert free.sum() > 1500
    drag, rolling = truth.drag_force[free], truth.rolling_force[free]
    assert_allclose(car.drag_area * law.drag_column(table), drag, rtol=1e-6)
    rolled = car.rolling_coefficient * law.rolling_column(table, mass)
    assert_allclose(rolled, rolling, rtol=1e-6)
    engine = car.engine_inertia * law.engine_inertia_column(table.gearing, table.accel)
    assert off(engine - (table.traction_force - truth.traction_force[free])) < 1.0
    wheels = car.wheel_inertia * law.wheel_inertia_column(table.accel, car.wheel_radius)
    left = truth.traction_force[free] - drag - rolling - mass * table.specific_force
    assert off(wheels - left) < 1.0
    assert np.std(engine) > 5.0
    assert np.std(wheels) > 5.0


def test_the_sum_of_the_columns_is_the_traction(driven):
    scenario, truth, free = driven
    table, made = seen(scenario, truth, free), scenario.car
    mass = truth.mass[free]
    assert mass.mean() == pytest.approx(MIDSIZE.mass + 220.0, abs=1.0)
    car = Vehicle(
        driveline=Driveline(
            gearings=made.gearings, wheel_radius=made.wheel_radius,
            engine_inertia=made.engine_inertia, wheel_inertia=made.wheel_inertia,
        ),
        road_load=RoadLoad(
            drag_area=made.drag_area, rolling_coefficient=made.rolling_coefficient
        ),
    )  # fmt: skip
    road = law.road_columns(table, mass, made.wheel_radius)
    parameters = np.array(
        [made.drag_area, made.rolling_coefficient, made.engine_inertia, made.wheel_inertia]
    )
    whole = mass * table.specific_force + road @ parameters
    assert off(whole - table.traction_force) < 1.5
    # The same as one slope: force on the mass over the column of the mass.
    phi = law.mass_column(table, car)
    assert off(law.force_on_mass(table, car) - mass * phi) < 1.5
    assert np.std(mass * phi) > 300.0
