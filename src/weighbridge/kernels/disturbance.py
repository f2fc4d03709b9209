"""Linear Kalman filter of constants and disturbances that fade."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel


class DisturbanceParams(NamedTuple):
    """How each state moves on its own.

    Attributes
    ----------
    time_constant : (n,) of a first-order Gauss-Markov state [s]; infinite for a
        constant
    std : (n,) stationary standard deviation of the fading states, 0 for constants
    gate : innovations beyond this many standard deviations are left out [-]
    settle : rows before the gate closes
    """

    time_constant: np.ndarray
    std: np.ndarray
    gate: float
    settle: int


class DisturbanceState(NamedTuple):
    """Estimate, covariance, and what was seen so far.

    Attributes
    ----------
    x : (n,) states
    cov : (n, n)
    time : of the last row [s]
    rows : rows seen
    log_likelihood : of all innovations, gated ones counted at the gate
    """

    x: np.ndarray
    cov: np.ndarray
    time: float
    rows: int
    log_likelihood: float


def initial_state(x, cov, time):
    """Start from ``x`` (n,) with ``cov`` (n, n) at ``time`` [s]."""
    return DisturbanceState(
        np.array(x, dtype=np.float64), np.array(cov, dtype=np.float64), float(time), 0, 0.0
    )


@kernel
def _faded(state, time, params):
    """Estimate and covariance at ``time``, and the part of each state that is left (n,)."""
    x = state.x.copy()
    cov = state.cov.copy()
    left = np.ones(x.size)
    span = time - state.time
    for i in range(x.size):
        if params.std[i] > 0.0:
            keep = np.exp(-span / params.time_constant[i])
            left[i] = keep
            x[i] *= keep
            cov[i, :] *= keep
            cov[:, i] *= keep
            cov[i, i] += params.std[i] ** 2 * (1.0 - keep * keep)
    return x, cov, left


@kernel
def step(state, time, row, y, noise_var, params):
    """Let the states fade until ``time`` and fold in ``y = row @ x + noise``.

    Parameters
    ----------
    state : DisturbanceState
    time : float
        Not before the last row [s].
    row : (n,) float64
    y, noise_var : float
        Measurement and its noise variance, > 0.
    params : DisturbanceParams

    Returns
    -------
    state : DisturbanceState
    innovation : float
        Divided by its standard deviation [-].
    taken : bool
        False where the gate left the row out.

    References
    ----------
    Gelb, Applied Optimal Estimation, 1974, ch. 3.8 (Gauss-Markov), 4.2.
    """
    x, cov, _ = _faded(state, time, params)
    cov_row = cov @ row
    innovation_var = row @ cov_row + noise_var
    innovation = (y - row @ x) / np.sqrt(innovation_var)
    taken = state.rows < params.settle or abs(innovation) <= params.gate
    seen = min(abs(innovation), params.gate)
    likelihood = state.log_likelihood - 0.5 * (np.log(innovation_var) + seen * seen)
    if taken:
        gain = cov_row / innovation_var
        x = x + gain * (y - row @ x)
        cov = cov - np.outer(gain, cov_row)
    return DisturbanceState(x, cov, time, state.rows + 1, likelihood), innovation, taken


@kernel
def run(state, time, rows, y, noise_var, added, params):
    """Apply ``step`` to each row.

    Parameters
    ----------
    state : DisturbanceState
    time : (m,) float64
        Not falling [s].
    rows : (m, n) float64
    y, noise_var : (m,) float64
    added : (m, n) float64
        Variance added to each state before the row, where it may jump.
    params : DisturbanceParams

    Returns
    -------
    state : DisturbanceState
        After the last row.
    first, first_var : (m,) float64
        The first state and its variance after each row.
    innovation : (m,) float64
        Divided by its standard deviation [-].
    taken : (m,) bool
    """
    first = np.empty(y.size)
    first_var = np.empty(y.size)
    innovation = np.empty(y.size)
    taken = np.empty(y.size, dtype=np.bool_)
    for k in range(y.size):
        if np.any(added[k] > 0.0):
            state = loosened(state, added[k])
        state, innovation[k], taken[k] = step(state, time[k], rows[k], y[k], noise_var[k], params)
        first[k] = state.x[0]
        first_var[k] = state.cov[0, 0]
    return state, first, first_var, innovation, taken


@kernel
def loosened(state, variance):
    """Return the state with ``variance`` (n,) added to those of the estimates."""
    cov = state.cov + np.diag(variance)
    return DisturbanceState(state.x, cov, state.time, state.rows, state.log_likelihood)


@kernel
def weight(state, time, row, noise_var, params):
    """Inverse variance of a measurement given all before it; parameters as of ``step``."""
    _, cov, _ = _faded(state, time, params)
    return 1.0 / (row @ (cov @ row) + noise_var)


@kernel
def weights(state, time, rows, y, noise_var, added, params):
    """Sum of `weight` over all rows; parameters as of ``run``."""
    total = 0.0
    for k in range(y.size):
        if np.any(added[k] > 0.0):
            state = loosened(state, added[k])
        total += weight(state, time[k], rows[k], noise_var[k], params)
        state, _, _ = step(state, time[k], rows[k], y[k], noise_var[k], params)
    return total


@kernel
def smooth(state, time, rows, y, noise_var, added, params):
    """Estimate every state at every row from all rows, before and after.

    Parameters
    ----------
    state, time, rows, y, noise_var, added, params
        As of ``run``.

    Returns
    -------
    x, var : (m, n) float64
        States and their variances.
    taken : (m,) bool
        As of ``run``.
    weight : (m,) float64
        Inverse variance of each ``y`` given all others; 0 where it was left out. They are the
        diagonal of the inverse covariance of ``y``.

    References
    ----------
    Fixed-interval smoother without inverses: Bierman, Automatica 9, 1973
    (modified Bryson-Frazier). It stays exact where a state has no variance.
    Weights: de Jong, Biometrika 75, 1988.
    """
    m, n = rows.shape
    x_pred = np.empty((m, n))
    cov_pred = np.empty((m, n, n))
    keep = np.empty((m, n))
    taken = np.empty(m, dtype=np.bool_)
    gain = np.zeros((m, n))
    inverse = np.zeros(m)
    error = np.zeros(m)
    weight = np.zeros(m)
    for k in range(m):
        if np.any(added[k] > 0.0):
            state = loosened(state, added[k])
        x, cov, keep[k] = _faded(state, time[k], params)
        x_pred[k] = x
        cov_pred[k] = cov
        state, _, taken[k] = step(state, time[k], rows[k], y[k], noise_var[k], params)
        if taken[k]:
            cov_row = cov @ rows[k]
            inverse[k] = 1.0 / (rows[k] @ cov_row + noise_var[k])
            gain[k] = cov_row * inverse[k]
            error[k] = y[k] - rows[k] @ x
    adjoint = np.zeros(n)
    information = np.zeros((n, n))
    x_out = np.empty((m, n))
    var_out = np.empty((m, n))
    for k in range(m - 1, -1, -1):
        row = rows[k]
        weight[k] = inverse[k] + gain[k] @ information @ gain[k]
        back = np.eye(n) - np.outer(gain[k], row)
        information = back.T @ information @ back + inverse[k] * np.outer(row, row)
        adjoint = back.T @ adjoint - inverse[k] * error[k] * row
        x_out[k] = x_pred[k] - cov_pred[k] @ adjoint
        spread = cov_pred[k] @ information @ cov_pred[k]
        for i in range(n):
            var_out[k, i] = max(cov_pred[k, i, i] - spread[i, i], 0.0)
        for i in range(n):
            adjoint[i] *= keep[k, i]
            information[i, :] *= keep[k, i]
            information[:, i] *= keep[k, i]
    return x_out, var_out, taken, weight
