"""What a data sheet leaves open: usual values of drivelines, and what the joint estimator finds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.noted import error

from weighbridge import ConfigError, Drive, Signal, Vehicle
from weighbridge.balance import ForceTable, Reason
from weighbridge.estimators.joint.problem import states_of
from weighbridge.estimators.joint.settings import JointSettings
from weighbridge.estimators.joint.slow_errors import inertia_relative_std
from weighbridge.estimators.joint.terms import Sizes, design
from weighbridge.estimators.judging import SQUAT_STD, uncalibrated_std
from weighbridge.vehicle import (
    Driveline,
    Provenance,
    TorqueModel,
    by_data_sheet,
    engine_torque,
    friction_coefficients,
    scale_std,
    wheel_efficiency,
)

GEARS = (12.0, 7.0, 4.5, 3.2)
CALIBRATED = ("mass", "disturbance", "resistance", "wind_north", "wind_east", "cold_torque",
              "drag_area")  # fmt: skip


def names_of(vehicle):
    return states_of(vehicle, Sizes(1500.0, 200.0), JointSettings()).names


def sheet(**changes):
    line = {"gearings": GEARS, **changes.pop("line", {})}
    return Vehicle(driveline=Driveline(**line), torque=TorqueModel(source="percent"), **changes)


def test_a_file_that_does_not_state_the_efficiency_gets_that_of_its_kind(tmp_path):
    across = sheet(line={"layout": "transverse"})
    lengthwise = sheet(line={"layout": "longitudinal"})
    electric = Vehicle(driveline=Driveline(gearings=(30.0,)))
    assert wheel_efficiency(electric) > wheel_efficiency(across) > wheel_efficiency(lengthwise)
    assert wheel_efficiency(lengthwise) < wheel_efficiency(sheet()) < wheel_efficiency(across)
    assert wheel_efficiency(sheet(line={"efficiency": 0.88})) == 0.88
    # A truck's layout is always the same.
    truck = sheet(kind="truck", line={"layout": "longitudinal"})
    assert wheel_efficiency(truck) == wheel_efficiency(sheet(kind="truck"))

    file = tmp_path / "car.toml"
    file.write_text('[driveline]\ngearings_per_m = [12.0, 7.0]\nlayout = "transverse"\n')
    loaded = Vehicle.load(file)
    assert loaded.driveline.efficiency is None
    assert wheel_efficiency(loaded) == wheel_efficiency(across)
    loaded.save(tmp_path / "again.toml")
    assert Vehicle.load(tmp_path / "again.toml") == loaded
    with pytest.raises(ConfigError, match="transverse or longitudinal"):
        Driveline(layout="sideways")


@pytest.mark.parametrize(
    "vehicle",
    [
        sheet(provenance=Provenance(masses=(1500.0,), mass_scale_std=0.01)),
        sheet(provenance=Provenance(method="joint")),
        Vehicle(torque=TorqueModel(source="load", coefficients=(-20.0, 300.0))),
    ],
)
def test_what_was_fitted_at_the_wheels_is_left_alone(vehicle):
    assert not by_data_sheet(vehicle)
    assert wheel_efficiency(vehicle) == 1.0
    assert names_of(vehicle) == CALIBRATED


def test_the_interval_holds_torque_efficiency_radius_and_lean():
    electric = Vehicle(driveline=Driveline(gearings=(30.0,)))
    assert_allclose(scale_std(electric), np.sqrt(0.03**2 + 0.01**2 + 0.015**2))
    leaning = np.hypot(scale_std(electric), SQUAT_STD)
    for source, squat, expected in (
        ("speed", None, scale_std(electric)),
        ("inertial", None, leaning),
        ("longitudinal_accel", None, leaning),
        ("inertial", 0.003, scale_std(electric)),
    ):
        motion = SimpleNamespace(source=source, squat=squat)
        assert_allclose(uncalibrated_std(electric, motion), expected)
    assert scale_std(sheet()) > scale_std(electric)


def test_friction_is_the_reading_at_idle_and_grows_as_printed():
    idle = 80.0
    for fuel, growth in (("petrol", 1.47 / 1.113), ("diesel", 1.854 / 1.138)):
        c = friction_coefficients(40.0, idle, fuel)

        # Accessories take a power: 12.5 N m of the 40 at idle, 5 at 200 rad/s.
        def friction(speed, c=c):
            return c[0] + c[1] * speed + c[2] * speed**2 - 1000.0 / 200.0

        assert_allclose(friction(idle), 40.0 - 1000.0 / idle)
        fast = 2000.0 * np.pi / 30.0
        assert_allclose(friction(fast) / friction(idle), growth, rtol=0.01)
    # No more than half of a small reading is taken for accessories.
    c = friction_coefficients(10.0, idle, "petrol")
    assert_allclose(c[0] + c[1] * idle + c[2] * idle**2, 5.0 + 5.0 * idle / 200.0)


def test_friction_in_percent_torque_may_grow_with_engine_speed():
    time, speed = np.arange(3.0), np.array([100.0, 200.0, 300.0])
    drive = Drive(
        "d", {"engine_torque_fraction": Signal("engine_torque_fraction", time, np.full(3, 0.5))}
    )
    model = TorqueModel(
        source="percent", reference_torque=200.0, coefficients=(-10.0, 1.0, -0.02, -1e-4)
    )
    found = engine_torque(drive, Vehicle(torque=model), speed, time)
    assert_allclose(found.torque, [100 - 10 - 2 - 1, 100 - 10 - 4 - 4, 100 - 10 - 6 - 9])
    with error(ConfigError, "percent 1"):
        replace(model, coefficients=(1.0,))


def test_offset_growth_and_inertias_are_states_of_a_data_sheet():
    """Errors put into force and inertia by hand are multiples of the rows of their states."""
    rng = np.random.default_rng(5)
    n = 50
    vehicle = sheet(line={"wheel_radius": 0.3, "engine_inertia": 0.15, "wheel_inertia": 4.0})
    line = vehicle.driveline
    gearing, accel, speed = rng.choice(GEARS, n), rng.normal(0, 1, n), rng.uniform(5, 20, n)

    def table(offset, growth):
        torque = 100.0 - offset - growth * gearing * speed / 200.0
        return ForceTable(
            time=np.arange(float(n)),
            traction_force=torque * gearing,
            force_std=np.ones(n),
            torque=torque,
            engine_speed=gearing * speed,
            speed=speed,
            accel=accel,
            specific_force=accel,
            grade=np.zeros(n),
            pitch=np.zeros(n),
            heading=np.zeros(n),
            gear=np.ones(n, dtype=np.int64),
            gearing=gearing,
            air_speed=speed,
            air_density=np.full(n, 1.2),
            fuel_burnt=np.zeros(n),
            reason=np.full(n, Reason.USED, dtype=np.uint8),
        )

    rows, right = design(table(0.0, 0.0), vehicle)
    found = ("torque_offset", "torque_growth", "engine_inertia", "wheel_inertia")
    assert names_of(vehicle) == (*CALIBRATED, *found)
    assert rows.shape[1] == len(CALIBRATED) + len(found)
    errors = np.array([3.0, 2.0, 0.05, 0.5])
    lighter = replace(
        vehicle,
        driveline=replace(
            line,
            engine_inertia=line.engine_inertia - errors[2],
            wheel_inertia=line.wheel_inertia - errors[3],
        ),
    )
    _, wrong = design(table(*errors[:2]), lighter)
    k = len(CALIBRATED)
    made = rows[:, k : k + 2] @ -errors[:2] + rows[:, k + 2 :] @ errors[2:]
    assert_allclose(wrong - right, made, atol=1e-9)


def test_with_one_gear_inertias_are_considered_not_estimated():
    """What hills say of them is what the accelerometer errs by, so the mass must not hang on it."""
    electric = Vehicle(driveline=Driveline(gearings=(30.0,), wheel_radius=0.33))
    assert names_of(electric) == (*CALIBRATED, "torque_offset", "torque_growth")
    accel = np.sin(np.arange(200.0))
    used = np.ones(200, dtype=bool)
    engine, wheels = electric.road.engine_inertia.std, electric.road.wheel_inertia.std
    assert (engine, wheels) == (0.02, 0.7)
    expected = np.hypot(engine * 30.0**2, wheels / 0.33**2) / 1500.0
    assert_allclose(inertia_relative_std(electric, 1500.0, accel, accel, used), expected)
    # Where all that weighs is hills, the inertias do not matter.
    hills = np.cos(np.arange(200.0))
    assert inertia_relative_std(electric, 1500.0, accel, accel + 9.0 * hills, used) < 0.2 * expected
    for known in (sheet(), replace(electric, provenance=Provenance(method="joint"))):
        assert inertia_relative_std(known, 1500.0, accel, accel, used) == 0.0
