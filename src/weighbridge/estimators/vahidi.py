"""Least squares of mass and grade with two forgetting factors (Vahidi et al. 2005)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.constants import GRAVITY
from weighbridge.errors import ConfigError
from weighbridge.estimators.judging import nothing
from weighbridge.estimators.track import MassTrack
from weighbridge.estimators.unmeasured_grade import (
    FEWEST_ROWS,
    UnmeasuredGradeSettings,
    blocks_of,
    finish,
    settled_rows,
)
from weighbridge.kernels import multiple_forgetting as kernel
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.possible import positive

METHOD = "vahidi-rls"

MEDIAN_STD = 1.25
"""Standard deviation of a median over that of a mean [-], of normal values (Kenney and Keeping,
Mathematics of Statistics, 1962, ch. 7)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VahidiSettings(UnmeasuredGradeSettings):
    """Settings of filter and gate.

    Attributes
    ----------
    mass_forgetting, grade_forgetting : weight that the past keeps at each row [-]. Chosen on six
        simulated trucks at 20 rows per second, with ``settle`` and ``batch``: nine others came out
        2.2 % off (RMS), 3.5 % at most, as the paper claims 5 %
    batch : first rows, fitted by least squares with one grade, from which it starts [s]; chosen
    """

    mass_forgetting: float = 0.98
    grade_forgetting: float = 0.8
    batch: float = 5.0

    def __post_init__(self) -> None:
        UnmeasuredGradeSettings.__post_init__(self)
        for name in ("mass_forgetting", "grade_forgetting"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise ConfigError(f"{name} must be in (0, 1], got {getattr(self, name)}")
        positive("batch", self.batch)


def estimate(
    balance: ForceBalance, vehicle: Vehicle, settings: VahidiSettings | None = None
) -> MassTrack:
    """Weigh by two joined recursions, for the mass and for a grade that changes at each row.

    Inverse mass and sine of the grade are estimated from force and acceleration, without a
    measured grade. Rolling resistance is part of the grade. The running mass is the paper's; the
    final answer is its median, and its standard deviation is from the medians of minutes.

    Parameters
    ----------
    balance, vehicle
    settings : the defaults when None

    References
    ----------
    Vahidi, Stefanopoulou and Peng, Recursive least squares with forgetting for online estimation of
    vehicle mass and road grade: theory and experiments, Vehicle System Dynamics 43(1), 2005,
    31-55. Its abstract states a mass within 5 % where inputs are persistently exciting.
    """
    settings = settings or VahidiSettings()
    rows = settled_rows(balance, vehicle, settings)
    index = rows.taken
    apart = np.median(np.diff(rows.time)) if rows.time.size > 1 else 1.0
    first = index[: max(FEWEST_ROWS, round(settings.batch / apart))]
    if index.size <= first.size:
        return nothing(METHOD, balance, vehicle, rows.reason, 0, settings)
    # In thousands of newtons: both columns are then of one size.
    design = np.column_stack([1e-3 * rows.force[first], np.full(first.size, -GRAVITY)])
    information = design.T @ design
    theta = np.linalg.lstsq(design, rows.accel[first], rcond=None)[0]
    gain = np.diag(np.linalg.pinv(information))
    scale = np.array([1e-3, 1.0])
    rest = index[first.size :]
    _, found = kernel.run(
        kernel.ForgettingState(theta * scale, gain * scale**2),
        rows.force[rest],
        GRAVITY,
        rows.accel[rest],
        np.array([settings.mass_forgetting, settings.grade_forgetting]),
    )
    estimates = np.full(rows.time.size, np.nan)
    with np.errstate(divide="ignore"):
        estimates[rest] = 1.0 / found[:, 0]

    def mass_of(part: slice, block: float) -> tuple[float, float, int]:
        known = np.isfinite(estimates[part])
        masses, number = estimates[part][known], blocks_of(rows.time[part], block)[known]
        if not masses.size:
            return float("nan"), float("inf"), 0
        medians = np.array([np.median(masses[number == k]) for k in np.unique(number)])
        n = medians.size
        std = MEDIAN_STD * float(np.std(medians, ddof=1)) / n**0.5 if n > 2 else float("inf")
        return float(np.median(masses)), std, int(n)

    return finish(
        METHOD,
        balance,
        vehicle,
        rows,
        settings,
        running=estimates,
        running_std=np.full(estimates.size, np.nanstd(estimates)),
        mass_of=mass_of,
    )
