"""Linear Kalman filter of constants and disturbances that fade."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import inlined_kernel, kernel


class DisturbanceParams(NamedTuple):
    """How each state moves on its own.

    Attributes
    ----------
    time_constant : (n,) of a first-order Gauss-Markov state [s]; infinite for a
        constant
    std : (n,) stationary standard deviation of the fading states, 0 for constants
    gate : innovations beyond this many standard deviations are left out [-]
    settle_rows : rows before the gate closes
    jump_rows : rows after a jump of a state before it closes again
    """

    time_constant: np.ndarray
    std: np.ndarray
    gate: float
    settle_rows: int
    jump_rows: int = 0


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


@inlined_kernel
def faded(state, time, params):
    """Estimate and covariance at ``time``, and the part of each state that is left (n,)."""
    n = state.x.size
    x, cov, left = np.empty(n), np.empty((n, n)), np.empty(n)
    span = time - state.time
    for i in range(n):
        left[i] = np.exp(-span / params.time_constant[i]) if params.std[i] > 0.0 else 1.0
        x[i] = state.x[i] * left[i]
        for j in range(i + 1):
            cov[i, j] = state.cov[i, j] * left[j] * left[i]
            cov[j, i] = state.cov[j, i] * left[j] * left[i]
        cov[i, i] += params.std[i] ** 2 * (1.0 - left[i] * left[i])
    return x, cov, left


@inlined_kernel
def predicted(x, cov, row, noise_var, cov_row):
    """Mean and variance of a measurement; ``cov_row`` (n,) becomes ``cov @ row``."""
    mean = 0.0
    var = noise_var
    for i in range(x.size):
        total = 0.0
        for j in range(x.size):
            total += cov[i, j] * row[j]
        cov_row[i] = total
        mean += row[i] * x[i]
        var += row[i] * total
    return mean, var


@inlined_kernel
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
    x, cov, _ = faded(state, time, params)
    cov_row = np.empty(x.size)
    mean, innovation_var = predicted(x, cov, row, noise_var, cov_row)
    innovation = (y - mean) / np.sqrt(innovation_var)
    taken = state.rows < params.settle_rows or abs(innovation) <= params.gate
    seen = min(abs(innovation), params.gate)
    likelihood = state.log_likelihood - 0.5 * (np.log(innovation_var) + seen * seen)
    if taken:
        for i in range(x.size):
            gain = cov_row[i] / innovation_var
            x[i] += gain * (y - mean)
            for j in range(x.size):
                cov[i, j] -= gain * cov_row[j]
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
        state = inflated(state, added[k], params)
        state, innovation[k], taken[k] = step(state, time[k], rows[k], y[k], noise_var[k], params)
        first[k] = state.x[0]
        first_var[k] = state.cov[0, 0]
    return state, first, first_var, innovation, taken


@kernel
def weighed(state, time, rows, columns, noise_var, added, params):
    """Return what each of several measurements makes of the first state, none left out.

    Parameters
    ----------
    state, time, rows, noise_var, added, params
        As of ``run``; the states of ``state`` are taken for 0.
    columns : (m, k) float64
        Measurements, one column each.

    Returns
    -------
    (k,) float64
        After the last row.
    """
    count = columns.shape[1]
    x = np.zeros((count, state.x.size))
    cov_row = np.empty(state.x.size)
    for k in range(time.size):
        state = inflated(state, added[k], params)
        none, cov, left = faded(state, time[k], params)
        _, innovation_var = predicted(none, cov, rows[k], noise_var[k], cov_row)
        for j in range(count):
            mean = 0.0
            for i in range(left.size):
                x[j, i] *= left[i]
                mean += rows[k, i] * x[j, i]
            for i in range(left.size):
                x[j, i] += cov_row[i] / innovation_var * (columns[k, j] - mean)
        for i in range(left.size):
            for j in range(left.size):
                cov[i, j] -= cov_row[i] / innovation_var * cov_row[j]
        state = DisturbanceState(none, cov, time[k], state.rows + 1, 0.0)
    return x[:, 0].copy()


@inlined_kernel
def inflated(state, variance, params):
    """Return the state with ``variance`` (n,) added to those of the estimates.

    Only the rows after a jump show a state that jumped. A false one among the first would close
    the gate to the right ones. So the first ``jump_rows`` all pass, as at the beginning.
    """
    cov, rows = state.cov.copy(), state.rows
    for i in range(variance.size):
        cov[i, i] += variance[i]
        if variance[i] > 0.0:
            rows = min(rows, params.settle_rows - params.jump_rows)
    return DisturbanceState(state.x, cov, state.time, rows, state.log_likelihood)


@kernel
def weight(state, time, row, noise_var, params):
    """Inverse variance of a measurement given all before it; parameters as of ``step``."""
    x, cov, _ = faded(state, time, params)
    return 1.0 / predicted(x, cov, row, noise_var, np.empty(x.size))[1]


@kernel
def weights(state, time, rows, y, noise_var, added, params):
    """Sum of `weight` over all rows; parameters as of ``run``."""
    total = 0.0
    for k in range(y.size):
        state = inflated(state, added[k], params)
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
        state = inflated(state, added[k], params)
        x, cov, left = faded(state, time[k], params)
        state, _, taken[k] = step(state, time[k], rows[k], y[k], noise_var[k], params)
        if taken[k]:
            mean, var = predicted(x, cov, rows[k], noise_var[k], gain[k])
            inverse[k] = 1.0 / var
            error[k] = y[k] - mean
        for i in range(n):
            x_pred[k, i], keep[k, i] = x[i], left[i]
            gain[k, i] *= inverse[k]
            for j in range(n):
                cov_pred[k, i, j] = cov[i, j]
    adjoint = np.zeros(n)
    information = np.zeros((n, n))
    x_out = np.empty((m, n))
    var_out = np.empty((m, n))
    for k in range(m - 1, -1, -1):
        weight[k] = _back(adjoint, information, gain[k], rows[k], inverse[k], error[k])
        for i in range(n):
            x_out[k, i] = x_pred[k, i]
            var_out[k, i] = cov_pred[k, i, i]
            for a in range(n):
                total = 0.0
                for b in range(n):
                    total += information[a, b] * cov_pred[k, b, i]
                x_out[k, i] -= cov_pred[k, i, a] * adjoint[a]
                var_out[k, i] -= cov_pred[k, i, a] * total
            var_out[k, i] = max(var_out[k, i], 0.0)
        for i in range(n):
            adjoint[i] *= keep[k, i]
            for j in range(n):
                information[i, j] *= keep[k, i] * keep[k, j]
    return x_out, var_out, taken, weight


@kernel
def _back(adjoint, information, gain, row, inverse, error):
    """Take a row into ``adjoint`` (n,) and ``information`` (n, n); return its weight."""
    n = row.size
    weight = inverse
    along = 0.0
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += information[i, j] * gain[j]
        weight += gain[i] * total
        along += gain[i] * adjoint[i]
        for j in range(n):
            information[i, j] -= total * row[j]
    for i in range(n):
        adjoint[i] -= (along + inverse * error) * row[i]
    for j in range(n):
        total = inverse * row[j]
        for i in range(n):
            total -= gain[i] * information[i, j]
        for i in range(n):
            information[i, j] += row[i] * total
    return weight
