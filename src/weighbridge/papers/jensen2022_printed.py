"""Jensen et al. 2022 by the paper's own rules: its filter, its fit, its recursive least squares.

Nothing of ours is in the way from the samples to the running mass; the training is in
`weighbridge.calibration.printed`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from weighbridge.balance import force_balance
from weighbridge.calibration import TrainingSettings
from weighbridge.calibration.printed import PrintedCar, calibrate_as_printed
from weighbridge.errors import ConfigError
from weighbridge.estimators import RlsSettings
from weighbridge.estimators.rls import estimate
from weighbridge.estimators.track import MassTrack
from weighbridge.navigation import printed_motion
from weighbridge.signals import Drive
from weighbridge.vehicle import Driveline, Vehicle

TYRE_RADIUS: Final = 0.319
"""Outer tyre radius [m] (Table 1)."""

PAPER_CAR: Final = Vehicle(name="car", driveline=Driveline(wheel_radius=TYRE_RADIUS))
"""What is known of the car before its training."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedSettings(TrainingSettings):
    """What the paper chooses or varies; the defaults are printed.

    Attributes
    ----------
    forgetting, initial_mass, initial_gain : of eqs. 7-9 [-], [kg], [s^4/m^2]
    engine_efficiency : of eq. 51, which the paper chose by the largest torque [-]
    """

    forgetting: float = 0.9995
    initial_mass: float = 1000.0
    initial_gain: float = 1000.0
    engine_efficiency: float = 0.33

    def __post_init__(self) -> None:
        TrainingSettings.__post_init__(self)
        if not 0.05 <= self.engine_efficiency <= 0.6:
            raise ConfigError(
                f"engine_efficiency must be in [0.05, 0.6], got {self.engine_efficiency:g}"
            )

    @property
    def rls(self) -> RlsSettings:
        """Settings of the estimator: no gate, no guard, every row with rising speed."""
        return RlsSettings(
            forgetting=self.forgetting,
            initial_mass=self.initial_mass,
            initial_gain=self.initial_gain,
            printed=True,
            filter=self.filter,
        )


def train(drive: Drive, mass: float, settings: PrintedSettings | None = None) -> PrintedCar:
    """Train the paper's car on one drive of known mass [kg], see `calibrate_as_printed`."""
    return calibrate_as_printed(drive, mass, PAPER_CAR, settings or PrintedSettings())


def weigh_as_printed(
    drive: Drive, car: PrintedCar, settings: PrintedSettings | None = None
) -> MassTrack:
    """Weigh a drive by the paper's filter and recursive least squares (secs. 3-5).

    Raises
    ------
    DriveError
        The drive lacks a signal, or does not begin at rest.
    """
    settings = settings or PrintedSettings()
    motion = printed_motion(drive, car.mounting, settings.filter)
    balance = force_balance(drive, car.vehicle, motion, delay=0.0, lag=0.0)
    return estimate(balance, car.vehicle, settings.rls)
