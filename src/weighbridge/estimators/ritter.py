"""Mass and course of the grade from a whole batch at once (after Ritter et al. 2021)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from weighbridge.balance import ForceBalance
from weighbridge.constants import GRAVITY, INDEPENDENT
from weighbridge.estimators.judging import nothing
from weighbridge.estimators.rls import jackknife
from weighbridge.estimators.track import MassTrack
from weighbridge.estimators.unmeasured_grade import (
    FEWEST_ROWS,
    UnmeasuredGradeSettings,
    blocks_of,
    finish,
    settled_rows,
)
from weighbridge.signals import Floats
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.possible import positive

METHOD = "ritter-batch"


@dataclass(frozen=True, slots=True, kw_only=True)
class RitterSettings(UnmeasuredGradeSettings):
    """Settings of the fit and the gate; both noise levels are chosen.

    Attributes
    ----------
    accel_noise : of one row [m/s^2]
    grade_walk : change of the slope of the road in one second [rad]
    """

    accel_noise: float = 0.1
    grade_walk: float = 0.001

    def __post_init__(self) -> None:
        UnmeasuredGradeSettings.__post_init__(self)
        positive("accel_noise", self.accel_noise)
        positive("grade_walk", self.grade_walk)


def estimate(
    balance: ForceBalance, vehicle: Vehicle, settings: RitterSettings | None = None
) -> MassTrack:
    """Weigh by one least squares of inverse mass and grade of every row.

    It minimises the squared errors of the acceleration and the squared changes of the grade from
    row to row. The grade is eliminated, so that one ratio of sums remains.

    Parameters
    ----------
    balance, vehicle
    settings : the defaults when None

    References
    ----------
    Ritter, Widmer, Vetterli and Onder, Optimization-based online estimation of vehicle mass and
    road grade: theoretical analysis and experimental validation, Mechatronics 80, 2021, 102663.
    The paper was not at hand: cost and regularisation are ours, by its title and by the regularised
    least squares of Boyd and Vandenberghe, Convex Optimization, 2004, ch. 6.3.
    """
    settings = settings or RitterSettings()
    rows = settled_rows(balance, vehicle, settings)
    index = rows.taken
    if index.size < FEWEST_ROWS:
        return nothing(METHOD, balance, vehicle, rows.reason, 0, settings)
    force, accel = rows.force[index], rows.accel[index]
    rough = _without_slow(rows.time[index], force, settings)
    cross, power = rough * accel, rough * force

    def mass_of(part: slice, block: float) -> tuple[float, float, int]:
        inside = (index >= (part.start or 0)) & (index < part.stop)
        if not inside.any():
            return float("nan"), float("inf"), 0
        number = blocks_of(rows.time[index[inside]], block)
        return _inverse(jackknife(number, cross[inside], power[inside]))

    running = np.full(rows.time.size, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        running[index] = np.cumsum(power) / np.cumsum(cross)
    return finish(
        METHOD,
        balance,
        vehicle,
        rows,
        settings,
        running=running,
        running_std=np.full(running.size, mass_of(slice(0, running.size), INDEPENDENT)[1]),
        mass_of=mass_of,
    )


def _inverse(found: tuple[float, float, int]) -> tuple[float, float, int]:
    """Return mass, standard deviation and blocks of those of an inverse mass."""
    inverse, std, blocks = found
    if not inverse > 0.0:
        return float("nan"), float("inf"), blocks
    return 1.0 / inverse, std / inverse**2, blocks


def _without_slow(time: Floats, values: Floats, settings: RitterSettings) -> Floats:
    """Take off what a slowly changing grade can explain (m,)."""
    walk = (GRAVITY * settings.grade_walk) ** 2 * np.maximum(np.diff(time), 1e-3)
    stiff = settings.accel_noise**2 / walk
    banded = np.ones((2, values.size))
    banded[0, :-1] += stiff
    banded[0, 1:] += stiff
    banded[1, :-1] = -stiff
    return np.asarray(values - solveh_banded(banded, values, lower=True))
