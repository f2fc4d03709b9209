"""Two hypotheses after every stop: the first state is as before, or it has jumped."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels import disturbance
from weighbridge.kernels._jit import inlined_kernel, kernel

FOLLOWED = 3
"""Times ``fewest`` rows after a stop before what speaks for the load of before counts in full, and
before a stop with less odds is tried in its place: in nights of live 7 and 10 rows spoke for it,
though the load had grown by 16 and 9 %."""


class LoadParams(NamedTuple):
    """How the hypotheses are weighed.

    Attributes
    ----------
    filter : disturbance.DisturbanceParams
    jump_var : (n,) variance of the jump of each state
    temper : part of the log-likelihood that counts, below one where the model is
        not the whole truth
    fewest : rows after a stop without which no jump is believed; until then its share in
        the mean grows with them
    """

    filter: disturbance.DisturbanceParams
    jump_var: np.ndarray
    temper: float
    fewest: int


class LoadState(NamedTuple):
    """Both hypotheses.

    Attributes
    ----------
    same : disturbance.DisturbanceState as if nothing had changed at the last stop
    changed : the same with a jump there
    open : whether ``changed`` is still tried
    prior : logarithm of its odds before any row
    trial_row : row from which it is tried
    rows : rows seen
    """

    same: disturbance.DisturbanceState
    changed: disturbance.DisturbanceState
    open: bool
    prior: float
    trial_row: int
    rows: int


def initial_state(same):
    """Start from one `disturbance.DisturbanceState`."""
    return LoadState(same, same, False, 0.0, 0, 0)


@inlined_kernel
def log_odds(state, params):
    """Logarithm of the odds of a jump at the last stop against none."""
    gain = state.changed.log_likelihood - state.same.log_likelihood
    return state.prior + params.temper * gain


@inlined_kernel
def decided(state, params):
    """Drop the less probable hypothesis.

    Returns
    -------
    state : LoadState
    changed_from : int
        Row from which the first state has another value; -1 if it has not.
    """
    seen = state.rows - state.trial_row
    if state.open and seen >= params.fewest and log_odds(state, params) > 0.0:
        kept = LoadState(state.changed, state.changed, False, 0.0, state.trial_row, state.rows)
        return kept, state.trial_row
    return LoadState(state.same, state.same, False, 0.0, state.trial_row, state.rows), -1


@inlined_kernel
def step(state, time, row, y, noise_var, odds, params):
    """Fold in one row; see `disturbance.step`.

    Parameters
    ----------
    state : LoadState
    time : float
    row : (n,) float64
    y, noise_var : float
    odds : float
        Logarithm of the odds that the load changed since the last row; NaN where the
        vehicle did not stand.
    params : LoadParams

    Returns
    -------
    state : LoadState
    first, first_var : float
        The first state, and its mean square error over both hypotheses. The first rows after a
        stop exclude a jump less than they seem to.
    changed_from : int
        Row from which a jump is now believed; -1 if none.

    References
    ----------
    Gaussian sum of two members: Bar-Shalom, Li, Kirubarajan, Estimation with
    Applications to Tracking and Navigation, 2001, ch. 11.6.
    """
    changed_from = -1
    young = state.open and state.rows - state.trial_row < FOLLOWED * params.fewest
    # Where stops come fast, the one at which a change is likeliest is tried until it can decide.
    if not np.isnan(odds) and not (young and odds <= state.prior):
        state, changed_from = decided(state, params)
        moved = disturbance.inflated(state.same, params.jump_var, params.filter)
        state = LoadState(state.same, moved, True, odds, state.rows, state.rows)
    same, _, _ = disturbance.step(state.same, time, row, y, noise_var, params.filter)
    if state.open:
        changed, _, _ = disturbance.step(state.changed, time, row, y, noise_var, params.filter)
        state = LoadState(same, changed, True, state.prior, state.trial_row, state.rows + 1)
        # Few rows after a stop are a launch, on a slipping clutch perhaps.
        part = (state.rows - state.trial_row) / params.fewest
        seen = log_odds(state, params)
        believed = min(1.0, part) / (1.0 + np.exp(-seen))
        heard = state.prior + min(1.0, part / FOLLOWED) * (seen - state.prior)
        share = 1.0 / (1.0 + np.exp(-max(seen, heard)))
    else:
        state = LoadState(same, same, False, 0.0, state.trial_row, state.rows + 1)
        share = believed = 0.0
    first = (1.0 - believed) * state.same.x[0] + believed * state.changed.x[0]
    within = (1.0 - share) * state.same.cov[0, 0] + share * state.changed.cov[0, 0]
    off = (1.0 - share) * (state.same.x[0] - first) ** 2
    off += share * (state.changed.x[0] - first) ** 2
    # What is unmodelled widens each of the two, and not the distance between them.
    first_var = within + params.temper * off
    return state, first, first_var, changed_from


@kernel
def run(state, time, rows, y, noise_var, odds, params):
    """Apply ``step`` to each row and decide at the end.

    Parameters
    ----------
    state : LoadState
    time : (m,) float64
        Not falling [s].
    rows : (m, n) float64
    y, noise_var : (m,) float64
    odds : (m,) float64
        As of ``step``.
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
        state, first[k], first_var[k], changed_from = step(
            state, time[k], rows[k], y[k], noise_var[k], odds[k], params
        )
        if changed_from >= 0:
            begins[changed_from] = True
    state, changed_from = decided(state, params)
    if changed_from >= 0:
        begins[changed_from] = True
    return state, first, first_var, begins
