"""Least squares with Huber's weights."""

import numpy as np

from weighbridge.kernels._jit import kernel


@kernel
def _solve(matrix, right):
    """Solve with a symmetric ``matrix`` (k, k) by Cholesky, in place; ``right`` gets x."""
    k = right.size
    for i in range(k):
        for j in range(i + 1):
            left = matrix[i, j]
            for m in range(j):
                left -= matrix[i, m] * matrix[j, m]
            matrix[i, j] = np.sqrt(left) if i == j else left / matrix[j, j]
    for i in range(k):
        for m in range(i):
            right[i] -= matrix[i, m] * right[m]
        right[i] /= matrix[i, i]
    for i in range(k - 1, -1, -1):
        for m in range(i + 1, k):
            right[i] -= matrix[m, i] * right[m]
        right[i] /= matrix[i, i]


@kernel
def _median(x):
    """Median of values (n,), which it reorders; quickselect (Hoare 1961).

    That of numba needs BLAS, and loads SciPy.
    """
    n = x.size
    if n == 0:
        return np.nan
    middle, left, right = n // 2, 0, n - 1
    while left < right:
        pivot = x[(left + right) // 2]
        i, j = left, right
        while i <= j:
            while x[i] < pivot:
                i += 1
            while x[j] > pivot:
                j -= 1
            if i <= j:
                x[i], x[j] = x[j], x[i]
                i += 1
                j -= 1
        if middle <= j:
            right = j
        elif middle >= i:
            left = i
        else:
            break
    if n % 2 == 1:
        return x[middle]
    below = x[0]
    for k in range(1, middle):
        below = max(below, x[k])
    return 0.5 * (below + x[middle])


@kernel
def _fit(columns, y, threshold, rounds, settled, found, weight):
    """One of `fits`; the parameters to ``found`` (k,), the weights to ``weight`` (n,)."""
    n, k = columns.shape
    size = np.empty(k)
    scaled = np.empty((k, n))
    for i in range(k):
        total = 0.0
        for row in range(n):
            total += columns[row, i] ** 2
        size[i] = np.sqrt(total / n) + 1e-300
        for row in range(n):
            scaled[i, row] = columns[row, i] / size[i]
    off, sizes = np.empty(n), np.empty(n)
    new, matrix = np.empty(k), np.empty((k, k))
    weight[:], found[:] = 1.0, 0.0
    for _ in range(rounds):
        for i in range(k):
            right = 0.0
            for row in range(n):
                right += weight[row] * scaled[i, row] * y[row]
            new[i] = right
            for j in range(i + 1):
                both = 0.0
                for row in range(n):
                    both += weight[row] * scaled[i, row] * scaled[j, row]
                matrix[i, j] = both
            matrix[i, i] += 1e-12 * n
        _solve(matrix, new)
        change, largest = 0.0, 0.0
        for i in range(k):
            change = max(change, abs(new[i] - found[i]))
            largest = max(largest, abs(new[i]))
            found[i] = new[i]
        if change <= settled * largest:
            break
        most = 0.0
        for row in range(n):
            left = y[row]
            for i in range(k):
                left -= new[i] * scaled[i, row]
            off[row] = sizes[row] = abs(left)
            most = max(most, off[row])
        # What rounding leaves of a perfect fit is no outlier.
        limit = threshold * 1.4826 * _median(sizes) + 1e-12 * most + 1e-300
        for row in range(n):
            weight[row] = limit / max(off[row], limit)
    for i in range(k):
        found[i] /= size[i]


@kernel
def fits(columns, y, threshold, rounds, settled):
    """Fit with weights by the residuals of the fit before, until the parameters stay.

    Parameters
    ----------
    columns : (b, n, k) float64
        Of each of b fits.
    y : (b, n) float64
    threshold : float
        Residual over the standard deviation from which a row counts less [-].
    rounds : int
        Times that rows are weighed anew, at most.
    settled : float
        Change of the parameters over their size from which they stay [-].

    Returns
    -------
    parameters (b, k) and weights of the rows (b, n)

    References
    ----------
    Huber, Robust Statistics, 1981, ch. 7.
    """
    found, weight = np.empty((y.shape[0], columns.shape[2])), np.empty_like(y)
    for b in range(y.shape[0]):
        _fit(columns[b], y[b], threshold, rounds, settled, found[b], weight[b])
    return found, weight
