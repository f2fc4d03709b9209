"""Does the torque read otherwise at high torque than at low, beside what the calibration found?

A motor that is not in the reading, an assist, a new map of the engine and values that are held all
make one drive weigh differently by its high torques and by its low ones. Only an accelerometer
shows it: noise of a speed's rate and of heights looks alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.estimators.joint.problem import UNMODELLED, FilterInput
from weighbridge.limits import SURE
from weighbridge.messages import Problem
from weighbridge.signals import Drive, Floats
from weighbridge.vehicle import Vehicle, source_of

KNEE: Final = 0.55
"""Part of the highest torque above which it may read otherwise [-]: from lower ones on, a driver's
answer to hills and wind passes for a bend too."""

PRIOR_STD: Final = 0.5
"""Standard deviation of the part that is missing or too much, before the drive has shown [-]."""

BENT: Final = 0.14
"""A larger part that is missing contradicts the calibration [-]: undamaged drives of three
simulators, in cars, vans, trucks and buses, had 0.07 at most."""

TOO_MUCH: Final = 0.35
"""The same of a part that is too much [-]: gusts and hills that a gentle driver answers look alike,
and undamaged drives had 0.23, or 0.33 hardly known."""


@dataclass(frozen=True, slots=True)
class TorqueBend:
    """What is missing of the torque above a knee.

    Attributes
    ----------
    part : of the torque above it that the reading does not show, at least [-]; negative where it
        shows more
    std : its standard deviation [-]
    knee : [N m] at the engine or motor
    """

    part: float
    std: float
    knee: float


def above_knee(torque: Floats, gain: Floats, knee: float) -> Floats:
    """Force at the wheels of the torque above a knee (n,) [N].

    Parameters
    ----------
    torque : (n,) [N m]
    gain : (n,) traction force over torque [1/m]
    knee : [N m]
    """
    return np.asarray(gain * np.maximum(0.0, torque - knee))


def torque_bend(given: FilterInput, force: Floats, gain: Floats, knee: float) -> TorqueBend:
    """Estimate the bend beside mass and slow errors, by what torque and motion both show.

    Noise of the motion, or torque that is sampled seldom, makes a bend where rows are high by the
    torque; noise of the torque makes the opposite one where they are high by the motion. The truth
    lies between the two.

    Parameters
    ----------
    given : what the filter was given
    force : (m,) means of `above_knee` over the windows, by the torque [N]
    gain : (m,) traction force over torque [1/m]
    knee : [N m]

    References
    ----------
    Bounds by regression in both directions: Frisch, Statistical Confluence Analysis, 1934;
    Klepper and Leamer, Econometrica 52, 1984.
    """
    by_motion = np.maximum(0.0, given.traction - gain * knee)
    one, other = _along(given, force, knee), _along(given, by_motion, knee)
    if one.part * other.part <= 0.0:
        return TorqueBend(0.0, max(one.std, other.std), knee)
    return min(one, other, key=lambda bend: abs(bend.part))


def _along(given: FilterInput, force: Floats, knee: float) -> TorqueBend:
    """Estimate the bend as one more state of the filter."""
    state = given.with_term(-force, PRIOR_STD).end()
    return TorqueBend(float(state.x[-1]), UNMODELLED * float(np.sqrt(state.cov[-1, -1])), knee)


def bent(bend: TorqueBend | None, drive: Drive, vehicle: Vehicle) -> Problem | None:
    """Say that the torque bends otherwise than in the calibration, None if not.

    Only a refined fit has found the bends that the reading always has. A torque that a person
    vouches for is not doubted.

    Parameters
    ----------
    bend : None where a method does not say
    drive, vehicle
    """
    fit, source = vehicle.provenance.fit, source_of(vehicle)
    if bend is None or fit is None or not fit.refined:
        return None
    if set(source.found(drive)) & set(drive.info.trusted):
        return None
    least = BENT if bend.part > 0.0 else TOO_MUCH
    if abs(bend.part) <= max(least, SURE * bend.std):
        return None
    less = "less" if bend.part > 0.0 else "more"
    return Problem.of(
        "torque.bent", knee=bend.knee, source=source.title, share=100.0 * abs(bend.part), less=less
    )
