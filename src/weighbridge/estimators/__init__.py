"""Estimators of the mass, one per file, each with its paper."""

from collections.abc import Callable
from typing import Final

from weighbridge.balance import ForceBalance
from weighbridge.estimators import joint, rls
from weighbridge.estimators.track import MassTrack, Segment, Status
from weighbridge.vehicle.model import Vehicle

Estimator = Callable[[ForceBalance, Vehicle], MassTrack]

ESTIMATORS: Final[dict[str, Estimator]] = {
    "joint": joint.estimate,
    "rls": rls.estimate,
}
"""Every method of `weighbridge weigh`, by its name."""

__all__ = ["ESTIMATORS", "Estimator", "MassTrack", "Segment", "Status"]
