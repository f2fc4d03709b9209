"""Filter of `disturbance` beside a force that is switched on and off at unknown times."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels import disturbance
from weighbridge.kernels._jit import inlined_kernel, kernel


class SwitchParams(NamedTuple):
    """How the states move, and how the force is switched.

    Attributes
    ----------
    filter : disturbance.DisturbanceParams
    on_time, off_time : how long the force stays on and off in the mean [s]
    """

    filter: disturbance.DisturbanceParams
    on_time: float
    off_time: float


class SwitchState(NamedTuple):
    """Estimates while the force is off (row 0) and on (row 1).

    Attributes
    ----------
    x : (2, n) states
    cov : (2, n, n)
    share : (2,) probability of either
    turned : (2, 2) probability of what it was before the last row and what it is
    time : of the last row [s]
    rows : rows seen
    log_likelihood : of all rows
    """

    x: np.ndarray
    cov: np.ndarray
    share: np.ndarray
    turned: np.ndarray
    time: float
    rows: int
    log_likelihood: float


def initial_state(state, params):
    """Start from a `disturbance.DisturbanceState`, the force off or on as it is in the mean."""
    x, cov = np.stack((state.x, state.x)), np.stack((state.cov, state.cov))
    on = params.on_time / (params.on_time + params.off_time)
    share = np.array([1.0 - on, on])
    return SwitchState(x, cov, share, np.diag(share), state.time, state.rows, 0.0)


@inlined_kernel
def _on_after(span, params):
    """Probability of being on after ``span`` [s], of a force that was off and that was on."""
    rate = 1.0 / params.on_time + 1.0 / params.off_time
    mean = params.on_time / (params.on_time + params.off_time)
    left = np.exp(-rate * max(span, 0.0))
    return mean * (1.0 - left), mean + (1.0 - mean) * left


@inlined_kernel
def step(state, time, row, y, noise_var, force, added, params):
    """Fold in ``y = row @ x + noise``, with ``force`` beside it where it is on.

    Parameters
    ----------
    state : SwitchState
    time : float
        Not before the last row [s].
    row : (n,) float64
    y, noise_var : float
        Measurement and its noise variance, > 0.
    force : float
        What is added to the measurement while it is on.
    added : (n,) float64
        Variance added to each state before the row.
    params : SwitchParams

    Returns
    -------
    SwitchState

    References
    ----------
    Generalised pseudo-Bayesian filter of second order: Bar-Shalom, Li, Kirubarajan, Estimation
    with Applications to Tracking and Navigation, 2001, ch. 11.6.5.
    """
    n = row.size
    gate = params.filter.gate
    from_off, from_on = _on_after(time - state.time, params)
    moved = np.empty((2, 2, n))
    cov = np.empty((2, n, n))
    chance = np.empty((2, 2))
    gain = np.empty(n)
    for i in range(2):
        held = disturbance.DisturbanceState(state.x[i], state.cov[i], state.time, state.rows, 0.0)
        held = disturbance.inflated(held, added, params.filter)
        x, held_cov, _ = disturbance.faded(held, time, params.filter)
        mean, var = disturbance.predicted(x, held_cov, row, noise_var, gain)
        on = from_on if i == 1 else from_off
        any_taken = False
        for j in range(2):
            error = y - mean - j * force
            size = abs(error) / np.sqrt(var)
            taken = held.rows < params.filter.settle_rows or size <= gate
            any_taken = any_taken or taken
            seen = min(size, gate)
            turned = on if j == 1 else 1.0 - on
            chance[i, j] = np.log(state.share[i] * turned) - 0.5 * (np.log(var) + seen * seen)
            for a in range(n):
                moved[i, j, a] = x[a] + (gain[a] / var * error if taken else 0.0)
        for a in range(n):
            for b in range(n):
                cov[i, a, b] = held_cov[a, b] - (gain[a] * gain[b] / var if any_taken else 0.0)
    return _merged(state, time, held.rows + 1, moved, cov, chance)


@inlined_kernel
def _merged(state, time, rows, moved, cov, chance):
    """Merge the ways to be off, and those to be on, by their moments.

    Parameters
    ----------
    state : before the row
    time : of the row [s]
    rows : seen with it
    moved : (2, 2, n) estimates, by what the force was and by what it is
    cov : (2, n, n) by what it was
    chance : (2, 2) logarithm of the weight of each
    """
    n = moved.shape[2]
    top = max(max(chance[0, 0], chance[0, 1]), max(chance[1, 0], chance[1, 1]))
    total = 0.0
    for i in range(2):
        for j in range(2):
            chance[i, j] = np.exp(chance[i, j] - top)
            total += chance[i, j]
    chance /= total
    x_out, cov_out, share = np.empty((2, n)), np.empty((2, n, n)), np.empty(2)
    for j in range(2):
        both = chance[0, j] + chance[1, j]
        # Never quite sure: what is certain could not be turned any more.
        share[j] = min(max(both, 1e-9), 1.0 - 1e-9)
        part = chance[1, j] / both if both > 0.0 else 0.5
        for a in range(n):
            x_out[j, a] = (1.0 - part) * moved[0, j, a] + part * moved[1, j, a]
        for a in range(n):
            apart = moved[1, j, a] - moved[0, j, a]
            for b in range(n):
                spread = apart * (moved[1, j, b] - moved[0, j, b])
                cov_out[j, a, b] = (
                    (1.0 - part) * cov[0, a, b] + part * cov[1, a, b] + part * (1.0 - part) * spread
                )
    likelihood = state.log_likelihood + top + np.log(total)
    return SwitchState(x_out, cov_out, share, chance, time, rows, likelihood)


@kernel
def run(state, time, rows, y, noise_var, force, added, params):
    """Apply ``step`` to each row, and find for each by all rows whether the force was on.

    Parameters
    ----------
    state : SwitchState
    time : (m,) float64
        Not falling [s].
    rows : (m, n) float64
    y, noise_var, force : (m,) float64
    added : (m, n) float64
    params : SwitchParams

    Returns
    -------
    on : (m,) float64
        Probability of being on.
    log_likelihood : float
        Of all rows.

    References
    ----------
    Backward pass over the probabilities: Kim, J. Econometrics 60, 1994, with what the next row
    says of the one before it.
    """
    m = y.size
    seen = np.empty((m, 2, 2))
    for k in range(m):
        state = step(state, time[k], rows[k], y[k], noise_var[k], force[k], added[k], params)
        for i in range(2):
            for j in range(2):
                seen[k, i, j] = state.turned[i, j]
    on = np.empty(m)
    on[m - 1] = state.share[1]
    for k in range(m - 2, -1, -1):
        was_on = 0.0
        for j in range(2):
            here = seen[k + 1, 0, j] + seen[k + 1, 1, j]
            part = seen[k + 1, 1, j] / here if here > 0.0 else 0.5
            was_on += (on[k + 1] if j == 1 else 1.0 - on[k + 1]) * part
        on[k] = was_on
    return on, state.log_likelihood
