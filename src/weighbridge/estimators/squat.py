"""What an accelerometer that leans with the body leaves in the mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.constants import GRAVITY
from weighbridge.navigation.motion import BY_SPEED, Motion, with_squat
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle.model import Vehicle

SQUAT: Final = (0.0035, 0.0025)
"""Pitch of the body per acceleration of a vehicle of which nothing is known, and its standard
deviation [rad per m/s^2]: four recorded cars had 0.0024 to 0.0051, and stiff trucks lean less."""


DRIVE_STD: Final = 0.0009
"""Standard deviation of the squat that one drive shows, beside what its navigation says
[rad per m/s^2]: heights by GNSS err together for minutes, and hills that happen to go with
acceleration pass for squat. Of 16 drives of two vehicles of another simulator half an hour
long the squat found was off by 0.0009, where the navigation says 0.0003."""

LOADED_STD: Final = 0.0003
"""By how much the squat of a vehicle changes with its load [rad per m/s^2]."""


def pooled(motions: Sequence[Motion]) -> tuple[float, float] | None:
    """Squat of a vehicle from several drives and its standard deviation; None where none shows."""
    found = [
        (m.squat, float(np.hypot(m.squat_std or 0.0, DRIVE_STD)))
        for m in motions
        if m.squat is not None and m.source not in BY_SPEED
    ]
    if not found:
        return None
    # What squat is usual counts as another drive.
    value, std = np.array([*found, SQUAT]).T
    weight = 1.0 / std**2
    return float(np.average(value, weights=weight)), float(1.0 / np.sqrt(np.sum(weight)))


def of_vehicle(motion: Motion, vehicle: Vehicle) -> Motion:
    """Hold the squat with which the torque was calibrated.

    What a calibration gets wrong of it is in its torque as well and cancels; what a drive
    gets wrong does not.
    """
    mounting = vehicle.mounting
    if mounting is None or mounting.squat is None or not vehicle.provenance.torque_fitted:
        return motion
    return with_squat(motion, mounting.squat, LOADED_STD)


@dataclass(frozen=True, slots=True)
class Lean:
    """Squat that is still in the specific force.

    Attributes
    ----------
    squat : pitch per acceleration to take out; negative to put back [rad per m/s^2]
    std : what stays unknown of it
    """

    squat: float
    std: float

    def leaned(self, accel: Floats) -> Floats:
        """Specific force that the lean adds to an acceleration (n,) [m/s^2]."""
        return GRAVITY * self.squat * accel

    def relative_std(self, accel: Floats, phi: Floats, used: Bools) -> float:
        """Relative standard deviation of the mass [-]; hills, which do not lean, weigh without.

        Parameters
        ----------
        accel, phi : (n,) acceleration and regressor of the mass [m/s^2]
        used : (n,)
        """
        if self.std <= 0.0 or np.count_nonzero(used) < 2:
            return 0.0
        weight = phi[used] - phi[used].mean()
        share = float(weight @ accel[used]) / max(float(weight @ weight), 1e-9)
        return GRAVITY * self.std * float(np.clip(share, 0.0, 1.0))


def lean(balance: ForceBalance, vehicle: Vehicle) -> Lean:
    """Find what squat the rows and the torque of the vehicle do not have in common.

    An accelerometer that leans by k per acceleration reads it 1 + g k times too
    large. The navigation takes that out where the drive shows k. A torque that
    was calibrated against such readings has the factor in it, and must meet it
    again; one of a data sheet, or calibrated by speed, must not.
    """
    motion, made, mounting = balance.motion, vehicle.provenance, vehicle.mounting
    given = mounting.squat if mounting is not None else None
    given_std = (mounting.squat_std or 0.0) if mounting is not None else 0.0
    found_std = motion.squat_std or 0.0
    if made.torque_fitted and given is None and made.motion is None:
        # The file does not say what its torque has met: most likely the same.
        return Lean(0.0, found_std)
    rows_lean = motion.source not in BY_SPEED and motion.squat is None
    torque_leans = made.torque_fitted and given is None and made.motion not in BY_SPEED
    if rows_lean == torque_leans:
        return Lean(0.0, found_std)
    if rows_lean:
        return Lean(given, given_std) if given is not None else Lean(*SQUAT)
    if motion.squat is not None:
        return Lean(-motion.squat, found_std)
    return Lean(-SQUAT[0], SQUAT[1])
