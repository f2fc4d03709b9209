"""Vehicle parameters from drives of known mass."""

from weighbridge.calibration.printed import TrainingSettings
from weighbridge.calibration.run import (
    calibrate,
    run_calibration,
    run_speed_calibration,
    run_training,
)
from weighbridge.calibration.settings import CalibrationSettings
from weighbridge.calibration.speed import SpeedCalibration

__all__ = [
    "CalibrationSettings",
    "SpeedCalibration",
    "TrainingSettings",
    "calibrate",
    "run_calibration",
    "run_speed_calibration",
    "run_training",
]
