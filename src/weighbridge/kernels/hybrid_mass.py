"""Robust least squares and Kalman filter side by side, and the blend of both."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels import mass_ekf, robust_rls
from weighbridge.kernels._jit import kernel

SPEED, VARIANCE, COVARIANCE, INTERSECTION, INNOVATIONS, SHARE = range(6)
"""How the two are blended, see `share_of_rls`."""

NOISE_WINDOWS = 50.0
"""Windows over which the noise of the innovations is averaged."""


class HybridParams(NamedTuple):
    """What stays the same from row to row.

    Attributes
    ----------
    rls : RobustRlsParams
    ekf : MassEkfParams
    first_information : of the least squares, at which the Kalman filter starts
        from it and a mass is reported
    start_mass : that the Kalman filter starts from instead [kg]; 0 for none
    start_std : of the mass the Kalman filter starts from, relative [-]
    blend : `SPEED` to `SHARE`
    blend_speed, blend_width : middle and width of the change from the one to the
        other [m/s]
    share : of the least squares, the same always [-]
    correlation : of the errors of both [-]
    forgetting : weight that the innovations of the past keep at each window [-]
    caution : squared noises by which both must have differed before the share by innovations
        is half of what they say [-]
    """

    rls: robust_rls.RobustRlsParams
    ekf: mass_ekf.MassEkfParams
    first_information: float
    start_mass: float
    start_std: float
    blend: int
    blend_speed: float
    blend_width: float
    share: float
    correlation: float
    forgetting: float
    caution: float


class Rivals(NamedTuple):
    """How well both have predicted the windows, each by what it knew before the window.

    Attributes
    ----------
    mass, offset : of the Kalman filter when the open window began [kg], [rad]
    apart : weighted sum of the squared difference of both innovations [N^2]
    gain : that of the product of this difference with the Kalman filter's innovation [N^2]
    noise_var : running mean of the Kalman filter's squared innovation [N^2]; 0 before the first
    """

    mass: float
    offset: float
    apart: float
    gain: float
    noise_var: float


class HybridState(NamedTuple):
    """States of both, and what they say together.

    Attributes
    ----------
    rls : RobustRlsState
    ekf : MassEkfState
        Without meaning before it has started.
    started : the Kalman filter runs
    rivals : Rivals
    share : of the least squares in the blend [-]
    mass, var : blended [kg], [kg^2]; NaN before the start
    """

    rls: robust_rls.RobustRlsState
    ekf: mass_ekf.MassEkfState
    started: bool
    rivals: Rivals
    share: float
    mass: float
    var: float


def initial_state(rls, params):
    """Start from a state of the least squares; the Kalman filter follows later."""
    nothing = mass_ekf.Row(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False, False, 0.0)
    ekf = mass_ekf.initial_state(0.0, 0.0, nothing, params.ekf)
    return HybridState(rls, ekf, False, Rivals(0.0, 0.0, 0.0, 0.0, 0.0), 1.0, np.nan, np.nan)


@kernel
def share_at(speed, middle, width):
    """Share h(v) of the least squares at a speed [-].

    A logistic curve that falls from 1 at rest to 0 at speed. Du et al. 2025
    give theirs as a drawing only (fig. 4).
    """
    return 1.0 / (1.0 + np.exp((speed - middle) / width))


@kernel
def share_of_rls(before, speed, rls_var, ekf_var, rivals, params):
    """Share of the least squares in the blend [-].

    Parameters
    ----------
    before : float
        The share until now.
    speed : float
        [m/s]; NaN where it is not known.
    rls_var, ekf_var : float
        Variances that the two have themselves [kg^2].
    rivals : Rivals
    params : HybridParams

    References
    ----------
    By speed: Du et al. 2025, eq. 34. By variances, the errors of both correlated: Bar-Shalom and
    Campo, IEEE Transactions on Aerospace and Electronic Systems 22, 1986. By innovations: Bates
    and Granger, Operational Research Quarterly 20, 1969. Covariance intersection of two numbers
    takes the one of the smaller variance: Julier and Uhlmann, American Control Conference, 1997.
    """
    if params.blend == SHARE:
        return params.share
    if params.blend == SPEED:
        if not np.isfinite(speed):
            return before
        return share_at(speed, params.blend_speed, params.blend_width)
    if params.blend == INTERSECTION:
        return 1.0 if rls_var < ekf_var else 0.0
    if params.blend == INNOVATIONS:
        most = rivals.apart + params.caution * rivals.noise_var
        return min(max(rivals.gain / most, 0.0), 1.0) if most > 0.0 else 0.0
    common = 0.0
    if params.blend == COVARIANCE:
        common = params.correlation * np.sqrt(rls_var * ekf_var)
    spread = rls_var + ekf_var - 2.0 * common
    return min(max((ekf_var - common) / spread, 0.0), 1.0) if spread > 0.0 else before


@kernel
def compare(rivals, mean_phi, mean_y, rls_innovation, params):
    """Fold in how well both predicted a window of the least squares.

    The least-squares weights of two forecasts of one force, as in Bates and Granger, are what
    the sums give: the share that would have predicted the past best.
    """
    innovation = mean_y - (mean_phi - params.ekf.gravity * rivals.offset) * rivals.mass
    apart = innovation - rls_innovation
    square = innovation * innovation
    noise_var = square
    if rivals.noise_var > 0.0:
        # An outlier says little of the noise.
        seen = min(square, 9.0 * rivals.noise_var)
        noise_var = rivals.noise_var + (seen - rivals.noise_var) / NOISE_WINDOWS
    return Rivals(
        rivals.mass,
        rivals.offset,
        params.forgetting * rivals.apart + apart * apart,
        params.forgetting * rivals.gain + innovation * apart,
        noise_var,
    )


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
    before = state.rls
    rls, mean_phi, mean_y, weight = robust_rls.step(
        before, row.time, phi, y, row.driven, params.rls
    )
    ekf, started, taken, rivals = state.ekf, state.started, False, state.rivals
    if started:
        if np.isfinite(mean_phi):
            foretold = mean_phi * before.mass + before.offset
            rivals = compare(rivals, mean_phi, mean_y, mean_y - foretold, params)
        if rls.count <= 1:
            mass, offset = ekf.x[mass_ekf.MASS], ekf.x[mass_ekf.OFFSET]
            rivals = Rivals(mass, offset, rivals.apart, rivals.gain, rivals.noise_var)
        ekf, innovation, passed = mass_ekf.step(ekf, row, params.ekf)
        taken = passed and np.isfinite(innovation)
    elif params.start_mass > 0.0 or rls.information >= params.first_information:
        started = True
        first = params.start_mass if params.start_mass > 0.0 else rls.mass
        spread = params.start_std * first
        ekf = mass_ekf.initial_state(first, spread * spread, row, params.ekf)
        rivals = Rivals(first, 0.0, 0.0, 0.0, 0.0)
    share, mass, var = state.share, state.mass, state.var
    if started:
        ekf_mass, ekf_var = ekf.x[mass_ekf.MASS], ekf.cov[mass_ekf.MASS, mass_ekf.MASS]
        # A start of the Kalman filter from the least squares says that they have reported a mass.
        if params.start_mass <= 0.0 or rls.information >= params.first_information:
            rls_var = robust_rls.variance(rls, params.rls)
            share = share_of_rls(share, row.speed, rls_var, ekf_var, rivals, params)
            mass = share * rls.mass + (1.0 - share) * ekf_mass
            # Both see the same rows, so their errors are taken as one.
            std = share * np.sqrt(rls_var) + (1.0 - share) * np.sqrt(ekf_var)
            var = std * std
        else:
            share, mass, var = 0.0, ekf_mass, ekf_var
    return HybridState(rls, ekf, started, rivals, share, mass, var), mean_phi, mean_y, weight, taken


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
