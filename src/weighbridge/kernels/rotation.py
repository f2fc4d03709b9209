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
def quaternion_to_matrix(q, rot):
    """Write the rotation matrix of the unit quaternion ``q`` (4,) into ``rot`` (3, 3)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    rot[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    rot[0, 1] = 2.0 * (x * y - w * z)
    rot[0, 2] = 2.0 * (x * z + w * y)
    rot[1, 0] = 2.0 * (x * y + w * z)
    rot[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    rot[1, 2] = 2.0 * (y * z - w * x)
    rot[2, 0] = 2.0 * (x * z - w * y)
    rot[2, 1] = 2.0 * (y * z + w * x)
    rot[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@kernel
def rotate_body(q, rx, ry, rz):
    """Turn ``q`` (4,) in place by a rotation vector in body axes: ``q <- q * exp(r)`` [rad]."""
    angle = math.sqrt(rx * rx + ry * ry + rz * rz)
    half = 0.5 * angle
    # sin(x)/x loses nothing to its series here and divides by zero without it
    s = 0.5 * (1.0 - half * half / 6.0) if angle < 1e-4 else math.sin(half) / angle
    c = math.cos(half)
    rx, ry, rz = s * rx, s * ry, s * rz
    w, x, y, z = q[0], q[1], q[2], q[3]
    q[0] = w * c - x * rx - y * ry - z * rz
    q[1] = w * rx + x * c + y * rz - z * ry
    q[2] = w * ry - x * rz + y * c + z * rx
    q[3] = w * rz + x * ry - y * rx + z * c


@kernel
def rotate_navigation(q, rx, ry, rz):
    """Turn ``q`` (4,) in place by a rotation vector in navigation axes: ``q <- exp(r) * q``."""
    angle = math.sqrt(rx * rx + ry * ry + rz * rz)
    half = 0.5 * angle
    s = 0.5 * (1.0 - half * half / 6.0) if angle < 1e-4 else math.sin(half) / angle
    c = math.cos(half)
    rx, ry, rz = s * rx, s * ry, s * rz
    w, x, y, z = q[0], q[1], q[2], q[3]
    q[0] = c * w - rx * x - ry * y - rz * z
    q[1] = c * x + rx * w + ry * z - rz * y
    q[2] = c * y - rx * z + ry * w + rz * x
    q[3] = c * z + rx * y - ry * x + rz * w


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
