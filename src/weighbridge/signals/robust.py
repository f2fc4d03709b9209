"""Statistics that single bad values do not move: spread, Huber's weights and fits, resolution.

References
----------
Huber, Robust Statistics, 1981, ch. 5 and 7.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.constants import HUBER
from weighbridge.signals.signal import Floats

_NORMAL: Final = 1.4826
"""Standard deviation over the median of the sizes, of normal values [-]."""

_ROUNDS: Final = 12
"""Times that rows are weighed anew, at most."""

_SETTLED: Final = 1e-10
"""Change of a fit over its size from which it is settled [-]."""

_TELLING: Final = 20_000
"""Values by which a resolution is found."""

_GRAIN: Final = 1e-7
"""Part of the largest value below which values differ by their conversion: single precision [-]."""

_WHOLE: Final = 0.1
"""Part of a step by which a multiple of it may be off [-]."""

_SHORT: Final = 4.5
"""Gaps over the smallest by which the step is found; over longer ones rounding adds up [-]."""


def spread(values: Floats) -> float:
    """Return the standard deviation of values (n,) about zero by the median of their sizes.

    In their unit; 0 of none.
    """
    return _NORMAL * float(np.median(np.abs(values))) if values.size else 0.0


def huber(residual: Floats, scale: float, threshold: float = HUBER) -> Floats:
    """Weights of rows by Huber's loss.

    Parameters
    ----------
    residual : (n,)
    scale : standard deviation of a sound one, in its unit
    threshold : residual over scale from which a row counts less [-]

    Returns
    -------
    (n,) in (0, 1]; all 1 where the scale is 0 and no residual is left
    """
    size = np.abs(residual)
    # What rounding leaves of a perfect fit is no outlier.
    limit = threshold * scale + 1e-12 * size.max(initial=0.0) + 1e-300
    return np.asarray(limit / np.maximum(size, limit))


def robust_fit(columns: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Least squares with Huber's weights.

    Parameters
    ----------
    columns : (n, k)
    y : (n,)

    Returns
    -------
    found : (k,) parameters
    weight : (n,) of the rows
    """
    found, weight = robust_fits(columns[None], y[None])
    return found[0], weight[0]


def robust_fits(columns: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Fit many times as `robust_fit` does, each on rows of its own, together.

    Parameters
    ----------
    columns : (b, n, k)
    y : (b, n)

    Returns
    -------
    found : (b, k) parameters
    weight : (b, n) of the rows
    """
    from weighbridge.kernels.huber import fits  # The compiler is slow to load.

    sets = (np.ascontiguousarray(a, dtype=np.float64) for a in (columns, y))
    found, weight = fits(*sets, HUBER, _ROUNDS, _SETTLED)
    return found, weight


def median_of_three(values: Floats) -> Floats:
    """Return the median of each value (n,) and its neighbours; the ends stand twice."""
    padded = np.concatenate((values[:1], values, values[-1:]))
    before, here, after = padded[:-2], padded[1:-1], padded[2:]
    lower, upper = np.minimum(before, here), np.maximum(before, here)
    return np.maximum(lower, np.minimum(upper, after))


def median_slope(x: Floats, y: Floats) -> float:
    """Return the median slope of all pairs of points (n,) (Theil 1950, Sen 1968)."""
    i, j = np.triu_indices(x.size, 1)
    return float(np.median((y[j] - y[i]) / (x[j] - x[i])))


def resolution(values: Floats) -> float:
    """Return the step that values (n,) are quantised to, in their unit; 0 where none shows."""
    some = values[:: 1 + values.size // _TELLING]
    some = some[np.isfinite(some)]
    grain = _GRAIN * float(np.max(np.abs(some), initial=0.0))
    levels = np.unique(np.round(some / grain)) if grain else some[:0]
    if levels.size < 3:
        return 0.0
    gaps = np.diff(levels) * grain
    short = gaps[gaps < _SHORT * gaps.min()]
    step = float(short.sum() / np.round(short / gaps.min()).sum())
    ratio = gaps / step
    # Of a step as fine as rounding, all are multiples.
    on_steps = np.abs(ratio - np.round(ratio)).max() < _WHOLE and step > 10.0 * grain
    return step if on_steps else 0.0
