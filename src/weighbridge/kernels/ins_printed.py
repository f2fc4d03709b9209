"""The navigation filter of Jensen et al. 2022 as printed: 15 error states, every sample a node.

Beside it stands the filter that weighs, `weighbridge.kernels.ins`. Axes are north-east-down and
forward-right-down here as there; the paper mixes them. Rows are taken one after another about the
same predicted state, which for a diagonal noise matrix is eqs. 37 to 44 without an inverse.

References
----------
Jensen et al., Mech. Syst. Signal Process. 171, 2022, eqs. 21-47, Algorithm 1, Tables 2, 3.
"""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel
from weighbridge.kernels.rotation import (
    half_turn,
    matrix_to_euler,
    normalise,
    product,
    quaternion_to_matrix,
)

STATES = 16
"""Position, velocity, quaternion, and what is added to accelerometer and gyro (eq. 22)."""
ERRORS = 15
SHOWN = 9
"""Columns of a result: specific force forward, roll, pitch, yaw, forward speed, position, and the
correction of the accelerometer forward."""


class PrintedNoise(NamedTuple):
    """Noise of the printed filter, per sample as in Tables 2 and 3.

    Attributes
    ----------
    gravity : [m/s^2]
    accel_std, gyro_std : of the samples [m/s^2], [rad/s]
    accel_bias_std, gyro_bias_std : steps of the biases [m/s^2], [rad/s]
    fix_std : (3,) north, east, down [m]
    speed_std, lateral_std, vertical_std : of speed and constraints [m/s]
    still_std : of the constraints of a vehicle that stands [m/s]
    attitude_term : 1 with the attitude's part in the velocity rows, which eq. 46 leaves out; 0
        without
    """

    gravity: float
    accel_std: float
    gyro_std: float
    accel_bias_std: float
    gyro_bias_std: float
    fix_std: np.ndarray
    speed_std: float
    lateral_std: float
    vertical_std: float
    still_std: float
    attitude_term: float


class PrintedAid(NamedTuple):
    """What aids the filter, each at the sample it belongs to.

    Attributes
    ----------
    speed : (n,) [m/s]; NaN where none came
    fix : (n,) row of ``ned`` that came with the sample; -1 where none did
    ned : (m, 3) [m]
    """

    speed: np.ndarray
    fix: np.ndarray
    ned: np.ndarray


@kernel
def _move(cov, work, rot, force, dt):
    """Multiply by the transition (eq. 34) from the left; ``work`` (15, 15) is filled."""
    for j in range(ERRORS):
        for i in range(3):
            work[i, j] = cov[i, j] + dt * cov[3 + i, j]
            bias = rot[i, 0] * cov[9, j] + rot[i, 1] * cov[10, j] + rot[i, 2] * cov[11, j]
            turn = rot[i, 0] * cov[12, j] + rot[i, 1] * cov[13, j] + rot[i, 2] * cov[14, j]
            a, b = (i + 1) % 3, (i + 2) % 3
            cross = force[a] * cov[6 + b, j] - force[b] * cov[6 + a, j]
            work[3 + i, j] = cov[3 + i, j] + dt * (cross + bias)
            work[6 + i, j] = cov[6 + i, j] - dt * turn
        for i in range(9, ERRORS):
            work[i, j] = cov[i, j]


@kernel
def _predict(x, cov, work, rot, accel, gyro, dt, noise):
    """Move state and covariance by one sample (eqs. 22-29, 33-35); return the force forward."""
    f0, f1, f2 = accel[0] + x[10], accel[1] + x[11], accel[2] + x[12]
    w0, w1, w2 = gyro[0] + x[13], gyro[1] + x[14], gyro[2] + x[15]
    quaternion_to_matrix(x[6:10], rot)
    force = (
        rot[0, 0] * f0 + rot[0, 1] * f1 + rot[0, 2] * f2,
        rot[1, 0] * f0 + rot[1, 1] * f1 + rot[1, 2] * f2,
        rot[2, 0] * f0 + rot[2, 1] * f1 + rot[2, 2] * f2,
    )
    for i in range(3):
        a = force[i] + (noise.gravity if i == 2 else 0.0)
        x[i] += dt * x[3 + i] + 0.5 * dt * dt * a
        x[3 + i] += dt * a
    c, s0, s1, s2 = half_turn(dt * w0, dt * w1, dt * w2)
    x[6], x[7], x[8], x[9] = product(x[6], x[7], x[8], x[9], c, s0, s1, s2)
    normalise(x[6:10])
    _move(cov, work, rot, force, dt)
    # F (F P)' is F P F' turned over, and that is symmetric.
    _move(work.T, cov, rot, force, dt)
    for i in range(3):
        cov[3 + i, 3 + i] += (dt * noise.accel_std) ** 2
        cov[6 + i, 6 + i] += (dt * noise.gyro_std) ** 2
        cov[9 + i, 9 + i] += noise.accel_bias_std**2
        cov[12 + i, 12 + i] += noise.gyro_bias_std**2
    return f0


@kernel
def _fold(cov, ph, h, dx, innovation, var):
    """Take one row with gain ``P h / s`` (eqs. 37, 40, 44)."""
    s, e = var, innovation
    for i in range(ERRORS):
        total = 0.0
        for j in range(ERRORS):
            total += cov[i, j] * h[j]
        ph[i] = total
    for i in range(ERRORS):
        s += h[i] * ph[i]
        e -= h[i] * dx[i]
    for i in range(ERRORS):
        gain = ph[i] / s
        dx[i] += gain * e
        for j in range(ERRORS):
            cov[i, j] -= gain * ph[j]


@kernel
def _update(x, cov, rot, room, aid, k, standing, noise):
    """Process fix, speed and constraints of a sample (eqs. 37-47)."""
    h, ph, dx = room
    quaternion_to_matrix(x[6:10], rot)
    dx[:] = 0.0
    if aid.fix[k] >= 0:
        for i in range(3):
            h[:] = 0.0
            h[i] = 1.0
            e = aid.ned[aid.fix[k], i] - x[i]
            if np.isfinite(e):
                _fold(cov, ph, h, dx, e, noise.fix_std[i] ** 2)
    for axis in range(3):
        velocity = rot[0, axis] * x[3] + rot[1, axis] * x[4] + rot[2, axis] * x[5]
        if axis == 0:
            if np.isnan(aid.speed[k]):
                continue
            e, std = aid.speed[k] - velocity, noise.speed_std
        else:
            e, std = -velocity, noise.lateral_std if axis == 1 else noise.vertical_std
            if standing:
                std = noise.still_std
        h[:] = 0.0
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            h[3 + i] = rot[i, axis]
            # d(R'v) = R'(eps x v) where R_true = (I - S(eps)) R, eq. 31
            turned = x[3 + a] * rot[b, axis] - x[3 + b] * rot[a, axis]
            h[6 + i] = noise.attitude_term * turned
        _fold(cov, ph, h, dx, e, std**2)
    for i in range(6):
        x[i] += dx[i]
        x[10 + i] += dx[9 + i]
    c, s0, s1, s2 = half_turn(-dx[6], -dx[7], -dx[8])
    x[6], x[7], x[8], x[9] = product(c, s0, s1, s2, x[6], x[7], x[8], x[9])
    normalise(x[6:10])


@kernel
def run(x, cov, time, accel, gyro, aid, noise, found):
    """Filter a drive.

    Parameters
    ----------
    x : (16,) float64
        State before the first sample, changed in place: position and velocity, north east down
        [m], [m/s]; quaternion of the vehicle, scalar first; additions to accelerometer and gyro.
    cov : (15, 15) float64
        Error covariance, changed in place.
    time : (n,) float64
        Rising [s].
    accel, gyro : (n, 3) float64
        Forward, right, down [m/s^2], [rad/s].
    aid : PrintedAid
    noise : PrintedNoise
    found : (n, 9) float64
        Filled, see `SHOWN`; the specific force is that of the sample, corrected.
    """
    rot, work = np.empty((3, 3)), np.empty((ERRORS, ERRORS))
    room = (np.zeros(ERRORS), np.zeros(ERRORS), np.zeros(ERRORS))
    standing = True
    for k in range(time.size):
        dt = time[k] - time[k - 1] if k > 0 else 0.0
        forward = _predict(x, cov, work, rot, accel[k], gyro[k], dt, noise)
        if not np.isnan(aid.speed[k]):
            standing = aid.speed[k] == 0.0
        _update(x, cov, rot, room, aid, k, standing, noise)
        quaternion_to_matrix(x[6:10], rot)
        found[k, 0] = forward
        found[k, 1], found[k, 2], found[k, 3] = matrix_to_euler(rot)
        found[k, 4] = rot[0, 0] * x[3] + rot[1, 0] * x[4] + rot[2, 0] * x[5]
        found[k, 5], found[k, 6], found[k, 7] = x[0], x[1], x[2]
        found[k, 8] = x[10]
