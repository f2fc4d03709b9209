"""One drive by every method."""

from __future__ import annotations

from typing import Final

from weighbridge.errors import WeighbridgeError
from weighbridge.estimators import SPEED_ALONE, MassTrack
from weighbridge.pipeline.weighing import (
    Weighing,
    fitted_for_another,
    weigh_balance,
    weigh_checked,
    without_mass,
)

METHODS: Final = ("joint", "rls", "robust-rls", "ekf", "hybrid", "speed-ekf")
"""Every method, in the order to show them."""


def compare(weighing: Weighing) -> tuple[Weighing, ...]:
    """Weigh a drive that has been weighed by one method by all the others too.

    The drive is not checked again, and forces and motion, which cost most, are
    taken over.

    Parameters
    ----------
    weighing : of the drive, by any method

    Returns
    -------
    (6,) in the order of `METHODS`; a method that could not be tried says why
    """
    found: dict[str, Weighing] = {weighing.method: weighing}
    for method in METHODS:
        if method not in found:
            joint = found.get("joint")
            found[method] = _by(weighing, method, joint.result if joint is not None else None)
    return tuple(found[method] for method in METHODS)


def _by(weighing: Weighing, method: str, joined: MassTrack | None) -> Weighing:
    """Weigh by another method."""
    drive, vehicle, done = weighing.drive, weighing.vehicle, weighing.result
    try:
        if done is None or {method, weighing.method} & SPEED_ALONE:
            return weigh_checked(drive, vehicle, method)
        warnings = fitted_for_another(vehicle, method)
        return weigh_balance(drive, vehicle, method, done.balance, warnings, joined)
    except WeighbridgeError as error:
        return without_mass(drive, vehicle, method, str(error))
