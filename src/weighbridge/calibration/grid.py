"""The paper's grid search, with one Gram matrix in place of 123 750 regressions."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.calibration.regression import TorqueRows
from weighbridge.signals import Floats

TABLE_5: Final[tuple[Floats, ...]] = (
    np.linspace(0.30, 1.00, 15),
    np.linspace(0.002, 0.030, 15),
    np.linspace(0.02, 1.00, 50),
    np.linspace(2.0, 12.0, 11),
)
"""Values of C_d A [m^2], C_r [-], I_e [kg m^2] and I_w [kg m^2] (Jensen 2022, Table 5)."""


def grid_search(
    rows: TorqueRows, weight: Floats, axes: tuple[Floats, ...] = TABLE_5
) -> tuple[Floats, Floats, float]:
    """Solve eq. 48 on every point of a grid of the road parameters.

    Eliminating the regression weights from the normal equations once leaves a
    quadratic form in the road parameters, to be evaluated on the grid.

    Parameters
    ----------
    rows : (n, p + 4) of the design
    weight : (n,) of the rows; ones for the paper's plain squares
    axes : values of each road parameter

    Returns
    -------
    coefficients : (p,) of the regression at the best point
    road : (4,) the best point
    cost : its weighted sum of squares [N^2 m^2]
    """
    full = np.column_stack([rows.design, rows.target])
    gram = (full * weight[:, None]).T @ full
    p = rows.design.shape[1] - 4
    inner = np.linalg.solve(gram[:p, :p], gram[:p, p:])
    reduced = gram[p:, p:] - gram[:p, p:].T @ inner
    form, linear, constant = reduced[:4, :4], reduced[:4, 4], reduced[4, 4]
    mesh = np.meshgrid(*axes, indexing="ij")
    cost = np.full(mesh[0].shape, constant)
    for i in range(4):
        cost = cost - 2.0 * linear[i] * mesh[i]
        for j in range(4):
            cost = cost + form[i, j] * mesh[i] * mesh[j]
    best = np.unravel_index(int(np.argmin(cost)), cost.shape)
    road = np.array([axis[k] for axis, k in zip(axes, best, strict=True)])
    coefficients = inner[:, 4] - inner[:, :4] @ road
    return coefficients, road, float(cost[best])
