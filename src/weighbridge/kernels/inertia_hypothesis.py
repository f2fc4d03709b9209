"""One hypothesis of the filter of `weighbridge.kernels.inertia`: integrate, predict, correct."""

import math

import numpy as np

from weighbridge.kernels._jit import kernel

VELOCITY_STD = 10.0
"""Of a velocity nothing is known of [m/s], [rad/s]."""

SPIKE = 5.0
"""Innovations of more standard deviations count less [-]."""


@kernel
def integral(older, old, new, old_step, step):
    """Integrate over the last step by the parabola through three samples, or the chord of two.

    Parameters
    ----------
    older, old, new : float
        Samples; ``older`` counts where ``old_step`` is comparable to ``step``.
    old_step, step : float
        Between them [s].

    References
    ----------
    Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993,
    sec. III.5, variable step size Adams method, one corrector of order three.
    """
    if not (old_step > 0.0 and old_step < 3.0 * step and step < 3.0 * old_step):
        return 0.5 * step * (old + new)
    both = old_step + step
    return step * (
        new * (2.0 * step + 3.0 * old_step) / (6.0 * both)
        + old * (step + 3.0 * old_step) / (6.0 * old_step)
        - older * step * step / (6.0 * old_step * both)
    )


@kernel
def predict(mean, cov, impulse, step, velocity_var, alpha_drift, beta_drift):
    """Integrate one hypothesis over a step; exact for a known impulse."""
    mean[0] += mean[1] * impulse + mean[2] * step
    # F P F' with F = [[1, impulse, step], [0, 1, 0], [0, 0, 1]].
    c01 = cov[0, 1] + impulse * cov[1, 1] + step * cov[1, 2]
    c02 = cov[0, 2] + impulse * cov[1, 2] + step * cov[2, 2]
    c00 = cov[0, 0] + impulse * (cov[0, 1] + c01) + step * (cov[0, 2] + c02)
    cov[0, 0] = c00 + velocity_var
    cov[0, 1] = c01
    cov[1, 0] = c01
    cov[0, 2] = c02
    cov[2, 0] = c02
    cov[1, 1] += alpha_drift * step
    cov[2, 2] += beta_drift * step


@kernel
def forget_velocity(mean, cov, velocity):
    """Make the velocity unknown; what is known of the rest stays."""
    mean[0] = velocity
    for i in range(1, 3):
        cov[0, i] = 0.0
        cov[i, 0] = 0.0
    cov[0, 0] = VELOCITY_STD**2


@kernel
def correct(mean, cov, measured, noise_var):
    """Fold a measured velocity in, by the Joseph form; return innovation and its variance.

    A velocity far off counts as noisier in proportion, as Huber weighs it: a
    spike of the sensor moves nothing much.
    """
    innovation = measured - mean[0]
    var = cov[0, 0] + noise_var
    far = abs(innovation) / (SPIKE * np.sqrt(var))
    if far > 1.0:
        noise_var += (far - 1.0) * var
        var *= far
    g0, g1, g2 = cov[0, 0] / var, cov[1, 0] / var, cov[2, 0] / var
    mean[0] += g0 * innovation
    mean[1] += g1 * innovation
    mean[2] += g2 * innovation
    # (I - g h) P (I - g h)' + g r g' of h = [1, 0, 0].
    c00, c01, c02 = cov[0, 0], cov[0, 1], cov[0, 2]
    keep = 1.0 - g0
    cov[0, 0] = keep * keep * c00 + g0 * g0 * noise_var
    cov[0, 1] = keep * (c01 - g1 * c00) + g0 * g1 * noise_var
    cov[0, 2] = keep * (c02 - g2 * c00) + g0 * g2 * noise_var
    cov[1, 1] += -2.0 * g1 * c01 + g1 * g1 * var
    cov[1, 2] += -g1 * c02 - g2 * c01 + g1 * g2 * var
    cov[2, 2] += -2.0 * g2 * c02 + g2 * g2 * var
    cov[1, 0] = cov[0, 1]
    cov[2, 0] = cov[0, 2]
    cov[2, 1] = cov[1, 2]
    return innovation, var


@kernel
def within(mean, std, lowest, highest):
    """Mean and standard deviation of a Gaussian of which only a range is possible.

    References
    ----------
    Johnson, Kotz, Balakrishnan, Continuous Univariate Distributions, vol. 1, 2nd ed., 1994,
    sec. 13.10.1.
    """
    low, high = (lowest - mean) / std, (highest - mean) / std
    if low < -6.0 and high > 6.0:
        return mean, std
    share = 0.5 * (math.erf(high / np.sqrt(2.0)) - math.erf(low / np.sqrt(2.0)))
    if not share > 1e-12:
        return min(max(mean, lowest), highest), std
    at_low = np.exp(-0.5 * low * low) / np.sqrt(2.0 * np.pi)
    at_high = np.exp(-0.5 * high * high) / np.sqrt(2.0 * np.pi)
    shift = (at_low - at_high) / share
    var = 1.0 + (low * at_low - high * at_high) / share - shift * shift
    return mean + std * shift, std * np.sqrt(max(var, 0.0))
