"""What needs the whole drive: mounting, delays, noise, scale and start of the navigation."""

from __future__ import annotations

from weighbridge.navigation.identify.rounds import navigate
from weighbridge.navigation.identify.setup import Setup
from weighbridge.navigation.settings import RATE, NavigationSettings
from weighbridge.navigation.sources import read_sources
from weighbridge.signals import Drive
from weighbridge.vehicle import Mounting

__all__ = ["Setup", "identify"]


def identify(
    drive: Drive,
    mounting: Mounting | None = None,
    *,
    settings: NavigationSettings | None = None,
    rate: float = RATE,
) -> Setup:
    """Find mounting, delays, noise, scale and start of a drive, for its samples to be folded with.

    Parameters
    ----------
    drive : as for `weighbridge.navigation.inertial.inertial_motion`
    mounting : known mounting and squat
    settings : noise levels and priors
    rate : of the nodes and of the motion [Hz]

    Raises
    ------
    DriveError
        Signals are missing, the drive is too short or too quiet, or units or axes of the
        inertial sensor do not fit together.
    """
    return navigate(read_sources(drive), mounting, settings or NavigationSettings(), rate)[0]
