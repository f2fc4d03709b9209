"""Two hypotheses after every stop: the first state is as before, or it has jumped."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels import disturbance
from weighbridge.kernels._jit import kernel


class LoadParams(NamedTuple):
    """How the hypotheses are weighed.

    Attributes
    ----------
    filter : disturbance.DisturbanceParams
    jump_var : variance of a jump of the first state
    prior : logarithm of the odds of a jump at a stop
    temper : part of the log-likelihood that counts, below one where the model is
        not the whole truth
    fewest : rows after a stop without which no jump is believed
    """

    filter: disturbance.DisturbanceParams
    jump_var: float
    prior: float
    temper: float
    fewest: int


class LoadState(NamedTuple):
    """Both hypotheses.

    Attributes
    ----------
    same : disturbance.DisturbanceState as if nothing had changed at the last stop
    changed : the same with a jump there
    open : whether ``changed`` is still tried
    begun : row at which it began
    rows : rows seen
    """

    same: disturbance.DisturbanceState
    changed: disturbance.DisturbanceState
    open: bool
    begun: int
    rows: int


def initial_state(same):
    """Start from one `disturbance.DisturbanceState`."""
    return LoadState(same, same, False, 0, 0)


@kernel
def log_odds(state, params):
    """Logarithm of the odds of a jump at the last stop against none."""
    gain = state.changed.log_likelihood - state.same.log_likelihood
    return params.prior + params.temper * gain


@kernel
def decided(state, params):
    """Drop the less probable hypothesis.

    Returns
    -------
    state : LoadState
    begun : int
        Row from which the first state has another value; -1 if it has not.
    """
    seen = state.rows - state.begun
    if state.open and seen >= params.fewest and log_odds(state, params) > 0.0:
        return LoadState(state.changed, state.changed, False, state.begun, state.rows), state.begun
    return LoadState(state.same, state.same, False, state.begun, state.rows), -1


@kernel
def step(state, time, row, y, noise_var, stopped, params):
    """Fold in one row; see `disturbance.step`.

    Parameters
    ----------
    state : LoadState
    time : float
    row : (n,) float64
    y, noise_var : float
    stopped : bool
        The vehicle stood since the last row, so that the load may have changed.
    params : LoadParams

    Returns
    -------
    state : LoadState
    first, first_var : float
        Mean and variance of the first state over both hypotheses.
    begun : int
        Row from which a jump is now believed; -1 if none.

    References
    ----------
    Gaussian sum of two members: Bar-Shalom, Li, Kirubarajan, Estimation with
    Applications to Tracking and Navigation, 2001, ch. 11.6.
    """
    begun = -1
    if stopped:
        state, begun = decided(state, params)
        loose = disturbance.loosened(state.same, params.jump_var)
        state = LoadState(state.same, loose, True, state.rows, state.rows)
    same, _, _ = disturbance.step(state.same, time, row, y, noise_var, params.filter)
    if state.open:
        changed, _, _ = disturbance.step(state.changed, time, row, y, noise_var, params.filter)
        state = LoadState(same, changed, True, state.begun, state.rows + 1)
        share = 1.0 / (1.0 + np.exp(-log_odds(state, params)))
    else:
        state = LoadState(same, same, False, state.begun, state.rows + 1)
        share = 0.0
    first = (1.0 - share) * state.same.x[0] + share * state.changed.x[0]
    first_var = (
        (1.0 - share) * state.same.cov[0, 0]
        + share * state.changed.cov[0, 0]
        + share * (1.0 - share) * (state.same.x[0] - state.changed.x[0]) ** 2
    )
    return state, first, first_var, begun


@kernel
def run(state, time, rows, y, noise_var, stopped, params):
    """Apply ``step`` to each row and decide at the end.

    Parameters
    ----------
    state : LoadState
    time : (m,) float64
        Not falling [s].
    rows : (m, n) float64
    y, noise_var : (m,) float64
    stopped : (m,) bool
    params : LoadParams

    Returns
    -------
    state : LoadState
        After the last row and the last decision.
    first, first_var : (m,) float64
        After each row.
    begins : (m,) bool
        Rows from which the first state has another value.
    """
    first = np.empty(y.size)
    first_var = np.empty(y.size)
    begins = np.zeros(y.size, dtype=np.bool_)
    for k in range(y.size):
        state, first[k], first_var[k], begun = step(
            state, time[k], rows[k], y[k], noise_var[k], stopped[k], params
        )
        if begun >= 0:
            begins[begun] = True
    state, begun = decided(state, params)
    if begun >= 0:
        begins[begun] = True
    return state, first, first_var, begins
