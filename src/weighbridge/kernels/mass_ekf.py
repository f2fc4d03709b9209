"""Extended Kalman filter of speed, grade, mass and the offset of the measured grade."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel


class MassEkfParams(NamedTuple):
    """What stays the same from row to row.

    Attributes
    ----------
    gravity : [m/s^2]
    rolling, rolling_speed : rolling resistance coefficient at standstill [-] and
        its growth with speed [s/m]
    speed_density, grade_density : of the measurements' noise: variance times the
        time over which it is the same [(m/s)^2 s], [rad^2 s]
    accel_walk : of the acceleration that the model does not know [m^2/s^3]
    grade_walk : of the road's slope [rad^2/s]
    mass_walk, load_walk : of the mass while driving and while standing [kg^2/s]
    start_speed_var, start_grade_var : of speed and grade at the start [(m/s)^2], [rad^2]
    offset_var, offset_walk : of the offset of the measured grade at the start [rad^2]
        and its walk [rad^2/s]
    gate : speed innovations beyond this many standard deviations are left out [-]
    pause : rows further apart are not connected [s]
    lightest, heaviest : bounds of the mass [kg]
    """

    gravity: float
    rolling: float
    rolling_speed: float
    speed_density: float
    grade_density: float
    accel_walk: float
    grade_walk: float
    mass_walk: float
    load_walk: float
    start_speed_var: float
    start_grade_var: float
    offset_var: float
    offset_walk: float
    gate: float
    pause: float
    lightest: float
    heaviest: float


class Row(NamedTuple):
    """One row of the force balance.

    Attributes
    ----------
    time : [s]
    traction : force at the wheels [N]
    drag : air drag over the square of the air speed, rho C_d A / 2 [kg/m]
    headwind : air speed less speed [m/s]
    rotating : mass of the rotating parts at the wheels [kg]
    speed, grade : measured [m/s], [rad]; may be NaN
    driven : forces are known: no brake, no shift
    standing : the vehicle stands
    regressor : measured specific force and rolling resistance over the mass, at which the model is
        linearised in the mass; NaN to linearise at the model's own [m/s^2]
    """

    time: float
    traction: float
    drag: float
    headwind: float
    rotating: float
    speed: float
    grade: float
    driven: bool
    standing: bool
    regressor: float


class MassEkfState(NamedTuple):
    """Estimate, covariance and the row it stands at.

    Attributes
    ----------
    x : (4,) speed [m/s], grade [rad], mass [kg], offset of the measured grade [rad]
    cov : (4, 4)
    row : the last one
    """

    x: np.ndarray
    cov: np.ndarray
    row: Row


UNKNOWN_SPEED_VAR = 1e4
"""Variance of a speed that nothing has measured [(m/s)^2]."""

SPEED, GRADE, MASS, OFFSET = range(4)
"""Places in the state."""

SHORTEST = 1e-3
"""Rows nearer than this count as so far apart, in the noise of a row [s]."""


@kernel
def initial_state(mass, mass_var, row, params):
    """Start at a row, with a mass [kg] and its variance [kg^2]; the rest is unknown."""
    x = np.array([0.0, 0.0, mass, 0.0])
    cov = np.zeros((4, 4))
    cov[SPEED, SPEED] = params.start_speed_var
    cov[GRADE, GRADE] = params.start_grade_var
    cov[MASS, MASS] = mass_var
    cov[OFFSET, OFFSET] = params.offset_var
    return MassEkfState(x, cov, row)


@kernel
def acceleration(speed, grade, mass, row, params):
    """Acceleration by the model and its derivatives.

    Parameters
    ----------
    speed, grade, mass : float
    row : Row
        Forces and rotating mass.
    params : MassEkfParams

    Returns
    -------
    accel : float
        [m/s^2]
    by_speed, by_grade, by_mass : float
        Its partial derivatives.

    References
    ----------
    Du et al. 2025, eqs. 22, 28; here without the small-angle approximation,
    with the slope of the rolling resistance and with the part of the rotating
    mass in the derivative by mass. That is minus what multiplies the mass over the
    inertia. By the model it holds the noise of the force, which draws the mass up:
    the measured one does not.
    """
    air = speed + row.headwind
    sine, cosine = np.sin(grade), np.cos(grade)
    rolling = params.rolling + params.rolling_speed * speed
    weight = params.gravity * (sine + rolling * cosine)
    inertia = mass + row.rotating
    accel = (row.traction - row.drag * air * abs(air) - mass * weight) / inertia
    by_speed = (
        -2.0 * row.drag * abs(air) - mass * params.gravity * params.rolling_speed * cosine
    ) / inertia
    by_grade = -mass * params.gravity * (cosine - rolling * sine) / inertia
    moved = weight + accel
    if np.isfinite(row.regressor):
        moved = row.regressor
    by_mass = -moved / inertia
    return accel, by_speed, by_grade, by_mass


@kernel
def fold(x, cov, part, measured, noise):
    """Fold one scalar measurement in, in place, by Joseph's form.

    Parameters
    ----------
    x, cov : (n,), (n, n) float64
    part : (n,) float64
        The measurement is ``part @ x`` and noise.
    measured, noise : float
        Value and variance of the noise.
    """
    # Plain loops: matrix products of four rows would only take long to compile.
    n = x.size
    shared = np.zeros(n)
    spread, residual = 0.0, measured
    for i in range(n):
        for j in range(n):
            shared[i] += cov[i, j] * part[j]
        spread += part[i] * shared[i]
        residual -= part[i] * x[i]
    total = spread + noise
    for i in range(n):
        gain = shared[i] / total
        x[i] += gain * residual
        left = shared[i] - gain * spread
        for j in range(i, n):
            other = shared[j] / total
            cov[i, j] += gain * other * noise - gain * shared[j] - left * other
            cov[j, i] = cov[i, j]


@kernel
def step(state, row, params):
    """Predict to a row and fold in its speed and grade.

    Between two driven rows the speed follows the model, with the mean of both
    rows' forces. Otherwise the speed is taken as measured and the mass only
    walks.

    Parameters
    ----------
    state : MassEkfState
    row : Row
        Later than the state's.
    params : MassEkfParams

    Returns
    -------
    state : MassEkfState
    innovation : float
        Of the speed, over its standard deviation [-]; NaN where the model did
        not predict it.
    taken : bool
        False where the gate left the row's speed out.

    References
    ----------
    Du et al. 2025, eqs. 21-33, with a fourth state for the offset of the
    measured grade.
    """
    x, cov, before = state.x.copy(), state.cov.copy(), state.row
    span = row.time - before.time
    apart = max(span, SHORTEST)
    cov[GRADE, GRADE] += params.grade_walk * span
    cov[MASS, MASS] += (params.load_walk if row.standing else params.mass_walk) * span
    cov[OFFSET, OFFSET] += params.offset_walk * span

    connected = row.driven and before.driven and span <= params.pause and np.isfinite(row.speed)
    innovation = np.nan
    taken = True
    if connected:
        held = Row(
            row.time,
            0.5 * (before.traction + row.traction),
            0.5 * (before.drag + row.drag),
            0.5 * (before.headwind + row.headwind),
            0.5 * (before.rotating + row.rotating),
            row.speed,
            row.grade,
            True,
            False,
            0.5 * (before.regressor + row.regressor) - params.gravity * x[OFFSET],
        )
        accel, by_speed, by_grade, by_mass = acceleration(x[SPEED], x[GRADE], x[MASS], held, params)
        x[SPEED] += accel * span
        # Only the first row of the transition differs from the unit matrix.
        slope = (1.0 + by_speed * span, by_grade * span, by_mass * span)
        first = np.empty(4)
        for i in range(4):
            first[i] = slope[0] * cov[0, i] + slope[1] * cov[1, i] + slope[2] * cov[2, i]
        cov[SPEED, SPEED] = (
            slope[0] * first[0] + slope[1] * first[1] + slope[2] * first[2]
        ) + params.accel_walk * span
        for i in range(1, 4):
            cov[SPEED, i] = first[i]
            cov[i, SPEED] = first[i]
        total = cov[SPEED, SPEED] + params.speed_density / apart
        innovation = (row.speed - x[SPEED]) / np.sqrt(total)
        taken = abs(innovation) <= params.gate
        if taken:
            fold(x, cov, np.array([1.0, 0.0, 0.0, 0.0]), row.speed, params.speed_density / apart)
    if not connected or not taken:
        cov[SPEED, :] = 0.0
        cov[:, SPEED] = 0.0
        if np.isfinite(row.speed):
            x[SPEED] = row.speed
            cov[SPEED, SPEED] = params.speed_density / apart
        else:
            cov[SPEED, SPEED] = UNKNOWN_SPEED_VAR
    if np.isfinite(row.grade):
        fold(x, cov, np.array([0.0, 1.0, 0.0, 1.0]), row.grade, params.grade_density / apart)
    x[MASS] = min(max(x[MASS], params.lightest), params.heaviest)
    return MassEkfState(x, cov, row), innovation, taken


@kernel
def row_at(columns, k):
    """Row ``k`` of `Columns`."""
    return Row(
        columns.time[k],
        columns.traction[k],
        columns.drag[k],
        columns.headwind[k],
        columns.rotating[k],
        columns.speed[k],
        columns.grade[k],
        columns.driven[k],
        columns.standing[k],
        columns.regressor[k],
    )


class Columns(NamedTuple):
    """`Row` by row: the same names, arrays (n,)."""

    time: np.ndarray
    traction: np.ndarray
    drag: np.ndarray
    headwind: np.ndarray
    rotating: np.ndarray
    speed: np.ndarray
    grade: np.ndarray
    driven: np.ndarray
    standing: np.ndarray
    regressor: np.ndarray


@kernel
def run(state, columns, begin, params):
    """Apply ``step`` to each row after ``begin``.

    Parameters
    ----------
    state : MassEkfState
        At row ``begin``.
    columns : Columns
    begin : int
    params : MassEkfParams

    Returns
    -------
    state : MassEkfState
        After the last row.
    mass, mass_var : (n,) float64
        After each row; NaN before ``begin``.
    innovation : (n,) float64
        Over its standard deviation; NaN where the model predicted nothing.
    taken : (n,) bool
        The row's speed was predicted by the model and taken.
    """
    n = columns.time.size
    mass = np.full(n, np.nan)
    mass_var = np.full(n, np.nan)
    innovation = np.full(n, np.nan)
    taken = np.zeros(n, dtype=np.bool_)
    if begin < n:
        mass[begin] = state.x[MASS]
        mass_var[begin] = state.cov[MASS, MASS]
    for k in range(begin + 1, n):
        state, innovation[k], passed = step(state, row_at(columns, k), params)
        taken[k] = passed and np.isfinite(innovation[k])
        mass[k] = state.x[MASS]
        mass_var[k] = state.cov[MASS, MASS]
    return state, mass, mass_var, innovation, taken
