"""From drives of known mass and grade to a vehicle that ``--method speed-ekf`` can weigh."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.balance.law import rotating_mass
from weighbridge.balance.speed_balance import SPEEDS, running, speed_motion_of, window_means
from weighbridge.calibration.speed_fit import (
    Nominal,
    SpeedFit,
    SpeedRows,
    fit_speed_model,
)
from weighbridge.messages import Problem as Message
from weighbridge.messages import refused
from weighbridge.navigation import find_motion
from weighbridge.signals import Drive
from weighbridge.vehicle import Provenance, SpeedModel, Vehicle
from weighbridge.vehicle.fits import SPEED_EKF
from weighbridge.vehicle.speed_model import SpeedSampling

AIR_DENSITY: Final = 1.22
"""Density of the air [kg/m^3] (Galvão et al., sec. 2.1)."""

GEARING: Final = 6.39 / 0.29
"""Gear ratios over wheel radius where no gearings are known [1/m] (Galvão et al., sec. 2.1)."""

SCALE_STD: Final = 0.20
"""Relative standard deviation that the method leaves in every mass [-]. Simulated, eight cars
each calibrated empty and weighed on eight other drives with loads to 35 % of the car: every
answer was the empty car's mass, RMS error 18 % (studies/galvao.py, seeds from 5000)."""


POOR: Final = 0.3
"""Part of the speed's changes below which a fit is questioned [-]: chosen below the 0.46 to 0.71
that simulated country roads reach (studies/galvao.md)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedCalibration:
    """A vehicle with a speed model and what it was made from.

    Attributes
    ----------
    vehicle : the result
    fit : of the corrections
    rows : windows of each drive
    """

    vehicle: Vehicle
    fit: SpeedFit
    rows: tuple[SpeedRows, ...]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Texts of the `problems`."""
        return tuple(p.text for p in self.problems)

    @property
    def problems(self) -> tuple[Message, ...]:
        """What is uncertain in the fit."""
        if self.fit.r_squared >= POOR:
            return ()
        names = ", ".join(rows.name for rows in self.rows)
        return (
            Message.of(
                "calibration.speed_poor",
                drives=names,
                share=100.0 * self.fit.r_squared,
                least=100.0 * POOR,
            ),
        )


def nominal_of(vehicle: Vehicle) -> Nominal:
    """Take the model's constants from the vehicle; its middle gear takes the place of all.

    The corrections make up for what is only roughly so.
    """
    line, road = vehicle.driveline, vehicle.road
    gearing = float(np.median(line.gearings)) if line.gearings else GEARING
    return Nominal(
        force_gain=(line.efficiency or 1.0) * gearing,
        drag=AIR_DENSITY * road.drag_area.value,
        rolling_coefficient=road.rolling_coefficient.value,
        rotating_mass=float(rotating_mass(vehicle, gearing)),
    )


def speed_rows(drive: Drive, vehicle: Vehicle, mass: float, sampling: SpeedSampling) -> SpeedRows:
    """Sample speed and grade of a drive.

    Raises
    ------
    DriveError
        There is too little speed, or nothing shows the grade.
    """
    if not any(drive.has(name) for name in SPEEDS):
        raise refused("calibration.no_speed", drive=drive.name, missing=" and no ".join(SPEEDS))
    graded = find_motion(drive, vehicle)
    if graded.source == "speed":
        raise refused("calibration.no_grade", drive=drive.name)
    motion = speed_motion_of(drive, vehicle, sampling.sample_time)
    seen = np.where(graded.valid, graded.grade, np.nan)
    grade = np.interp(motion.time, graded.time, seen, left=np.nan, right=np.nan)
    speed = window_means(motion, motion.speed, sampling)
    known, slow, braked = running(speed, sampling)
    return SpeedRows(
        name=drive.name,
        mass=mass,
        speed=speed,
        grade=window_means(motion, grade, sampling),
        used=known & ~slow & ~braked,
    )


def calibrate_by_speed(
    drives: Sequence[Drive],
    masses: Sequence[float],
    base: Vehicle,
    *,
    nominal: Nominal | None = None,
    sampling: SpeedSampling | None = None,
) -> SpeedCalibration:
    """Fit the speed model of a vehicle; all else of the vehicle stays.

    Parameters
    ----------
    drives : with speed, and with what shows the grade
    masses : known mass of each [kg]
    base : what is known of the vehicle
    nominal : constants of the model; from the vehicle when None
    sampling : of the speed; ours when None

    Raises
    ------
    DriveError
        A drive lacks speed or grade, or is too short or too even.
    """
    nominal = nominal or nominal_of(base)
    sampling = sampling or SpeedSampling()
    rows = tuple(
        speed_rows(drive, base, mass, sampling) for drive, mass in zip(drives, masses, strict=True)
    )
    fit = fit_speed_model(rows, nominal, sampling.sample_time)
    model = SpeedModel(
        mass=float(np.mean(masses)),
        sample_time=sampling.sample_time,
        averaged=sampling.averaged,
        slowest=sampling.slowest,
        hardest=sampling.hardest,
        force_gain=nominal.force_gain,
        drag=nominal.drag,
        rolling_coefficient=nominal.rolling_coefficient,
        rotating_mass=nominal.rotating_mass,
        corrections=fit.corrections,
        r_squared=fit.r_squared,
        samples=fit.samples,
        scale_std=SCALE_STD,
    )
    vehicle = replace(base, speed_model=model)
    if not base.provenance.drives:
        made = Provenance(
            drives=tuple(drive.name for drive in drives),
            masses=tuple(masses),
            date=datetime.date.today().isoformat(),
            method=SPEED_EKF.name,
            mass_scale_std=base.provenance.mass_scale_std,
            notes="speed model alone: nothing of torque or road load was fitted",
        )
        vehicle = replace(vehicle, provenance=made)
    return SpeedCalibration(vehicle=vehicle, fit=fit, rows=rows)
