"""Robust least squares and Kalman filter side by side, blended by speed."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels import mass_ekf, robust_rls
from weighbridge.kernels._jit import kernel


class HybridParams(NamedTuple):
    """What stays the same from row to row.

    Attributes
    ----------
    rls : RobustRlsParams
    ekf : MassEkfParams
    first_information : of the least squares, at which the Kalman filter starts
        from it and a mass is told
    start_std : of the mass the Kalman filter starts from, relative [-]
    blend_speed, blend_width : middle and width of the change from the one to the
        other [m/s]
    """

    rls: robust_rls.RobustRlsParams
    ekf: mass_ekf.MassEkfParams
    first_information: float
    start_std: float
    blend_speed: float
    blend_width: float


class HybridState(NamedTuple):
    """States of both, and what they say together.

    Attributes
    ----------
    rls : RobustRlsState
    ekf : MassEkfState
        Without meaning before it has started.
    started : the Kalman filter runs
    share : of the least squares in the blend [-]
    mass, var : blended [kg], [kg^2]; NaN before the start
    """

    rls: robust_rls.RobustRlsState
    ekf: mass_ekf.MassEkfState
    started: bool
    share: float
    mass: float
    var: float


def initial_state(rls, params):
    """Start from a state of the least squares; the Kalman filter follows later."""
    nothing = mass_ekf.Row(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False, False)
    ekf = mass_ekf.initial_state(0.0, 0.0, nothing, params.ekf)
    return HybridState(rls, ekf, False, 1.0, np.nan, np.nan)


@kernel
def share_of_rls(speed, middle, width):
    """Share h(v) of the least squares in the blend [-].

    A logistic curve that falls from 1 at rest to 0 at speed. Du et al. 2025
    give theirs as a drawing only (fig. 4).
    """
    return 1.0 / (1.0 + np.exp((speed - middle) / width))


@kernel
def step(state, row, phi, y, params):
    """Take one row into both filters and blend what they say.

    Parameters
    ----------
    state : HybridState
    row : mass_ekf.Row
    phi, y : float
        Regressor [m/s^2] and measurement [N] of the least squares.
    params : HybridParams

    Returns
    -------
    state : HybridState
    mean_phi, mean_y, weight : float
        As of `robust_rls.step`.
    taken : bool
        As of `mass_ekf.run`.

    References
    ----------
    Du et al. 2025, sec. 3.3, eq. 34.
    """
    rls, mean_phi, mean_y, weight = robust_rls.step(
        state.rls, row.time, phi, y, row.driven, params.rls
    )
    ekf, started, taken = state.ekf, state.started, False
    if started:
        ekf, innovation, passed = mass_ekf.step(ekf, row, params.ekf)
        taken = passed and np.isfinite(innovation)
    elif rls.information >= params.first_information:
        started = True
        spread = params.start_std * rls.mass
        ekf = mass_ekf.initial_state(rls.mass, spread * spread, row, params.ekf)
    share, mass, var = state.share, state.mass, state.var
    if started:
        if np.isfinite(row.speed):
            share = share_of_rls(row.speed, params.blend_speed, params.blend_width)
        mass = share * rls.mass + (1.0 - share) * ekf.x[mass_ekf.MASS]
        # Both see the same rows, so their errors are taken as one.
        std = share * np.sqrt(robust_rls.variance(rls, params.rls)) + (1.0 - share) * np.sqrt(
            ekf.cov[mass_ekf.MASS, mass_ekf.MASS]
        )
        var = std * std
    return HybridState(rls, ekf, started, share, mass, var), mean_phi, mean_y, weight, taken


@kernel
def run(state, columns, phi, y, params):
    """Apply ``step`` to each row.

    Parameters
    ----------
    state : HybridState
    columns : mass_ekf.Columns
    phi, y : (n,) float64
    params : HybridParams

    Returns
    -------
    state : HybridState
        After the last row.
    mass, var, share : (n,) float64
        Blend, its variance and the share of the least squares after each row.
    rls_mass, ekf_mass : (n,) float64
        What the two say; NaN before the start.
    mean_phi, mean_y, weight : (n,) float64
        Of the window folded in at each row; NaN where none was.
    taken : (n,) bool
        The Kalman filter took the row.
    """
    n = columns.time.size
    mass = np.empty(n)
    var = np.empty(n)
    share = np.empty(n)
    rls_mass = np.full(n, np.nan)
    ekf_mass = np.full(n, np.nan)
    mean_phi = np.empty(n)
    mean_y = np.empty(n)
    weight = np.empty(n)
    taken = np.zeros(n, dtype=np.bool_)
    for k in range(n):
        state, mean_phi[k], mean_y[k], weight[k], taken[k] = step(
            state, mass_ekf.row_at(columns, k), phi[k], y[k], params
        )
        mass[k], var[k], share[k] = state.mass, state.var, state.share
        if state.started:
            rls_mass[k] = state.rls.mass
            ekf_mass[k] = state.ekf.x[mass_ekf.MASS]
    return state, mass, var, share, rls_mass, ekf_mass, mean_phi, mean_y, weight, taken
