"""The last scale of a torque: the drives of the calibration weigh what they are known to."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from weighbridge.balance import ForceBalance, Reason
from weighbridge.calibration.fitted import rebalanced
from weighbridge.calibration.problem import Problem
from weighbridge.calibration.uncertain_motion import gain_std
from weighbridge.estimators import joint, speed_torque_ekf
from weighbridge.estimators.considered import fit_consider_std, pinned, triangle
from weighbridge.estimators.joint.problem import UNMODELLED
from weighbridge.estimators.judging import USUAL_SLOPE
from weighbridge.estimators.torque_shape import shape_std
from weighbridge.estimators.track import MassTrack
from weighbridge.messages import refused
from weighbridge.signals import Floats
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.fits import JOINT, SPEED_TORQUE_EKF, Fit

TRANSFER_STD: Final = (0.002, 0.003)
"""What a joint calibration loses on other drives, relative [-]: always, and from each
drive of the calibration anew. Simulated, sixteen vehicles, calibrated by one or three
ordinary drives, six others weighed with each; sensors whose scale is 0.3 % off from drive
to drive are most of it."""

SLOPES: Final = (0.8, 2.5)
"""The same at least and at most [-]."""

SCALES: Final = (0.5, 2.0)
"""A torque that was fitted is scaled by so much at least and at most [-]."""

SELF_CLOSE: Final = 5e-4
"""The calibration's own drives are weighed so near to their masses, in the mean [-]."""

SELF_ROUNDS: Final = 4
"""Rounds of scaling and weighing again, at most."""

PARTS: Final = 3
"""Parts of each drive of a calibration that are weighed on their own, to see how they scatter."""

FREEDOM: Final = 6.0
"""Degrees of freedom with which the scatter of such parts is known before a calibration has shown
it: the likeliest are 6.8, of 521 masses of 32 vehicles of two simulators through four kinds of
equipment."""

STEPLESS_STD: Final = 0.010
"""How far masses of one vehicle with a stepless gearbox scatter from drive to drive by the losses
of belt and pump, relative [-]: 29 drives of ten vehicles of two simulators on roads of their own
have half the squared error that is reported with it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Weigher:
    """How the drives of a calibration are weighed.

    Attributes
    ----------
    fit : that it is for
    estimate : makes a track, with its ``sensitivity``, of a balance and a vehicle
    burnt : part of the fuel that is gone at the mass it gives [-]
    """

    fit: Fit
    estimate: Callable[[ForceBalance, Vehicle], MassTrack]
    burnt: float


def _unchanged(balance: ForceBalance, vehicle: Vehicle) -> MassTrack:
    """Weigh by joint; the mass is known, and does not change at stops."""
    return joint.estimate(balance, vehicle, load_changes=False)


BY_JOINT: Final = Weigher(fit=JOINT, estimate=_unchanged, burnt=1.0)

BY_SPEED_TORQUE: Final = Weigher(
    fit=SPEED_TORQUE_EKF, estimate=speed_torque_ekf.estimate, burnt=0.5
)


def self_weighed(
    problem: Problem, vehicle: Vehicle, cov: Floats | None, weigher: Weigher
) -> Vehicle:
    """Scale the torque so that the drives weigh what they are known to.

    The scale pins what the drives weigh in the mean; what is uncertain moves drives that use the
    torque otherwise.

    Parameters
    ----------
    problem, vehicle
    cov : of the fit, if there was one
    weigher : the method that the file is made for

    Raises
    ------
    DriveError
        No drive can be weighed.
    """
    tables = [balance.table for balance in rebalanced(problem, vehicle)]
    highest = max(float(np.max(t.torque[t.usable], initial=0.0)) for t in tables)
    vehicle = replace(
        vehicle,
        provenance=replace(vehicle.provenance, highest_torque=highest or None, torque_use=()),
    )

    def found(scale: float) -> _Found:
        tried = replace(vehicle, torque=vehicle.torque.scaled(scale))
        ratios, stds = [], []
        moved: list[Floats] = []
        use: list[Floats] = []
        for balance, mass in zip(rebalanced(problem, tried), problem.masses, strict=True):
            track = weigher.estimate(balance, tried)
            if np.isfinite(track.mass) and track.sensitivity is not None:
                left = mass - weigher.burnt * float(balance.table.fuel_burnt[-1])
                ratios.append(track.mass / left)
                stds.append(track.bound_std / left)
                moved.append(track.sensitivity / left)
                if track.shape_sensitivity is not None:
                    use.append(track.shape_sensitivity / left)
        if not ratios:
            raise refused("calibration.not_weighable")
        weight = 1.0 / np.square(stds)
        return _Found(
            scale=scale,
            ratio=float(np.average(ratios, weights=weight)),
            bound=float(1.0 / np.sqrt(np.mean(weight))),
            moved=np.average(np.array(moved), axis=0, weights=weight),
            use=np.average(np.array(use), axis=0, weights=weight) if use else np.empty(0),
            drives=len(ratios),
        )

    scale, slope = 1.0, USUAL_SLOPE
    tried = [found(scale)]
    for _ in range(SELF_ROUNDS):
        before, ratio = scale, tried[-1].ratio
        if abs(ratio - 1.0) < SELF_CLOSE:
            break
        scale = float(np.clip(scale + (1.0 - ratio) / slope, *SCALES))
        if scale == before:
            break
        tried.append(found(scale))
        # Levels of noise may fall into another optimum, and the mass jump with them.
        slope = float(np.clip((tried[-1].ratio - ratio) / (scale - before), *SLOPES))
    best = min(tried, key=lambda t: abs(t.ratio - 1.0))
    open_cov: tuple[float, ...] = ()
    if cov is not None:
        # The torque coefficients are scaled, and their errors with them.
        units = np.concatenate((np.full(len(cov) - 4, best.scale), np.ones(4)))
        open_cov = triangle(pinned(cov * np.outer(units, units), best.moved))
    done = replace(
        vehicle,
        torque=vehicle.torque.scaled(best.scale),
        provenance=replace(
            vehicle.provenance,
            method=weigher.fit.name,
            fit_cov=open_cov,
            torque_use=tuple(float(v) for v in best.use),
        ),
    )
    factor = part_scatter(problem, done) if weigher.fit is JOINT else None
    between = math.hypot(
        problem.source.between(single_speed=vehicle.driveline.single_speed),
        vehicle.of_class.scatter_std,
    )
    if vehicle.driveline.stepless:
        between = math.hypot(between, STEPLESS_STD)
    each = math.hypot(TRANSFER_STD[1], between, (factor or UNMODELLED) * best.bound)
    # Where the torque could not be fitted anew, what its own fit leaves uncertain stays. The drive
    # that is weighed differs from others as those of the calibration do.
    known = math.hypot(
        TRANSFER_STD[0], between, vehicle.provenance.mass_scale_std or 0.0, best.ratio - 1.0
    )
    if cov is not None:
        known = math.hypot(known, gain_std(r.motion for r in problem.recordings))
    left = float(np.hypot(known, each / np.sqrt(best.drives)))
    made = replace(done.provenance, std_factor=factor, mass_scale_std=left)
    return replace(done, provenance=made)


def part_scatter(problem: Problem, vehicle: Vehicle) -> float:
    """How parts of a calibration's drives scatter, over what the filter says of it [-].

    Each drive is weighed in `PARTS` of as many rows.

    Parameters
    ----------
    problem
    vehicle : as calibrated

    References
    ----------
    Scaled inverse chi-squared distribution of a variance: Gelman et al., Bayesian Data Analysis,
    2013, eq. 2.12.
    """
    ratios, variances = [], []
    for balance, mass in zip(rebalanced(problem, vehicle), problem.masses, strict=True):
        table = balance.table
        number = np.cumsum(table.usable) * PARTS // (np.count_nonzero(table.usable) + 1)
        left = mass - float(table.fuel_burnt[-1])
        for part in range(PARTS):
            reason = np.where(table.usable & (number != part), Reason.TOO_SHORT, table.reason)
            one = replace(table, reason=reason.astype(np.uint8))
            track = joint.estimate(replace(balance, table=one), vehicle, load_changes=False)
            if not np.isfinite(track.mass) or track.shape_sensitivity is None:
                continue
            assert track.sensitivity is not None
            fit = fit_consider_std(vehicle, track.sensitivity, left)
            shape = shape_std(track.shape_sensitivity / left, vehicle.provenance.torque_use)
            ratios.append(track.mass / left)
            variances.append((track.bound_std / left) ** 2 + fit**2 + shape**2)
    squares, freedom = FREEDOM * UNMODELLED**2, FREEDOM
    if len(ratios) > 1:
        off = np.array(ratios) - np.average(ratios, weights=1.0 / np.array(variances))
        squares += float(np.sum(off**2 / variances))
        freedom += len(ratios) - 1
    return math.sqrt(squares / freedom)


class _Found(NamedTuple):
    """What the drives weigh with a torque of some scale.

    Attributes
    ----------
    scale : of the torque [-]
    ratio : weighed over known mass, mean of the drives [-]
    bound : standard deviation of one ratio by the filter [-]
    moved : (k,) of `MassTrack.sensitivity`, relative, mean of the drives
    use : (k,) of `MassTrack.shape_sensitivity`, relative, mean of the drives; (0,) where the method
        does not say
    drives : that were weighed
    """

    scale: float
    ratio: float
    bound: float
    moved: Floats
    use: Floats
    drives: int
