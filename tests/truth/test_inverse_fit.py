"""The fit of the reading on the motion, against a map that is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from weighbridge.balance.force_balance import MergedView
from weighbridge.calibration.inverse import DriveRows, FitSettings, TorquePrior, fit
from weighbridge.vehicle.class_values import road_prior

MASS, DRAG_AREA, ROLLING, ENGINE_INERTIA, WHEEL_INERTIA, RADIUS = 1400.0, 0.62, 0.01, 0.15, 5.0, 0.3
OFFSET, SCALE, LEAN = -20.0, 150.0, 0.12


def made(rng, motion_noise, n=4800):
    """One drive at 2 Hz whose reading is the share of a full-load torque that grows with speed."""
    time = 0.5 * np.arange(n)
    stretch = (time // 12.0).astype(int)
    found = np.maximum(rng.normal(0.3, 0.25, stretch[-1] + 1), 0.0)[stretch]
    # What was found is a conditional mean: its error is in the truth and not in it.
    accel = found + rng.normal(0.0, motion_noise, n)
    speed = 8.0 + 12.0 * rng.random(stretch[-1] + 1)[stretch]
    gearing = rng.choice([14.0, 10.0, 7.5], stretch[-1] + 1)[stretch]
    engine = gearing * speed
    zero, one = np.zeros(n), np.ones(n)
    rotating = WHEEL_INERTIA / RADIUS**2 + ENGINE_INERTIA * gearing**2
    force = (MASS + rotating) * accel + MASS * 9.80665 * ROLLING + 0.6 * DRAG_AREA * speed**2
    load = (force / gearing - OFFSET) / (SCALE + LEAN * engine) + rng.normal(0.0, 0.03, n)
    view = MergedView(
        time=time, traction_force=force, speed=speed, accel=found, specific_force=found, grade=zero,
        pitch=zero, heading=zero, gear=np.ones(n, dtype=np.int64), gearing=gearing,
        rotating_mass=rotating, air_speed=speed, drag_force=0.6 * DRAG_AREA * speed**2,
        air_density=1.2 * one, fuel_burnt=zero, reason=np.zeros(n, dtype=np.uint8),
    )  # fmt: skip
    motion = SimpleNamespace(
        source="speed", specific_force_std=motion_noise, grade_open=0.008,
        mean_accel_std=lambda length: motion_noise / np.sqrt(2.0 * length),
    )  # fmt: skip
    return DriveRows(
        view=view, regressor=load, engine_speed=engine,
        usable=np.append(np.diff(stretch) == 0, True), mass=MASS, motion=motion,
    )  # fmt: skip


@pytest.mark.parametrize("motion_noise", [0.02, 0.2])
def test_the_map_is_found_where_the_motion_is_noisy(motion_noise):
    drive = made(np.random.default_rng(1), motion_noise)
    settings = FitSettings(
        source="load", order=2, curved=True, knots=(), torque_noise=5.0,
        bounds=TorquePrior(offset=0.5, growth=0.5, lean=1.0, bend=0.5, knot=0.0),
        wheel_radius=RADIUS, prior=road_prior("car", single_speed=False),
    )  # fmt: skip
    found = fit([drive], settings)
    _, scale, _, _, lean, bend = found.coefficients
    load, engine = 0.6, 120.0
    slope = scale + lean * engine + 2.0 * bend * load
    # A reading that stands on both sides explains itself and leaves nothing to the motion.
    assert slope == pytest.approx(SCALE + LEAN * engine, rel=0.05)
    assert found.road[0] == pytest.approx(DRAG_AREA, abs=0.2)
