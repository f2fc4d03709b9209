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


def test_smoother_and_likelihood_equal_the_dense_ones():
    made = model(np.random.default_rng(1))
    mean, var, told = dense(*made)
    x, found_var = rts.smooth(*made)
    assert_allclose(x, mean, rtol=1e-9, atol=1e-12)
    assert_allclose(found_var, var, rtol=1e-9, atol=1e-12)
    assert_allclose(rts.log_likelihood(*made), told, rtol=1e-9)
