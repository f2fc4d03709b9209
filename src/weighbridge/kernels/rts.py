"""Kalman filter and fixed-interval smoother of a linear model with scalar measurements."""

import numpy as np

from weighbridge.kernels._jit import inlined_kernel, kernel


@inlined_kernel
def _product(a, b, out):
    """Matrix product of small matrices, without a call of a library."""
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            total = 0.0
            for m in range(a.shape[1]):
                total += a[i, m] * b[m, j]
            out[i, j] = total


@inlined_kernel
def _predict(transition, process_cov, i, x, cov, work):
    """Take state and covariance one row further, to row ``i``, in place."""
    k = x.size
    for a in range(k):
        total = 0.0
        for m in range(k):
            total += transition[i, a, m] * x[m]
        work[2, 0, a] = total
    for a in range(k):
        x[a] = work[2, 0, a]
        for b in range(k):
            total = 0.0
            for m in range(k):
                total += transition[i, a, m] * cov[m, b]
            work[0, a, b] = total
    for a in range(k):
        for b in range(k):
            total = 0.0
            for m in range(k):
                total += work[0, a, m] * transition[i, b, m]
            work[1, a, b] = total
    for a in range(k):
        for b in range(k):
            cov[a, b] = 0.5 * (work[1, a, b] + work[1, b, a]) + process_cov[i, a, b]


@inlined_kernel
def _spread(cov, row, variance, gain):
    """Variance of the innovation; ``gain`` becomes the covariance with the measurement."""
    total = variance
    for i in range(row.size):
        gain[i] = 0.0
        for m in range(row.size):
            gain[i] += cov[i, m] * row[m]
        total += row[i] * gain[i]
    return total


@inlined_kernel
def _error(row, x, z):
    total = z
    for i in range(row.size):
        total -= row[i] * x[i]
    return total


@inlined_kernel
def _update(x, cov, gain, error, spread):
    inverse = 1.0 / spread
    for i in range(x.size):
        x[i] += gain[i] * (error * inverse)
        for j in range(x.size):
            cov[i, j] -= gain[i] * gain[j] * inverse


@kernel
def gauss_markov(step, length, std):
    """Integrate a first-order Gauss-Markov process over steps.

    Parameters
    ----------
    step : (n,) in the unit of ``length``
    length, std : how long the process lasts, and its standard deviation

    Returns
    -------
    transition, process_cov : (n, 2, 2) of the integral and the process
    """
    n = step.size
    transition, cov = np.zeros((n, 2, 2)), np.empty((n, 2, 2))
    for i in range(n):
        x = step[i] / length
        keep = np.exp(-x)
        transition[i, 0, 0] = 1.0
        transition[i, 0, 1] = length * (1.0 - keep)
        transition[i, 1, 1] = keep
        # In short steps the difference loses its digits: there it is its series.
        if x < 1e-2:
            integral = 2.0 / 3.0 * x**3 * (1.0 - 0.75 * x)
        else:
            integral = 2.0 * x - 3.0 + 4.0 * keep - keep**2
        cov[i, 0, 0] = std**2 * length**2 * integral
        cov[i, 0, 1] = cov[i, 1, 0] = std**2 * length * (1.0 - keep) ** 2
        cov[i, 1, 1] = std**2 * (1.0 - keep**2)
    return transition, cov


@kernel
def log_likelihood(transition, process_cov, row, z, variance, x0, cov0):
    """Log-likelihood of the innovations, constant left out.

    Parameters
    ----------
    transition, process_cov : (n, k, k) from the row before to each; those of row 0 are not used
    row : (k,) what is measured of the state
    z : (n,) measurements; NaN where there is none
    variance : (n,) of their noise
    x0, cov0 : (k,), (k, k) state before row 0 is measured

    Returns
    -------
    float
    """
    k = x0.size
    x, cov, gain, work = x0.copy(), cov0.copy(), np.empty(k), np.empty((3, k, k))
    total = 0.0
    for i in range(z.size):
        if i > 0:
            _predict(transition, process_cov, i, x, cov, work)
        if np.isfinite(z[i]):
            spread = _spread(cov, row, variance[i], gain)
            error = _error(row, x, z[i])
            total -= 0.5 * (np.log(spread) + error**2 / spread)
            _update(x, cov, gain, error, spread)
    return total


@kernel
def smooth(transition, process_cov, row, z, variance, x0, cov0):
    """Smooth the state over all rows; parameters as of `log_likelihood`.

    Returns
    -------
    x : (n, k) mean given all measurements
    var : (n, k) its variances

    References
    ----------
    Bierman, Automatica 9(5), 1973, 633-639: the form of Bryson and Frazier, which inverts no
    covariance.
    """
    n, k = z.size, x0.size
    mean, covs = np.empty((n, k)), np.empty((n, k, k))
    gains, spreads, errors = np.empty((n, k)), np.empty(n), np.empty(n)
    x, cov, work = x0.copy(), cov0.copy(), np.empty((3, k, k))
    for i in range(n):
        if i > 0:
            _predict(transition, process_cov, i, x, cov, work)
        # What is kept is from before the row is measured.
        for a in range(k):
            mean[i, a] = x[a]
            for b in range(k):
                covs[i, a, b] = cov[a, b]
        if np.isfinite(z[i]):
            spreads[i] = _spread(cov, row, variance[i], gains[i])
            errors[i] = _error(row, x, z[i])
            _update(x, cov, gains[i], errors[i], spreads[i])
    var = np.empty((n, k))
    adjoint, information = np.zeros(k), np.zeros((k, k))
    keep = np.empty((k, k))
    for i in range(n - 1, -1, -1):
        if np.isfinite(z[i]):
            for a in range(k):
                for b in range(k):
                    keep[a, b] = (1.0 if a == b else 0.0) - gains[i, a] * row[b] / spreads[i]
            moved = work[2, 0]
            for a in range(k):
                moved[a] = -row[a] * errors[i] / spreads[i]
                for b in range(k):
                    moved[a] += keep[b, a] * adjoint[b]
            for a in range(k):
                adjoint[a] = moved[a]
            _product(keep.T, information, work[0])
            _product(work[0], keep, information)
            for a in range(k):
                for b in range(k):
                    information[a, b] += row[a] * row[b] / spreads[i]
        _product(covs[i], information, work[0])
        _product(work[0], covs[i], work[1])
        for a in range(k):
            var[i, a] = covs[i, a, a] - work[1, a, a]
            for b in range(k):
                mean[i, a] -= covs[i, a, b] * adjoint[b]
        # Back to just after the row before.
        moved = work[2, 0]
        for a in range(k):
            moved[a] = 0.0
            for b in range(k):
                moved[a] += transition[i, b, a] * adjoint[b]
        for a in range(k):
            adjoint[a] = moved[a]
        _product(transition[i].T, information, work[0])
        _product(work[0], transition[i], information)
    return mean, var
