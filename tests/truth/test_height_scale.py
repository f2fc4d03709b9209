"""What hills take, against a road and heights that are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from weighbridge import Vehicle
from weighbridge.balance import ForceBalance, ForceTable, height_scale
from weighbridge.constants import GRAVITY
from weighbridge.vehicle import Driveline, RoadLoad

MASS = 12_000.0
TRUCK = Vehicle(
    name="truck", kind="truck", driveline=Driveline(engine_inertia=0.0, wheel_inertia=0.0),
    road_load=RoadLoad(drag_area=0.0, rolling_coefficient=0.0),
)  # fmt: skip


def balance(grade, seen, rng, n=6000):
    """Half an hour on a road of ``grade``, of which the heights show ``seen`` (k,) [rad]."""
    zero, one, last = np.zeros(n), np.ones(n), n // grade.size
    accel = np.repeat(rng.normal(0.0, 0.3, grade.size), last)
    force = MASS * (accel + GRAVITY * np.sin(np.repeat(grade, last)))
    force += rng.normal(0.0, 300.0, n)
    sloped = np.repeat(seen, last)
    table = ForceTable(
        time=0.3 * np.arange(n), traction_force=force, force_std=zero, torque=force,
        engine_speed=10.0 * one, speed=15.0 * one, accel=accel,
        specific_force=accel + GRAVITY * np.sin(sloped), grade=sloped,
        pitch=zero, heading=zero, gear=np.ones(n, dtype=np.int64), gearing=one,
        air_speed=zero, air_density=1.2 * one, fuel_burnt=zero, reason=np.zeros(n, dtype=np.uint8),
    )  # fmt: skip
    return ForceBalance(motion=SimpleNamespace(source="speed_grade"), table=table)


@pytest.mark.parametrize("factor", [1.0 / 0.3048, -1.0])
def test_heights_of_another_scale_are_named(factor):
    rng = np.random.default_rng(1)
    grade = rng.normal(0.0, 0.02, 600)
    found = height_scale(balance(grade, factor * grade, rng), TRUCK, "altitude")
    assert found.values["ratio"] == pytest.approx(factor, rel=0.1)
    assert height_scale(balance(grade, grade, rng), TRUCK, "altitude") is None


def test_noise_of_heights_on_a_flat_road_is_no_other_scale():
    named = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        seen = rng.normal(0.0, 0.004, 600)
        flat = balance(np.zeros(600), seen, rng)
        named += height_scale(flat, TRUCK, "altitude") is not None
    # Three standard deviations of twenty blocks are exceeded now and then.
    assert named <= 1
