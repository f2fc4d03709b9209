"""The filter's linear model against finite differences of its nonlinear one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from weighbridge.constants import GRAVITY
from weighbridge.kernels.ins import propagate, propagate_covariance
from weighbridge.kernels.ins_model import (
    BA,
    BG,
    ERRORS,
    FORCE,
    LEVER,
    MEASUREMENTS,
    PITCH0,
    RATE,
    SCALE,
    SQUAT,
    STATES,
    TRANSITION,
    YAW0,
    Z_D,
    Z_E,
    Z_HVAR,
    Z_N,
    Z_SPEED,
    Z_SPEED_VAR,
    Z_STILL,
    Z_VVAR,
    Noise,
    Q,
    V,
    new_rows,
)
from weighbridge.kernels.ins_rows import correct, update
from weighbridge.kernels.ins_smoother import smooth
from weighbridge.kernels.rotation import euler_to_quaternion

QUIET = Noise(
    gravity=GRAVITY, accel_psd=0.0, gyro_psd=0.0, gyro_share=0.0, accel_bias_psd=0.0,
    gyro_bias_psd=0.0, lateral_std=0.1, lateral_slip_std=0.01, lateral_turn_std=0.5,
    vertical_std=0.08, vertical_slope_std=0.004, constraint_time=0.3, still_std=0.02,
    rest_rate_std=0.002, gate=20.0, patience=10.0, force_time=0.15, constraints=1.0,
)  # fmt: skip


def _state():
    x = np.zeros(STATES)
    x[0:3] = [10.0, -20.0, 3.0]
    x[V : V + 3] = [14.0, 7.0, -0.6]
    x[Q : Q + 4] = euler_to_quaternion(0.03, -0.05, 0.5)
    x[BA : BA + 3] = [0.05, -0.03, 0.1]
    x[BG : BG + 3] = [0.002, -0.001, 0.003]
    x[PITCH0], x[YAW0], x[SQUAT], x[SCALE], x[LEVER] = 0.01, -0.02, 0.004, 1.02, 1.3
    x[FORCE] = 0.8
    return x


def _difference(a, b):
    """Error state of ``a`` from ``b``."""
    dx = np.empty(ERRORS)
    dx[:6] = a[:6] - b[:6]
    turn = (
        Rotation.from_quat(np.roll(a[Q : Q + 4], -1))
        * Rotation.from_quat(np.roll(b[Q : Q + 4], -1)).inv()
    )
    dx[6:9] = turn.as_rotvec()
    dx[9:] = a[BA : LEVER + 1] - b[BA : LEVER + 1]
    return dx


def _moved(x, place, size):
    dx = np.zeros(ERRORS)
    dx[place] = size
    y = x.copy()
    correct(y, dx)
    return y


def _propagated(x):
    y = x.copy()
    rng = np.random.default_rng(1)
    for _ in range(10):
        f = rng.normal([0.7, 1.2, -9.6], 0.5)
        w = rng.normal([0.02, -0.03, 0.1], 0.02)
        propagate(y, tuple(f), tuple(w), 0.005, QUIET)
    return y


@pytest.mark.parametrize("correlated", [False, True])
def test_covariance_follows_the_nonlinear_propagation(correlated):
    x = _state()
    end = _propagated(x)
    jacobian = np.empty((ERRORS, ERRORS))
    for i in range(ERRORS):
        h = 1e-4
        up, down = _propagated(_moved(x, i, h)), _propagated(_moved(x, i, -h))
        jacobian[:, i] = (_difference(up, end) - _difference(down, end)) / (2.0 * h)
    cov = np.diag(np.linspace(0.5, 2.0, ERRORS))
    if correlated:
        root = np.random.default_rng(2).normal(size=(ERRORS, ERRORS))
        cov = root @ root.T
    flat = cov.ravel().copy()
    propagate_covariance(end, flat, QUIET)
    ours = flat.reshape(cov.shape)
    # blocks of the transition are of first order over the 50 ms of a node
    assert_allclose(ours, jacobian @ cov @ jacobian.T, atol=0.02 * np.abs(cov).max())
    assert_allclose(ours, ours.T, atol=0.0)
    # and they are not the identity: the change itself is right to a few percent
    change = jacobian @ cov @ jacobian.T - cov
    assert np.abs(ours - cov - change).max() < 0.05 * np.abs(change).max()


def _predicted(x, rate):
    """Speed, lateral and vertical row as functions of the nominal state."""
    body = Rotation.from_quat(np.roll(x[Q : Q + 4], -1)).inv().apply(x[V : V + 3])
    # What the body reads less what its mounting and its squat add is the force along the road.
    along = (x[FORCE] - QUIET.gravity * x[PITCH0]) / (1.0 + QUIET.gravity * x[SQUAT])
    return np.array(
        [
            x[SCALE] * body[0],
            body[1] - x[YAW0] * body[0] - x[LEVER] * rate[2],
            body[2] - (x[PITCH0] + x[SQUAT] * along) * body[0],
        ]
    )


def test_rows_of_speed_and_constraints_are_the_derivatives():
    x = _state()
    rate = np.array([0.01, 0.02, 0.15])
    rows = new_rows()
    x[RATE : RATE + 3], x[TRANSITION] = rate, 1.0
    z = np.full((1, MEASUREMENTS), np.nan)
    z[0, [Z_STILL, Z_SPEED, Z_SPEED_VAR]] = 0.0, 16.0, 0.1
    # so small a covariance that the rows do not move the state between them
    update(x.copy(), (np.eye(ERRORS) * 1e-16).ravel(), z, 0, QUIET, rows, 0)
    assert rows.row_count[0] == 3
    expected = np.empty((3, ERRORS))
    for i in range(ERRORS):
        h = 1e-5
        up, down = _predicted(_moved(x, i, h), rate), _predicted(_moved(x, i, -h), rate)
        expected[:, i] = (up - down) / (2.0 * h)
    assert_allclose(rows.h[0].reshape(-1, ERRORS)[:3], expected, atol=1e-6)
    # the term eq. 46 leaves out is there: attitude moves the constraint rows by the speed
    assert np.abs(expected[1:, 6:9]).max() > 10.0
    assert_allclose(rows.innovation[0, :3], [16.0, 0.0, 0.0] - _predicted(x, rate), atol=1e-9)


def test_scalar_rows_equal_the_joint_update():
    rng = np.random.default_rng(3)
    x = np.zeros(STATES)
    x[Q], x[SCALE] = 1.0, 1.0
    root = rng.normal(size=(ERRORS, ERRORS)) * 1e-3
    cov = root @ root.T + 1e-6 * np.eye(ERRORS)
    z = np.full((1, MEASUREMENTS), np.nan)
    z[0, Z_STILL] = 0.0
    z[0, Z_N : Z_D + 1] = [1e-3, -2e-3, 1.5e-3]
    z[0, Z_HVAR], z[0, Z_VVAR] = 1e-6, 4e-6
    noise = QUIET._replace(constraints=0.0)
    ours, flat = x.copy(), cov.ravel().copy()
    update(ours, flat, z, 0, noise, new_rows(), 0)
    ours_cov = flat.reshape(cov.shape)
    h = np.eye(3, ERRORS)
    s = h @ cov @ h.T + np.diag([1e-6, 1e-6, 4e-6])
    gain = cov @ h.T @ np.linalg.inv(s)
    assert_allclose(_difference(ours, x), gain @ z[0, Z_N : Z_D + 1], rtol=1e-3, atol=1e-8)
    assert_allclose(ours_cov, (np.eye(ERRORS) - gain @ h) @ cov, atol=1e-12)
    assert_allclose(z[0, Z_E], -2e-3)


def test_smoother_equals_least_squares_over_all_epochs():
    """Twenty nodes with fixes against one batch solution of the same linear problem."""
    rng = np.random.default_rng(4)
    noise = QUIET._replace(constraints=0.0, accel_psd=0.04, gate=1e9)
    nodes = 20
    x = np.zeros(STATES)
    x[Q], x[SCALE] = 1.0, 1.0
    prior = np.full(ERRORS, 1e-10)
    prior[0:3], prior[3:6] = 4.0, 1.0
    cov = np.diag(prior).ravel().copy()
    log = new_rows(nodes)
    states = np.empty((nodes, 24))
    z_all = rng.normal(scale=1.0, size=nodes)
    for k in range(nodes):
        for _ in range(10):
            propagate(x, (0.0, 0.0, -noise.gravity), (0.0, 0.0, 0.0), 0.01, noise)
        propagate_covariance(x, cov, noise)
        log.transition[k] = x[TRANSITION : TRANSITION + 13]
        z = np.full((1, MEASUREMENTS), np.nan)
        z[0, Z_STILL] = 0.0
        z[0, [Z_N, Z_E, Z_D]] = z_all[k], 0.0, 0.0
        z[0, [Z_HVAR, Z_VVAR]] = 0.25, 0.25
        update(x, cov, z, 0, noise, log, k)
        log.cov[k] = cov
        states[k] = x[:24]
        x[TRANSITION : TRANSITION + 13] = 0.0
    smooth(log, nodes, np.zeros(ERRORS), states, 0)

    # one axis: p0, v0 and the velocity kicks of each node, which follow the move
    count = 2 + nodes
    design, target = [], []
    position = np.zeros((nodes, count))
    row_p, row_v = np.zeros(count), np.zeros(count)
    row_p[0], row_v[1] = 1.0, 1.0
    for k in range(nodes):
        row_p = row_p + 0.1 * row_v
        row_v = row_v.copy()
        row_v[2 + k] += 1.0
        position[k] = row_p
        design.append(row_p / 0.5)
        target.append(z_all[k] / 0.5)
    stds = np.concatenate([[2.0, 1.0], np.full(nodes, np.sqrt(0.04 * 0.1))])
    design += list(np.diag(1.0 / stds))
    target += [0.0] * count
    solution, *_ = np.linalg.lstsq(np.array(design), np.array(target), rcond=None)
    assert_allclose(states[:, 0], position @ solution, atol=1e-5)
