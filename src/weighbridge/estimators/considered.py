"""How uncertain the calibration's fit is on this drive: another mix of gears, loads, slopes."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.balance.law import road_columns, torque_columns
from weighbridge.kernels import disturbance
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle import Vehicle

UNSEEN: Final = 1e12
"""Factor on the noise of a row that the filter had left out [-]."""


def force_columns(balance: ForceBalance, vehicle: Vehicle, mass: float) -> Floats:
    """Force that one unit of each fitted parameter adds to what is left for the mass.

    Parameters
    ----------
    balance, vehicle
    mass : of the first row, rough; what rolls with C_r [kg]

    Returns
    -------
    (n, p + 4) for the torque coefficients, their curvature, slopes at the knots, C_d A, C_r,
    I_e, I_w, as `weighbridge.vehicle.model.Provenance.fit_cov` has them
    """
    table = balance.table
    road = road_columns(table, mass - table.fuel_burnt, vehicle.driveline.wheel_radius)
    return np.asarray(np.nan_to_num(np.hstack([torque_columns(table, vehicle), -road])))


def sensitivity(
    columns: Floats,
    time: Floats,
    rows: Floats,
    noise: Floats,
    added: Floats,
    taken: Bools,
    start: disturbance.DisturbanceState,
    params: disturbance.DisturbanceParams,
) -> Floats:
    """How far one unit of each parameter moves the mass at the end (k,) [kg per unit].

    With its gains as they are the filter is linear, so that it weighs the column
    of a parameter as it weighs a force.

    Parameters
    ----------
    columns : (m, k) means over the windows of `force_columns`
    time, rows, noise, added, start, params : as of `weighbridge.kernels.disturbance.smooth`
    taken : (m,) windows that its gate let through

    References
    ----------
    Consider analysis: Schmidt, Application of State-Space Methods to Navigation Problems,
    1966; Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, ch. 8.
    """
    noise = np.where(taken, noise, UNSEEN * noise)
    start = start._replace(x=np.zeros_like(start.x))
    columns = np.ascontiguousarray(columns)
    return np.asarray(disturbance.weighed(start, time, rows, columns, noise, added, params))


def from_triangle(values: tuple[float, ...]) -> Floats:
    """Symmetric matrix (k, k) from its lower triangle, row by row."""
    size = int(np.sqrt(2 * len(values)))
    matrix = np.zeros((size, size))
    matrix[np.tril_indices(size)] = values
    return np.asarray(matrix + np.tril(matrix, -1).T)


def triangle(matrix: Floats) -> tuple[float, ...]:
    """Lower triangle of a symmetric matrix (k, k), row by row."""
    return tuple(float(v) for v in matrix[np.tril_indices(len(matrix))])


def pinned(cov: Floats, direction: Floats) -> Floats:
    """Covariance (k, k) once ``direction @ parameters`` is known exactly.

    Parameters
    ----------
    cov : (k, k) before
    direction : (k,)
    """
    gain = cov @ direction
    power = float(direction @ gain)
    return np.asarray(cov - np.outer(gain, gain) / power) if power > 0.0 else cov


def fit_consider_std(vehicle: Vehicle, moved: Floats, mass: float) -> float:
    """Relative standard deviation of a mass by what the fit left open [-].

    Parameters
    ----------
    vehicle : 0 where its file does not say
    moved : (k,) of `sensitivity`
    mass : [kg]
    """
    cov = from_triangle(vehicle.provenance.fit_cov)
    if len(cov) != moved.size or not mass > 0.0:
        return 0.0
    return float(np.sqrt(max(float(moved @ cov @ moved), 0.0)) / mass)
