"""What a drive offers the navigation filter."""

from __future__ import annotations

from dataclasses import dataclass

from weighbridge.limits import FEW
from weighbridge.messages import refused
from weighbridge.navigation.aiding import Fixes, Imu, read_fixes, read_imu, speed_from_fixes
from weighbridge.signals import Drive, Signal


@dataclass(frozen=True, slots=True)
class Sources:
    """Inertial samples and what aids them.

    Attributes
    ----------
    drive : the signals as recorded
    imu : inertial samples in sensor axes
    fixes : GNSS fixes; None without
    wheel : vehicle speed; None without
    reference : the speed that delays and mounting are found by: of the wheels, else of GNSS
    """

    drive: Drive
    imu: Imu
    fixes: Fixes | None
    wheel: Signal | None
    reference: Signal

    @property
    def speed(self) -> Signal | None:
        """The speed that makes rows; None where only fixes show one."""
        return self.reference if self.wheel is not None or self.drive.has("gnss_speed") else None


def read_sources(drive: Drive) -> Sources:
    """Gather inertial samples, fixes and speeds of a drive, false ones left out.

    Raises
    ------
    DriveError
        Signals are missing or too short.
    """
    imu = read_imu(drive)
    start, end = float(imu.time[0]), float(imu.time[-1])
    fixes = read_fixes(drive, start, end)
    wheel = usable(drive.get("vehicle_speed"), start, end)
    reference = wheel or usable(drive.get("gnss_speed"), start, end)
    if reference is None and fixes is not None:
        reference = speed_from_fixes(fixes)
    if reference is None or len(reference) < FEW:
        raise refused("motion.drifts", drive=drive.name)
    return Sources(drive, imu, fixes, wheel, reference)


def usable(signal: Signal | None, start: float, end: float) -> Signal | None:
    """Return the signal if it has samples enough beside the inertial ones."""
    if signal is None or len(signal) < FEW:
        return None
    inside = (signal.time > start - 1.0) & (signal.time < end + 1.0)
    return signal if inside.sum() >= FEW else None


def undelayed(signal: Signal, delay: float) -> Signal:
    """Return the signal with its stamps set back by its delay [s]."""
    return Signal(signal.name, signal.time - delay, signal.values)
