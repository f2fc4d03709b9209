"""Vehicle parameters from drives of known mass."""

from weighbridge.calibration.grid import TABLE_5, grid_search
from weighbridge.calibration.known_mass import tared, with_findings
from weighbridge.calibration.printed import TrainingSettings
from weighbridge.calibration.regression import build_rows
from weighbridge.calibration.run import (
    calibrate,
    run_calibration,
    run_speed_calibration,
    run_training,
)
from weighbridge.calibration.settings import CalibrationSettings
from weighbridge.calibration.speed import SpeedCalibration

__all__ = [
    "TABLE_5",
    "CalibrationSettings",
    "SpeedCalibration",
    "TrainingSettings",
    "build_rows",
    "calibrate",
    "grid_search",
    "run_calibration",
    "run_speed_calibration",
    "run_training",
    "tared",
    "with_findings",
]
