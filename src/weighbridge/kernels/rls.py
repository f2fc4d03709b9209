"""Recursive least squares with exponential forgetting."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel


class RlsParams(NamedTuple):
    """What stays the same from row to row.

    Attributes
    ----------
    forgetting : weight kept by the past at each row, in (0, 1] [-]
    cov_limit : (n,) diagonal of the covariance above which nothing is forgotten:
        the guard against wind-up where the regressor carries nothing
    gate : a row whose innovation is larger than this many standard deviations
        is left out; infinite to take every row [-]
    scale_rows : rows over which the innovation variance is averaged [-]
    settle_rows : rows before the gate closes [-]
    block : length over which rows count as dependent, for the standard
        deviation [s]
    """

    forgetting: float
    cov_limit: np.ndarray
    gate: float
    scale_rows: float
    settle_rows: int
    block: float


class RlsState(NamedTuple):
    """The estimate, its covariance for unit noise, and what scales it.

    Attributes
    ----------
    theta : (n,) parameters
    cov : (n, n) covariance for a noise variance of one
    noise_var : running variance of the innovations [unit of y squared]
    rows : rows folded in so far
    block_end : when the running block of dependent rows ends [s]
    block_score : sum of the block's first regressor times innovation
    block_expected : what its square would be for independent rows
    score, expected : their squares and expectations over past blocks
    """

    theta: np.ndarray
    cov: np.ndarray
    noise_var: float
    rows: int
    block_end: float
    block_score: float
    block_expected: float
    score: float
    expected: float


def initial_state(theta, cov):
    """Start from ``theta`` (n,) and ``cov`` (n, n) for a unit noise variance."""
    return RlsState(
        np.array(theta, dtype=np.float64),
        np.array(cov, dtype=np.float64),
        np.nan,
        0,
        -np.inf,
        0.0,
        0.0,
        0.0,
        0.0,
    )


@kernel
def _fold(theta, cov, phi, innovation, params):
    """Fold an innovation into ``theta`` (n,) and ``cov`` (n, n)."""
    n = theta.size
    keep = params.forgetting
    for i in range(n):
        if cov[i, i] / params.forgetting > params.cov_limit[i]:
            keep = 1.0
    cov_phi = np.zeros(n)
    known = 1.0
    for i in range(n):
        for j in range(n):
            cov[i, j] /= keep
            cov_phi[i] += cov[i, j] * phi[j]
        known += phi[i] * cov_phi[i]
    for i in range(n):
        theta[i] += cov_phi[i] / known * innovation
        for j in range(i + 1):
            both = cov[i, j] + cov[j, i]
            both -= cov_phi[i] / known * cov_phi[j] + cov_phi[j] / known * cov_phi[i]
            cov[i, j] = cov[j, i] = 0.5 * both


@kernel
def step(state, time, phi, y, params):
    """Fold the row ``y = phi @ theta + noise`` into the estimate.

    Parameters
    ----------
    state : RlsState
    time : float
        Instant of the row [s].
    phi : (n,) float64
        Regressor [unit of y / unit of theta].
    y : float
        Measurement.
    params : RlsParams

    Returns
    -------
    state : RlsState
    innovation : float
        ``y`` minus its prediction [unit of y].
    taken : bool
        False where the gate left the row out.

    References
    ----------
    Jensen et al. 2022, eqs. 7-9, here for n parameters.
    Ljung, System Identification, 2nd ed., 1999, sec. 11.2.
    """
    n = phi.size
    predicted = 0.0
    for i in range(n):
        predicted += phi[i] * state.theta[i]
    innovation = y - predicted
    std = np.sqrt(state.noise_var)
    limit = np.inf
    if state.rows >= params.settle_rows and params.gate < np.inf:
        limit = params.gate * std
    taken = abs(innovation) <= limit

    # The running variance sees outliers clipped, never dropped: a filter whose
    # model stopped fitting widens its gate until rows pass again.
    clipped = min(max(innovation, -limit), limit)
    weight = 1.0 / min(state.rows + 1.0, params.scale_rows)
    if state.rows == 0:
        noise_var = innovation * innovation
    else:
        noise_var = state.noise_var + weight * (clipped * clipped - state.noise_var)

    theta, cov = state.theta.copy(), state.cov.copy()
    if taken:
        _fold(theta, cov, phi, innovation, params)

    # Rows near each other share their error (wind, grade, torque model). The
    # sum over a block against its value for independent rows shows how much
    # less they know than their number says.
    block_end, score, expected = state.block_end, state.score, state.expected
    block_score, block_expected = state.block_score, state.block_expected
    if time >= block_end:
        if state.rows >= params.settle_rows:
            keep = params.forgetting**params.scale_rows
            score = keep * score + block_score * block_score
            expected = keep * expected + block_expected
        block_end = time + params.block
        block_score = 0.0
        block_expected = 0.0
    if taken:
        block_score = block_score + phi[0] * innovation
        block_expected = block_expected + phi[0] * phi[0] * noise_var
    after = RlsState(
        theta, cov, noise_var, state.rows + 1, block_end, block_score, block_expected,
        score, expected,
    )  # fmt: skip
    return after, innovation, taken


@kernel
def variance(state, index):
    """Variance of parameter ``index``, with the rows' dependence in it."""
    inflation = 1.0
    if state.expected > 0.0:
        inflation = max(1.0, state.score / state.expected)
    return state.cov[index, index] * state.noise_var * inflation


@kernel
def run(state, time, phi, y, valid, params):
    """Apply ``step`` to each valid row; other rows leave the state alone.

    Parameters
    ----------
    state : RlsState
    time : (m,) float64
    phi : (m, n) float64
    y : (m,) float64
    valid : (m,) bool
    params : RlsParams

    Returns
    -------
    state : RlsState
        After the last row.
    theta : (m, n) float64
        Estimate after each row.
    var : (m,) float64
        Variance of the first parameter after each row.
    innovation : (m,) float64
        NaN where the row was not valid.
    taken : (m,) bool
    """
    theta = np.empty((y.size, state.theta.size))
    var = np.empty(y.size)
    innovation = np.full(y.size, np.nan)
    taken = np.zeros(y.size, dtype=np.bool_)
    for k in range(y.size):
        if valid[k]:
            state, innovation[k], taken[k] = step(state, time[k], phi[k], y[k], params)
        for i in range(state.theta.size):
            theta[k, i] = state.theta[i]
        var[k] = variance(state, 0)
    return state, theta, var, innovation, taken
