"""Does the joint estimator, which knows slow errors and noise, contradict another method's mass?"""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.estimators.track import MassTrack, Status

APART: Final = 0.10
"""Masses that differ by more contradict each other [-]: undamaged drives of ten minutes and more
had 0.05, and 0.08 where a cold engine made it less sure."""

SURE: Final = 2.0
"""Standard deviations of both by which they have to differ as well [-]."""


def contradicted(track: MassTrack, joined: MassTrack) -> str:
    """Say that a mass cannot be so by the joint estimator; empty if it may be.

    What a published method takes as exact (torque without dropouts, motion without noise, a level
    that stays) the joint estimator estimates beside the mass, from the same rows.

    Parameters
    ----------
    track : of the method
    joined : of the joint estimator; where it is the method's own, nothing is said
    """
    if track.method == joined.method:
        return ""
    if joined.status is Status.INCONSISTENT:
        return f"by joint the same rows make no mass that can be: {joined.reason}"
    if joined.status is not Status.CONVERGED:
        return ""
    apart = abs(float(np.log(track.mass / joined.mass)))
    std = float(np.hypot(track.std / track.mass, joined.std / joined.mass))
    if apart <= max(APART, SURE * std):
        return ""
    return (
        f"{track.method} makes {track.mass:.0f} kg of rows of which joint makes {joined.mass:.0f} "
        "kg: dropouts or noise of torque or accelerometer, or a torque whose level changes, do not "
        f"suit {track.method}; weigh by joint"
    )
