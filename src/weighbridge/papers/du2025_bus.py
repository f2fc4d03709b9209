"""The bus of Du et al. 2025, and its simulated drives."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from weighbridge.simulation import Braking, Sensors, make_scenario, simulate_car
from weighbridge.vehicle import Driveline, Mounting, Provenance, RoadLoad, TorqueModel, Vehicle

if TYPE_CHECKING:
    from weighbridge.simulation import SimulatedDrive

LOADS: Final = {"no-load": 0.0, "half-load": 3000.0, "full-load": 6000.0}
"""Payload over the empty bus of 7000 kg, Table 1 [kg]."""

NOT_IN_THE_PAPER: Final = (
    "accessories", "load_nonlinearity", "driveline_loss", "warm_up", "tyre_temperature", "surface",
    "gusts", "squat", "load_pitch", "imu_bias", "imu_bias_walk", "imu_cross_axis",
)  # fmt: skip
"""Effects that the paper's filters and its simulated sensors do not have: they know torque,
efficiency, rolling resistance and the zero of the accelerometer, and no wind blows. Noise,
vibration, scale errors, rounding, lateness and jitter of the sensors, the tyres' slip and
growth with speed, shifts, rough road and released brakes that hold a little are left in."""

ROLLING_SPEED: Final = 3.5e-5
"""Growth of the rolling coefficient with speed, f1 [s/m]: straight line to what the simulated
tyres have at 70 km/h, a fifth of the quadratic growth at 30 m/s."""


EARLY_BRAKING: Final = Braking(time=12.0, duration=2.0, decel=1.2)
"""Braking while the estimate still rises, which delays the paper's least squares (sec. 4.2). The
paper shows no time: at 12 s the bus has driven for 9 s and has 25 km/h."""


def data_sheet() -> Vehicle:
    """Return the bus of Table 1, and what the table lacks from the simulated one's data sheet.

    Gear ratios and inertias are not in the table. Its rolling coefficient of
    0.0005 is a tenth of any tyre's; 0.0075 is usual for buses.
    """
    radius, axle = 0.49, 3.545
    ratios = (6.75, 3.60, 2.13, 1.39, 1.00, 0.78)
    return Vehicle(
        name="bus of Du 2025, data sheet",
        kind="bus",
        tare=7000.0,
        gross=13_000.0,
        driveline=Driveline(
            gearings=tuple(g * axle / radius for g in ratios),
            engine_inertia=1.1,
            wheel_inertia=62.0,
            wheel_radius=radius,
            efficiency=0.95,
        ),
        torque=TorqueModel(source="percent"),
        road_load=RoadLoad(drag_area=0.69 * 7.9, rolling_coefficient=0.0075),
    )


def known_bus() -> Vehicle:
    """Return the bus as the paper's filters know it: all of it is certain.

    The losses of the driveline are off in these drives, as the paper knows
    them, so its efficiency is one; the sensor's mounting is known.
    """
    sheet = data_sheet()
    roll, pitch, yaw = Sensors().mounting
    return replace(
        sheet,
        name="bus of Du 2025, known",
        driveline=replace(sheet.driveline, efficiency=1.0),
        road_load=replace(sheet.road_load, rolling_speed_coefficient=ROLLING_SPEED),
        mounting=Mounting(roll=roll, pitch=pitch, yaw=yaw, std=(1e-3, 1e-3, 1e-3)),
        provenance=Provenance(mass_scale_std=0.0),
    )


def simulate(
    payload: float, seed: int, *, as_paper: bool, early_braking: bool = True
) -> SimulatedDrive:
    """Simulate a drive of the bus on the straight road.

    Parameters
    ----------
    payload : [kg]
    seed : of driver, weather and sensors
    as_paper : on a level road, without `NOT_IN_THE_PAPER`, wind and GNSS; else with
        all effects. Without GNSS no height shows grade from the accelerometer's
        zero, which the paper's filters know.
    early_braking : brake at `EARLY_BRAKING`, too
    """
    if as_paper:
        made = make_scenario("bus", payload=payload, seed=seed, wind=0.0, without=NOT_IN_THE_PAPER)
    else:
        made = make_scenario("bus", payload=payload, seed=seed)
    if early_braking:
        made = replace(made, brakings=(EARLY_BRAKING, *made.brakings))
    if not as_paper:
        return simulate_car(made)
    level = replace(made.route, grade=0.0 * made.route.grade)
    return simulate_car(replace(made, route=level, sensors=replace(made.sensors, gnss_rate=0.0)))
