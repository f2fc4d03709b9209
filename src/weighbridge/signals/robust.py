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
    limit = threshold * scale + 1e-12 * float(size.max(initial=0.0)) + 1e-300
    return np.asarray(np.minimum(1.0, limit / np.maximum(size, limit)))


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
    size = np.sqrt(np.mean(columns**2, axis=0)) + 1e-300
    scaled = columns / size
    ridge = 1e-12 * y.size * np.eye(size.size)
    weight, found = np.ones_like(y), np.zeros(size.size)
    for _ in range(_ROUNDS):
        before = found
        rows = scaled.T * weight
        found = np.linalg.solve(rows @ scaled + ridge, rows @ y)
        residual = y - scaled @ found
        if np.max(np.abs(found - before)) <= _SETTLED * np.max(np.abs(found)):
            break
        weight = huber(residual, spread(residual))
    return np.asarray(found / size), weight


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
