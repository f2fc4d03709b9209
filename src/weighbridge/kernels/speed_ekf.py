"""Extended Kalman filter of speed, inverse mass and slope, from speed alone."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel


class SpeedEkfParams(NamedTuple):
    """What stays the same from sample to sample.

    Attributes
    ----------
    sample_time : T_s between samples [s]
    force_gain : a1, traction force per torque [1/m]
    drag : a2, air density times drag area [kg/m]
    gravity : a3 [m/s^2]
    rotating_mass : m_r [kg]
    corrections : (7,) p1 to p7, in SI
    process_var : (3,) diagonal of Q; also that of P where the filter starts
    speed_var : R, of a sample of the speed [m^2/s^2]
    """

    sample_time: float
    force_gain: float
    drag: float
    gravity: float
    rotating_mass: float
    corrections: np.ndarray
    process_var: np.ndarray
    speed_var: float


class SpeedEkfState(NamedTuple):
    """The estimate and the sample before.

    Attributes
    ----------
    x : (3,) speed [m/s], inverse mass phi1 [1/kg], slope phi2 = sin(theta + beta) [-]
    cov : (3, 3) its covariance
    speed : measured one sample earlier; NaN where the estimation was off [m/s]
    """

    x: np.ndarray
    cov: np.ndarray
    speed: float


def initial_state(mass, slope, params):
    """Start from a mass [kg] and a slope [-], with P = Q."""
    return SpeedEkfState(
        np.array([0.0, 1.0 / mass, slope]),
        np.diag(np.asarray(params.process_var, dtype=np.float64)),
        np.nan,
    )


@kernel
def traction_force(speed, params):
    """Traction that the model gives a measured speed (eqs. 15, 18) [N]."""
    p = params.corrections
    return (params.force_gain + p[0] + p[1] * speed) * p[6] * speed


@kernel
def acceleration(x, measured, params):
    """Acceleration of the model and its derivatives.

    Parameters
    ----------
    x : (3,) float64
        State.
    measured : float
        Speed at the previous instant, in torque and corrections [m/s].
    params : SpeedEkfParams

    Returns
    -------
    accel : float
        [m/s^2]
    jacobian : (3,) float64
        Its derivatives by the state.

    References
    ----------
    Galvão et al., eq. 11 with the corrections of eqs. 15-18.
    """
    p = params.corrections
    drag = params.drag + p[2] + p[3] * measured
    gravity = params.gravity + p[4] + p[5] * measured
    force = traction_force(measured, params) - 0.5 * drag * x[0] * x[0]
    inertia = 1.0 + x[1] * params.rotating_mass
    accel = (x[1] * force - gravity * x[2]) / inertia
    jacobian = np.empty(3)
    jacobian[0] = -x[1] * drag * x[0] / inertia
    jacobian[1] = (force - accel * params.rotating_mass) / inertia
    jacobian[2] = -gravity / inertia
    return accel, jacobian


@kernel
def step(state, speed, on, params):
    """Fold one sample of the speed into the estimate.

    Parameters
    ----------
    state : SpeedEkfState
    speed : float
        Measured [m/s].
    on : bool
        False while braking or slow: mass and slope are held then, and the
        speed is taken up anew afterwards.
    params : SpeedEkfParams

    Returns
    -------
    state : SpeedEkfState
    innovation : float
        Measured minus predicted speed [m/s]; NaN where nothing was predicted.
    innovation_var : float
        Its variance as the filter sees it [m^2/s^2]; NaN there too.

    References
    ----------
    Galvão et al., eqs. 13, 14, 21-26.
    """
    if not on:
        return SpeedEkfState(state.x, state.cov, np.nan), np.nan, np.nan
    x, cov = state.x.copy(), state.cov.copy()
    if np.isnan(state.speed):
        x[0] = speed
        cov[0, :] = 0.0
        cov[:, 0] = 0.0
        cov[0, 0] = params.process_var[0]
        return SpeedEkfState(x, cov, speed), np.nan, np.nan

    # The transition is the identity but for its first row, so both updates are of
    # rank one or two: plain loops, which stay symmetric and compile quickly.
    accel, by_state = acceleration(x, state.speed, params)
    x[0] += params.sample_time * accel
    moved = np.zeros(3)
    for i in range(3):
        for j in range(3):
            moved[i] += params.sample_time * by_state[j] * cov[i, j]
    cross = 0.0
    for i in range(3):
        cross += params.sample_time * by_state[i] * moved[i]
    for i in range(3):
        cov[i, 0] += moved[i]
        cov[0, i] += moved[i]
        cov[i, i] += params.process_var[i]
    cov[0, 0] += cross

    innovation = speed - x[0]
    innovation_var = cov[0, 0] + params.speed_var
    seen = cov[:, 0].copy()
    for i in range(3):
        x[i] += seen[i] / innovation_var * innovation
        for j in range(3):
            cov[i, j] -= seen[i] * seen[j] / innovation_var
    return SpeedEkfState(x, cov, speed), innovation, innovation_var


@kernel
def run(state, speed, on, params):
    """Apply ``step`` to each sample.

    Parameters
    ----------
    state : SpeedEkfState
    speed : (n,) float64
    on : (n,) bool
    params : SpeedEkfParams

    Returns
    -------
    state : SpeedEkfState
        After the last sample.
    x : (n, 3) float64
        State after each sample.
    var : (n, 3) float64
        Diagonal of its covariance.
    innovation, innovation_var : (n,) float64
    """
    n = speed.size
    x, var = np.empty((n, 3)), np.empty((n, 3))
    innovation, innovation_var = np.empty(n), np.empty(n)
    for k in range(n):
        state, innovation[k], innovation_var[k] = step(state, speed[k], on[k], params)
        for i in range(3):
            x[k, i] = state.x[i]
            var[k, i] = state.cov[i, i]
    return state, x, var, innovation, innovation_var
