"""First-order lag of unevenly sampled values."""

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
