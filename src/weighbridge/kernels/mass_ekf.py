"""Extended Kalman filter of speed, grade and mass."""

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


class MassEkfState(NamedTuple):
    """Estimate, covariance and the row it stands at.

    Attributes
    ----------
    speed, grade, mass : [m/s], [rad], [kg]
    p_vv, p_va, p_vm, p_aa, p_am, p_mm : covariance of speed, grade a and mass
    row : the last one
    """

    speed: float
    grade: float
    mass: float
    p_vv: float
    p_va: float
    p_vm: float
    p_aa: float
    p_am: float
    p_mm: float
    row: Row


UNKNOWN_SPEED_VAR = 1e4
UNKNOWN_GRADE_VAR = 4e-3
"""Variances before anything is measured [(m/s)^2], [rad^2]; a road is within 8 % or so."""


@kernel
def initial_state(mass, mass_var, row):
    """Start at a row, with a mass [kg] and its variance [kg^2]; the rest is unknown."""
    return MassEkfState(
        0.0, 0.0, mass, UNKNOWN_SPEED_VAR, 0.0, 0.0, UNKNOWN_GRADE_VAR, 0.0, mass_var, row
    )


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
    mass in the derivative by mass.
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
    by_mass = -(weight + accel) / inertia
    return accel, by_speed, by_grade, by_mass


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
    Du et al. 2025, eqs. 21-33; sequential scalar updates in Joseph's form.
    """
    v, a, m = state.speed, state.grade, state.mass
    p_vv, p_va, p_vm = state.p_vv, state.p_va, state.p_vm
    p_aa, p_am, p_mm = state.p_aa, state.p_am, state.p_mm
    before = state.row
    span = row.time - before.time
    p_aa += params.grade_walk * span
    p_mm += (params.load_walk if row.standing else params.mass_walk) * span

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
        )
        accel, by_speed, by_grade, by_mass = acceleration(v, a, m, held, params)
        v += accel * span
        f_v, f_a, f_m = 1.0 + by_speed * span, by_grade * span, by_mass * span
        c_v = f_v * p_vv + f_a * p_va + f_m * p_vm
        c_a = f_v * p_va + f_a * p_aa + f_m * p_am
        c_m = f_v * p_vm + f_a * p_am + f_m * p_mm
        p_vv = f_v * c_v + f_a * c_a + f_m * c_m + params.accel_walk * span
        p_va, p_vm = c_a, c_m

        noise = params.speed_density / span
        total = p_vv + noise
        difference = row.speed - v
        innovation = difference / np.sqrt(total)
        taken = abs(innovation) <= params.gate
        if taken:
            k_v, k_a, k_m = p_vv / total, p_va / total, p_vm / total
            v += k_v * difference
            a += k_a * difference
            m += k_m * difference
            # Joseph's form for h = (1, 0, 0).
            rest = 1.0 - k_v
            j_vv = rest * rest * p_vv + k_v * k_v * noise
            j_va = rest * (p_va - k_a * p_vv) + k_v * k_a * noise
            j_vm = rest * (p_vm - k_m * p_vv) + k_v * k_m * noise
            j_aa = p_aa - 2.0 * k_a * p_va + k_a * k_a * total
            j_am = p_am - k_a * p_vm - k_m * p_va + k_a * k_m * total
            j_mm = p_mm - 2.0 * k_m * p_vm + k_m * k_m * total
            p_vv, p_va, p_vm, p_aa, p_am, p_mm = j_vv, j_va, j_vm, j_aa, j_am, j_mm
    if not connected or not taken:
        p_va, p_vm = 0.0, 0.0
        if np.isfinite(row.speed):
            v = row.speed
            p_vv = params.speed_density / max(span, 1e-3)
        else:
            p_vv = UNKNOWN_SPEED_VAR

    if np.isfinite(row.grade):
        noise = params.grade_density / max(span, 1e-3)
        total = p_aa + noise
        difference = row.grade - a
        k_v, k_a, k_m = p_va / total, p_aa / total, p_am / total
        v += k_v * difference
        a += k_a * difference
        m += k_m * difference
        rest = 1.0 - k_a
        j_aa = rest * rest * p_aa + k_a * k_a * noise
        j_va = rest * (p_va - k_v * p_aa) + k_a * k_v * noise
        j_am = rest * (p_am - k_m * p_aa) + k_a * k_m * noise
        j_vv = p_vv - 2.0 * k_v * p_va + k_v * k_v * total
        j_vm = p_vm - k_v * p_am - k_m * p_va + k_v * k_m * total
        j_mm = p_mm - 2.0 * k_m * p_am + k_m * k_m * total
        p_vv, p_va, p_vm, p_aa, p_am, p_mm = j_vv, j_va, j_vm, j_aa, j_am, j_mm

    m = min(max(m, params.lightest), params.heaviest)
    return MassEkfState(v, a, m, p_vv, p_va, p_vm, p_aa, p_am, p_mm, row), innovation, taken


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
        mass[begin] = state.mass
        mass_var[begin] = state.p_mm
    for k in range(begin + 1, n):
        state, innovation[k], passed = step(state, row_at(columns, k), params)
        taken[k] = passed and np.isfinite(innovation[k])
        mass[k] = state.mass
        mass_var[k] = state.p_mm
    return state, mass, mass_var, innovation, taken
