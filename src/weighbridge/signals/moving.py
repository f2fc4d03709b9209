"""Moving mean of even samples.

SciPy's filter gives the same bits, and takes longer to import than a drive keeps it busy.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from weighbridge.signals.signal import Floats


def moving_mean(
    values: Floats, width: int, beyond: Literal["constant", "edge", "symmetric"]
) -> Floats:
    """Mean of the samples about each one.

    Parameters
    ----------
    values : (n,) or (k, n), without NaN
    width : samples in the mean, at least 1
    beyond : what is beyond the ends, as `numpy.pad` names it: zeros, the sample at the end, or the
        samples before the end in reverse

    Returns
    -------
    As ``values``
    """
    if not values.size:
        return values
    before = width // 2
    sides = (before, width - 1 - before)
    padded = np.pad(values, [(0, 0)] * (values.ndim - 1) + [sides], beyond)
    first = np.cumsum(padded[..., :width], axis=-1)[..., -1:]
    steps = padded[..., width:] - padded[..., :-width]
    return np.asarray(np.cumsum(np.concatenate((first, steps), axis=-1), axis=-1) / width)
