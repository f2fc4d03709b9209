"""A calibration as data, for the report."""

from __future__ import annotations

from dataclasses import dataclass

from weighbridge.balance import ForceBalance
from weighbridge.calibration.regression import TorqueFit, TorqueRows
from weighbridge.vehicle.gear import GearDetection
from weighbridge.vehicle.model import Vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """A calibrated vehicle and what it was made from, for the report.

    Attributes
    ----------
    vehicle : the result
    gears : ratios found; None where they were given
    balances : of each drive, with the calibrated vehicle
    fit : of the torque
    rows : what was fitted
    """

    vehicle: Vehicle
    gears: GearDetection | None
    balances: tuple[ForceBalance, ...]
    fit: TorqueFit
    rows: TorqueRows
