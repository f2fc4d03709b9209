"""Error-state extended Kalman filter of a wheeled vehicle (Jensen 2022, Algorithm 1).

States, rows and noise are those of `weighbridge.kernels.ins_model`. Between two covariance
steps ("nodes") the mechanisation runs at the full rate of the sensor and only the sums of
``f_n dt`` and ``rot dt`` are kept: they are the blocks of the transition matrix (eq. 34) to
first order in the node spacing.

References
----------
Jensen et al., Mech. Syst. Signal Process. 171, 2022, sec. 5.2-5.4.
Farrell, Aided Navigation, 2008, ch. 11.
"""

import math

import numpy as np

from weighbridge.kernels._jit import fast_kernel, inlined_fast_kernel, inlined_kernel, kernel
from weighbridge.kernels.ins_model import (
    BA,
    BG,
    E_ATT,
    E_BA,
    E_BG,
    E_PITCH0,
    E_SQUAT,
    E_V,
    E_YAW0,
    FORCE,
    LAST,
    PSD,
    RATE,
    SHOWN,
    TIME,
    TRANSITION,
    Z_PITCH_MOVED,
    Z_SPEED,
    Z_YAW_MOVED,
    P,
    Q,
    V,
)
from weighbridge.kernels.ins_model import ERRORS as N
from weighbridge.kernels.ins_rows import travel_angle, update
from weighbridge.kernels.rotation import half_turn, matrix_rows, product

D = N + 1
"""Distance of the diagonal places of a covariance."""

LONGEST_STEP = 0.5
"""Samples further apart are bridged as a gap [s]."""


@inlined_fast_kernel
def _follow_noise(x, wx, wy, wz, dt):
    """Follow the power density of sample-to-sample differences over about a second.

    Half the mean square of differences is the variance of white noise, and
    slow motion hardly enters it; times ``dt`` it is a density. A rattling sensor
    shows here and nowhere else.
    """
    share = min(1.0, dt)
    half = 0.5 * dt
    d0, d1, d2 = wx - x[LAST], wy - x[LAST + 1], wz - x[LAST + 2]
    x[PSD] += share * (half * d0 * d0 - x[PSD])
    x[PSD + 1] += share * (half * d1 * d1 - x[PSD + 1])
    x[PSD + 2] += share * (half * d2 * d2 - x[PSD + 2])
    x[LAST], x[LAST + 1], x[LAST + 2] = wx, wy, wz


@inlined_fast_kernel
def propagate(x, force, turn, dt, noise):
    """Move the filter state by one sample (eqs. 22-29, second order in the attitude).

    Parameters
    ----------
    x : (47,) filter state, changed in place
    force : 3 floats
        Specific force in body axes [m/s^2].
    turn : 3 floats
        Angular rate in body axes [rad/s].
    dt : float
        Time the sample covers [s].
    noise : Noise
    """
    fx, fy, fz = force
    wx, wy, wz = turn
    _follow_noise(x, wx, wy, wz, dt)
    fx, fy, fz = fx - x[BA], fy - x[BA + 1], fz - x[BA + 2]
    wx, wy, wz = wx - x[BG], wy - x[BG + 1], wz - x[BG + 2]
    # specific force is turned with the attitude of the middle of the step
    half = 0.5 * dt
    c, s0, s1, s2 = half_turn(half * wx, half * wy, half * wz)
    q0, q1, q2, q3 = product(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], c, s0, s1, s2)
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = matrix_rows(q0, q1, q2, q3)
    q0, q1, q2, q3 = product(q0, q1, q2, q3, c, s0, s1, s2)
    unit = 1.5 - 0.5 * (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = unit * q0, unit * q1, unit * q2, unit * q3
    f0 = r00 * fx + r01 * fy + r02 * fz
    f1 = r10 * fx + r11 * fy + r12 * fz
    f2 = r20 * fx + r21 * fy + r22 * fz
    x[P] += dt * (x[V] + half * f0)
    x[P + 1] += dt * (x[V + 1] + half * f1)
    x[P + 2] += dt * (x[V + 2] + half * (f2 + noise.gravity))
    x[V] += dt * f0
    x[V + 1] += dt * f1
    x[V + 2] += dt * (f2 + noise.gravity)
    x[TRANSITION] += dt
    x[TRANSITION + 1] += dt * f0
    x[TRANSITION + 2] += dt * f1
    x[TRANSITION + 3] += dt * f2
    x[TRANSITION + 4] += dt * r00
    x[TRANSITION + 5] += dt * r01
    x[TRANSITION + 6] += dt * r02
    x[TRANSITION + 7] += dt * r10
    x[TRANSITION + 8] += dt * r11
    x[TRANSITION + 9] += dt * r12
    x[TRANSITION + 10] += dt * r20
    x[TRANSITION + 11] += dt * r21
    x[TRANSITION + 12] += dt * r22
    x[RATE], x[RATE + 1], x[RATE + 2] = wx, wy, wz
    x[FORCE] += (fx - x[FORCE]) * min(1.0, dt / noise.force_time)


@fast_kernel
def _move_rows(x, cov, columns):
    """Multiply the first ``columns`` columns by the transition since the last node from the left.

    Only the rows of position, velocity and attitude change.
    """
    dt, sx, sy, sz = x[TRANSITION], x[TRANSITION + 1], x[TRANSITION + 2], x[TRANSITION + 3]
    r00, r01, r02 = x[TRANSITION + 4], x[TRANSITION + 5], x[TRANSITION + 6]
    r10, r11, r12 = x[TRANSITION + 7], x[TRANSITION + 8], x[TRANSITION + 9]
    r20, r21, r22 = x[TRANSITION + 10], x[TRANSITION + 11], x[TRANSITION + 12]
    for j in range(columns):
        v0, v1, v2 = cov[3 * N + j], cov[4 * N + j], cov[5 * N + j]
        t0, t1, t2 = cov[6 * N + j], cov[7 * N + j], cov[8 * N + j]
        a0, a1, a2 = cov[9 * N + j], cov[10 * N + j], cov[11 * N + j]
        g0, g1, g2 = cov[12 * N + j], cov[13 * N + j], cov[14 * N + j]
        cov[j] += dt * v0
        cov[N + j] += dt * v1
        cov[2 * N + j] += dt * v2
        # theta x s - R b
        cov[3 * N + j] = v0 + (t1 * sz - t2 * sy) - (r00 * a0 + r01 * a1 + r02 * a2)
        cov[4 * N + j] = v1 + (t2 * sx - t0 * sz) - (r10 * a0 + r11 * a1 + r12 * a2)
        cov[5 * N + j] = v2 + (t0 * sy - t1 * sx) - (r20 * a0 + r21 * a1 + r22 * a2)
        cov[6 * N + j] = t0 - (r00 * g0 + r01 * g1 + r02 * g2)
        cov[7 * N + j] = t1 - (r10 * g0 + r11 * g1 + r12 * g2)
        cov[8 * N + j] = t2 - (r20 * g0 + r21 * g1 + r22 * g2)


@kernel
def _turn_over(cov):
    """Turn the block of the nine rows that move over, and its columns beside into rows."""
    for i in range(1, 9):
        for j in range(i):
            cov[i * N + j], cov[j * N + i] = cov[j * N + i], cov[i * N + j]
    for i in range(9, N):
        for j in range(9):
            cov[i * N + j] = cov[j * N + i]


@kernel
def _mirror(cov):
    """Give columns up to the twelfth, above the diagonal, what is below it."""
    for i in range(1, 12):
        for j in range(min(i, 9)):
            cov[j * N + i] = cov[i * N + j]


@fast_kernel
def propagate_covariance(x, cov, noise):
    """Move the covariance (400,) over the time since the last node (eqs. 34-35).

    ``F P F'`` by rows, so that the compiler can take several columns at once: rows of position,
    velocity and attitude from the left, then the same of what was turned over. The rest follows
    by symmetry, since biases and constants do not move.
    """
    if x[TRANSITION] <= 0.0:
        return
    _move_rows(x, cov, N)
    _turn_over(cov)
    # of the columns beside the block three are spoilt, which symmetry gives back
    _move_rows(x, cov, 12)
    _mirror(cov)
    _add_process_noise(x, cov, noise)


@inlined_fast_kernel
def _add_process_noise(x, cov, noise):
    """Add what the time since the last node makes uncertain; a rattle by the axis it is about."""
    dt = x[TRANSITION]
    share = noise.gyro_share / dt
    for i in range(3):
        cov[(E_V + i) * D] += dt * noise.accel_psd
        cov[(E_ATT + i) * D] += dt * noise.gyro_psd
        cov[(E_BA + i) * D] += dt * noise.accel_bias_psd
        cov[(E_BG + i) * D] += dt * noise.gyro_bias_psd
        r = TRANSITION + 4 + 3 * i
        w0, w1, w2 = (
            share * x[r] * x[PSD],
            share * x[r + 1] * x[PSD + 1],
            share * x[r + 2] * x[PSD + 2],
        )
        for j in range(i, 3):
            q = TRANSITION + 4 + 3 * j
            more = w0 * x[q] + w1 * x[q + 1] + w2 * x[q + 2]
            cov[(E_ATT + i) * N + E_ATT + j] += more
            if j > i:
                cov[(E_ATT + j) * N + E_ATT + i] += more


@inlined_kernel
def bridge_gap(x, cov, gap, speed, noise):
    """Carry the filter over ``gap`` seconds without inertial samples.

    Position goes on with the last velocity, attitude stays; both become as
    uncertain as a vehicle can make them. ``speed`` is what the vehicle shows
    after the gap, NaN where unknown [m/s].
    """
    old = math.sqrt(x[V] ** 2 + x[V + 1] ** 2 + x[V + 2] ** 2)
    for i in range(3):
        x[P + i] += gap * x[V + i]
        if not math.isnan(speed) and old > 0.5:
            x[V + i] *= speed / old
    x[FORCE] = 0.0
    t = min(gap, 60.0)
    for i in range(3):
        tilt = min(0.03 * math.sqrt(t), 0.1) if i < 2 else min(0.2 * t, 1.5)
        cov[(E_ATT + i) * D] += tilt**2
        cov[(E_V + i) * D] += (2.0 * t) ** 2 if i < 2 else t**2
        cov[i * D] += (0.5 * (old + 2.0 * t) * gap) ** 2
        cov[(E_BA + i) * D] += gap * noise.accel_bias_psd
        cov[(E_BG + i) * D] += gap * noise.gyro_bias_psd


@inlined_kernel
def _inflate(cov, pitch_var, yaw_var):
    """Open the mounting by these variances of pitch and yaw, and the attitude with it."""
    cov[E_PITCH0 * D] += pitch_var
    cov[E_YAW0 * D] += yaw_var
    for i in range(3):
        cov[(E_ATT + i) * D] += yaw_var


@inlined_kernel
def _grade_std(x, cov, noise):
    """Standard deviation of the grade [rad]."""
    (r00, _, _), (r10, _, _), _ = matrix_rows(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    n = 1.0 / math.sqrt(r00 * r00 + r10 * r10 + 1e-12)
    # pitch turns about the horizontal axis to the right of the heading; mounting and squat
    # are no grade
    right, ahead = -r10 * n, r00 * n
    _, level, lean = travel_angle(x, noise.gravity)
    a, b, c, d = E_ATT, E_ATT + 1, E_PITCH0, E_SQUAT
    grade = (
        right * right * cov[a * D] + ahead * ahead * cov[b * D]
        + level * level * cov[c * D] + lean * lean * cov[d * D]
        + 2.0 * right * (ahead * cov[a * N + b] - level * cov[a * N + c] - lean * cov[a * N + d])
        - 2.0 * ahead * (level * cov[b * N + c] + lean * cov[b * N + d])
        + 2.0 * level * lean * cov[c * N + d]
    )  # fmt: skip
    return math.sqrt(max(grade, 0.0))


@inlined_kernel
def _node(x, cov, z, node, noise, rows, slot):
    """Process covariance and measurements of a node; keep it where ``rows`` is a log."""
    if z[node, Z_PITCH_MOVED] > 0.0 or z[node, Z_YAW_MOVED] > 0.0:
        _inflate(cov, z[node, Z_PITCH_MOVED], z[node, Z_YAW_MOVED])
    propagate_covariance(x, cov, noise)
    update(x, cov, z, node, noise, rows, slot)
    for i in range(13):
        rows.transition[slot, i] = x[TRANSITION + i]
        x[TRANSITION + i] = 0.0
    if rows.cov.shape[0] > 0:
        for i in range(N * N):
            rows.cov[slot, i] = cov[i]


@kernel
def run(x, cov, samples, rot_bs, noise, rows, states, grade_std):
    """Process inertial samples and, at the nodes, covariance and measurements.

    A sample that is not finite, or does not follow the one before it in time, is left out.

    Parameters
    ----------
    x : (47,) float64
        Filter state, changed in place.
    cov : (400,) float64
        Error covariance, changed in place.
    samples : Samples
    rot_bs : (3, 3) float64
        Sensor to body axes.
    noise : Noise
    rows : Rows
        Work space of one node, or a log of as many as there are.
    states : (m, 24) float64
        Filled: first part of the filter state after each node.
    grade_std : (m,) float64
        Filled: standard deviation of the grade after each node [rad].
    """
    time, accel, gyro, nodes, z = samples
    step_slot = 1 if rows.cov.shape[0] > 0 else 0
    k = np.int64(0)  # not compiled for a literal 0 as well
    for i in range(time.size):
        f0, f1, f2 = accel[i, 0], accel[i, 1], accel[i, 2]
        w0, w1, w2 = gyro[i, 0], gyro[i, 1], gyro[i, 2]
        dt = 0.0 if math.isnan(x[TIME]) else time[i] - x[TIME]
        is_node = k < nodes.size and nodes[k] == i
        if dt >= 0.0 and math.isfinite(f0 + f1 + f2 + w0 + w1 + w2):
            if dt > LONGEST_STEP:
                bridge_gap(x, cov, dt, z[k, Z_SPEED] if is_node else math.nan, noise)
                dt = 0.0
            propagate(
                x,
                (
                    rot_bs[0, 0] * f0 + rot_bs[0, 1] * f1 + rot_bs[0, 2] * f2,
                    rot_bs[1, 0] * f0 + rot_bs[1, 1] * f1 + rot_bs[1, 2] * f2,
                    rot_bs[2, 0] * f0 + rot_bs[2, 1] * f1 + rot_bs[2, 2] * f2,
                ),
                (
                    rot_bs[0, 0] * w0 + rot_bs[0, 1] * w1 + rot_bs[0, 2] * w2,
                    rot_bs[1, 0] * w0 + rot_bs[1, 1] * w1 + rot_bs[1, 2] * w2,
                    rot_bs[2, 0] * w0 + rot_bs[2, 1] * w1 + rot_bs[2, 2] * w2,
                ),
                dt,
                noise,
            )
            x[TIME] = time[i]
        if is_node:
            _node(x, cov, z, k, noise, rows, k * step_slot)
            for a in range(SHOWN):
                states[k, a] = x[a]
            grade_std[k] = _grade_std(x, cov, noise)
            k += 1
