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


@inlined_kernel
def _integrated(x):
    """What is left of a first-order Gauss-Markov process after ``x`` of its lengths.

    Beside it the part of its first value, and of its variance, that comes to the integral, in units
    of the length and of its square.
    """
    keep = np.exp(-x)
    # In short steps the difference loses its digits: there it is its series.
    if x < 1e-2:
        integral = 2.0 / 3.0 * x**3 * (1.0 - 0.75 * x)
    else:
        integral = 2.0 * x - 3.0 + 4.0 * keep - keep**2
    return keep, 1.0 - keep, integral


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
        keep, moves, integral = _integrated(step[i] / length)
        transition[i, 0, 0] = 1.0
        transition[i, 0, 1] = length * moves
        transition[i, 1, 1] = keep
        cov[i, 0, 0] = std**2 * length**2 * integral
        cov[i, 0, 1] = cov[i, 1, 0] = std**2 * length * moves**2
        cov[i, 1, 1] = std**2 * (1.0 - keep**2)
    return transition, cov


@kernel
def log_likelihood(step, span, row, z, sizes, start, opened):
    """Log-likelihood of measurements of an integrated Gauss-Markov process, constant left out.

    The states are the integral, the process, and an error of the measurement that lasts.

    Parameters
    ----------
    step : (n,) from the row before to each, in the unit of the process's length
    span : (n,) the same, in the unit of the error's length
    row : (3,) what is measured of the states
    z : (n,) measurements; NaN where there is none
    sizes : (5,) standard deviation and length of the process, standard deviation of the noise,
        standard deviation (0 for none) and length of the error
    start, opened : integral before row 0 is measured, and its variance

    Returns
    -------
    float
    """
    std, length, noise, lasting_std, lasting = sizes
    r0, r1, r2 = row
    var, noise_var, lasting_var = std * std, noise * noise, lasting_std * lasting_std
    x0, x1, x2 = start, 0.0, 0.0
    p00, p01, p02, p11, p12, p22 = opened, 0.0, 0.0, var, 0.0, lasting_var
    total, product = 0.0, 1.0
    for i in range(z.size):
        if i > 0:
            keep, moves, integral = _integrated(step[i] / length)
            left = np.exp(-span[i] / lasting) if lasting_std > 0.0 else 1.0
            a = length * moves
            x0 += a * x1
            x1 *= keep
            x2 *= left
            p00 += a * (2.0 * p01 + a * p11) + var * length * length * integral
            p01 = keep * (p01 + a * p11) + var * length * moves * moves
            p02 = left * (p02 + a * p12)
            p11 = keep * keep * p11 + var * (1.0 - keep * keep)
            p12 *= keep * left
            p22 = left * left * p22 + lasting_var * (1.0 - left * left)
        if np.isfinite(z[i]):
            g0 = p00 * r0 + p01 * r1 + p02 * r2
            g1 = p01 * r0 + p11 * r1 + p12 * r2
            g2 = p02 * r0 + p12 * r1 + p22 * r2
            spread = noise_var + r0 * g0 + r1 * g1 + r2 * g2
            inverse = 1.0 / spread
            error = z[i] - r0 * x0 - r1 * x1 - r2 * x2
            gain = error * inverse
            total += error * gain
            x0 += g0 * gain
            x1 += g1 * gain
            x2 += g2 * gain
            p00 -= g0 * g0 * inverse
            p01 -= g0 * g1 * inverse
            p02 -= g0 * g2 * inverse
            p11 -= g1 * g1 * inverse
            p12 -= g1 * g2 * inverse
            p22 -= g2 * g2 * inverse
            # One logarithm of many factors, which stay far from the limits of a number.
            product *= spread
            if not 1e-100 < product < 1e100:
                total += np.log(product)
                product = 1.0
    return -0.5 * (total + np.log(product))


@kernel
def smooth(transition, process_cov, row, z, variance, x0, cov0):
    """Smooth the state over all rows.

    Parameters
    ----------
    transition, process_cov : (n, k, k) from the row before to each; those of row 0 are not used
    row : (k,) what is measured of the state
    z : (n,) measurements; NaN where there is none
    variance : (n,) of their noise
    x0, cov0 : (k,), (k, k) state before row 0 is measured

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
