"""How a calibration is made."""

from __future__ import annotations

from dataclasses import dataclass, field
from numbers import Integral

from weighbridge.arguments import check_choice, check_flag, check_number, check_text, check_type
from weighbridge.calibration.printed import TrainingSettings
from weighbridge.errors import ConfigError
from weighbridge.vehicle import TORQUE_SOURCES
from weighbridge.vehicle.fits import FITS, JOINT, RLS, Fit


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationSettings:
    """How a calibration is made.

    Attributes
    ----------
    order : highest power of engine speed in the torque regression; 2 for load
        and air flow, 0 for measured torque when None
    source : torque source; the best the drives have when None
    grid : train as Jensen 2022 prints it: its filter of the motion, no lateness, plain squares on
        the grid of Table 5, on one drive
    training : of that, such as the limits of the grid
    curved : let the torque per load change with engine speed and load; off for
        the regression of eq. 49 as printed
    method : estimator the vehicle is calibrated for: "joint", "rls" by eq. 48,
        "speed-torque-ekf", which uses no accelerometer, or "speed-ekf", which fits a model of the
        speed alone
    """

    order: int | None = None
    source: str | None = None
    grid: bool = False
    curved: bool = True
    method: str = JOINT.name
    training: TrainingSettings = field(default_factory=TrainingSettings)

    def __post_init__(self) -> None:
        if self.order is not None:
            check_number("order", self.order)
            check_type("order", self.order, Integral, "a whole number")
        check_text("source", self.source, optional=True)
        check_flag("grid", self.grid)
        check_flag("curved", self.curved)
        check_text("method", self.method)
        check_type("training", self.training, TrainingSettings, "TrainingSettings")
        if self.order is not None and not 0 <= self.order <= 4:
            raise ConfigError(f"order must be between 0 and 4, got {self.order}")
        if self.source is not None:
            check_choice("source", self.source, TORQUE_SOURCES)
        check_choice("method", self.method, FITS)
        if self.grid and self.fit != RLS:
            raise ConfigError("the grid of Jensen 2022 is of method rls; calibrate with that")
        if self.grid and (self.order is not None or self.source not in (None, "load")):
            raise ConfigError(
                "the grid of Jensen 2022 is of source load, and training.order is its order"
            )
        if not self.grid and self.training != TrainingSettings():
            raise ConfigError("training is that of the grid; calibrate with grid as well")

    @property
    def fit(self) -> Fit:
        """What is fitted."""
        return FITS[self.method]
