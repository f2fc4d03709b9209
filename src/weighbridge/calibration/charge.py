"""With which power of the air's density the torque at one load grows, by drives of known mass."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from weighbridge.calibration.fitted import rebalanced
from weighbridge.calibration.problem import Problem
from weighbridge.calibration.recording import Recording
from weighbridge.estimators import joint
from weighbridge.estimators.judging import USUAL_SLOPE
from weighbridge.vehicle import Vehicle, identify_air

APART: Final = 0.04
"""Charges of the drives that differ by less show nothing [-]: 350 m of height."""

BETWEEN_STD: Final = 0.015
"""Of a drive's mass by all else, relative [-]; see `TorqueSource.transfer_std`."""


def in_their_air(problem: Problem, vehicle: Vehicle) -> Problem | None:
    """See the drives with the power of the charge by which their masses agree.

    Parameters
    ----------
    problem
    vehicle : as fitted to it

    Returns
    -------
    Problem
        None where the drives were in much the same air.
    """
    exponent, std = vehicle.torque.in_thin_air
    if vehicle.torque.charge is None or std == 0.0:
        return None
    off, denser = [], []
    for balance, recording in zip(rebalanced(problem, vehicle), problem.recordings, strict=True):
        track = joint.estimate(balance, vehicle, load_changes=False)
        if track.mass > 0.0:
            altitude = recording.motion.altitude
            charge = identify_air(recording.drive, altitude).charge(altitude)
            left = recording.mass - float(balance.table.fuel_burnt[-1])
            off.append(np.log(track.mass / left))
            denser.append(np.mean(np.log(charge / vehicle.torque.charge)))
    if len(off) < 2 or np.ptp(denser) < APART:
        return None
    x = USUAL_SLOPE * (np.array(denser) - np.mean(denser))
    reported = float(x @ x) / BETWEEN_STD**2
    # Of the power in use, less that of the vehicle.
    surplus = float(x @ np.array(off)) / BETWEEN_STD**2 / (reported + 1.0 / std**2)
    torque = replace(
        problem.draft.torque,
        charge_exponent=float(np.clip(exponent - surplus, -1.0, 2.0)),
        charge_exponent_std=float(1.0 / np.sqrt(reported + 1.0 / std**2)),
    )
    draft = replace(problem.draft, torque=torque)
    return replace(
        problem,
        draft=draft,
        recordings=tuple(
            Recording.of(r.drive, r.motion, r.mass, draft, problem.source)
            for r in problem.recordings
        ),
    )
