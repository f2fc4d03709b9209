"""What a calibration fits, one record each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """One way to calibrate a vehicle.

    Attributes
    ----------
    name : in vehicle files and options: an estimator it is made for
    torque : it fits torque and road load; else a model of the speed alone
    refined : torque and road load are fitted by likelihood, the noise of the reading on its own
        side; else noise attenuates the torque, and the road load holds what else was not modelled
    by_speed : made without an accelerometer, whatever the drives hold
    """

    name: str
    torque: bool
    refined: bool
    by_speed: bool = False


JOINT: Final = Fit(name="joint", torque=True, refined=True)
RLS: Final = Fit(name="rls", torque=True, refined=False)
SPEED_TORQUE_EKF: Final = Fit(name="speed-torque-ekf", torque=True, refined=False, by_speed=True)
SPEED_EKF: Final = Fit(name="speed-ekf", torque=False, refined=False)

FITS: Final[dict[str, Fit]] = {fit.name: fit for fit in (JOINT, RLS, SPEED_TORQUE_EKF, SPEED_EKF)}
"""Every fit, by its name."""
