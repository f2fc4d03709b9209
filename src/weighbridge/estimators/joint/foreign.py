"""Is the vehicle file another vehicle's? Its road load, stretched to fit, shows it."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.estimators.joint.terms import TERMS, Sizes
from weighbridge.estimators.track import MassTrack
from weighbridge.messages import Problem
from weighbridge.vehicle import Vehicle

FARTHEST: Final = 8.0
"""Root of the summed squares of slow resistance and drag area, each over its standard deviation
before the drive, above which the file is another vehicle's [-]: with their own files, drives of
simulated and foreign vehicles had 0.6 in the middle and 2.2 at most; with those of others, torque
from load and gearings alike, 0.9 to 7, half of them above 2.6; with a file from one drive in
another wind, up to 7.4."""

DOUBTFUL: Final = 4.0
"""The same, above which a warning says so [-]."""


def stretched(track: MassTrack, vehicle: Vehicle) -> float:
    """How far the drive takes slow resistance and drag area from the vehicle file [-].

    A grade that is off by a constant, as it may be without GNSS, looks like a resistance.

    Parameters
    ----------
    track : of the joint estimator
    vehicle
    """
    slow = track.slow_errors
    if slow is None or not (np.isfinite(track.mass) and track.mass > 0.0):
        return 0.0
    sizes = Sizes(track.mass, 0.0)
    far = 0.0
    if "resistance" in slow.found:
        grade = GRAVITY * track.mass * float(np.median(track.balance.motion.grade_std))
        std = float(np.hypot(TERMS["resistance"].std(vehicle, sizes), grade))
        far = float(np.sqrt(np.mean(slow.found["resistance"].value ** 2))) / std
    if "drag_area" in slow.found and (std := TERMS["drag_area"].std(vehicle, sizes)) > 0.0:
        far = math.hypot(far, slow.constants["drag_area"][0] / std)
    return far


def of_another(vehicle: Vehicle, track: MassTrack) -> tuple[bool, Problem | None]:
    """Say why the vehicle file is another vehicle's; nothing if it may be its own.

    Only files of a refined fit can show: a data sheet leaves more open, and fits
    for others put their road load elsewhere.

    Parameters
    ----------
    vehicle
    track : of the joint estimator

    Returns
    -------
    refused : whether there is no mass for it
    doubt : None where nothing is uncertain
    """
    fit = vehicle.provenance.fit
    if fit is None or not fit.refined:
        return False, None
    far = stretched(track, vehicle)
    if far <= DOUBTFUL:
        return False, None
    return far > FARTHEST, Problem.of("vehicle.foreign", far=far, vehicle=vehicle.name)
