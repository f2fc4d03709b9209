"""The Kalman-Bucy filter of Nguyen 2024 with one fixed process noise, in three forms.

The state is x = (v, q): vertical, roll and pitch velocity, and three parameters. With the
known acceleration phi of the reference parameters p0 under the suspension forces,

    v' = phi / q,   q = p / p0     in direct form, and
    v' = phi q,     q = p0 / p     in inverse form, which is linear.

The Riccati equation is integrated by a step of the transition and a fold of the
measurement, each exact for its part: the covariance stays positive definite at any rate.
"""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel
from weighbridge.kernels.inertia_hypothesis import VELOCITY_STD, integral

PRINTED, EXTENDED, INVERSE = 0, 1, 2
"""As printed (A_02 = 0 in the Riccati equation), with the Jacobian, in inverse parameters."""


class KalmanBucyParams(NamedTuple):
    """What stays the same from sample to sample.

    Attributes
    ----------
    spring, damper : (3, 4) acceleration of each axis per travel and per rate of each
        wheel, of the reference parameters
    process : (6, 6) spectral density Q of the process noise [state^2/s]
    noise : (3,) spectral density R of the measurement noise [m^2/s], [rad^2/s]
    lowest, highest : bounds of q [-]
    longest : step between samples above which velocities are unknown [s]
    form : PRINTED, EXTENDED or INVERSE
    """

    spring: np.ndarray
    damper: np.ndarray
    process: np.ndarray
    noise: np.ndarray
    lowest: float
    highest: float
    longest: float
    form: int


class KalmanBucyState(NamedTuple):
    """The estimate after a sample.

    Attributes
    ----------
    time : of the sample [s]
    phi : (2, 3) at the sample and the one before
    old_step : between them [s]; 0 where there is none
    mean : (6,) velocities, parameters over those of the reference
    cov : (6, 6)
    """

    time: float
    phi: np.ndarray
    old_step: float
    mean: np.ndarray
    cov: np.ndarray


def initial_state(mean, cov):
    """Start with mean (6,) and covariance (6, 6) at no time yet."""
    return KalmanBucyState(
        np.nan,
        np.full((2, 3), np.nan),
        0.0,
        np.array(mean, dtype=np.float64),
        np.array(cov, dtype=np.float64),
    )


@kernel
def fold(mean, cov, j, measured, noise):
    """Fold a measurement of state ``j`` in.

    What the measurement takes from its own row is written as the share that stays,
    ``noise / var``: nothing small is a difference of large numbers.
    """
    var = cov[j, j] + noise
    row = cov[j].copy()
    innovation = measured - mean[j]
    for i in range(6):
        mean[i] += row[i] / var * innovation
        for k in range(i, 6):
            if i == j or k == j:
                cov[i, k] = cov[i, k] * (noise / var)
            else:
                cov[i, k] -= row[i] * row[k] / var
            cov[k, i] = cov[i, k]


@kernel
def step(state, time, travel, rate, velocity, params):
    """Fold one sample in.

    Parameters
    ----------
    state : KalmanBucyState
    time : float
        After the sample before [s].
    travel, rate : (4,) float64
        Of the suspension at the wheels, positive in extension [m], [m/s].
    velocity : (3,) float64
        Measured; NaN where it was not.
    params : KalmanBucyParams

    Returns
    -------
    state : KalmanBucyState

    References
    ----------
    Nguyen 2024, eqs. 7-9. Jazwinski, Stochastic Processes and Filtering Theory, 1970,
    sec. 7.3, for the limit of dense samples: their noise variance is R over the step.
    """
    mean, cov = state.mean.copy(), state.cov.copy()
    phi = np.empty((2, 3))
    slope = np.zeros(3)  # of each velocity by its parameter
    length = time - state.time
    known = length > 0.0 and length <= params.longest
    old_step = state.old_step if np.isfinite(state.phi[1, 0]) else 0.0
    for j in range(3):
        phi[1, j] = state.phi[0, j]
        phi[0, j] = 0.0
        for w in range(4):
            phi[0, j] -= params.spring[j, w] * travel[w] + params.damper[j, w] * rate[w]
        if known:
            impulse = integral(state.phi[1, j], phi[1, j], phi[0, j], old_step, length)
            q = mean[3 + j]
            if params.form == INVERSE:
                mean[j] += impulse * q
                slope[j] = impulse
            else:
                mean[j] += impulse / q
                if params.form == EXTENDED:
                    slope[j] = -impulse / (q * q)
    if known:
        # Half of the process noise before and half after: of second order in the step.
        for i in range(6):
            for k in range(6):
                cov[i, k] += 0.5 * length * params.process[i, k]
        for j in range(3):
            for k in range(6):
                cov[j, k] += slope[j] * cov[3 + j, k]
        for j in range(3):
            for k in range(6):
                cov[k, j] += slope[j] * cov[k, 3 + j]
        for i in range(6):
            for k in range(6):
                cov[i, k] += 0.5 * length * params.process[i, k]
    else:
        for j in range(3):
            for i in range(6):
                cov[j, i] = 0.0
                cov[i, j] = 0.0
            cov[j, j] = VELOCITY_STD**2
            if np.isfinite(velocity[j]):
                mean[j] = velocity[j]
    for j in range(3):
        if np.isfinite(velocity[j]):
            fold(mean, cov, j, velocity[j], params.noise[j] / (length if known else 1.0))
    for j in range(3, 6):
        mean[j] = min(max(mean[j], params.lowest), params.highest)
    return KalmanBucyState(time, phi, length if known else 0.0, mean, cov)


@kernel
def run(state, time, travel, rate, velocity, params):
    """Apply ``step`` to each sample.

    Returns
    -------
    state : KalmanBucyState
        After the last sample.
    mean : (n, 6) float64
    std : (n, 6) float64
    """
    mean, std = np.empty((time.size, 6)), np.empty((time.size, 6))
    for k in range(time.size):
        state = step(state, time[k], travel[k], rate[k], velocity[k], params)
        mean[k] = state.mean
        for i in range(6):
            std[k, i] = np.sqrt(state.cov[i, i])
    return state, mean, std
