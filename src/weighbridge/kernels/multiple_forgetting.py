"""Least squares of mass and grade, each with a forgetting factor of its own."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel


class ForgettingState(NamedTuple):
    """Estimate and gains.

    Attributes
    ----------
    theta : (2,) inverse mass [1/kg] and sine of the grade, rolling resistance included [-]
    gain : (2,) the scalar covariance of each, as far as noise of one [1/kg^2], [-]
    """

    theta: np.ndarray
    gain: np.ndarray


@kernel
def step(state, force, gravity, accel, forgetting):
    """Fold the row ``accel = force theta_1 - gravity theta_2`` into the estimate.

    Parameters
    ----------
    state : ForgettingState
    force : float
        That moves and lifts the mass [N].
    gravity : float
        [m/s^2]
    accel : float
        [m/s^2]
    forgetting : (2,) float64
        Weight that the past keeps, of mass and grade, in (0, 1] [-].

    Returns
    -------
    state : ForgettingState

    References
    ----------
    Vahidi, Stefanopoulou and Peng, Vehicle System Dynamics 43, 2005: two scalar recursions, whose
    gains are joined by the denominator.
    """
    phi = (force, -gravity)
    theta, gain = state.theta.copy(), state.gain.copy()
    innovation = accel - phi[0] * theta[0] - phi[1] * theta[1]
    joined = 1.0
    for i in range(2):
        joined += gain[i] * phi[i] * phi[i] / forgetting[i]
    for i in range(2):
        theta[i] += gain[i] * phi[i] / forgetting[i] / joined * innovation
        gain[i] /= forgetting[i] + phi[i] * phi[i] * gain[i]
    return ForgettingState(theta, gain)


@kernel
def run(state, force, gravity, accel, forgetting):
    """Apply ``step`` to each row.

    Parameters
    ----------
    state : ForgettingState
    force, accel : (n,) float64
    gravity : float
    forgetting : (2,) float64

    Returns
    -------
    state : ForgettingState
        After the last row.
    theta : (n, 2) float64
        Estimate after each row.
    """
    theta = np.empty((accel.size, 2))
    for k in range(accel.size):
        state = step(state, force[k], gravity, accel[k], forgetting)
        theta[k, 0] = state.theta[0]
        theta[k, 1] = state.theta[1]
    return state, theta
