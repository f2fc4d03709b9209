"""Classes below 250 kg: a motorcycle of known mass, and what vehicle files take."""

import math
from dataclasses import replace

import numpy as np
import pytest

from weighbridge import ConfigError, Signal, weigh
from weighbridge.simulation import SimulatedCar, make_scenario, simulate_car
from weighbridge.vehicle import VEHICLE_CLASSES, Known, describe

GEARS = (2.58, 1.93, 1.55, 1.33, 1.20, 1.11)
FINAL_DRIVE = 1.71 * 2.6
RPM = np.pi / 30.0
BIKE = SimulatedCar(
    name="motorcycle of 900 cm³, with its rider",
    kind="motorcycle",
    mass=285.0,
    transmission="manual",
    gear_ratios=GEARS,
    final_drive=FINAL_DRIVE,
    wheel_radius=0.306,
    engine_inertia=0.018,
    wheel_inertia=1.1,
    drag_area=0.5,
    rolling_coefficient=0.017,
    curve_speed=tuple(RPM * n for n in (1000, 3000, 5000, 7000, 9000, 10_500)),
    curve_torque=(40.0, 60.0, 78.0, 88.0, 80.0, 55.0),
    idle_speed=1250 * RPM,
    max_speed=10_500 * RPM,
    drag_torque=(4.0, 0.004, 1.5e-5),
    loss_constant=0.8,
    loss_slope=0.05,
    torque_lag=0.1,
    shift_time=0.35,
    shift_floor=0.0,
    upshift=4200 * RPM,
    downshift=2300 * RPM,
    accessory_power=200.0,
    load_full=1.0,
    load_curvature=0.0,
    load_speed_slope=0.0,
    squat=math.radians(0.2),
    load_pitch=2e-5,
)


def test_a_motorcycle_is_weighed_by_data_sheet():
    scenario = replace(make_scenario("car", seed=5), car=BIKE, payload=40.0, duration=900.0)
    made = simulate_car(scenario)
    time = made.drive.signals["engine_speed"].time
    torque = np.interp(time, made.truth.time, made.truth.engine_torque)
    drive = made.drive.with_signals(Signal("engine_torque", time, torque))
    known = Known(
        kind="motorcycle", tare=210.0, radius=0.306, gear_ratios=GEARS, final_drive=FINAL_DRIVE,
        torque="measured",
    )  # fmt: skip
    done = weigh(drive, describe(known).vehicle)
    low, high = done.interval()
    assert low < scenario.mass < high
    assert done.mass == pytest.approx(scenario.mass, rel=0.08)


@pytest.mark.parametrize("kind", ["motorcycle", "racer", "quad"])
def test_light_classes_take_masses_that_a_car_cannot_have(kind):
    known = Known(kind=kind, tare=180.0, torque="measured")
    assert describe(known).vehicle.of_class is VEHICLE_CLASSES[kind]
    with pytest.raises(ConfigError, match="a car has 250"):
        describe(replace(known, kind="car"))


@pytest.mark.parametrize(
    ("size", "diameter"),
    # Overall diameters that makers print [mm].
    [("180/55 ZR17", 630.0), ("120/70 ZR17", 600.0), ("90/90-21", 695.0), ("140/70-14", 552.0)],
)
def test_tyres_of_motorcycles(size, diameter):
    radius = describe(Known(tyre=size)).vehicle.driveline.wheel_radius
    assert 2000.0 * radius == pytest.approx(0.97 * diameter, rel=0.01)
