"""Low-pass and resampling of unevenly sampled channels."""

import math

import numpy as np

from weighbridge.kernels._jit import fast_kernel, kernel


@fast_kernel
def lowpass_resample(time, values, start, period, first, reach, out, weight):
    """Low-pass unevenly sampled channels and take them to an even clock, without delay.

    Each output is the weighted mean of the samples within ``reach`` output
    periods, with the weights ``sinc(0.8 u) cos^2(pi u / (2 reach))`` of a Hann-windowed
    ideal low-pass at 0.4 of the output rate: beyond 0.6 of it, what would
    fold stays below 1 % for ``reach = 3``.

    Parameters
    ----------
    time : (n,) float64
        Rising [s].
    values : (n, c) float64
    start, period : float
        Begin of the even clock and distance of its instants [s].
    first : int
        Which of them is the first output.
    reach : float
        [-]
    out : (count, c) float64
        Filled; NaN where too few samples are near.
    weight : (count,) float64
        Filled: sum of the weights, about samples per output period.
    """
    count, channels = out.shape
    fine = 256
    size = int(reach * fine)
    window = np.empty(size + 2)
    for i in range(size + 2):
        u = i / fine
        angle = math.pi * 0.8 * u
        window[i] = math.sin(angle) / angle if i > 0 else 1.0
        window[i] *= math.cos(0.5 * math.pi * min(u, reach) / reach) ** 2
    out[:] = 0.0
    weight[:] = 0.0
    nearest = np.zeros(count)
    for i in range(time.size):
        # each sample covers the time to its neighbours, so that jitter and
        # bursts do not weigh more
        left = time[i] - time[i - 1] if i > 0 else time[i + 1] - time[i]
        right = time[i + 1] - time[i] if i + 1 < time.size else left
        share = 0.5 * (min(left, 2.0 * period) + min(right, 2.0 * period)) / period
        place = (time[i] - start) / period
        low = max(first, math.ceil(place - reach))
        high = min(first + count - 1, math.floor(place + reach))
        for k in range(low - first, high - first + 1):
            u = place - (first + k)
            cell = abs(u) * fine
            at = int(cell)
            w = share * (window[at] + (cell - at) * (window[at + 1] - window[at]))
            weight[k] += w
            if abs(u) <= 1.0:
                nearest[k] += 1.0
            for c in range(channels):
                out[k, c] += w * values[i, c]
    for k in range(count):
        good = nearest[k] > 0.0 and weight[k] > 0.5
        for c in range(channels):
            out[k, c] = out[k, c] / weight[k] if good else np.nan


@kernel
def lowpass_even(values, good, anew, share, reach):
    """Low-pass channels of an even clock, without delay, each output from its neighbours alone.

    The weights are those of a Hann-windowed ideal low-pass; where samples lack, the others count
    for all.

    Parameters
    ----------
    values : (n, c) float64
    good : (n,) bool
        Samples that count; the others stay as they are.
    anew : (n,) bool
        The clock begins anew with these.
    share : float
        Edge of the low-pass over the rate of the clock [-].
    reach : int
        Samples on either side.

    Returns
    -------
    (n, c) float64
    """
    count, channels = values.shape
    weights = np.empty(reach + 1)
    for k in range(reach + 1):
        angle = 2.0 * math.pi * share * k
        weights[k] = math.sin(angle) / angle if k > 0 else 1.0
        weights[k] *= math.cos(0.5 * math.pi * k / (reach + 1)) ** 2
    out = values.copy()
    sums = np.empty(channels)
    for i in range(count):
        if not good[i]:
            continue
        first, last = i, i
        while first > 0 and i - first < reach and not anew[first]:
            first -= 1
        while last < count - 1 and last - i < reach and not anew[last + 1]:
            last += 1
        whole = 0.0
        sums[:] = 0.0
        for j in range(first, last + 1):
            if good[j]:
                w = weights[abs(j - i)]
                whole += w
                for c in range(channels):
                    sums[c] += w * values[j, c]
        for c in range(channels):
            out[i, c] = sums[c] / whole
    return out
