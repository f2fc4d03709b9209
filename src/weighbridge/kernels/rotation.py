"""Rotations: scalar-first Hamilton quaternions and rotation matrices.

``q`` or ``rot`` named ``nb`` turns body into navigation coordinates:
``x_n = rot_nb @ x_b``. Angles are roll, pitch, yaw of
``rot_nb = Rz(yaw) Ry(pitch) Rx(roll)``.

References
----------
Sola, Quaternion kinematics for the error-state Kalman filter, 2017, sec. 1-4.
"""

import math

import numpy as np

from weighbridge.kernels._jit import kernel


@kernel
def matrix_rows(w, x, y, z):
    """Return the three rows of the rotation matrix of a unit quaternion."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@kernel
def quaternion_to_matrix(q, rot):
    """Write the rotation matrix of the unit quaternion ``q`` (4,) into ``rot`` (3, 3)."""
    (
        (rot[0, 0], rot[0, 1], rot[0, 2]),
        (rot[1, 0], rot[1, 1], rot[1, 2]),
        (rot[2, 0], rot[2, 1], rot[2, 2]),
    ) = matrix_rows(q[0], q[1], q[2], q[3])


@kernel
def half_turn(rx, ry, rz):
    """Return cosine and scaled vector of the quaternion of a rotation vector [rad]."""
    square = 0.25 * (rx * rx + ry * ry + rz * rz)
    if square < 2.5e-3:
        # the series is exact to the last bit here and spares three slow functions
        c = 1.0 - square * (0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0)))
        s = 0.5 * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0))))
    else:
        half = math.sqrt(square)
        c = math.cos(half)
        s = 0.5 * math.sin(half) / half
    return c, s * rx, s * ry, s * rz


@kernel
def product(aw, ax, ay, az, bw, bx, by, bz):
    """Return the Hamilton product ``a * b`` of two quaternions."""
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


@kernel
def rotate_body(q, rx, ry, rz):
    """Turn ``q`` (4,) in place by a rotation vector in body axes: ``q <- q * exp(r)`` [rad]."""
    c, x, y, z = half_turn(rx, ry, rz)
    q[0], q[1], q[2], q[3] = product(q[0], q[1], q[2], q[3], c, x, y, z)


@kernel
def rotate_navigation(q, rx, ry, rz):
    """Turn ``q`` (4,) in place by a rotation vector in navigation axes: ``q <- exp(r) * q``."""
    c, x, y, z = half_turn(rx, ry, rz)
    q[0], q[1], q[2], q[3] = product(c, x, y, z, q[0], q[1], q[2], q[3])


@kernel
def normalise(q):
    """Scale ``q`` (4,) to unit length in place."""
    n = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] *= n


@kernel
def euler_to_quaternion(roll, pitch, yaw):
    """Return the unit quaternion (4,) of roll, pitch, yaw [rad]."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    q = np.empty(4)
    q[0] = cr * cp * cy + sr * sp * sy
    q[1] = sr * cp * cy - cr * sp * sy
    q[2] = cr * sp * cy + sr * cp * sy
    q[3] = cr * cp * sy - sr * sp * cy
    return q


@kernel
def matrix_to_euler(rot):
    """Return roll, pitch, yaw [rad] of a rotation matrix (3, 3); pitch in [-pi/2, pi/2]."""
    roll = math.atan2(rot[2, 1], rot[2, 2])
    pitch = math.asin(min(1.0, max(-1.0, -rot[2, 0])))
    yaw = math.atan2(rot[1, 0], rot[0, 0])
    return roll, pitch, yaw


@kernel
def quaternions_to_euler(q, out):
    """Fill ``out`` (n, 3) with roll, pitch, yaw [rad] of the unit quaternions ``q`` (n, 4)."""
    rot = np.empty((3, 3))
    for i in range(q.shape[0]):
        quaternion_to_matrix(q[i], rot)
        out[i, 0], out[i, 1], out[i, 2] = matrix_to_euler(rot)


@kernel
def euler_to_matrix(roll, pitch, yaw):
    """Return the rotation matrix (3, 3) of roll, pitch, yaw [rad]."""
    rot = np.empty((3, 3))
    quaternion_to_matrix(euler_to_quaternion(roll, pitch, yaw), rot)
    return rot
