"""Attenuation bias by noise of the motion: regressors that are themselves measured."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.balance.table import ForceTable
from weighbridge.messages import Problem
from weighbridge.navigation.motion import noise_level
from weighbridge.signals import Bools, Floats

LEVEL_STD: Final = 0.5
"""Standard deviation of the attenuation by the motion's noise, over what is reckoned [-]:
how the noise that a drive shows is shared between torque and motion is by typical sizes."""


def attenuation(weight: Floats, variance: Floats, mass_var: Floats, begins: Bools) -> Floats:
    """Part by which the mass of each load is too low (m,) [-], the same all along a load.

    Least squares of y on phi + n, weighted by W, comes out as ``phi W y / (phi W phi + n W n)``.
    Of the information in the denominator, the trace of W times the variances of n is noise:
    times the variance of the mass it is the part that is missing.

    Parameters
    ----------
    weight : (m,) diagonal of the inverse covariance of the force [1/N^2]
    variance : (m,) of the noise of the specific force [m^2/s^4]
    mass_var : (m,) of the mass by the whole drive [kg^2]
    begins : (m,) windows before which the load changed

    References
    ----------
    Fuller, Measurement Error Models, 1987, ch. 1, 2.
    """
    load = np.cumsum(begins)
    return np.asarray(mass_var * np.bincount(load, weight * variance)[load])


ROW_FAST: Final = 2.0
"""Rows below this speed tell no noise [m/s]."""

LEAST: Final = 0.01
"""Less is nothing [-]: undamaged drives have 0.002 to 0.004."""

MOST: Final = 0.07
"""Above this a method that takes the motion as exact gives no mass [-]."""


def row_noise_std(table: ForceTable, phi: Floats, used: Bools, share: float) -> float:
    """Relative standard deviation of a mass by a method that takes the motion as exact [-].

    White noise of 0.5 to 2 m/s^2 in simulated drives of nine vehicles took 1.5 to 3.2 times the
    noise's part of the rows' mean square off by rls, 1 to 2.5 times by robust-rls, and moved the
    others either way. Rows show more noise than white noise is between them, for navigation
    smooths it.

    Parameters
    ----------
    table : the rows
    phi : (n,) regressor of the mass [m/s^2]
    used : (n,)
    share : error of the method's mass over the noise's part of the rows' mean square [-]
    """
    moving = table.specific_force[np.isfinite(table.specific_force) & (table.speed > ROW_FAST)]
    if not used.any() or moving.size < 10:
        return 0.0
    part = noise_level(moving) ** 2 / float(np.mean(phi[used] ** 2))
    std = share * part
    return std if std > LEAST else 0.0


def too_noisy(std: float) -> Problem | None:
    """Say that the motion is too noisy for such a method; None if not."""
    if std <= MOST:
        return None
    return Problem.of("imu.too_noisy", share=100.0 * min(std, 1.0))
