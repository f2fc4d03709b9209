"""What every estimator returns."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.balance import ForceBalance, Reason
from weighbridge.messages import Problem
from weighbridge.signals import Bools, Floats

if TYPE_CHECKING:
    from weighbridge.estimators.joint.bend import TorqueBend
    from weighbridge.estimators.joint.possible import PossibleChange
    from weighbridge.estimators.joint.problem import FilterInput, JointSizes
    from weighbridge.estimators.joint.slow_errors import SlowErrors
    from weighbridge.estimators.joint.switched import Switched


APART: Final = 3.0
"""Standard deviations of the difference by which two answers contradict each other [-]."""


class Status(StrEnum):
    """How a weighing ended."""

    CONVERGED = "converged"
    NOT_EXCITED = "not_excited"
    INCONSISTENT = "inconsistent"
    MISSING_SIGNALS = "missing_signals"


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """Mass between two stops, where load can change.

    Attributes
    ----------
    start, end : [s]
    mass, std : [kg]; NaN where the segment is too poor
    """

    start: float
    end: float
    mass: float
    std: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MassTrack:
    """The mass over time and the final answer of one estimator.

    Attributes
    ----------
    method : name of the estimator
    balance : what it was made from; the rows are those of its force table
    running_mass, running_std : (n,) as the rows until then have it; motion and levels of noise
        are those of the whole drive [kg]
    residual : (n,) measured force minus the model's at the final mass [N];
        NaN where a row was not used
    row_reason : (n,) `Reason` why a row was not used
    mass, std : final answer and its standard deviation [kg]
    systematic_std : part of ``std`` that vehicle file and equipment leave, whatever the drive
        [kg]; NaN where a method does not say
    doubt : part of ``std`` by what else may explain the drive, relative to the mass [-]
    degrees_of_freedom : behind ``std``, for the interval; infinite if known
    bound_std : Cramér-Rao bound of this drive [kg]
    converged_at : when the running mass stays within 5 % of the final answer
        for good [s]; NaN if never
    status : and ``reason``, None where it is converged
    segments : mass between stops
    sensitivity : (k,) how far one unit of each parameter of the calibration moves the mass
        [kg per unit]; None where a method does not say
    shape_sensitivity : (k,) how far an error of the torque at each of the knots of
        `weighbridge.estimators.torque_shape` moves it [kg]; None where a method does not say
    slow_errors : what was estimated beside the mass; None where a method does not
    filter_input : what the filter of the joint estimator was given; None of other methods
    possible_change : of the load that was not found and may have been; None of other methods
    bend : of the torque's reading; None of other methods and without an accelerometer
    switched : accessories that go on and off; None where nothing shows them, and of other methods
    sizes : of noise and states, by which the joint estimator runs forward; None of other methods
    """

    method: str
    balance: ForceBalance
    running_mass: Floats
    running_std: Floats
    residual: Floats
    row_reason: NDArray[np.uint8]
    mass: float
    std: float
    degrees_of_freedom: float
    bound_std: float
    converged_at: float
    status: Status
    reason: Problem | None
    segments: tuple[Segment, ...]
    systematic_std: float = math.nan
    doubt: float = 0.0
    sensitivity: Floats | None = None
    shape_sensitivity: Floats | None = None
    slow_errors: SlowErrors | None = None
    filter_input: FilterInput | None = None
    possible_change: PossibleChange | None = None
    bend: TorqueBend | None = None
    switched: Switched | None = None
    sizes: JointSizes | None = None

    def doubted(self, share: float) -> MassTrack:
        """Return the track with more uncertainty in all its masses.

        Parameters
        ----------
        share : its standard deviation, relative to the mass [-]
        """
        if not share > 0.0:
            return self
        more = share * self.mass
        return replace(
            self,
            std=float(np.hypot(self.std, more)),
            systematic_std=float(np.hypot(self.systematic_std, more)),
            doubt=math.hypot(self.doubt, share),
            running_std=np.hypot(self.running_std, share * self.running_mass),
            segments=tuple(
                replace(s, std=float(np.hypot(s.std, share * s.mass))) for s in self.segments
            ),
        )

    def joined(self, other: MassTrack, correlation: float) -> MassTrack:
        """Return the track with the mean of two answers by their uncertainty in all its masses.

        The interval stays that of the surer one: how much surer both are is known too little.

        Parameters
        ----------
        other : a track of the same drive by other sensors
        correlation : of the errors beside what else may explain the drive, which is in both [-]

        Returns
        -------
        This track or the other, unchanged, where the mean is surer without the second one; of two
        that are `APART` the surer one

        References
        ----------
        Best linear unbiased mean of two: Aitken, Proc. Royal Society of Edinburgh 55, 1936.
        """
        a, b = self.own_std, other.own_std
        common = correlation * a * b
        variance = a**2 + b**2 - 2.0 * common
        if (self.mass - other.mass) ** 2 >= APART**2 * variance:
            return other if b < a else self
        share = (a**2 - common) / variance
        if not 0.0 < share < 1.0:
            return other if share >= 1.0 else self
        mass, std = (1.0 - share) * self.mass + share * other.mass, min(self.std, other.std)
        moved, surer = mass / self.mass, std / self.std
        return replace(
            self,
            mass=mass,
            std=std,
            systematic_std=surer * self.systematic_std,
            running_mass=moved * self.running_mass,
            running_std=surer * self.running_std,
            segments=tuple(
                replace(s, mass=moved * s.mass, std=surer * s.std) for s in self.segments
            ),
        )

    @property
    def own_std(self) -> float:
        """Standard deviation of the mass without what else may explain the drive [kg]."""
        return math.sqrt(max(self.std**2 - (self.doubt * self.mass) ** 2, 0.0))

    @property
    def time(self) -> Floats:
        """(n,) instants of the rows [s]."""
        return self.balance.table.time

    @property
    def used(self) -> Bools:
        """(n,) rows the mass was made from."""
        return np.asarray(self.row_reason == Reason.USED)
