"""Rotations against SciPy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from weighbridge.kernels.rotation import (
    euler_to_matrix,
    euler_to_quaternion,
    matrix_to_euler,
    normalise,
    quaternion_to_matrix,
    quaternions_to_euler,
    rotate_body,
    rotate_navigation,
)


def _random(seed):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=4)
    return q / np.linalg.norm(q), rng


def _scipy(q):
    return Rotation.from_quat(np.roll(q, -1))


@pytest.mark.parametrize("seed", range(5))
def test_matrix_of_quaternion(seed):
    q, _ = _random(seed)
    rot = np.empty((3, 3))
    quaternion_to_matrix(q, rot)
    assert_allclose(rot, _scipy(q).as_matrix(), atol=1e-14)


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-3, 0.09, 0.11, 1.0, 3.0])
def test_turning_about_body_and_navigation_axes(size):
    q, rng = _random(7)
    axis = rng.normal(size=3)
    r = axis / np.linalg.norm(axis) * size
    expected_body = (_scipy(q) * Rotation.from_rotvec(r)).as_matrix()
    expected_nav = (Rotation.from_rotvec(r) * _scipy(q)).as_matrix()
    body, nav = q.copy(), q.copy()
    rotate_body(body, *r)
    rotate_navigation(nav, *r)
    assert_allclose(_scipy(body).as_matrix(), expected_body, atol=1e-14)
    assert_allclose(_scipy(nav).as_matrix(), expected_nav, atol=1e-14)
    assert_allclose([np.linalg.norm(body), np.linalg.norm(nav)], 1.0, atol=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_euler_angles_both_ways(seed):
    q, rng = _random(seed)
    roll, pitch, yaw = rng.uniform(-1.5, 1.5, 3)
    expected = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    assert_allclose(
        _scipy(euler_to_quaternion(roll, pitch, yaw)).as_matrix(), expected.as_matrix(), atol=1e-14
    )
    assert_allclose(euler_to_matrix(roll, pitch, yaw), expected.as_matrix(), atol=1e-14)
    assert_allclose(matrix_to_euler(expected.as_matrix()), (roll, pitch, yaw), atol=1e-12)
    out = np.empty((1, 3))
    quaternions_to_euler(q[None, :], out)
    assert_allclose(out[0], _scipy(q).as_euler("ZYX")[::-1], atol=1e-12)


def test_normalise():
    q = np.array([2.0, -4.0, 4.0, 8.0])
    normalise(q)
    assert_allclose(q, [0.2, -0.4, 0.4, 0.8], atol=1e-15)
