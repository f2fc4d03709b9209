"""Recursive least squares of mass and offset, robust against outliers, with forgetting."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel

CLIPPED = 0.7785
"""Mean of min(z^2, 1.5^2) of a standard normal z: what clipping at 1.5 takes from a variance."""


class RobustRlsParams(NamedTuple):
    """What stays the same from row to row.

    Attributes
    ----------
    window : length of the means that are folded in [s]
    period : time that one row covers [s]
    pause : rows further apart belong to different windows [s]
    forgetting : weight kept by the past at each window, in (0, 1] [-]
    kept_information : sum of squared regressors below which nothing is forgotten
        without being replaced: the guard against wind-up
    threshold : Huber's, in standard deviations of the innovation [-]
    threshold_force : the same in their place [N]; 0 for none
    weight_information : Huber's weight counts in the information, too
    scale_windows : windows over which the innovation variance is averaged [-]
    settle_windows : windows before the threshold holds
    offset_std : standard deviation of the offset over the mass before the drive
        [m/s^2]; 0 for none, as the paper
    offset_forgetting : weight kept by the past of the offset at each window, in
        (0, 1] [-]
    noise_floor : standard deviation over the mass that a window has at least [m/s^2]
    dependence : windows whose error is the same
    """

    window: float
    period: float
    pause: float
    forgetting: float
    kept_information: float
    threshold: float
    threshold_force: float
    weight_information: bool
    scale_windows: float
    settle_windows: int
    offset_std: float
    offset_forgetting: float
    noise_floor: float
    dependence: float


class RobustRlsState(NamedTuple):
    """The estimate, what it is made from, and the window that is open.

    Attributes
    ----------
    mass : the parameter theta of the paper [kg]
    offset : of the force: rolling resistance, zero of the accelerometer [N]
    information : weighted sum of squared regressors, one over the paper's P
    sum_weight, sum_weighted : weighted number of windows and sum of regressors
    noise_var : running variance of the innovations [N^2]
    windows : windows folded in so far
    count : rows in the open window
    begin, last : first row of the open window, last row seen [s]
    sum_phi, sum_y : over the open window
    """

    mass: float
    offset: float
    information: float
    sum_weight: float
    sum_weighted: float
    noise_var: float
    windows: int
    count: int  # type: ignore[assignment]
    begin: float
    last: float
    sum_phi: float
    sum_y: float


def initial_state(mass, information):
    """Start from ``mass`` with an ``information`` > 0, small for none."""
    return RobustRlsState(
        float(mass), 0.0, float(information), 0.0, 0.0, 0.0, 0, 0, 0.0, -np.inf, 0.0, 0.0
    )


@kernel
def floor_var(state, params):
    """Variance of a window, that at the floor at least [N^2]."""
    least = params.noise_floor * state.mass
    return max(state.noise_var, least * least, 1.0)


@kernel
def held(state, params):
    """Weight of the prior on the offset, in windows; 0 where there is no offset."""
    if params.offset_std <= 0.0:
        return 0.0
    # A mass of next to nothing would hold the offset without end.
    prior = params.offset_std * max(abs(state.mass), 1.0)
    return params.dependence * floor_var(state, params) / (prior * prior)


@kernel
def mass_information(state, params):
    """What is known of the mass with the offset unknown, in squared regressors."""
    if params.offset_std <= 0.0:
        return state.information
    known = state.sum_weight + held(state, params)
    return state.information - state.sum_weighted * state.sum_weighted / known


@kernel
def fold(state, phi, y, params):
    """Fold the mean row ``y = phi * mass + offset + noise`` into the estimate.

    Returns
    -------
    state : RobustRlsState
    weight : float
        Huber's weight of the row, in (0, 1] [-].

    References
    ----------
    Du et al. 2025, eqs. 15-20: the weight is 1 up to the threshold and falls as
    its inverse beyond. Here it enters the covariance too, as in Huber and
    Ronchetti, Robust Statistics, 2nd ed., 2009, ch. 7, and the threshold counts
    in standard deviations of the innovation, that of the estimate included: a
    start from nothing is no outlier. Mass and offset have a forgetting factor
    each, as in Vahidi et al., Vehicle System Dynamics 43, 2005.
    """
    innovation = y - phi * state.mass - state.offset
    spread = 1.0 + phi * phi / mass_information(state, params)
    size = abs(innovation)
    bound = params.threshold_force
    if bound <= 0.0:
        bound = params.threshold * np.sqrt(floor_var(state, params) * spread)
    settled = state.windows >= params.settle_windows
    weight = 1.0
    if settled and size > bound:
        weight = bound / size

    # The first window says nothing of the noise: its innovation is the start's error.
    noise_var = state.noise_var
    if state.windows > 0:
        seen = min(size, bound) if settled else size
        correction = CLIPPED if settled else 1.0
        share = 1.0 / min(float(state.windows), params.scale_windows)
        noise_var = noise_var + share * (seen * seen / spread / correction - noise_var)

    keep = params.forgetting
    if keep * state.information < params.kept_information:
        keep = min(1.0, params.kept_information / state.information)
    counted = weight if params.weight_information else 1.0
    information = keep * state.information + counted * phi * phi
    stays = params.offset_forgetting
    sum_weighted = np.sqrt(keep * stays) * state.sum_weighted + counted * phi
    sum_weight = stays * state.sum_weight + counted
    mass, offset = state.mass, state.offset
    if params.offset_std <= 0.0:
        mass += weight * phi * innovation / information
    else:
        known = sum_weight + held(state, params)
        determinant = information * known - sum_weighted * sum_weighted
        mass += weight * innovation * (known * phi - sum_weighted) / determinant
        offset += weight * innovation * (information - sum_weighted * phi) / determinant
    return (
        RobustRlsState(
            mass,
            offset,
            information,
            sum_weight,
            sum_weighted,
            noise_var,
            state.windows + 1,
            state.count,
            state.begin,
            state.last,
            state.sum_phi,
            state.sum_y,
        ),
        weight,
    )


@kernel
def step(state, time, phi, y, valid, params):
    """Take one row; when its window is full, fold the window's mean in.

    Parameters
    ----------
    state : RobustRlsState
    time : float
        Instant of the row [s].
    phi, y : float
        Regressor and measurement; may be NaN where not valid.
    valid : bool
        False closes the open window without folding it in.
    params : RobustRlsParams

    Returns
    -------
    state : RobustRlsState
    mean_phi, mean_y : float
        Of the window folded in at this row; NaN if none was.
    weight : float
        Of that window; NaN if none was.
    """
    count, begin, sum_phi, sum_y = state.count, state.begin, state.sum_phi, state.sum_y
    if not valid or time - state.last > params.pause:
        count, sum_phi, sum_y = 0, 0.0, 0.0
    mean_phi, mean_y, weight = np.nan, np.nan, np.nan
    full = False
    if valid:
        if count == 0:
            begin = time
        count += 1
        sum_phi += phi
        sum_y += y
        # Half a row of tolerance: stamps jitter.
        full = time - begin + 1.5 * params.period >= params.window
    if full:
        mean_phi, mean_y = sum_phi / count, sum_y / count
        count, sum_phi, sum_y = 0, 0.0, 0.0
    state = RobustRlsState(
        state.mass,
        state.offset,
        state.information,
        state.sum_weight,
        state.sum_weighted,
        state.noise_var,
        state.windows,
        count,
        begin,
        time,
        sum_phi,
        sum_y,
    )
    if full:
        state, weight = fold(state, mean_phi, mean_y, params)
    return state, mean_phi, mean_y, weight


@kernel
def variance(state, params):
    """Variance of the mass, with the windows' dependence in it [kg^2]."""
    return params.dependence * floor_var(state, params) / mass_information(state, params)


@kernel
def run(state, time, phi, y, valid, params):
    """Apply ``step`` to each row.

    Parameters
    ----------
    state : RobustRlsState
    time, phi, y : (m,) float64
    valid : (m,) bool
    params : RobustRlsParams

    Returns
    -------
    state : RobustRlsState
        After the last row.
    mass, var, information : (m,) float64
        Estimate, its variance and the weighted sum of squared regressors after
        each row.
    mean_phi, mean_y, weight : (m,) float64
        Of the window folded in at each row; NaN where none was.
    """
    mass = np.empty(time.size)
    var = np.empty(time.size)
    information = np.empty(time.size)
    mean_phi = np.empty(time.size)
    mean_y = np.empty(time.size)
    weight = np.empty(time.size)
    for k in range(time.size):
        state, mean_phi[k], mean_y[k], weight[k] = step(
            state, time[k], phi[k], y[k], valid[k], params
        )
        mass[k] = state.mass
        var[k] = variance(state, params)
        information[k] = state.information
    return state, mass, var, information, mean_phi, mean_y, weight
