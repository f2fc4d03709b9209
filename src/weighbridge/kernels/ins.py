"""Error-state extended Kalman filter of a wheeled vehicle (Jensen 2022, Algorithm 1).

Nominal state, one flat array so that a step allocates nothing:

======  =====================================================================
0:3     position, north east down of a fixed origin [m]
3:6     velocity, north east down [m/s]
6:10    attitude quaternion, body to navigation, scalar first
10:13   accelerometer bias [m/s^2]
13:16   gyro bias [rad/s]
16      pitch of the body axes over the direction of travel, mounting [rad]
17      yaw from the body's x axis to the direction of travel, mounting [rad]
18      squat: further pitch of the body per acceleration [rad per m/s^2]
19      indicated over true vehicle speed [-]
20      distance of the sensor ahead of the axle that does not slip sideways [m]
21      acceleration along the body, low-passed [m/s^2]
22, 23  rows of GNSS and of vehicle speed refused in succession [-]
24:27   last angular rate, body axes [rad/s]
27:30   its noise power density by axis, from differences of neighbours
======  =====================================================================

Error state (20): position, velocity, attitude (rotation vector in navigation
axes: ``rot_true = exp([theta x]) rot``), accelerometer bias, gyro bias, then
the five constants 16..20. The first 15 are the paper's; the constants are what
its method takes as known.

Between two covariance steps ("nodes") the mechanisation runs at the full rate
of the sensor and only the sums of ``f_n dt`` and ``rot dt`` are kept: they are
the blocks of the transition matrix (eq. 34) to first order in the node spacing.
Measurements are processed one scalar row after another, so no matrix is
inverted and the covariance stays symmetric to the last bit (eq. 44 does not).

Velocity rows carry the attitude term ``r x v`` that eq. 46 leaves out, where
``r`` is the row's body axis in navigation coordinates.

References
----------
Jensen et al., Mech. Syst. Signal Process. 171, 2022, sec. 5.2-5.4.
Farrell, Aided Navigation, 2008, ch. 11.
Bierman, Fixed interval smoothing with discrete measurements, Int. J. Control
18, 1973 (the backward pass).
"""

import math
from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import fast_kernel, kernel
from weighbridge.kernels.rotation import half_turn, matrix_rows, product

STATES = 30
SHOWN = 24
"""Part of the nominal state that a run keeps for each node."""
ERRORS = 20
MEASUREMENTS = 11
ROWS = 11
"""Most scalar rows one node can process."""

P, V, Q, BA, BG, PITCH0, YAW0, SQUAT, SCALE, LEVER, ACCEL, LOST_GNSS, LOST_SPEED, LAST, PSD = (
    0, 3, 6, 10, 13, 16, 17, 18, 19, 20, 21, 22, 23, 24, 27,
)  # fmt: skip
"""Places in the nominal state."""

Z_SPEED, Z_SPEED_VAR, Z_STILL, Z_N, Z_E, Z_D, Z_HVAR, Z_VVAR, Z_VN, Z_VE, Z_VEL_VAR = range(11)
"""Places in a measurement vector; NaN where there is none. ``Z_STILL`` is 0 when
moving, 1 when the wheels stand, 2 when the body rests too."""


class Noise(NamedTuple):
    """Noise model of the filter.

    Attributes
    ----------
    gravity : [m/s^2]
    accel_psd : of specific force [(m/s^2)^2/Hz]
    gyro_psd : of angular rate [(rad/s)^2/Hz]
    gyro_share : part of the power of sample-to-sample differences of the rate taken
        as white noise on top [-]: 1 is right for white noise, less for
        vibration that the sensor follows
    accel_bias_psd : random walk of the accelerometer bias [(m/s^2)^2/s]
    gyro_bias_psd : random walk of the gyro bias [(rad/s)^2/s]
    lateral_std : lateral velocity of the body at rest speed [m/s]
    lateral_slip_std : further, per speed [-]
    lateral_turn_std : further, per yaw rate: side slip [m]
    vertical_std : vertical velocity of the body, heave [m/s]
    vertical_slope_std : further, per speed [-]
    constraint_time : correlation time of the constraint errors [s]
    still_std : velocity of a standing body [m/s]
    rest_rate_std : angular rate of a body at rest [rad/s]
    gate : normalised innovation squared above which a row is refused [-]
    patience : refusals in succession after which a row is believed again [-]
    accel_time : time constant of the low-passed acceleration [s]
    constraints : 1 with the non-holonomic rows, 0 without
    """

    gravity: float
    accel_psd: float
    gyro_psd: float
    gyro_share: float
    accel_bias_psd: float
    gyro_bias_psd: float
    lateral_std: float
    lateral_slip_std: float
    lateral_turn_std: float
    vertical_std: float
    vertical_slope_std: float
    constraint_time: float
    still_std: float
    rest_rate_std: float
    gate: float
    patience: float
    accel_time: float
    constraints: float


class Work(NamedTuple):
    """Scratch arrays of one filter, so that a step allocates nothing.

    Attributes
    ----------
    transition : (13,) time, sum of ``f_n dt`` and sum of ``rot dt`` since the last node
    h, ph : (20,) one measurement row, covariance times row
    rate : (3,) last angular rate, bias removed [rad/s]
    """

    transition: np.ndarray
    h: np.ndarray
    ph: np.ndarray
    rate: np.ndarray


class RowLog(NamedTuple):
    """What the backward pass needs of each node; empty arrays log nothing.

    Attributes
    ----------
    transition : (m, 13) see `Work`
    cov : (m, 20, 20) after the node's rows
    row_count : (m,) rows processed
    h, ph : (m, 11, 20) rows and covariance times row
    innovation, innovation_var : (m, 11)
    """

    transition: np.ndarray
    cov: np.ndarray
    row_count: np.ndarray
    h: np.ndarray
    ph: np.ndarray
    innovation: np.ndarray
    innovation_var: np.ndarray


def new_work() -> Work:
    """Return scratch arrays for one filter."""
    return Work(np.zeros(13), np.zeros(ERRORS), np.zeros(ERRORS), np.zeros(3))


def new_log(nodes: int) -> RowLog:
    """Return a log for so many nodes; 0 logs nothing."""
    return RowLog(
        np.zeros((nodes, 13)),
        np.zeros((nodes, ERRORS, ERRORS)),
        np.zeros(nodes, np.int64),
        np.zeros((nodes, ROWS, ERRORS)),
        np.zeros((nodes, ROWS, ERRORS)),
        np.zeros((nodes, ROWS)),
        np.zeros((nodes, ROWS)),
    )


@fast_kernel
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


@fast_kernel
def propagate(x, work, fx, fy, fz, wx, wy, wz, dt, noise):
    """Move the nominal state by one sample (eqs. 22-29, second order in the attitude).

    Parameters
    ----------
    x : (30,) nominal state, changed in place
    work : Work
    fx, fy, fz : float
        Specific force in body axes [m/s^2].
    wx, wy, wz : float
        Angular rate in body axes [rad/s].
    dt : float
        Time the sample stands for [s].
    noise : Noise
    """
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
    tr = work.transition
    tr[0] += dt
    tr[1] += dt * f0
    tr[2] += dt * f1
    tr[3] += dt * f2
    tr[4] += dt * r00
    tr[5] += dt * r01
    tr[6] += dt * r02
    tr[7] += dt * r10
    tr[8] += dt * r11
    tr[9] += dt * r12
    tr[10] += dt * r20
    tr[11] += dt * r21
    tr[12] += dt * r22
    work.rate[0], work.rate[1], work.rate[2] = wx, wy, wz
    accel = fx + noise.gravity * r20
    x[ACCEL] += (accel - x[ACCEL]) * min(1.0, dt / noise.accel_time)


@fast_kernel
def propagate_covariance(x, cov, work, noise):
    """Move the covariance over the time since the last node (eqs. 34-35).

    ``F P F'`` by blocks: rows of position, velocity and attitude over all
    columns, then only the 9 x 9 block from the right; the rest follows by
    symmetry since the biases and constants do not move.
    """
    tr = work.transition
    dt, sx, sy, sz = tr[0], tr[1], tr[2], tr[3]
    if dt <= 0.0:
        return
    r00, r01, r02 = tr[4], tr[5], tr[6]
    r10, r11, r12 = tr[7], tr[8], tr[9]
    r20, r21, r22 = tr[10], tr[11], tr[12]
    for j in range(ERRORS):
        t0, t1, t2 = cov[6, j], cov[7, j], cov[8, j]
        a0, a1, a2 = cov[9, j], cov[10, j], cov[11, j]
        g0, g1, g2 = cov[12, j], cov[13, j], cov[14, j]
        v0, v1, v2 = cov[3, j], cov[4, j], cov[5, j]
        cov[0, j] += dt * v0
        cov[1, j] += dt * v1
        cov[2, j] += dt * v2
        # theta x s - R b
        cov[3, j] = v0 + (t1 * sz - t2 * sy) - (r00 * a0 + r01 * a1 + r02 * a2)
        cov[4, j] = v1 + (t2 * sx - t0 * sz) - (r10 * a0 + r11 * a1 + r12 * a2)
        cov[5, j] = v2 + (t0 * sy - t1 * sx) - (r20 * a0 + r21 * a1 + r22 * a2)
        cov[6, j] = t0 - (r00 * g0 + r01 * g1 + r02 * g2)
        cov[7, j] = t1 - (r10 * g0 + r11 * g1 + r12 * g2)
        cov[8, j] = t2 - (r20 * g0 + r21 * g1 + r22 * g2)
    # from the right a row needs itself only; below the diagonal symmetry serves
    for i in range(9):
        v0, v1, v2 = cov[i, 3], cov[i, 4], cov[i, 5]
        t0, t1, t2 = cov[i, 6], cov[i, 7], cov[i, 8]
        if i < 3:
            cov[i, 0] += dt * v0
            cov[i, 1] += dt * v1
            cov[i, 2] += dt * v2
        if i < 6:
            a0, a1, a2 = cov[i, 9], cov[i, 10], cov[i, 11]
            cov[i, 3] = v0 + (t1 * sz - t2 * sy) - (r00 * a0 + r01 * a1 + r02 * a2)
            cov[i, 4] = v1 + (t2 * sx - t0 * sz) - (r10 * a0 + r11 * a1 + r12 * a2)
            cov[i, 5] = v2 + (t0 * sy - t1 * sx) - (r20 * a0 + r21 * a1 + r22 * a2)
        g0, g1, g2 = cov[i, 12], cov[i, 13], cov[i, 14]
        cov[i, 6] = t0 - (r00 * g0 + r01 * g1 + r02 * g2)
        cov[i, 7] = t1 - (r10 * g0 + r11 * g1 + r12 * g2)
        cov[i, 8] = t2 - (r20 * g0 + r21 * g1 + r22 * g2)
    n = cov.shape[0]
    for i in range(9):
        for j in range(i + 1, n):
            cov[j, i] = cov[i, j]
    for i in range(3):
        cov[3 + i, 3 + i] += dt * noise.accel_psd
        cov[6 + i, 6 + i] += dt * noise.gyro_psd
        # by body axis: a loose sensor rattles about one of them
        share = noise.gyro_share / dt
        w0, w1, w2 = tr[4 + 3 * i] * x[PSD], tr[5 + 3 * i] * x[PSD + 1], tr[6 + 3 * i] * x[PSD + 2]
        for j in range(i, 3):
            more = share * (w0 * tr[4 + 3 * j] + w1 * tr[5 + 3 * j] + w2 * tr[6 + 3 * j])
            cov[6 + i, 6 + j] += more
            if j > i:
                cov[6 + j, 6 + i] += more
        cov[9 + i, 9 + i] += dt * noise.accel_bias_psd
        cov[12 + i, 12 + i] += dt * noise.gyro_bias_psd


@fast_kernel
def correct(x, dx):
    """Add the error ``dx`` (20,) to the nominal state ``x`` (eqs. 41-43)."""
    for i in range(6):
        x[i] += dx[i]
    for i in range(11):
        x[BA + i] += dx[9 + i]
    c, s0, s1, s2 = half_turn(dx[6], dx[7], dx[8])
    q0, q1, q2, q3 = product(c, s0, s1, s2, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    unit = 1.5 - 0.5 * (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = unit * q0, unit * q1, unit * q2, unit * q3


@fast_kernel
def _fold(x, cov, ph, innovation, innovation_var):
    """Fold one row whose covariance product is ``ph`` (20,) into state and covariance.

    Leaves ``ph`` scaled.
    """
    n = cov.shape[0]  # not the constant: the compiler would unroll instead of vectorise
    scale = 1.0 / math.sqrt(innovation_var)
    for i in range(n):
        ph[i] *= scale
    for i in range(n):
        c = ph[i]
        for j in range(n):
            cov[i, j] -= c * ph[j]
    gain = innovation * scale
    for i in range(6):
        x[i] += gain * ph[i]
    for i in range(11):
        x[BA + i] += gain * ph[9 + i]
    c, s0, s1, s2 = half_turn(gain * ph[6], gain * ph[7], gain * ph[8])
    q0, q1, q2, q3 = product(c, s0, s1, s2, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    unit = 1.5 - 0.5 * (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = unit * q0, unit * q1, unit * q2, unit * q3


@fast_kernel
def _body_row(x, h, axis, lean):
    """Set ``h`` (20,) to the row of one body velocity; return that velocity and the forward one.

    The row's direction is body axis ``axis`` less ``lean`` times the forward
    axis, in navigation coordinates: lean carries the mounting and squat angle.
    Places 15.. of ``h`` are left zero for the caller.
    """
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = matrix_rows(
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    )
    vx, vy, vz = x[V], x[V + 1], x[V + 2]
    forward = r00 * vx + r10 * vy + r20 * vz
    if axis == 0:
        rx, ry, rz = r00, r10, r20
    elif axis == 1:
        rx, ry, rz = r01, r11, r21
    else:
        rx, ry, rz = r02, r12, r22
    rx -= lean * r00
    ry -= lean * r10
    rz -= lean * r20
    for i in range(ERRORS):
        h[i] = 0.0
    h[3], h[4], h[5] = rx, ry, rz
    h[6], h[7], h[8] = ry * vz - rz * vy, rz * vx - rx * vz, rx * vy - ry * vx
    return rx * vx + ry * vy + rz * vz, forward


@fast_kernel
def _body_product(cov, h, ph):
    """Set ``ph`` to ``P h`` of a row with velocity, attitude and constants; return ``h P h'``."""
    h3, h4, h5, h6, h7, h8 = h[3], h[4], h[5], h[6], h[7], h[8]
    h15, h16, h17, h18, h19 = h[15], h[16], h[17], h[18], h[19]
    n = cov.shape[0]
    for j in range(n):
        ph[j] = h3 * cov[3, j] + h4 * cov[4, j] + h5 * cov[5, j]
    for j in range(n):
        ph[j] += h6 * cov[6, j] + h7 * cov[7, j] + h8 * cov[8, j]
    for j in range(n):
        ph[j] += h15 * cov[15, j] + h16 * cov[16, j] + h17 * cov[17, j]
    for j in range(n):
        ph[j] += h18 * cov[18, j] + h19 * cov[19, j]
    return (
        h3 * ph[3] + h4 * ph[4] + h5 * ph[5] + h6 * ph[6] + h7 * ph[7] + h8 * ph[8]
        + h15 * ph[15] + h16 * ph[16] + h17 * ph[17] + h18 * ph[18] + h19 * ph[19]
    )  # fmt: skip


@fast_kernel
def _direct_product(cov, h, ph, place):
    """Set ``h`` and ``ph`` for a row that reads one error state; return its variance."""
    for j in range(ERRORS):
        h[j] = 0.0
        ph[j] = cov[place, j]
    h[place] = 1.0
    return cov[place, place]


@kernel
def _record(log, node, h, ph, innovation, innovation_var):
    """Keep one row for the backward pass, before `_fold` scales ``ph``."""
    if node < log.row_count.size:
        k = log.row_count[node]
        for i in range(ERRORS):
            log.h[node, k, i] = h[i]
            log.ph[node, k, i] = ph[i]
        log.innovation[node, k] = innovation
        log.innovation_var[node, k] = innovation_var
        log.row_count[node] = k + 1


@kernel
def update(x, cov, work, z, noise, log, node):
    """Process the rows of one node.

    Parameters
    ----------
    x, cov : nominal state and covariance, changed in place
    work : Work
    z : (11,) measurement vector, NaN where there is none
    noise : Noise
    log : RowLog
    node : int
        Place in the log.
    """
    h, ph = work.h, work.ph
    period = work.transition[0]
    # errors of wheel speed and constraints last for about constraint_time: the
    # white noise of the same power density has this much more variance
    inflate = max(1.0, 2.0 * noise.constraint_time / max(period, 1e-3))

    if not (math.isnan(z[Z_N]) and math.isnan(z[Z_D])):
        refused = False
        for i in range(3):
            if math.isnan(z[Z_N + i]):
                continue
            r = z[Z_VVAR] if i == 2 else z[Z_HVAR]
            s = _direct_product(cov, h, ph, i) + r
            e = z[Z_N + i] - x[P + i]
            nis = e * e / s
            if nis > noise.gate:
                refused = True
                if x[LOST_GNSS] < noise.patience:
                    continue
                # lost: believe the fix, with a variance that makes it just possible
                s = e * e / noise.gate
                s = max(s, cov[i, i] + r)
            _record(log, node, h, ph, e, s)
            _fold(x, cov, ph, e, s)
        if not refused:
            x[LOST_GNSS] = 0.0
        elif x[LOST_GNSS] < noise.patience:
            x[LOST_GNSS] += 1.0
        else:
            # the filter, not the receiver, is wrong: let it move
            for i in range(3):
                cov[i, i] += 25.0
                cov[3 + i, 3 + i] += 1.0
    if not math.isnan(z[Z_VN]):
        for i in range(2):
            s = _direct_product(cov, h, ph, 3 + i) + z[Z_VEL_VAR]
            e = z[Z_VN + i] - x[V + i]
            s = max(s, e * e / noise.gate)
            _record(log, node, h, ph, e, s)
            _fold(x, cov, ph, e, s)

    if z[Z_STILL] > 0.0:
        for axis in range(3):
            v, _ = _body_row(x, h, axis, 0.0)
            e = -v
            s = _body_product(cov, h, ph) + noise.still_std**2 * inflate
            s = max(s, e * e / noise.gate)
            _record(log, node, h, ph, e, s)
            _fold(x, cov, ph, e, s)
        if z[Z_STILL] > 1.0:
            for i in range(3):
                # the residual rate at rest is what is left of the bias
                s = _direct_product(cov, h, ph, 12 + i) + noise.rest_rate_std**2 * inflate
                e = work.rate[i]
                s = max(s, e * e / noise.gate)
                _record(log, node, h, ph, e, s)
                _fold(x, cov, ph, e, s)
        return

    if not math.isnan(z[Z_SPEED]):
        vx, _ = _body_row(x, h, 0, 0.0)
        for i in range(3, 9):
            h[i] *= x[SCALE]
        h[18] = vx
        s = _body_product(cov, h, ph) + z[Z_SPEED_VAR]
        e = z[Z_SPEED] - x[SCALE] * vx
        if e * e <= noise.gate * s:
            x[LOST_SPEED] = 0.0
            _record(log, node, h, ph, e, s)
            _fold(x, cov, ph, e, s)
        elif x[LOST_SPEED] < noise.patience:
            x[LOST_SPEED] += 1.0
        else:
            s = e * e / noise.gate
            _record(log, node, h, ph, e, s)
            _fold(x, cov, ph, e, s)
            for i in range(3):
                cov[3 + i, 3 + i] += 1.0

    if noise.constraints > 0.0:
        v, speed = _body_row(x, h, 1, x[YAW0])
        v -= x[LEVER] * work.rate[2]
        h[16] = -speed
        h[19] = -work.rate[2]
        r = (
            noise.lateral_std**2
            + (noise.lateral_slip_std * speed) ** 2
            + (noise.lateral_turn_std * work.rate[2]) ** 2
        )
        s = _body_product(cov, h, ph) + r * inflate
        s = max(s, v * v / noise.gate)
        _record(log, node, h, ph, -v, s)
        _fold(x, cov, ph, -v, s)

        v, speed = _body_row(x, h, 2, x[PITCH0] + x[SQUAT] * x[ACCEL])
        h[15] = -speed
        h[17] = -speed * x[ACCEL]
        r = noise.vertical_std**2 + (noise.vertical_slope_std * speed) ** 2
        s = _body_product(cov, h, ph) + r * inflate
        s = max(s, v * v / noise.gate)
        _record(log, node, h, ph, -v, s)
        _fold(x, cov, ph, -v, s)


@kernel
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
    x[ACCEL] = 0.0
    t = min(gap, 60.0)
    for i in range(3):
        tilt = min(0.03 * math.sqrt(t), 0.1) if i < 2 else min(0.2 * t, 1.5)
        cov[6 + i, 6 + i] += tilt**2
        cov[3 + i, 3 + i] += (2.0 * t) ** 2 if i < 2 else t**2
        cov[i, i] += (0.5 * (old + 2.0 * t) * gap) ** 2
        cov[9 + i, 9 + i] += gap * noise.accel_bias_psd
        cov[12 + i, 12 + i] += gap * noise.gyro_bias_psd


@kernel
def step(x, cov, work, accel, gyro, dt, is_node, z, noise, log, node):
    """Process one inertial sample and, at a node, covariance and measurements.

    Parameters
    ----------
    x : (30,) float64
        Nominal state, changed in place.
    cov : (20, 20) float64
        Error covariance, changed in place.
    work : Work
    accel, gyro : (3,) float64
        Specific force [m/s^2] and angular rate [rad/s] in body axes.
    dt : float
        Time the sample stands for [s]; beyond 0.5 s it is bridged as a gap.
    is_node : bool
        Whether covariance and measurements follow.
    z : (11,) float64
        Measurements of this node; not read otherwise.
    noise : Noise
    log : RowLog
    node : int
        Place in the log.
    """
    if dt > 0.5:
        bridge_gap(x, cov, dt, z[Z_SPEED], noise)
        dt = 0.0
    propagate(x, work, accel[0], accel[1], accel[2], gyro[0], gyro[1], gyro[2], dt, noise)
    if is_node:
        propagate_covariance(x, cov, work, noise)
        if node < log.row_count.size:
            log.row_count[node] = 0
            log.transition[node] = work.transition
        update(x, cov, work, z, noise, log, node)
        if node < log.row_count.size:
            log.cov[node] = cov
        work.transition[:] = 0.0


@kernel
def grade_std(x, cov, work):
    """Return the standard deviation of the grade: pitch less mounting and squat [rad]."""
    h, ph = work.h, work.ph
    (r00, _, _), (r10, _, _), _ = matrix_rows(x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    n = 1.0 / math.sqrt(r00 * r00 + r10 * r10 + 1e-12)
    for i in range(ERRORS):
        h[i] = 0.0
    # pitch turns about the horizontal axis to the right of the heading
    h[6], h[7] = -r10 * n, r00 * n
    h[15], h[17] = -1.0, -x[ACCEL]
    return math.sqrt(max(_body_product(cov, h, ph), 0.0))


@kernel
def run(x, cov, work, time, accel, gyro, rot_bs, nodes, first, last, z, noise, log, states, stds):
    """Run `step` over the samples up to node ``last`` (excluded) from node ``first``.

    Parameters
    ----------
    x, cov, work : as in `step`; at ``first`` the state just after node ``first - 1``
    time : (n,) float64
        Stamps of the inertial samples [s].
    accel, gyro : (n, 3) float64
        In sensor axes.
    rot_bs : (3, 3) float64
        Sensor to body axes.
    nodes : (m,) int64
        Sample of each node, rising.
    first, last : int
    z : (m, 11) float64
        Measurements of each node.
    noise : Noise
    log : RowLog
        Of ``last - first`` nodes, or empty.
    states : (m, 24) float64
        Filled: first part of the nominal state after each node.
    stds : (m,) float64
        Filled: standard deviation of the grade after each node [rad].
    """
    start = nodes[first - 1] + 1 if first > 0 else 0
    f = np.empty(3)
    w = np.empty(3)
    k = first
    for i in range(start, nodes[last - 1] + 1):
        for a in range(3):
            f[a] = (
                rot_bs[a, 0] * accel[i, 0] + rot_bs[a, 1] * accel[i, 1] + rot_bs[a, 2] * accel[i, 2]
            )
            w[a] = rot_bs[a, 0] * gyro[i, 0] + rot_bs[a, 1] * gyro[i, 1] + rot_bs[a, 2] * gyro[i, 2]
        dt = time[i] - time[i - 1] if i > 0 else 0.0
        is_node = i == nodes[k]
        step(x, cov, work, f, w, dt, is_node, z[k], noise, log, k - first)
        if is_node:
            for a in range(SHOWN):
                states[k, a] = x[a]
            stds[k] = grade_std(x, cov, work)
            k += 1


@fast_kernel
def smooth(log, count, adjoint, states, first):
    """Go backward over one stretch of nodes (Bierman 1973, modified Bryson-Frazier).

    Parameters
    ----------
    log : RowLog
        Of the nodes ``first .. first + count - 1``.
    count : int
    adjoint : (20,) float64
        From the stretch after this one, zero at the end of the drive; changed
        in place, for the stretch before.
    states : (m, 24) float64
        Nominal states after each node; corrected in place.
    first : int
    """
    dx = np.empty(ERRORS)
    for k in range(count - 1, -1, -1):
        for i in range(ERRORS):
            total = 0.0
            for j in range(ERRORS):
                total += log.cov[k, i, j] * adjoint[j]
            dx[i] = -total
        correct(states[first + k], dx)
        for row in range(log.row_count[k] - 1, -1, -1):
            s = log.innovation_var[k, row]
            back = log.innovation[k, row] / s
            for i in range(ERRORS):
                back += log.ph[k, row, i] * adjoint[i] / s
            for i in range(ERRORS):
                adjoint[i] -= log.h[k, row, i] * back
        tr = log.transition[k]
        dt, sx, sy, sz = tr[0], tr[1], tr[2], tr[3]
        v0, v1, v2 = adjoint[3], adjoint[4], adjoint[5]
        t0, t1, t2 = adjoint[6], adjoint[7], adjoint[8]
        for i in range(3):
            adjoint[9 + i] -= tr[4 + i] * v0 + tr[7 + i] * v1 + tr[10 + i] * v2
            adjoint[12 + i] -= tr[4 + i] * t0 + tr[7 + i] * t1 + tr[10 + i] * t2
        adjoint[6] = t0 + sy * v2 - sz * v1
        adjoint[7] = t1 + sz * v0 - sx * v2
        adjoint[8] = t2 + sx * v1 - sy * v0
        for i in range(3):
            adjoint[3 + i] += dt * adjoint[i]


@fast_kernel
def lowpass_resample(time, values, start, period, count, reach, out, weight):
    """Low-pass unevenly sampled channels and take them to an even clock, without delay.

    Each output is the weighted mean of the samples within ``reach`` output
    periods, with the weights ``sinc(0.8 u) cos^2(pi u / (2 reach))`` of a Hann-windowed
    ideal low-pass at 0.4 of the output rate: beyond 0.6 of it, what would
    fold stays below 1 % for ``reach = 3``.

    Parameters
    ----------
    time : (n,) float64
        Rising [s].
    values : (n, c) float64
    start, period : float
        First output instant and distance of outputs [s].
    count : int
    reach : float
        [-]
    out : (count, c) float64
        Filled; NaN where too few samples are near.
    weight : (count,) float64
        Filled: sum of the weights, about samples per output period.
    """
    channels = values.shape[1]
    fine = 256
    size = int(reach * fine)
    window = np.empty(size + 2)
    for i in range(size + 2):
        u = i / fine
        angle = math.pi * 0.8 * u
        window[i] = math.sin(angle) / angle if i > 0 else 1.0
        window[i] *= math.cos(0.5 * math.pi * min(u, reach) / reach) ** 2
    out[:] = 0.0
    weight[:] = 0.0
    nearest = np.zeros(count)
    for i in range(time.size):
        # each sample stands for the time to its neighbours, so that jitter and
        # bursts do not weigh more
        left = time[i] - time[i - 1] if i > 0 else time[i + 1] - time[i]
        right = time[i + 1] - time[i] if i + 1 < time.size else left
        share = 0.5 * (min(left, 2.0 * period) + min(right, 2.0 * period)) / period
        place = (time[i] - start) / period
        low = max(0, math.ceil(place - reach))
        high = min(count - 1, math.floor(place + reach))
        for k in range(low, high + 1):
            u = place - k
            cell = abs(u) * fine
            at = int(cell)
            w = share * (window[at] + (cell - at) * (window[at + 1] - window[at]))
            weight[k] += w
            if abs(u) <= 1.0:
                nearest[k] += 1.0
            for c in range(channels):
                out[k, c] += w * values[i, c]
    for k in range(count):
        good = nearest[k] > 0.0 and weight[k] > 0.5
        for c in range(channels):
            out[k, c] = out[k, c] / weight[k] if good else np.nan
