"""What a running mass of Du et al. 2025 does over a drive: rise, brakings, cruise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.estimators import MassTrack
from weighbridge.papers.du2025_methods import BAND
from weighbridge.papers.reproduced import rms
from weighbridge.signals import Bools, scalar_to_si

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
