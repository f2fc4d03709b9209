"""Drives of the reproduction of Jensen et al. 2022, against what was true."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.balance.law import force_on_mass, mass_column
from weighbridge.estimators.track import MassTrack
from weighbridge.navigation import Motion
from weighbridge.papers.jensen2022_drives import TestDrive
from weighbridge.papers.reproduced import rms
from weighbridge.pipeline.weighing import Weighing
from weighbridge.signals import Bools, Drive, Floats, scalar_to_si
from weighbridge.simulation import SimulatedDrive
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.torque_sources import air_flow_torque

BAND: Final = 0.05
"""The paper's band around the true mass [-]."""

ONE_DEGREE: Final = scalar_to_si(1.0, "deg")
"""The paper's largest error of the pitch [rad]."""

_MOVING: Final = 1.5
"""Slower, angles are not judged [m/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveResult:
    """How one drive of the table went by one method.

    Attributes
    ----------
    drive : the row of Table B.1
    true_mass : mean over the drive [kg]
    track : mass over time
    weighing : whole result; None by the paper's own rules, which give a running mass alone
    worst : largest relative error of the running mass over the last two thirds [-]
    worst_at : where in the drive that is, from 0 to 1 [-]
    typical : mean relative error of the running mass over the last two thirds [-]
    inside : part of the last two thirds within the paper's band [-]
    error : relative error of the final mass: of the weighing, else the running mass at the end [-]
    covered : the 95 % interval holds the true mass; False without a weighing
    grade_rms, pitch_rms : errors while moving [rad]
    pitch_largest : largest error of the pitch while moving [rad]
    pitch_within : part of the moving time with less than 1 degree [-]
    grade_largest, grade_within : the same of the slope of the road
    """

    drive: TestDrive
    true_mass: float
    track: MassTrack
    weighing: Weighing | None
    worst: float
    worst_at: float
    typical: float
    inside: float
    error: float
    covered: bool
    grade_rms: float
    pitch_rms: float
    pitch_largest: float
    pitch_within: float
    grade_largest: float
    grade_within: float

    @property
    def balance(self) -> ForceBalance:
        """Forces and motion the mass was made from."""
        return self.track.balance


def judge(row: TestDrive, made: SimulatedDrive, weighing: Weighing) -> DriveResult:
    """Compare a weighing with the truth.

    Raises
    ------
    RuntimeError
        Nothing was estimated.
    """
    if weighing.result is None:
        raise RuntimeError(f"drive {row.number} was not weighed: {weighing.reason}")
    return judge_track(row, made, weighing.result, weighing)


def judge_track(
    row: TestDrive, made: SimulatedDrive, track: MassTrack, weighing: Weighing | None = None
) -> DriveResult:
    """Compare a mass over time with the truth."""
    truth, motion = made.truth, track.balance.motion
    mass = float(np.mean(truth.mass))
    part = (track.time - track.time[0]) / (track.time[-1] - track.time[0])
    last = part >= 1.0 / 3.0
    running = track.running_mass[last] / mass - 1.0
    final, covered = track.running_mass[-1], False
    if weighing is not None:
        low, high = weighing.interval(0.95)
        final, covered = weighing.mass, low <= mass <= high
    moving = motion.speed > _MOVING
    grade, pitch = (
        (getattr(motion, name) - np.interp(motion.time, truth.time, getattr(truth, name)))[moving]
        for name in ("grade", "pitch")
    )
    return DriveResult(
        drive=row,
        true_mass=mass,
        track=track,
        weighing=weighing,
        worst=float(np.max(np.abs(running))),
        worst_at=float(part[last][np.argmax(np.abs(running))]),
        typical=float(np.mean(running)),
        inside=float(np.mean(np.abs(running) <= BAND)),
        error=float(final) / mass - 1.0,
        covered=covered,
        grade_rms=rms(grade),
        pitch_rms=rms(pitch),
        pitch_largest=float(np.max(np.abs(pitch))),
        pitch_within=float(np.mean(np.abs(pitch) < ONE_DEGREE)),
        grade_largest=float(np.max(np.abs(grade))),
        grade_within=float(np.mean(np.abs(grade) < ONE_DEGREE)),
    )


def within(drives: Sequence[DriveResult]) -> int:
    """Count the drives whose running mass stays within the paper's band.

    That is at every instant of the last two thirds of the drive.
    """
    return sum(d.worst <= BAND for d in drives)


@dataclass(frozen=True, slots=True, kw_only=True)
class Torques:
    """Torque of the engine three ways (figs. 8, 9).

    Attributes
    ----------
    time : (n,) instants [s]
    load : (n,) engine load [-]
    engine_speed : (n,) [rad/s]
    motion : (n,) from the longitudinal law with the known mass, eq. 3 [N m]
    source : (n,) from load and engine speed, eq. 49 [N m]
    air : (n,) from the intake air flow, eq. 51 [N m]
    """

    time: Floats
    load: Floats
    engine_speed: Floats
    motion: Floats
    source: Floats
    air: Floats

    @property
    def r_squared(self) -> float:
        """Part of the torque of the motion that load and engine speed explain, unweighted [-]."""
        total = np.sum((self.motion - np.mean(self.motion)) ** 2)
        return float(1.0 - np.sum((self.motion - self.source) ** 2) / total)

    @property
    def air_over_source(self) -> float:
        """Slope of the torque from air flow over that from load, through zero [-]."""
        return float(np.sum(self.air * self.source) / np.sum(self.source**2))


def torques(
    drive: Drive,
    balance: ForceBalance,
    vehicle: Vehicle,
    mass: float,
    rows: Bools,
    *,
    efficiency: float,
) -> Torques:
    """Find the torque of a drive of known mass three ways.

    Parameters
    ----------
    drive : with engine load, engine speed and mass air flow
    balance, vehicle : it was weighed by
    mass : true [kg]
    rows : (n,) of the balance, to take
    efficiency : of the engine in eq. 51 [-]
    """
    table = balance.table
    rest = table.traction_force - force_on_mass(table, vehicle)
    needed = mass * mass_column(table, vehicle) + rest
    stamps = table.time + balance.delay
    equivalence = drive.get("lambda_1")
    air = air_flow_torque(
        drive.signals["mass_air_flow"].at(stamps),
        drive.signals["engine_speed"].at(stamps),
        np.ones(stamps.size) if equivalence is None else equivalence.at(stamps),
        efficiency,
    )
    # Efficiency is one after a calibration: torque and force go by the gearing alone.
    motion = needed / table.gearing
    known = rows & np.isfinite(motion) & np.isfinite(table.torque) & np.isfinite(air)
    return Torques(
        time=table.time[known],
        load=drive.signals["engine_load"].at(stamps)[known],
        engine_speed=table.engine_speed[known],
        motion=motion[known],
        source=table.torque[known],
        air=air[known],
    )


def joined(parts: Sequence[Torques]) -> Torques:
    """Put the torques of several drives one after another."""
    names = ("time", "load", "engine_speed", "motion", "source", "air")
    return Torques(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in names})


def kilometres(motion: Motion, time: Floats) -> Floats:
    """Distance driven at instants (n,) [km]."""
    return np.asarray(np.interp(time, motion.time, motion.distance) / 1e3)
