"""The smoother of a linear model against the dense normal distribution."""

import numpy as np
from numpy.testing import assert_allclose

from weighbridge.kernels import rts


def model(rng, n=12, k=3):
    transition = 0.5 * rng.normal(size=(n, k, k))
    root = rng.normal(size=(n, k, k))
    z = 2.0 * rng.normal(size=n)
    z[4] = np.nan
    return (
        transition, root @ root.transpose(0, 2, 1), rng.normal(size=k), z,
        rng.uniform(0.5, 2.0, n), rng.normal(size=k), np.eye(k),
    )  # fmt: skip


def dense(transition, process_cov, row, z, variance, x0, cov0):
    """Mean and variance given all measurements, and the log-likelihood, by one large matrix."""
    n, k = z.size, x0.size
    mean, cov = np.zeros(n * k), np.zeros((n * k, n * k))
    mean[:k], cov[:k, :k] = x0, cov0
    for i in range(1, n):
        now, past = slice(i * k, (i + 1) * k), slice((i - 1) * k, i * k)
        mean[now] = transition[i] @ mean[past]
        cov[now, : i * k] = transition[i] @ cov[past, : i * k]
        cov[: i * k, now] = cov[now, : i * k].T
        cov[now, now] = transition[i] @ cov[past, past] @ transition[i].T + process_cov[i]
    seen = np.isfinite(z)
    rows = np.kron(np.eye(n), row)[seen]
    spread = rows @ cov @ rows.T + np.diag(variance[seen])
    left = z[seen] - rows @ mean
    gain = cov @ rows.T @ np.linalg.inv(spread)
    told = -0.5 * (np.linalg.slogdet(spread)[1] + left @ np.linalg.solve(spread, left))
    return (
        (mean + gain @ left).reshape(n, k), np.diag(cov - gain @ rows @ cov).reshape(n, k), told,
    )  # fmt: skip


def test_the_smoother_equals_the_dense_one():
    made = model(np.random.default_rng(1))
    mean, var, _ = dense(*made)
    x, found_var = rts.smooth(*made)
    assert_allclose(x, mean, rtol=1e-9, atol=1e-12)
    assert_allclose(found_var, var, rtol=1e-9, atol=1e-12)


def test_the_likelihood_of_a_process_equals_the_dense_one():
    rng = np.random.default_rng(2)
    step, span = rng.uniform(0.0, 8.0, (2, 300)) * rng.choice([1e-3, 1.0], 300)
    z = 5.0 + 40.0 * rng.normal(size=300)
    z[[3, 70]] = np.nan
    std, length, noise, walk, lasting = sizes = (0.5, 3.0, 0.2, 2.0, 9.0)
    transition, cov = np.zeros((2, 300, 3, 3))
    transition[:, :2, :2], cov[:, :2, :2] = rts.gauss_markov(step, length, std)
    keep = np.exp(-span / lasting)
    transition[:, 2, 2], cov[:, 2, 2] = keep, walk**2 * (1.0 - keep**2)
    for row, used in (([1.0, 0.0, 1.0], 3), ([1.0, 0.0, 0.0], 2), ([0.0, 1.0, 0.0], 2)):
        size = sizes if used == 3 else (*sizes[:3], 0.0, 1.0)
        told = dense(
            transition[:, :used, :used], cov[:, :used, :used], np.array(row[:used]), z,
            np.full(300, noise**2), np.array([5.0, 0.0, 0.0][:used]),
            np.diag([7.0, std**2, walk**2][:used]),
        )[2]  # fmt: skip
        found = rts.log_likelihood(step, span, np.array(row), z, size, 5.0, 7.0)
        assert_allclose(found, told, rtol=1e-8)
