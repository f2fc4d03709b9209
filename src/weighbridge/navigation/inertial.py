"""Motion from an inertial sensor, vehicle speed and GNSS (Jensen 2022, sec. 5)."""

from __future__ import annotations

from weighbridge.navigation.identify.rounds import navigate
from weighbridge.navigation.motion import Motion
from weighbridge.navigation.settings import RATE, NavigationSettings
from weighbridge.navigation.sources import read_sources
from weighbridge.signals import Drive
from weighbridge.vehicle import Mounting


def inertial_motion(
    drive: Drive,
    mounting: Mounting | None = None,
    *,
    settings: NavigationSettings | None = None,
    rate: float = RATE,
) -> Motion:
    """Find how the vehicle moved from its inertial sensor, aided by speed and GNSS.

    The drive is identified, folded, smoothed and laid out. The mounting is found from the drive,
    or refined where given. The filter runs forward twice, first to find the constants, then from
    these with their uncertainty as it was, and once backward. The identification ends in the
    smoothed motion, since this shows the accelerometer's scale.

    The specific force is low-passed without delay at 0.4 of ``rate`` before it is taken to the
    even clock, so that road and engine vibration does not fold.

    Parameters
    ----------
    drive : with ``accel_x..z`` and ``gyro_x..z`` and at least one of
        ``vehicle_speed``, ``gnss_speed`` and ``latitude`` with ``longitude``
    mounting : known mounting and squat
    settings : noise levels and priors
    rate : of the result [Hz]

    Raises
    ------
    DriveError
        Signals are missing, the drive is too short or too quiet, or units or axes of the
        inertial sensor do not fit together.

    References
    ----------
    Jensen et al., Mech. Syst. Signal Process. 171, 2022, sec. 5.2-5.4.
    """
    return navigate(read_sources(drive), mounting, settings or NavigationSettings(), rate)[1]
