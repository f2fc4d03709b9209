"""Which of two hidden states held, from how likely each sample is in either."""

import numpy as np

from weighbridge.kernels._jit import kernel


@kernel
def _before(backward, log_ratio, span, mean_stay):
    """Odds of the first state by all later samples, one sample earlier."""
    change = 0.5 * (1.0 - np.exp(-2.0 * span / mean_stay))
    later = backward * np.exp(log_ratio)
    return (later * (1.0 - change) + change) / (later * change + 1.0 - change)


@kernel
def _with(probability, odds):
    """Probability of a state with more odds for it."""
    odds = probability / (1.0 - probability) * odds
    return odds / (1.0 + odds)


@kernel
def posterior(log_ratio, time, mean_stay, ahead):
    """Probability of the first of two states at each sample, from those until soon after it.

    Parameters
    ----------
    log_ratio : (n,) float64
        Logarithm of the likelihood of a sample in the first state over that in the second.
    time : (n,) float64
        Rising [s].
    mean_stay : float
        Mean time that either state lasts [s].
    ahead : float
        Time after a sample that is looked at [s]; infinite for all of it.

    Returns
    -------
    (n,) float64

    References
    ----------
    Forward-backward recursion: Rabiner, Proceedings of the IEEE 77, 1989, sec. III; smoothed
    with a fixed lag where ``ahead`` is finite.
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
    if np.isinf(ahead):
        backward = 1.0
        for k in range(n - 2, -1, -1):
            backward = _before(backward, log_ratio[k + 1], time[k + 1] - time[k], mean_stay)
            first[k] = _with(first[k], backward)
        return first
    last = n - 1
    for k in range(n - 1, -1, -1):
        while time[last] > time[k] + ahead:
            last -= 1
        backward = 1.0
        for j in range(last - 1, k - 1, -1):
            backward = _before(backward, log_ratio[j + 1], time[j + 1] - time[j], mean_stay)
        first[k] = _with(first[k], backward)
    return first
