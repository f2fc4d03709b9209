"""Straight lines by least squares with Huber's weights."""

import numpy as np

from weighbridge.kernels._jit import kernel


@kernel
def robust_line(x, y, first, last, rounds):
    """Fit a line to all points but some neighbouring ones.

    Parameters
    ----------
    x, y : (m,) float64
    first, last : int
        Points from ``first`` to before ``last`` are left out.
    rounds : int
        Of weighing anew.

    Returns
    -------
    slope, level : float

    References
    ----------
    Huber, Robust Statistics, 1981, ch. 7.
    """
    count = x.size - (last - first)
    u, v = np.empty(count), np.empty(count)
    largest = 0.0
    for k in range(count):
        at = k if k < first else k + last - first
        u[k], v[k] = x[at], y[at]
        largest = max(largest, abs(v[k]))
    weight, off, least = np.ones(count), np.empty(count), 1e-12 * largest
    slope, level = 0.0, 0.0
    for _ in range(rounds):
        total, u_sum, v_sum = 0.0, 0.0, 0.0
        for k in range(count):
            total += weight[k]
            u_sum += weight[k] * u[k]
            v_sum += weight[k] * v[k]
        u_mean, v_mean = u_sum / total, v_sum / total
        both, square = 0.0, 0.0
        for k in range(count):
            du = weight[k] * (u[k] - u_mean)
            both += du * v[k]
            square += du * (u[k] - u_mean)
        slope = both / max(square, 1e-300)
        level = v_mean - slope * u_mean
        for k in range(count):
            off[k] = abs(v[k] - slope * u[k] - level)
        limit = 2.0 * np.median(off) + least
        for k in range(count):
            weight[k] = min(1.0, limit / max(off[k], 1e-300))
    return slope, level


@kernel
def lines_without_parts(x, y, begins, size, rounds):
    """Fit a line to all points but those of each part in turn; see `robust_line`.

    Parameters
    ----------
    x, y : (m,) float64
    begins : (k,) int64
        First point of each part.
    size : int
        Points of a part.
    rounds : int

    Returns
    -------
    (k, 2) float64
        Slope and level.
    """
    found = np.empty((begins.size, 2))
    for k in range(begins.size):
        found[k] = robust_line(x, y, begins[k], begins[k] + size, rounds)
    return found
