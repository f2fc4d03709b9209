"""The tests of Galvão et al. with the torque recorded: eq. 13 as it is, its input measured."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from weighbridge.calibration.run import run_calibration
from weighbridge.calibration.settings import CalibrationSettings
from weighbridge.estimators.speed_torque_ekf import SpeedTorqueSettings
from weighbridge.papers.galvao_drives import CAR, mass_of, scenario, with_grade
from weighbridge.pipeline.weighing import weigh
from weighbridge.report.table import Table
from weighbridge.signals import Floats
from weighbridge.simulation import Polling, Route, SimulatedDrive, simulate_car
from weighbridge.vehicle.model import Driveline, Vehicle

METHOD: Final = "speed-torque-ekf"

START: Final = 1500.0
"""Mass that the filter is started from, as the paper's [kg]."""

FROM_PRINTED_START: Final = SpeedTorqueSettings(initial_mass=START)
"""Our settings but for the start."""

LOADS: Final = (0.0, 0.0, 0.0, 200.0, 400.0)
"""Of the three tests, and of two drives that the paper did not try [kg]."""

POLLED: Final = Polling(
    fast=("vehicle_speed", "engine_speed", "engine_load"), slow=(), speed_scale=1.0
)
"""Speed, engine speed and load at 4 Hz, a third of which is the torque."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueTrial:
    """Drives of one road, weighed by speed and recorded torque; arrays (n,) one value a drive.

    The model is calibrated on the first drive with its true grade, as the paper does.

    Attributes
    ----------
    masses : true [kg]
    by_grade, by_grade_std : weighed with the grade of a map, and standard deviation [kg]
    blind, blind_std : weighed without a grade, as the paper's filter [kg]
    """

    masses: Floats
    by_grade: Floats
    by_grade_std: Floats
    blind: Floats
    blind_std: Floats

    def errors(self, found: Floats) -> Floats:
        """Relative errors of masses that were found (n,) [-]."""
        return found / self.masses - 1.0


def torque_trial(
    seed: int, route: Route, settings: SpeedTorqueSettings | None = None
) -> TorqueTrial:
    """Drive the paper's road with torque recorded, calibrate on the first drive, weigh all.

    Parameters
    ----------
    seed : of the first drive; the others count on from it
    route : of all drives
    settings : of the method; the defaults from the paper's start when None
    """
    settings = settings or FROM_PRINTED_START
    drives = [
        simulate_car(replace(scenario(seed + k, route, payload=load), polling=POLLED))
        for k, load in enumerate(LOADS)
    ]
    base = Vehicle(name=CAR.name, driveline=Driveline(wheel_radius=CAR.wheel_radius))
    car = run_calibration(
        [with_grade(drives[0])],
        [mass_of(drives[0])],
        vehicle=base,
        settings=CalibrationSettings(method=METHOD),
    ).vehicle
    by_grade = _weighed(drives, car, settings, graded=True)
    blind = _weighed(drives, car, settings, graded=False)
    return TorqueTrial(
        masses=np.array([mass_of(made) for made in drives]),
        by_grade=by_grade[0],
        by_grade_std=by_grade[1],
        blind=blind[0],
        blind_std=blind[1],
    )


def _weighed(
    drives: list[SimulatedDrive], car: Vehicle, settings: SpeedTorqueSettings, *, graded: bool
) -> tuple[Floats, Floats]:
    usual = SpeedTorqueSettings()
    values = {f.name: getattr(settings, f.name) for f in fields(settings)}
    changed = {name: value for name, value in values.items() if value != getattr(usual, name)}
    found = [
        weigh(with_grade(made) if graded else made.drive, car, METHOD, settings=changed)
        for made in drives
    ]
    return np.array([w.mass for w in found]), np.array([w.std for w in found])


def torque_table(done: TorqueTrial) -> Table:
    """Put the masses by recorded torque beside the true ones."""
    rows = []
    for k, load in enumerate(LOADS):
        name = f"Test {k + 1:02d}" if load == 0.0 else f"{load:.0f} kg loaded"
        cells = []
        for found, std in ((done.by_grade, done.by_grade_std), (done.blind, done.blind_std)):
            cells += [
                f"{found[k]:.0f} ± {1.96 * std[k]:.0f}" if np.isfinite(found[k]) else "no mass",
                f"{100.0 * (found[k] / done.masses[k] - 1.0):+.1f}",
            ]
        rows.append((name, f"{done.masses[k]:.0f}", *cells))
    return Table(
        f"Torque recorded (eq. 13), started at {START:.0f} kg; Test 01 is the calibration's",
        ("drive", "true kg", "grade of a map: kg", "error %", "no grade: kg", "error %"),
        tuple(rows),
    )


def torque_figures(done: TorqueTrial) -> dict[str, str]:
    """Figures that the paper's items ask for."""
    found = {}
    for name, masses, std in (
        ("torque", done.by_grade, done.by_grade_std),
        ("blind torque", done.blind, done.blind_std),
    ):
        errors = 100.0 * done.errors(masses)
        known = np.isfinite(masses)
        held = np.count_nonzero(np.abs(masses - done.masses)[known] < 1.96 * std[known])
        tests = " / ".join(f"{abs(x):.1f}" for x in errors[:3])
        loaded = " / ".join(f"{x:+.1f}" for x in errors[3:])
        found[f"{name} errors"] = (
            f"errors {tests} %; 200 and 400 kg loaded {loaded} %; {held} of {known.sum()} within "
            "95 % told"
        )
    return found
