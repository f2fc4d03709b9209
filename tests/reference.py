"""Kernels written again in plain numpy, slow and as the equations have them."""

import numpy as np


def least_squares(time, phi, y, theta, cov, forgetting):
    """Recursive least squares with forgetting (Ljung 1999, sec. 11.2): (m, n) estimates."""
    found = []
    for row, value in zip(phi, y, strict=True):
        information = forgetting * np.linalg.inv(cov)
        cov = np.linalg.inv(information + np.outer(row, row))
        theta = cov @ (information @ theta + row * value)
        found.append(theta)
    return np.array(found), cov


def fading_filter(time, rows, y, noise_var, x, cov, time_constant, std):
    """Kalman filter of constants and first-order Gauss-Markov states (Gelb 1974, ch. 4).

    Returns the last state and covariance, and the innovations over their standard deviations.
    """
    innovations = []
    x, cov = np.array(x, float), np.array(cov, float)
    before = time[0]
    for now, row, value, noise in zip(time, rows, y, noise_var, strict=True):
        keep = np.diag(np.exp(-(now - before) / time_constant))
        x = keep @ x
        cov = keep @ cov @ keep + np.diag(std**2) @ (np.eye(x.size) - keep @ keep)
        spread = row @ cov @ row + noise
        gain = cov @ row / spread
        innovations.append((value - row @ x) / np.sqrt(spread))
        x = x + gain * (value - row @ x)
        # Joseph's form, which the kernel does not use.
        less = np.eye(x.size) - np.outer(gain, row)
        cov = less @ cov @ less.T + noise * np.outer(gain, gain)
        before = now
    return x, cov, np.array(innovations)


def two_state_posterior(log_ratio, time, mean_stay):
    """Probability of the first of two hidden states, from every path of a short chain."""
    n = log_ratio.size
    total, first = 0.0, np.zeros(n)
    for number in range(2**n):
        path = np.array([(number >> k) & 1 for k in range(n)])
        changes = 0.5 * (1.0 - np.exp(-2.0 * np.diff(time) / mean_stay))
        chance = 0.5 * np.prod(np.where(np.diff(path) != 0, changes, 1.0 - changes))
        chance *= np.exp(np.sum(log_ratio[path == 0]))
        total += chance
        first += chance * (path == 0)
    return first / total


def speed_filter(speed, on, params, x, cov):
    """Extended Kalman filter of Galvao et al., eqs. 11-26, with numerical derivatives."""
    p, process = params.corrections, np.diag(params.process_var)
    seen = np.array([1.0, 0.0, 0.0])
    before, found = np.nan, []

    def moved(state, measured):
        drag = params.drag + p[2] + p[3] * measured
        gravity = params.gravity + p[4] + p[5] * measured
        traction = (params.force_gain + p[0] + p[1] * measured) * p[6] * measured
        force = traction - 0.5 * drag * state[0] ** 2
        accel = (state[1] * force - gravity * state[2]) / (1.0 + state[1] * params.rotating_mass)
        return state + params.sample_time * np.array([accel, 0.0, 0.0])

    for value, is_on in zip(speed, on, strict=True):
        if not is_on:
            before = np.nan
        elif np.isnan(before):
            x = np.array([value, x[1], x[2]])
            cov = cov.copy()
            cov[0, :], cov[:, 0] = 0.0, 0.0
            cov[0, 0] = process[0, 0]
            before = value
        else:
            sizes = np.array([1e-4, 1e-9, 1e-6])
            jacobian = np.column_stack(
                [
                    (moved(x + d, before) - moved(x - d, before)) / (2.0 * size)
                    for size, d in zip(sizes, np.diag(sizes), strict=True)
                ]
            )
            x, cov = moved(x, before), jacobian @ cov @ jacobian.T + process
            gain = cov @ seen / (seen @ cov @ seen + params.speed_var)
            x, cov = x + gain * (value - x[0]), cov - np.outer(gain, seen @ cov)
            before = value
        found.append(x)
    return np.array(found), cov
