"""First-order lag of samples."""

import math

import numpy as np

from weighbridge.kernels._jit import kernel


@kernel
def first_order(time, values, lag):
    """Pass unevenly sampled values through a first-order lag.

    Between two samples the input runs on a line, for which the lag is solved exactly.

    Parameters
    ----------
    time : (n,) float64
        Not falling [s].
    values : (n,) float64
        NaN where nothing is known; the lag begins anew behind it.
    lag : float
        Time constant, > 0 [s].

    Returns
    -------
    (n,) float64
        NaN where ``values`` are.
    """
    out = np.empty(values.size)
    for i in range(values.size):
        if i == 0 or math.isnan(values[i]) or math.isnan(out[i - 1]):
            out[i] = values[i]
            continue
        span = time[i] - time[i - 1]
        keep = math.exp(-span / lag)
        # What the output falls behind a line of this slope.
        late = lag * (values[i] - values[i - 1]) / span if span > 0.0 else 0.0
        out[i] = values[i] - late + (out[i - 1] - values[i - 1] + late) * keep
    return out


@kernel
def even_lag(values, keep, start):
    """Pass even samples through a first-order lag.

    To the last bit what `scipy.signal.lfilter` makes of them, which takes a second to load.

    Parameters
    ----------
    values : (n,) float64
    keep : float
        What is left of a value after one sample [-].
    start : float
        What came out before the first sample.

    Returns
    -------
    (n,) float64
    """
    out = np.empty(values.size)
    left = keep * start
    for i in range(values.size):
        out[i] = left + (1.0 - keep) * values[i]
        left = keep * out[i]
    return out


@kernel
def fading(values, keep):
    """Sum up what came before each sample, a part ``keep`` of it left after each.

    Parameters
    ----------
    values : (n,) float64
    keep : float

    Returns
    -------
    (n,) float64
        ``sum_j values_j keep^(i - j)`` over all j < i.
    """
    out = np.empty(values.size)
    left = 0.0
    for i in range(values.size):
        out[i] = left
        left = keep * values[i] + keep * left
    return out
