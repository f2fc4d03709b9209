"""The tests of Galvão et al. with the torque recorded: eq. 13 as it is, its input measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np
from scipy.stats import spearmanr

from weighbridge.calibration import CalibrationSettings, run_calibration
from weighbridge.estimators.speed_torque_ekf import SpeedTorqueSettings
from weighbridge.papers.claims import Found
from weighbridge.papers.galvao_drives import CAR, mass_of, scenario, with_grade
from weighbridge.pipeline.weighing import weigh
from weighbridge.report.table import Table
from weighbridge.signals import Drive, Floats
from weighbridge.simulation import Polling, Route, simulate_car
from weighbridge.vehicle import Driveline, Vehicle


def slope(masses: Floats, answers: Floats) -> tuple[float, float]:
    """Regress answers on true masses.

    Parameters
    ----------
    masses, answers : (n,) [kg]

    Returns
    -------
    slope, std : kg answered per kg loaded, and its standard error [-]
    """
    away = masses - masses.mean()
    power = float(np.sum(away**2))
    found = float(away @ answers) / power
    residual = answers - answers.mean() - found * away
    return found, float(np.sqrt(residual @ residual / (masses.size - 2) / power))


def rank_correlation(masses: Floats, answers: Floats) -> float:
    """Spearman's: 1 where heavier drives always get heavier answers; wild answers do no harm."""
    return float(spearmanr(masses, answers).statistic)


METHOD: Final = "speed-torque-ekf"

START: Final = 1500.0
"""Mass that the filter is started from, as the paper's [kg]."""

FROM_PRINTED_START: Final = SpeedTorqueSettings(initial_mass=START)
"""Our settings but for the start."""

BOUND: Final = 5.0
"""Largest error that the abstract states [%]."""

LOADS: Final = (0.0, 0.0, 0.0, 200.0, 400.0)
"""Of the three tests, and of two drives that the paper did not try [kg]."""

POLLED: Final = Polling(
    fast=("vehicle_speed", "engine_speed", "engine_load"), slow=(), speed_scale=1.0
)
"""Speed, engine speed and load at 4 Hz, a third of which is the torque."""


WAYS: Final = ("grade of a map", "no grade", "no grade, calibrated with one")
"""What is known of the grade."""


@dataclass(frozen=True, slots=True)
class Weighed:
    """Drives as weighed in one way; arrays (n,) one value a drive.

    Attributes
    ----------
    mass : NaN where there is none [kg]
    std : [kg]
    """

    mass: Floats
    std: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class TorqueTrial:
    """Drives of one road, weighed by speed and recorded torque.

    Attributes
    ----------
    masses : true (n,) [kg]
    ways : the same drives weighed, by `WAYS`; each is calibrated on the first drive with what the
        way knows of the grade, the last one as the paper: with the true grade
    """

    masses: Floats
    ways: Mapping[str, Weighed]

    def errors(self, way: str) -> Floats:
        """Relative errors of a way (n,) [-]."""
        return self.ways[way].mass / self.masses - 1.0

    def slope(self, way: str) -> tuple[float, float]:
        """Kg found per kg loaded by a way, and standard error, of the drives with a mass [-]."""
        found = self.ways[way].mass
        known = np.isfinite(found)
        return slope(self.masses[known], found[known])


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
    made = [
        simulate_car(replace(scenario(seed + k, route, payload=load), polling=POLLED))
        for k, load in enumerate(LOADS)
    ]
    masses = np.array([mass_of(one) for one in made])
    plain = [one.drive for one in made]
    graded = [with_grade(one) for one in made]
    car = _calibrated(plain[0], masses[0])
    graded_car = _calibrated(graded[0], masses[0])
    ways = ((graded, graded_car), (plain, car), (plain, graded_car))
    return TorqueTrial(
        masses=masses,
        ways={
            name: _weighed(drives, by, settings)
            for name, (drives, by) in zip(WAYS, ways, strict=True)
        },
    )


def _calibrated(drive: Drive, mass: float) -> Vehicle:
    base = Vehicle(name=CAR.name, driveline=Driveline(wheel_radius=CAR.wheel_radius))
    settings = CalibrationSettings(method=METHOD)
    return run_calibration([drive], [mass], vehicle=base, settings=settings).vehicle


def _weighed(drives: list[Drive], car: Vehicle, settings: SpeedTorqueSettings) -> Weighed:
    usual = SpeedTorqueSettings()
    values = {f.name: getattr(settings, f.name) for f in fields(settings)}
    changed = {name: value for name, value in values.items() if value != getattr(usual, name)}
    found = [weigh(drive, car, METHOD, settings=changed) for drive in drives]
    return Weighed(np.array([w.mass for w in found]), np.array([w.std for w in found]))


def torque_table(done: TorqueTrial) -> Table:
    """Put the masses by recorded torque beside the true ones."""
    rows = []
    for k, load in enumerate(LOADS):
        name = f"Test {k + 1:02d}" if load == 0.0 else f"{load:.0f} kg loaded"
        cells = []
        for way, found in done.ways.items():
            mass, half = found.mass[k], 1.96 * found.std[k]
            known = np.isfinite(mass)
            cells += [
                f"{mass:.0f} ± {half:.0f}" if known else "no mass",
                f"{100.0 * done.errors(way)[k]:+.1f}" if known else "",
            ]
        rows.append((name, f"{done.masses[k]:.0f}", *cells))
    per_load = [
        cell for way in done.ways for cell in ("{:+.2f} ± {:.2f}".format(*done.slope(way)), "")
    ]
    rows.append(("kg found per kg loaded", "", *per_load))
    heads = [head for way in done.ways for head in (f"{way}: kg", "error %")]
    return Table(
        f"Torque recorded (eq. 13), started at {START:.0f} kg; Test 01 is the calibration's",
        ("drive", "true kg", *heads),
        tuple(rows),
    )


def torque_figures(done: TorqueTrial) -> dict[str, Found]:
    """Figures that the paper's items ask for."""
    found = {}
    for name, way in zip(("torque", "blind torque", "mixed torque"), WAYS, strict=True):
        errors = 100.0 * done.errors(way)
        masses, std = done.ways[way].mass, done.ways[way].std
        known = np.isfinite(masses)
        held = np.count_nonzero(np.abs(masses - done.masses)[known] < 1.96 * std[known])
        width = 196.0 * std / done.masses

        def shown(part: slice, errors: Floats = errors, width: Floats = width) -> str:
            """Errors of some drives and their half widths."""
            off = " / ".join(f"{x:+.1f}" if np.isfinite(x) else "no mass" for x in errors[part])
            return f"{off} % ± {' / '.join(f'{x:.1f}' for x in width[part])} %"

        found[f"{name} errors"] = Found(
            f"errors {shown(slice(3))}; 200 and 400 kg loaded {shown(slice(3, None))}; {held} of "
            f"{known.sum()} within 95 %",
            bool(known.all() and np.max(np.abs(errors)) <= BOUND),
        )
    return found
