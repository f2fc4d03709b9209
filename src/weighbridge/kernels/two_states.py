"""Which of two hidden states held, from how likely each sample is in either."""

import numpy as np

from weighbridge.kernels._jit import kernel


@kernel
def posterior(log_ratio, time, mean_stay):
    """Probability of the first of two states at each sample, from all samples.

    Parameters
    ----------
    log_ratio : (n,) float64
        Logarithm of the likelihood of a sample in the first state over that in the second.
    time : (n,) float64
        Rising [s].
    mean_stay : float
        Mean time that either state lasts [s].

    Returns
    -------
    (n,) float64

    References
    ----------
    Forward-backward recursion: Rabiner, Proceedings of the IEEE 77, 1989, sec. III.
    """
    n = log_ratio.size
    first = np.empty(n)
    forward = 0.5
    for k in range(n):
        if k > 0:
            change = 0.5 * (1.0 - np.exp(-2.0 * (time[k] - time[k - 1]) / mean_stay))
            forward = forward * (1.0 - change) + (1.0 - forward) * change
        odds = forward / (1.0 - forward) * np.exp(log_ratio[k])
        forward = min(max(odds / (1.0 + odds), 1e-9), 1.0 - 1e-9)
        first[k] = forward
    backward = 1.0
    for k in range(n - 2, -1, -1):
        # Odds of the first state by all later samples.
        change = 0.5 * (1.0 - np.exp(-2.0 * (time[k + 1] - time[k]) / mean_stay))
        later = backward * np.exp(log_ratio[k + 1])
        backward = (later * (1.0 - change) + change) / (later * change + 1.0 - change)
        odds = first[k] / (1.0 - first[k]) * backward
        first[k] = odds / (1.0 + odds)
    return first
