"""One drive by every method."""

from __future__ import annotations

from weighbridge.errors import WeighbridgeError
from weighbridge.estimators import ESTIMATORS, MassTrack
from weighbridge.pipeline.weighing import (
    DEFAULT_METHOD,
    Weighing,
    fitted_for_another,
    weigh_balance,
    weigh_checked,
    without_mass,
)


def compare(weighing: Weighing) -> tuple[Weighing, ...]:
    """Weigh a drive that has been weighed by one method by all the others too.

    The drive is not checked again, and forces and motion, which cost most, are
    taken over.

    Parameters
    ----------
    weighing : of the drive, by any method

    Returns
    -------
    One by each of `weighbridge.estimators.ESTIMATORS`, in their order; a method that could not be
    tried says why
    """
    found: dict[str, Weighing] = {weighing.method: weighing}
    for method in ESTIMATORS:
        if method not in found:
            joint = found.get(DEFAULT_METHOD)
            found[method] = _by(weighing, method, joint.result if joint is not None else None)
    return tuple(found[method] for method in ESTIMATORS)


def _by(weighing: Weighing, method: str, joined: MassTrack | None) -> Weighing:
    """Weigh by another method."""
    drive, vehicle, done = weighing.drive, weighing.vehicle, weighing.result
    try:
        if done is None or weighing.estimator.speed_alone or ESTIMATORS[method].speed_alone:
            return weigh_checked(drive, vehicle, method)
        warnings = fitted_for_another(vehicle, method)
        return weigh_balance(drive, vehicle, method, done.balance, warnings, joined)
    except WeighbridgeError as error:
        return without_mass(drive, vehicle, method, str(error))
