"""Estimators of the mass, one per file, each with its paper."""

from collections.abc import Callable
from typing import Final

from weighbridge.balance import ForceBalance
from weighbridge.estimators import ekf, hybrid, joint, rls, robust_rls, speed_ekf
from weighbridge.estimators.track import MassTrack, Segment, Status
from weighbridge.vehicle.model import Vehicle

Estimator = Callable[[ForceBalance, Vehicle], MassTrack]

ESTIMATORS: Final[dict[str, Estimator]] = {
    "ekf": ekf.estimate,
    "hybrid": hybrid.estimate,
    "joint": joint.estimate,
    "rls": rls.estimate,
    "robust-rls": robust_rls.estimate,
    "speed-ekf": speed_ekf.estimate,
}
"""Every method of `weighbridge weigh`, by its name."""

SPEED_ALONE: Final = frozenset({"speed-ekf"})
"""Methods that need a speed and no torque; they take a balance of
`weighbridge.balance.speed_balance`."""

__all__ = ["ESTIMATORS", "SPEED_ALONE", "Estimator", "MassTrack", "Segment", "Status"]
