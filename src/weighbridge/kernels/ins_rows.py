"""Measurement rows of the navigation filter: one scalar after another.

No matrix is inverted, and the covariance stays symmetric to the last bit (eq. 44 of Jensen 2022
does not). The covariance is a flat array of 20 lines: with constant distances between them the
compiler can take several columns at once.

Velocity rows carry the attitude term ``r x v`` that eq. 46 leaves out, where
``r`` is the row's body axis in navigation coordinates.
"""

import math

import numpy as np

from weighbridge.kernels._jit import contracted_kernel, fast_kernel, inlined_fast_kernel
from weighbridge.kernels.ins_model import (
    BA,
    E_ATT,
    E_BA,
    E_BG,
    E_LEVER,
    E_PITCH0,
    E_SCALE,
    E_SQUAT,
    E_V,
    E_YAW0,
    FORCE,
    LEVER,
    LOST_GNSS,
    LOST_SPEED,
    PITCH0,
    RATE,
    SCALE,
    SQUAT,
    TRANSITION,
    YAW0,
    Z_D,
    Z_HVAR,
    Z_N,
    Z_SPEED,
    Z_SPEED_VAR,
    Z_STILL,
    Z_VEL_VAR,
    Z_VN,
    Z_VVAR,
    P,
    Q,
    V,
)
from weighbridge.kernels.ins_model import ERRORS as N
from weighbridge.kernels.rotation import half_turn, matrix_rows, product

VELOCITY, SPEED, LATERAL, VERTICAL, STANDING, REST, KINDS = 3, 5, 6, 7, 8, 11, 14
"""First of each kind of row, after the three of a GNSS position: GNSS velocity, wheel speed,
lateral and vertical constraint, velocity and angular rate of a vehicle that stands."""


@fast_kernel
def correct(x, dx):
    """Add the error ``dx`` (20,) to the filter state ``x`` (eqs. 41-43)."""
    for i in range(6):
        x[i] += dx[i]
    for i in range(11):
        x[BA + i] += dx[9 + i]
    c, s0, s1, s2 = half_turn(dx[6], dx[7], dx[8])
    q0, q1, q2, q3 = product(c, s0, s1, s2, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    unit = 1.5 - 0.5 * (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = unit * q0, unit * q1, unit * q2, unit * q3


@inlined_fast_kernel
def travel_angle(x, gravity):
    """Pitch of the body over its direction of travel, and its slopes on mounting and squat.

    The body squats by the specific force ``f`` along the road, and reads ``f (1 + g k)``.
    """
    read = 1.0 / (1.0 + gravity * x[SQUAT])
    along = read * (x[FORCE] - gravity * x[PITCH0])
    return x[PITCH0] + x[SQUAT] * along, read, read * along


@fast_kernel
def _set_body_row(x, h, slot, start, axis, gravity):
    """Set the row of one body velocity; return that velocity and the forward one.

    The row's direction is body axis ``axis``, for the constraints less the forward axis times
    the angle at which the vehicle travels in its own axes: mounting, and squat where it pitches.
    The row is in ``h[slot, start:]``; its places of the constants are left zero.
    """
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = matrix_rows(
        x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    )
    vx, vy, vz = x[V], x[V + 1], x[V + 2]
    forward = r00 * vx + r10 * vy + r20 * vz
    rx, ry, rz = r00, r10, r20
    if axis == LATERAL:
        rx, ry, rz = r01 - x[YAW0] * r00, r11 - x[YAW0] * r10, r21 - x[YAW0] * r20
    elif axis == VERTICAL:
        angle, _, _ = travel_angle(x, gravity)
        rx, ry, rz = r02 - angle * r00, r12 - angle * r10, r22 - angle * r20
    elif axis == STANDING + 1:
        rx, ry, rz = r01, r11, r21
    elif axis == STANDING + 2:
        rx, ry, rz = r02, r12, r22
    h[slot, start + E_V], h[slot, start + E_V + 1], h[slot, start + E_V + 2] = rx, ry, rz
    h[slot, start + E_ATT] = ry * vz - rz * vy
    h[slot, start + E_ATT + 1] = rz * vx - rx * vz
    h[slot, start + E_ATT + 2] = rx * vy - ry * vx
    return rx * vx + ry * vy + rz * vz, forward


@contracted_kernel
def _body_product(cov, h, ph, slot, start):
    """Set ``P h`` of a row with velocity, attitude and constants; return ``h P h'``."""
    o = start
    h3, h4, h5 = h[slot, o + 3], h[slot, o + 4], h[slot, o + 5]
    h6, h7, h8 = h[slot, o + 6], h[slot, o + 7], h[slot, o + 8]
    h15, h16, h17 = h[slot, o + 15], h[slot, o + 16], h[slot, o + 17]
    h18, h19 = h[slot, o + 18], h[slot, o + 19]
    for j in range(N):
        ph[slot, o + j] = (
            (h3 * cov[3 * N + j] + h4 * cov[4 * N + j] + h5 * cov[5 * N + j])
            + (h6 * cov[6 * N + j] + h7 * cov[7 * N + j] + h8 * cov[8 * N + j])
        ) + (
            (h15 * cov[15 * N + j] + h16 * cov[16 * N + j] + h17 * cov[17 * N + j])
            + (h18 * cov[18 * N + j] + h19 * cov[19 * N + j])
        )  # fmt: skip
    return (
        (h3 * ph[slot, o + 3] + h4 * ph[slot, o + 4] + h5 * ph[slot, o + 5])
        + (h6 * ph[slot, o + 6] + h7 * ph[slot, o + 7] + h8 * ph[slot, o + 8])
    ) + (
        (h15 * ph[slot, o + 15] + h16 * ph[slot, o + 16] + h17 * ph[slot, o + 17])
        + (h18 * ph[slot, o + 18] + h19 * ph[slot, o + 19])
    )  # fmt: skip


@inlined_fast_kernel
def _direct_product(cov, h, ph, slot, start, place):
    """Set a row that reads one error state, and its ``P h``; return ``h P h'``."""
    for j in range(N):
        ph[slot, start + j] = cov[place * N + j]
    h[slot, start + place] = 1.0
    return cov[place * N + place]


@contracted_kernel
def _fold(cov, ph, slot, start, innovation_var):
    """Take ``P h h' P / s`` of a row off the covariance, four lines at a time."""
    scale = 1.0 / math.sqrt(innovation_var)
    for i in range(0, N, 4):
        a, b = scale * ph[slot, start + i], scale * ph[slot, start + i + 1]
        c, d = scale * ph[slot, start + i + 2], scale * ph[slot, start + i + 3]
        o = i * N
        for j in range(N):
            p = scale * ph[slot, start + j]
            cov[o + j] -= a * p
            cov[o + N + j] -= b * p
            cov[o + 2 * N + j] -= c * p
            cov[o + 3 * N + j] -= d * p


@fast_kernel
def _accept(x, ph, slot, start, gain):
    """Correct the filter state by ``gain`` times ``P h`` of a row."""
    for i in range(6):
        x[i] += gain * ph[slot, start + i]
    for i in range(11):
        x[BA + i] += gain * ph[slot, start + E_BA + i]
    o = start + E_ATT
    c, s0, s1, s2 = half_turn(gain * ph[slot, o], gain * ph[slot, o + 1], gain * ph[slot, o + 2])
    q0, q1, q2, q3 = product(c, s0, s1, s2, x[Q], x[Q + 1], x[Q + 2], x[Q + 3])
    unit = 1.5 - 0.5 * (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    x[Q], x[Q + 1], x[Q + 2], x[Q + 3] = unit * q0, unit * q1, unit * q2, unit * q3


@inlined_fast_kernel
def _fix_row(x, z, node, kind):
    """Innovation and noise variance of a GNSS row; NaN where there is none."""
    if kind < VELOCITY:
        var = z[node, Z_VVAR] if kind == 2 else z[node, Z_HVAR]
        return z[node, Z_N + kind] - x[P + kind], var
    return z[node, Z_VN + kind - VELOCITY] - x[V + kind - VELOCITY], z[node, Z_VEL_VAR]


@inlined_fast_kernel
def _vehicle_row(x, h, slot, start, kind, measured, noise):
    """Set the row of wheel speed, constraint or standing; return innovation and noise variance.

    Parameters
    ----------
    measured : wheel speed and its variance, NaN where there is none
    """
    # errors of wheel speed and constraints last for about constraint_time: the
    # white noise of the same power density has this much more variance
    inflate = max(1.0, 2.0 * noise.constraint_time / max(x[TRANSITION], 1e-3))
    v, forward = _set_body_row(x, h, slot, start, kind, noise.gravity)
    yaw_rate = x[RATE + 2]
    if kind >= STANDING:
        return -v, noise.still_std**2 * inflate
    if kind == SPEED:
        speed, var = measured
        for i in range(E_V, E_ATT + 3):
            h[slot, start + i] *= x[SCALE]
        h[slot, start + E_SCALE] = v
        return speed - x[SCALE] * v, var
    if kind == LATERAL:
        h[slot, start + E_YAW0], h[slot, start + E_LEVER] = -forward, -yaw_rate
        slip, turn = noise.lateral_slip_std * forward, noise.lateral_turn_std * yaw_rate
        return x[LEVER] * yaw_rate - v, (noise.lateral_std**2 + slip**2 + turn**2) * inflate
    _, level, lean = travel_angle(x, noise.gravity)
    h[slot, start + E_PITCH0], h[slot, start + E_SQUAT] = -forward * level, -forward * lean
    slope = noise.vertical_slope_std * forward
    return -v, (noise.vertical_std**2 + slope**2) * inflate


@inlined_fast_kernel
def _is_lost(x, place, refused, noise):
    """Count refusals in succession; return whether there are so many that the filter is lost."""
    if not refused:
        x[place] = 0.0
    elif x[place] < noise.patience:
        x[place] += 1.0
    else:
        return True
    return False


@inlined_fast_kernel
def _first_and_last(z, node, noise):
    """Kinds of row that a node may have: from the first up to the last, which is excluded."""
    fix = not math.isnan(z[node, Z_N]) or not math.isnan(z[node, Z_D])
    first = 0 if fix else VELOCITY if not math.isnan(z[node, Z_VN]) else SPEED
    if z[node, Z_STILL] > 0.0:
        return first, fix, KINDS if z[node, Z_STILL] > 1.0 else REST
    return first, fix, STANDING if noise.constraints > 0.0 else LATERAL


@inlined_fast_kernel
def update(x, cov, z, node, noise, rows, slot):
    """Process the rows of one node.

    Rows that are too far off count less. A fix is refused, unless that happens time and again: the
    filter is lost. A speed pulls as hard as one at the gate (Huber, Robust Statistics, 1981): it is
    all that holds the speed where there are no fixes.

    Parameters
    ----------
    x, cov : filter state (47,) and covariance (400,), changed in place
    z : (m, 13) measurement vectors, NaN where there is none
    node : int
        Place in ``z``.
    noise : Noise
    rows : Rows
        Filled.
    slot : int
        Place in ``rows``.
    """
    h, ph, innovation, innovation_var, counts, _, _ = rows
    first, fix, last = _first_and_last(z, node, noise)
    standing = z[node, Z_STILL] > 0.0
    start = np.int64(0)
    refused = False
    for kind in range(first, last):
        if fix and kind == VELOCITY and _is_lost(x, LOST_GNSS, refused, noise):
            for i in range(3):
                cov[i * N + i] += 25.0
                cov[(E_V + i) * N + E_V + i] += 1.0
        if SPEED <= kind < STANDING and standing:
            continue
        for j in range(start, start + N):
            h[slot, j] = 0.0
        if kind < SPEED:
            e, r = _fix_row(x, z, node, kind)
            place = kind
        elif kind < REST:
            measured = z[node, Z_SPEED], z[node, Z_SPEED_VAR]
            e, r = _vehicle_row(x, h, slot, start, kind, measured, noise)
            place = -1
        else:
            # the residual rate at rest is what is left of the bias
            e, r = x[RATE + kind - REST], noise.rest_rate_std**2
            r *= max(1.0, 2.0 * noise.constraint_time / max(x[TRANSITION], 1e-3))
            place = E_BG + kind - REST
        if math.isnan(e):
            continue
        if place < 0:
            s = _body_product(cov, h, ph, slot, start) + r
        else:
            s = _direct_product(cov, h, ph, slot, start, place) + r
        lost = False
        if e * e > noise.gate * s:
            if kind < VELOCITY:
                refused = True
                if x[LOST_GNSS] < noise.patience:
                    continue
                s = e * e / noise.gate
            elif kind == SPEED:
                lost = _is_lost(x, LOST_SPEED, True, noise)
                s = abs(e) * math.sqrt(s / noise.gate)
            else:
                s = e * e / noise.gate
        elif kind == SPEED:
            x[LOST_SPEED] = 0.0
        row = start // N
        innovation[slot, row], innovation_var[slot, row] = e, s
        _accept(x, ph, slot, start, e / s)
        _fold(cov, ph, slot, start, s)
        start += N
        if lost:
            for i in range(E_V, E_V + 3):
                cov[i * N + i] += 1.0
    counts[slot] = start // N
