"""How far noise of the motion draws a mass down: regressors that are themselves measured."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.signals import Bools, Floats

LEVEL_STD: Final = 0.5
"""Standard deviation of how far the motion's noise draws a mass, over what is reckoned [-]:
how the noise that a drive shows is shared between torque and motion is by typical sizes."""


def drawn(weight: Floats, variance: Floats, mass_var: Floats, begins: Bools) -> Floats:
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
