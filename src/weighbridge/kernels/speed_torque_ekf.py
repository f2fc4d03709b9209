"""Extended Kalman filter of speed, inverse mass, slope, rolling resistance and constant errors."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel


class SpeedTorqueParams(NamedTuple):
    """What stays the same from sample to sample.

    Attributes
    ----------
    gravity : [m/s^2]
    rolling, rolling_speed : rolling resistance coefficient at standstill [-] and its growth with
        speed [s/m]
    speed_var : R, of one sample of the speed [m^2/s^2]
    accel_density : of the acceleration that the model does not know, white [m^2/s^3]
    gust_speed : speed at which gusts are half of it [m/s]
    slope_var : of the slope that no grade shows, where it is stationary [-]
    slope_length : way over which it lasts; infinite for a random walk [m]
    slope_walk : growth of its variance per way [1/m]
    rolling_var : of the error of the rolling coefficient, where it is stationary [-]
    rolling_time : over which that lasts [s]
    mass_walk : growth of the variance of the inverse mass [1/(kg^2 s)]
    gate : innovations beyond so many standard deviations are left out [-]
    """

    gravity: float
    rolling: float
    rolling_speed: float
    speed_var: float
    accel_density: float
    gust_speed: float
    slope_var: float
    slope_length: float
    slope_walk: float
    rolling_var: float
    rolling_time: float
    mass_walk: float
    gate: float


class Step(NamedTuple):
    """One sample of the speed, and what acted since the one before.

    Attributes
    ----------
    length : time since the sample before [s]
    speed : measured [m/s]; NaN where unknown
    force : traction, mean since then [N]
    force_var : variance of its noise [N^2]
    drag : air drag over the square of the air speed, rho C_d A / 2 [kg/m]
    headwind : air speed less speed [m/s]
    rotating : mass of the rotating parts at the wheels [kg]
    grade : known, mean since then [rad]
    accel : measured, mean since then, at which the model is linearised in the inverse mass; NaN to
        linearise at the model's own [m/s^2]
    columns : (k,) force that one unit of each constant error takes [N per unit]
    on : the forces since then are known: no brake, no shift, no gap
    """

    length: float
    speed: float
    force: float
    force_var: float
    drag: float
    headwind: float
    rotating: float
    grade: float
    accel: float
    columns: np.ndarray
    on: bool


class Columns(NamedTuple):
    """The samples of a drive: arrays (n,) of the fields of `Step`, columns (n, k)."""

    length: np.ndarray
    speed: np.ndarray
    force: np.ndarray
    force_var: np.ndarray
    drag: np.ndarray
    headwind: np.ndarray
    rotating: np.ndarray
    grade: np.ndarray
    accel: np.ndarray
    columns: np.ndarray
    on: np.ndarray


class SpeedTorqueState(NamedTuple):
    """The estimate and its covariance.

    Attributes
    ----------
    x : (4 + k,) speed [m/s], inverse mass phi1 [1/kg], slope above the known grade, as a sine [-],
        error of the rolling coefficient [-], and the constant errors, each in its unit
    cov : (4 + k, 4 + k)
    known : whether the speed is that of a sample
    """

    x: np.ndarray
    cov: np.ndarray
    known: bool


SPEED, INVERSE, SLOPE, ROLLING, CONSTANT = range(5)
"""Places in the state; the constant errors begin at the last."""


@kernel
def acceleration(x, row, params):
    """Acceleration by the model and its derivatives.

    Parameters
    ----------
    x : (n,) float64
        State.
    row : Step
    params : SpeedTorqueParams

    Returns
    -------
    accel : float
        [m/s^2]
    jacobian : (n,) float64
        Its derivatives by the state.

    References
    ----------
    Galvão et al., eqs. 8, 11, the torque an input (eq. 13); with speed-dependent rolling
    resistance, a known part of the grade and constant errors of the force.
    """
    air = x[SPEED] + row.headwind
    cosine = np.cos(row.grade)
    rolling = params.rolling + params.rolling_speed * x[SPEED] + x[ROLLING]
    weight = params.gravity * (np.sin(row.grade) + x[SLOPE] + rolling * cosine)
    force = row.force - row.drag * air * abs(air)
    for k in range(row.columns.size):
        force -= row.columns[k] * x[CONSTANT + k]
    inertia = 1.0 + x[INVERSE] * row.rotating
    accel = (x[INVERSE] * force - weight) / inertia
    jacobian = np.empty(x.size)
    jacobian[SPEED] = (
        -2.0 * x[INVERSE] * row.drag * abs(air) - params.gravity * params.rolling_speed * cosine
    ) / inertia
    if np.isfinite(row.accel):
        known = params.rolling + params.rolling_speed * x[SPEED]
        lifted = params.gravity * (np.sin(row.grade) + known * cosine)
        jacobian[INVERSE] = (row.accel + lifted) / (x[INVERSE] * inertia)
    else:
        jacobian[INVERSE] = (force - accel * row.rotating) / inertia
    jacobian[SLOPE] = -params.gravity / inertia
    jacobian[ROLLING] = -params.gravity * cosine / inertia
    for k in range(row.columns.size):
        jacobian[CONSTANT + k] = -x[INVERSE] * row.columns[k] / inertia
    return accel, jacobian


@kernel
def drift(x, cov, row, params):
    """Let slope, rolling resistance and inverse mass walk for one step, in place."""
    way = max(x[SPEED], 0.0) * row.length
    for place, keep, var, walk in (
        (SLOPE, np.exp(-way / params.slope_length), params.slope_var, params.slope_walk * way),
        (ROLLING, np.exp(-row.length / params.rolling_time), params.rolling_var, 0.0),
        (INVERSE, 1.0, 0.0, params.mass_walk * row.length),
    ):
        x[place] *= keep
        for i in range(x.size):
            cov[i, place] *= keep
            cov[place, i] *= keep
        cov[place, place] += (1.0 - keep**2) * var + walk


@kernel
def take_speed(x, cov, speed, var):
    """Take the speed as measured, whatever was predicted, in place."""
    x[SPEED] = speed
    for i in range(x.size):
        cov[i, SPEED] = 0.0
        cov[SPEED, i] = 0.0
    cov[SPEED, SPEED] = var


@kernel
def predict(x, cov, row, params):
    """Let the force act for one step, in place.

    The step is that of the midpoint rule in the mean, Euler's in the covariance.
    """
    accel, by_state = acceleration(x, row, params)
    middle = x.copy()
    middle[SPEED] += 0.5 * row.length * accel
    accel, by_state = acceleration(middle, row, params)
    gusts = 0.5 * (1.0 + (x[SPEED] / params.gust_speed) ** 2)
    x[SPEED] += row.length * accel
    moved = np.zeros(x.size)
    for i in range(x.size):
        for j in range(x.size):
            moved[i] += row.length * by_state[j] * cov[i, j]
    cross = 0.0
    for i in range(x.size):
        cross += row.length * by_state[i] * moved[i]
    for i in range(x.size):
        cov[i, SPEED] += moved[i]
        cov[SPEED, i] += moved[i]
    cov[SPEED, SPEED] += cross + gusts * params.accel_density * row.length
    cov[SPEED, SPEED] += x[INVERSE] ** 2 * row.force_var * row.length**2


@kernel
def step(state, row, params):
    """Fold one sample of the speed into the estimate.

    Parameters
    ----------
    state : SpeedTorqueState
    row : Step
    params : SpeedTorqueParams

    Returns
    -------
    state : SpeedTorqueState
    innovation : float
        Measured minus predicted speed [m/s]; NaN where nothing was predicted.
    innovation_var : float
        Its variance as the filter sees it [m^2/s^2]; NaN there too.
    taken : bool
        Whether the sample updated the mass: False where the forces are unknown, and where the gate
        left it out.

    References
    ----------
    Galvão et al., eqs. 13, 21-26.
    """
    x, cov = state.x.copy(), state.cov.copy()
    if not state.known and np.isfinite(row.speed):
        x[SPEED] = row.speed
    drift(x, cov, row, params)
    if not np.isfinite(row.speed):
        return SpeedTorqueState(x, cov, False), np.nan, np.nan, False
    if not (state.known and row.on):
        take_speed(x, cov, row.speed, params.speed_var)
        return SpeedTorqueState(x, cov, True), np.nan, np.nan, False
    held, held_cov = x.copy(), cov.copy()
    predict(x, cov, row, params)
    innovation = row.speed - x[SPEED]
    innovation_var = cov[SPEED, SPEED] + params.speed_var
    if innovation**2 > params.gate**2 * innovation_var:
        take_speed(held, held_cov, row.speed, params.speed_var)
        return SpeedTorqueState(held, held_cov, True), innovation, innovation_var, False
    seen = cov[:, SPEED].copy()
    for i in range(x.size):
        x[i] += seen[i] / innovation_var * innovation
        for j in range(x.size):
            cov[i, j] -= seen[i] * seen[j] / innovation_var
    return SpeedTorqueState(x, cov, True), innovation, innovation_var, True


@kernel
def row_at(table, k):
    """Return one row of columns."""
    return Step(
        table.length[k],
        table.speed[k],
        table.force[k],
        table.force_var[k],
        table.drag[k],
        table.headwind[k],
        table.rotating[k],
        table.grade[k],
        table.accel[k],
        table.columns[k],
        table.on[k],
    )


@kernel
def run(state, table, params):
    """Apply ``step`` to each sample.

    Parameters
    ----------
    state : SpeedTorqueState
    table : Columns
    params : SpeedTorqueParams

    Returns
    -------
    state : SpeedTorqueState
        After the last sample.
    x : (n, 4 + k) float64
        State after each sample.
    var : (n, 4 + k) float64
        Diagonal of its covariance.
    innovation, innovation_var : (n,) float64
    taken : (n,) bool
    """
    n = table.speed.size
    size = state.x.size
    x, var = np.empty((n, size)), np.empty((n, size))
    innovation, innovation_var = np.empty(n), np.empty(n)
    taken = np.zeros(n, dtype=np.bool_)
    for k in range(n):
        state, innovation[k], innovation_var[k], taken[k] = step(state, row_at(table, k), params)
        for i in range(size):
            x[k, i] = state.x[i]
            var[k, i] = state.cov[i, i]
    return state, x, var, innovation, innovation_var, taken


@kernel
def log_likelihood(state, table, params):
    """Logarithm of the likelihood of all innovations (Schweppe, IEEE Trans. Inf. Theory 11, 1965).

    An innovation that the gate leaves out counts as if it lay on the gate, so that the sum does
    not gain by leaving rows out.

    Parameters
    ----------
    state, table, params : as of `run`
    """
    total = 0.0
    for k in range(table.speed.size):
        state, innovation, var, _ = step(state, row_at(table, k), params)
        if np.isfinite(innovation):
            total -= 0.5 * (min(innovation**2 / var, params.gate**2) + np.log(var))
    return total
