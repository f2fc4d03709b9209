"""Uncertainty by the shape of the torque reading: its error is not the same at every torque.

A calibration finds the scale and the offset that fit its drives. What is left of the reading
bends to and fro from one torque to the next. Ordinary drives average it as the calibration did.
A cruise uses a few torques, and the slope of the bend there is a scale of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from weighbridge.balance.law import traction_gain
from weighbridge.balance.table import ForceTable
from weighbridge.estimators.considered import pinned
from weighbridge.signals import Floats
from weighbridge.vehicle import Vehicle

SHAPE_STD: Final = 0.014
"""Error of the reading beside offset and scale, over the highest torque of the drive [-]: from
31 cruises and 11 ordinary drives of ten simulated vehicles."""

SHAPE_LENGTH: Final = 0.4
"""Part of the highest torque over which that error changes [-]; from the same drives."""

ORDINARY: Final = (0.34, 0.22)
"""Mean and standard deviation of the torques that weigh on an ordinary drive, over its highest
[-]; from the same drives."""

KNOTS: Final = np.linspace(-0.5, 1.2, 18)
"""Torques over the highest between which the error is interpolated [-]."""


def shape_columns(table: ForceTable, vehicle: Vehicle, highest: float) -> Floats:
    """Force that one unit of the error at each of the `KNOTS` adds at the wheels (n, k) [N].

    Parameters
    ----------
    table, vehicle
    highest : torque of the calibration's drives, else of this one, which is the unit [N m]
    """
    torque = np.nan_to_num(table.torque)
    if not highest > 0.0:
        return np.zeros((torque.size, KNOTS.size))
    part = np.clip(torque / highest, KNOTS[0], KNOTS[-1])
    near = np.maximum(0.0, 1.0 - np.abs(part[:, None] - KNOTS) / (KNOTS[1] - KNOTS[0]))
    gain = highest * traction_gain(vehicle, torque, np.nan_to_num(table.gearing))
    return np.asarray(near * np.nan_to_num(gain)[:, None])


def shape_std(moved: Floats, use: Sequence[float]) -> float:
    """Relative standard deviation of a mass by the shape of the reading [-].

    Parameters
    ----------
    moved : (k,) how far one unit at each of the `KNOTS` moves the mass, relative [-]
    use : (k,) how far it moved the masses of the calibration, relative, which has taken that out;
        empty where it is not known

    References
    ----------
    Covariance of a smooth error, and of one of which a sum is known: Rasmussen and Williams,
    Gaussian Processes for Machine Learning, 2006, eqs. 2.31 and 2.19.
    """
    cov = pinned(_SMOOTH, np.array(use)) if len(use) == KNOTS.size else _UNCALIBRATED
    return float(np.sqrt(max(float(moved @ cov @ moved), 0.0)))


def _uncalibrated() -> Floats:
    """Covariance of the error at the `KNOTS` without a calibration (k, k) [-].

    Its sum over ordinary drives is zero, and what it adds to their mass.
    """
    away = KNOTS - ORDINARY[0]
    often = np.exp(-0.5 * (away / ORDINARY[1]) ** 2)
    return pinned(pinned(_SMOOTH, often), away * often)


_SMOOTH: Final = SHAPE_STD**2 * np.exp(-0.5 * ((KNOTS[:, None] - KNOTS) / SHAPE_LENGTH) ** 2)
_UNCALIBRATED: Final = _uncalibrated()
