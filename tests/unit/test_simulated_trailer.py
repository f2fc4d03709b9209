"""A simulated trailer: what it adds to mass, drag, rolling, slip and pitch."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.noted import error

from weighbridge import ConfigError
from weighbridge.constants import GRAVITY
from weighbridge.simulation import TRUCK18, Effects, Sensors, Trailer, make_scenario, simulate_car
from weighbridge.simulation.fleet import FleetSettings, plan_fleet

BOX = Trailer(kind="box", mass=7000.0, drag_area=1.5, hitch_load=0.04)


def truck(payload=0.0, **changes):
    made = replace(
        make_scenario("truck", payload=payload, seed=3),
        duration=150.0,
        wind_speed=0.0,
        sensors=Sensors(imu_rate=0.0, gnss_rate=0.0),
        effects=Effects.only(tyre_slip=1.0, squat=1.0, load_pitch=1.0),
    )
    return simulate_car(replace(made, **changes))


@pytest.fixture(scope="module")
def pair():
    """Truth of 7 t behind the truck and of 7 t on it."""
    return truck(trailer=BOX).truth, truck(payload=7000.0).truth


def test_it_is_drawn_with_all_of_its_mass(pair):
    behind, aboard = pair
    assert_allclose((behind.mass[0], aboard.mass[0]), TRUCK18.mass + 7000.0)


def test_it_adds_its_drag_area(pair):
    density = 101_325.0 / (287.05 * 283.15)
    for truth, area in zip(pair, (TRUCK18.drag_area + 1.5, TRUCK18.drag_area), strict=True):
        fast = truth.speed > 8.0
        found = truth.drag_force[fast] / (0.5 * density * truth.speed[fast] ** 2)
        assert_allclose(found, area, rtol=0.01)


def test_its_tyres_carry_what_the_coupling_does_not(pair):
    for truth, force in zip(pair, (
        0.0065 * (9000.0 + 280.0) + 0.0055 * 6720.0, 0.0065 * 16000.0,
    ), strict=True):  # fmt: skip
        driven = truth.speed > 3.0
        assert_allclose(truth.rolling_force[driven], GRAVITY * force, rtol=0.01)


def test_the_driven_wheels_slip_more_than_under_a_load(pair):
    slips = []
    for truth in pair:
        held = (truth.phase == 0) & (truth.speed > 3.0) & (truth.gear > 0)
        gearing = np.array(TRUCK18.gearings)[truth.gear[held].astype(int) - 1]
        over = truth.engine_speed[held] / gearing / truth.speed[held] - 1.0
        against = (truth.drag_force + truth.rolling_force) / truth.mass
        pull = (truth.specific_force + against)[held] / GRAVITY
        # The engine is a step of the simulation late.
        late = truth.accel[held] / truth.speed[held]
        columns = np.column_stack([np.ones_like(pull), pull, late])
        slips.append(np.linalg.lstsq(columns, over, rcond=None)[0][1])
    assert_allclose(slips, (0.030 * 16000.0 / 9280.0, 0.030), rtol=0.08)


def test_it_pitches_the_vehicle_less_than_a_load_on_the_bed(pair):
    at_rest = [float(truth.pitch[0]) for truth in pair]
    bare = float(truck(duration=20.0).truth.pitch[0])
    assert at_rest[0] - bare == pytest.approx(1.0e-6 * 3.0 * 280.0, rel=0.01)
    assert at_rest[1] - bare == pytest.approx(1.0e-6 * 7000.0, rel=0.01)


@pytest.mark.parametrize("wrong", [{"mass": 0.0}, {"drag_area": -1.0}, {"hitch_load": np.nan}])
def test_what_no_trailer_can_have_is_refused(wrong):
    with error(ConfigError, next(iter(wrong))):
        replace(BOX, **wrong)


def test_trailers_of_a_fleet_are_of_both_kinds_and_lie_in_their_ranges():
    _, days = plan_fleet(FleetSettings(vehicles=60, days=5, seed=430190))
    drawn = [(day.vehicle, t) for day in days for t in day.trailers if t is not None]
    kinds = [t.kind for _, t in drawn]
    assert 0.6 < kinds.count("box") / len(kinds) < 0.9
    for vehicle, trailer in drawn:
        low, high = {"box": (1.2, 1.8), "flat": (0.3, 0.8)}[trailer.kind]
        assert low <= trailer.drag_area <= high
        assert 0.59 < trailer.mass / vehicle.car.mass < 1.01
