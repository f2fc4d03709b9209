"""Linear interpolation of signals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def interpolate(
    at: NDArray[np.float64],
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    left: float | None = None,
    right: float | None = None,
) -> NDArray[np.float64]:
    """Interpolate as `numpy.interp` does, to the last bit, and faster where instants rise.

    Parameters
    ----------
    at : instants, of any shape [s]
    time, values : (n,) of the points, n > 0; times do not fall
    left, right : before the first point and after the last; their values when None
    """
    from weighbridge.kernels import interpolation  # The compiler is slow to load.

    found: NDArray[np.float64] = interpolation.interpolate(
        np.ascontiguousarray(at, dtype=np.float64).ravel(),
        np.ascontiguousarray(time, dtype=np.float64),
        np.ascontiguousarray(values, dtype=np.float64),
        float(values[0] if left is None else left),
        float(values[-1] if right is None else right),
    )
    return found.reshape(np.shape(at))[()]
