"""The last scale of a torque: the drives of the calibration weigh what they are known to."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.calibration.doubted_motion import gain_std
from weighbridge.calibration.fitted import rebalanced
from weighbridge.calibration.problem import Problem
from weighbridge.estimators import joint, speed_torque_ekf
from weighbridge.estimators.considered import pinned, triangle
from weighbridge.estimators.joint.problem import UNMODELLED
from weighbridge.estimators.judging import USUAL_SLOPE
from weighbridge.estimators.track import MassTrack
from weighbridge.messages import refused
from weighbridge.signals import Floats
from weighbridge.vehicle.fits import JOINT, SPEED_TORQUE_EKF, Fit
from weighbridge.vehicle.model import Vehicle

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

STEPLESS_STD: Final = 0.035
"""How far masses of one vehicle with a stepless gearbox scatter from drive to drive by the losses
of belt and pump, relative [-]: eight drives of two vehicles of the second model, on other
roads than those of the calibration, scattered by 4.5 % where all else leaves 2 %."""


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

    The scale pins what the drives weigh in the mean; what is left open moves drives that use the
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

    def found(scale: float) -> tuple[float, float, Floats, int]:
        tried = replace(vehicle, torque=vehicle.torque.scaled(scale))
        ratios, stds = [], []
        moved: list[Floats] = []
        for balance, mass in zip(rebalanced(problem, tried), problem.masses, strict=True):
            track = weigher.estimate(balance, tried)
            if np.isfinite(track.mass) and track.sensitivity is not None:
                left = mass - weigher.burnt * float(balance.table.fuel_burnt[-1])
                ratios.append(track.mass / left)
                stds.append(track.bound_std / left)
                moved.append(track.sensitivity / left)
        if not ratios:
            raise refused("calibration.not_weighable")
        weight = 1.0 / np.square(stds)
        return (
            float(np.average(ratios, weights=weight)),
            float(1.0 / np.sqrt(np.mean(weight))),
            np.average(np.array(moved), axis=0, weights=weight),
            len(ratios),
        )

    scale, slope = 1.0, USUAL_SLOPE
    tried = [(scale, *found(scale))]
    for _ in range(SELF_ROUNDS):
        before, ratio = scale, tried[-1][1]
        if abs(ratio - 1.0) < SELF_CLOSE:
            break
        scale = float(np.clip(scale + (1.0 - ratio) / slope, *SCALES))
        if scale == before:
            break
        tried.append((scale, *found(scale)))
        # Levels of noise may fall into another optimum, and the mass jump with them.
        slope = float(np.clip((tried[-1][1] - ratio) / (scale - before), *SLOPES))
    scale, ratio, bound, direction, count = min(tried, key=lambda t: abs(t[1] - 1.0))
    between = problem.source.between(single_speed=vehicle.driveline.single_speed)
    if vehicle.driveline.stepless:
        between = math.hypot(between, STEPLESS_STD)
    each = math.hypot(TRANSFER_STD[1], between, UNMODELLED * bound)
    # Where the torque could not be fitted anew, what its own fit left open stays. The drive that
    # is weighed differs from others as those of the calibration do.
    known = math.hypot(
        TRANSFER_STD[0], between, vehicle.provenance.mass_scale_std or 0.0, ratio - 1.0
    )
    if cov is not None:
        known = math.hypot(known, gain_std(r.motion for r in problem.recordings))
    open_cov: tuple[float, ...] = ()
    if cov is not None:
        # The torque coefficients are scaled, and their errors with them.
        units = np.concatenate((np.full(len(cov) - 4, scale), np.ones(4)))
        open_cov = triangle(pinned(cov * np.outer(units, units), direction))
    return replace(
        vehicle,
        torque=vehicle.torque.scaled(scale),
        provenance=replace(
            vehicle.provenance,
            method=weigher.fit.name,
            fit_cov=open_cov,
            mass_scale_std=float(np.hypot(known, each / np.sqrt(count))),
        ),
    )
