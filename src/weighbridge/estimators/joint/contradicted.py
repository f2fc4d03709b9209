"""Does the joint estimator, which knows slow errors and noise, contradict another method's mass?"""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.estimators.track import MassTrack, Status
from weighbridge.limits import POSSIBLE
from weighbridge.messages import Problem

APART: Final = 0.10
"""Masses that differ by more contradict each other [-]: undamaged drives of ten minutes and more
had 0.05, and 0.08 where a cold engine made it less sure."""


def contradicted(track: MassTrack, joined: MassTrack) -> Problem | None:
    """Say that a mass cannot be so by the joint estimator; None if it may be.

    What a published method takes as exact (torque without dropouts, motion without noise, a level
    that stays) the joint estimator estimates beside the mass, from the same rows.

    Parameters
    ----------
    track : of the method
    joined : of the joint estimator; where it is the method's own, nothing is said
    """
    if track.method == joined.method:
        return None
    if joined.status is Status.INCONSISTENT:
        return Problem.of(
            "method.joint_refuses", reason="" if joined.reason is None else joined.reason.text
        )
    if joined.status is not Status.CONVERGED:
        return None
    apart = abs(float(np.log(track.mass / joined.mass)))
    std = float(np.hypot(track.std / track.mass, joined.std / joined.mass))
    if apart <= max(APART, POSSIBLE * std):
        return None
    return Problem.of(
        "method.contradicted", method=track.method, mass=track.mass, joint_mass=joined.mass
    )
