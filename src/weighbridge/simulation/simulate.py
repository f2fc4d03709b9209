"""Simulate a drive: what was recorded, and what was true."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import get_args

import numpy as np

from weighbridge.arguments import check_choice
from weighbridge.constants import GRAVITY
from weighbridge.io.write import TableFormat, write_drive
from weighbridge.signals import Drive, DriveInfo, Floats, Signal, from_si
from weighbridge.simulation.body import Pose, simulate_pose
from weighbridge.simulation.hybrid import shared
from weighbridge.simulation.longitudinal import DT, Trajectory, simulate_trajectory
from weighbridge.simulation.scenario import Scenario
from weighbridge.simulation.sensing import (
    POLLABLE,
    engine_load,
    simulate_gnss,
    simulate_imu,
    simulate_polling,
)

log = logging.getLogger(__name__)

TRUTH_RATE = 20.0
"""Samples of the truth per second [Hz]."""

_STRIDE = round(1.0 / (DT * TRUTH_RATE))


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What was true, at 20 Hz; every array (n,), SI.

    Attributes
    ----------
    time : [s]
    distance : along the road [m]
    speed, accel : along the road [m/s], [m/s^2]
    specific_force : along the road, ``accel + g sin(grade)`` [m/s^2]
    grade : of the road, positive uphill [rad]
    pitch : of the body, squat and load included, nose up [rad]
    roll : of the body, right side down [rad]
    heading : of the body, clockwise from north, in [0, 2 pi) [rad]
    altitude : [m]
    latitude, longitude : [rad]
    mass : of all that rolls [kg]
    engine_speed : [rad/s]
    engine_torque : of engine or motor at the clutch: friction and accessories
        taken off, its own inertia not yet [N m]
    load : calculated load before sampling and quantisation [-]
    gear : current one; during a shift the next
    phase : 0 driving, 1 shifting, 2 clutch or converter slips, 3 clutch open
    traction_force : of the driveline at the wheels, its losses and the engine's
        inertia taken off, the wheels' inertia not yet [N]
    brake_force, drag_force, rolling_force : against the motion [N]
    wind_along : wind at the car along its heading, positive from behind [m/s]
    fuel_flow : [kg/s]
    pedal : torque asked for over torque there is [-]
    brake_pedal : 1 while it is pressed, however lightly

    Notes
    -----
    ``(mass + I_w / r^2) accel = traction_force - brake_force - drag_force -
    rolling_force - mass g sin(grade)``, with the force held over one step of
    5 ms, but while the car stands.
    """

    time: Floats
    distance: Floats
    speed: Floats
    accel: Floats
    specific_force: Floats
    grade: Floats
    pitch: Floats
    roll: Floats
    heading: Floats
    altitude: Floats
    latitude: Floats
    longitude: Floats
    mass: Floats
    engine_speed: Floats
    engine_torque: Floats
    load: Floats
    gear: Floats
    phase: Floats
    traction_force: Floats
    brake_force: Floats
    drag_force: Floats
    rolling_force: Floats
    wind_along: Floats
    fuel_flow: Floats
    pedal: Floats
    brake_pedal: Floats


_TRUTH_SUFFIX = {
    "time": "s", "distance": "m", "speed": "mps", "accel": "mps2", "specific_force": "mps2",
    "grade": "rad", "pitch": "rad", "roll": "rad", "heading": "rad", "altitude": "m",
    "latitude": "deg", "longitude": "deg", "mass": "kg", "engine_speed": "rpm",
    "engine_torque": "nm", "load": "pct", "gear": "", "phase": "", "traction_force": "n",
    "brake_force": "n", "drag_force": "n", "rolling_force": "n", "wind_along": "mps",
    "fuel_flow": "kgps", "pedal": "pct", "brake_pedal": "",
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedDrive:
    """A drive with its truth.

    Attributes
    ----------
    scenario : what was simulated
    drive : what was recorded; `DriveInfo.mass` is the mass at the start
    truth : what was true
    """

    scenario: Scenario
    drive: Drive
    truth: Truth

    def write(self, folder: Path, *, format: TableFormat = "parquet") -> None:
        """Write the drive's tables, ``drive.toml`` and the truth into a folder.

        Parameters
        ----------
        folder : Path
            Made where it is not there; files of the same name are replaced.
        format : "parquet" or "csv"

        Raises
        ------
        ConfigError
            The format is neither.
        """
        check_choice("format", format, get_args(TableFormat))
        columns = {}
        for f in fields(self.truth):
            values, suffix = getattr(self.truth, f.name), _TRUTH_SUFFIX[f.name]
            column = f"{f.name}_{suffix}" if suffix else f.name
            columns[column] = from_si(values, suffix) if suffix else values
        write_drive(self.drive, folder, format, truth=columns)


def simulate_car(
    scenario: Scenario, progress: Callable[[int, int], None] | None = None
) -> SimulatedDrive:
    """Simulate one drive.

    Parameters
    ----------
    scenario : Scenario
    progress : called with parts done and all

    Returns
    -------
    SimulatedDrive
        The same for the same scenario, to the last bit.

    Raises
    ------
    ConfigError
        The scenario polls what cannot be polled.
    """
    for name in (*scenario.polling.fast, *scenario.polling.slow):
        check_choice("what is polled", name, POLLABLE)
    tell = progress or (lambda done, total: None)
    random = scenario.streams()
    trajectory = simulate_trajectory(scenario, random["plan"], random["drive"], random["habits"])
    if scenario.car.split is not None:
        trajectory = shared(trajectory, scenario.car.split)
    tell(4, 8)
    pose = simulate_pose(scenario, trajectory, random["road"])
    tell(5, 8)
    signals: list[Signal] = []
    if scenario.sensors.imu_rate > 0.0:
        signals += simulate_imu(scenario, trajectory, pose, random["imu"])
    tell(7, 8)
    signals += simulate_polling(scenario, trajectory, pose, random["obd"])
    if scenario.sensors.gnss_rate > 0.0:
        signals += simulate_gnss(scenario, trajectory, pose, random["gnss"])

    info = DriveInfo(
        start_time=scenario.start_time,
        vehicle=scenario.car.name,
        mass=scenario.mass,
        ambient_temperature=scenario.ambient_temperature,
        barometric_pressure=scenario.pressure,
        wind_speed=scenario.wind_speed,
        wind_from=scenario.wind_from,
        notes=f"simulated, scenario {scenario.name}, seed {scenario.seed}",
    )
    drive = Drive(scenario.name, {s.name: s for s in signals}, info)
    log.info("simulated %s: %.0f s, %.1f km", scenario.name, drive.duration,
             trajectory.distance[-1] / 1e3)  # fmt: skip
    return SimulatedDrive(scenario=scenario, drive=drive, truth=_truth(scenario, trajectory, pose))


def _truth(scenario: Scenario, trajectory: Trajectory, pose: Pose) -> Truth:
    """Thin what was true to 20 Hz."""

    def cut(values: Floats) -> Floats:
        return np.ascontiguousarray(values[::_STRIDE])

    accel = np.gradient(trajectory.speed, DT)
    values = trajectory._asdict() | pose._asdict()
    values |= {
        "accel": accel,
        "specific_force": accel + GRAVITY * np.sin(pose.grade),
        "heading": np.mod(pose.heading, 2.0 * math.pi),
        "load": engine_load(scenario, trajectory),
    }
    return Truth(**{f.name: cut(values[f.name]) for f in fields(Truth)})
