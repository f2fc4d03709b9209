"""What the reproduction of Galvão et al. comes to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.calibration.speed_fit import SpeedRows
from weighbridge.estimators.speed_ekf import FilterRun
from weighbridge.papers.galvao_bounds import SpeedSays
from weighbridge.papers.galvao_torque import TorqueTrial
from weighbridge.signals import Floats
from weighbridge.vehicle import Vehicle

LAST: Final = 200
"""Samples over which Table 2 gives the band."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Test:
    """One of the three drives.

    Attributes
    ----------
    number : 1 to 3
    mass : true mean [kg]
    balance : windows of the drive
    rows : the same with the true grade
    predicted : (n,) speed of the model one window ahead, with the true grade [m/s]
    ours, printed : runs of the filter started at the calibration's mass with a
        constant mass, and with start and noise as printed
    """

    number: int
    mass: float
    balance: ForceBalance
    rows: SpeedRows
    predicted: Floats
    ours: FilterRun
    printed: FilterRun

    def error(self, run: FilterRun) -> float:
        """Relative error of the mean mass of a run [-]."""
        return run.answer / self.mass - 1.0

    @property
    def superimposed(self) -> tuple[float, float]:
        """How far the model's speed is off, RMS [m/s], and the part of the speed it explains."""
        known = np.isfinite(self.predicted)
        left = (self.rows.speed - self.predicted)[known]
        part = 1.0 - np.var(left) / np.var(self.rows.speed[known])
        return float(np.sqrt(np.mean(left**2))), float(part)

    def band(self, run: FilterRun) -> float:
        """Widest half of the 95 % band over the last samples used [kg]."""
        return float(np.max(1.96 * run.std[run.used][-LAST:]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """Drives that the paper did not try, of one kind.

    Attributes
    ----------
    kind : what is different
    masses : true masses [kg]
    answers : of our settings [kg]
    pinned : of the filter that starts from nothing and knows the road to be level [kg]
    """

    kind: str
    masses: Floats
    answers: Floats
    pinned: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduction:
    """All the figures of the study.

    Attributes
    ----------
    vehicle : with the speed model fitted to the first drive
    r_squared : of the fit
    tests : the three drives
    starts : masses the filter is started from, and where the second drive ends then, by ours and
        with noise as printed [kg]
    stated : masses the calibration is given, and what the second drive weighs then [kg], and R² of
        the fit
    trials : drives the paper did not try
    torque : the tests with the torque recorded
    says : what speed alone says in the tests
    """

    vehicle: Vehicle
    r_squared: float
    tests: tuple[Test, ...]
    starts: tuple[tuple[float, float, float], ...]
    stated: tuple[tuple[float, float, float], ...]
    trials: tuple[Trial, ...]
    torque: TorqueTrial
    says: SpeedSays
