"""What comes out: masses, inertias and calibrations, and how they are written."""

from weighbridge.results.calibration import Calibration, DelaySearch, FittedRows

__all__ = ["Calibration", "DelaySearch", "FittedRows"]
