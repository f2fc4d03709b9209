"""What a reproduction of Du et al. 2025 finds: of one drive, and of all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.estimators import MassTrack
from weighbridge.papers.du2025_methods import BAND
from weighbridge.papers.reproduced import rms
from weighbridge.signals import Bools, Floats, scalar_to_si
from weighbridge.vehicle import Vehicle

if TYPE_CHECKING:
    from weighbridge.simulation import SimulatedDrive

CONVERGED: Final = 21.0
"""From when the paper's least squares count as converged [s] (sec. 4.2)."""

AFTER: Final = 20.0
"""After a braking in the cruise its effect on the mass is looked at for so long [s]."""

LATER: Final = 40.0
"""At the beginning and at the end of the time after `CONVERGED`, errors are compared over this
time [s]."""

SLOW: Final = scalar_to_si(40.0, "kmh")
"""Above it our h(v) leaves nothing to the least squares [m/s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningError:
    """What one running mass did; errors are relative to the true mass.

    Attributes
    ----------
    first : error of the first mass reported [-]
    steady_at : time since the start from when on it stays within `BAND` of the true one [s]
    swing : farthest that it moves within `AFTER` of a braking in the cruise [-]
    slow, fast : RMS error below and above `SLOW`, from the first mass reported [kg]
    early, late : mean absolute error in the first and in the last `LATER` after `CONVERGED` [kg]
    wander : its standard deviation from `CONVERGED` on [kg]
    """

    first: float
    steady_at: float
    swing: float
    slow: float
    fast: float
    early: float
    late: float
    wander: float


def running_error(track: MassTrack, made: SimulatedDrive, mass: float) -> RunningError:
    """Look at a running mass of a drive.

    Parameters
    ----------
    track, made
    mass : true one [kg]
    """
    error = np.abs(track.running_mass - mass)
    known, time = np.isfinite(error), track.time - made.drive.start
    late = time >= CONVERGED
    slow = track.balance.table.speed < SLOW

    def mean(rows: Bools) -> float:
        return float(np.mean(error[rows]))

    return RunningError(
        first=float(error[np.argmax(known)] / mass),
        steady_at=steady_from(track, mass, made.drive.start),
        swing=swing(track, made),
        slow=rms(error[known & slow]),
        fast=rms(error[known & ~slow]),
        early=mean(late & (time < CONVERGED + LATER)),
        late=mean(late & (time > time[-1] - LATER)),
        wander=float(np.std(track.running_mass[late])),
    )


def steady_from(track: MassTrack, mass: float, start: float) -> float:
    """Time since the start from when on a running mass stays within `BAND` of the true one [s]."""
    outside = ~(np.abs(track.running_mass / mass - 1.0) <= BAND)
    last = np.flatnonzero(outside)
    return float(track.time[last[-1]] - start) if last.size else 0.0


def swing(track: MassTrack, made: SimulatedDrive) -> float:
    """Farthest that a running mass moves within `AFTER` of a braking in the cruise [-]."""
    moved = 0.0
    for braking in made.scenario.brakings:
        begin = made.drive.start + braking.time
        within = (track.time >= begin) & (track.time <= begin + AFTER)
        if braking.time > CONVERGED and within.any():
            mass = track.running_mass[within]
            moved = max(moved, float(np.max(np.abs(mass / mass[0] - 1.0))))
    return moved


@dataclass(frozen=True, slots=True, kw_only=True)
class Opposite:
    """Both filters as printed where their errors have opposite signs.

    Attributes
    ----------
    part : of the rows from `CONVERGED` where the signs differ [-]
    share : of the least squares in the best blend of a constant share, from 0 to 1 [-]
    parts, blended : RMSE of least squares and Kalman filter, and of that blend [kg]
    """

    part: float
    share: float
    parts: tuple[float, float]
    blended: float


@dataclass(slots=True, kw_only=True)
class DriveResult:
    """How one drive went, by method.

    Attributes
    ----------
    load : of `LOADS`
    seed : of the drive
    true_mass : mean over the drive [kg]
    tracks : of each method
    rmse : of the running mass from the first one reported [kg]
    late_rmse : the same from `CONVERGED` [kg]
    worst : largest relative error of the running mass from `CONVERGED` [-]
    held : part of the instants from `CONVERGED` whose 95 % interval holds the truth [-]
    seconds : processor time of each method, forces and motion given [s]
    steady_at : time since the start from when on the running mass stays within `BAND` [s]
    twice_rmse : of robust-rls with the grade counted twice, from the first mass reported [kg]
    blends : ``late_rmse`` of the hybrid by its blend
    printed : ``late_rmse`` of each method as printed, by the code of a `Form`; empty where the
        bus is not known
    printed_mean : mean error of the running mass of the same [kg]
    printed_worst : largest relative error of the running mass of the same from `CONVERGED` [-]
    printed_running : what the running mass of the same does, method by method
    printed_tracks : their tracks with f = 0.005, by the code of the form
    unit_start : ``printed`` of the Kalman filter with a first variance of the mass of 1 kg²,
        P0 = I [kg]
    opposite : errors of opposite sign, `Opposite`; None where the bus is not known
    """

    load: str
    seed: int
    true_mass: float
    tracks: dict[str, MassTrack]
    rmse: dict[str, float]
    late_rmse: dict[str, float]
    worst: dict[str, float]
    held: dict[str, float]
    seconds: dict[str, float]
    steady_at: dict[str, float]
    twice_rmse: float
    blends: dict[str, float]
    printed: dict[str, dict[str, float]] = field(default_factory=dict)
    printed_mean: dict[str, dict[str, float]] = field(default_factory=dict)
    printed_worst: dict[str, dict[str, float]] = field(default_factory=dict)
    printed_running: dict[str, dict[str, RunningError]] = field(default_factory=dict)
    printed_tracks: dict[str, dict[str, MassTrack]] = field(default_factory=dict)
    unit_start: dict[str, float] = field(default_factory=dict)
    opposite: Opposite | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduction:
    """All the figures.

    Attributes
    ----------
    drives : as in the paper, the bus known
    road : with all effects, the bus calibrated on other drives
    sheet : of the latter the first at each load, with the data sheet alone
    vehicle : as calibrated
    """

    drives: tuple[DriveResult, ...]
    road: tuple[DriveResult, ...]
    sheet: tuple[DriveResult, ...]
    vehicle: Vehicle


def cell(
    drives: Sequence[DriveResult], load: str, method: str, name: str, form: str = ""
) -> Floats:
    """Return one figure of a cell of Table 2, drive by drive.

    Parameters
    ----------
    drives : of any load
    load : of `LOADS`
    method : of `METHODS`
    name : field of `DriveResult`
    form : code of a `Form`, where the field has one value for each
    """
    values = [getattr(d, name) for d in drives if d.load == load]
    return np.array([(v[form] if form else v)[method] for v in values])
