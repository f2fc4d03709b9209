"""Fewer points that look the same."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from tsdownsample import MinMaxLTTBDownsampler

from weighbridge.signals import Bools, Floats, Ints

LINE_POINTS = 1200
"""Points kept of a line: as many as a figure across the page has columns."""

SCATTER_POINTS = 1200
"""Points kept of a scatter."""

_KEPT = 0xFFFFFF00
_ROUND_UP = 0x80
"""Of a number in single precision, the bits that are kept, and half of the first that is not."""

Thinned = NDArray[np.float32]


def thin_line(x: Floats, *ys: Floats, points: int = LINE_POINTS) -> tuple[Thinned, ...]:
    """Thin a line, keeping its extremes and its gaps.

    Parameters
    ----------
    x : (n,) not falling
    ys : (n,) each; the first one decides which points stay, NaN where unknown
    points : at most, gaps aside

    Returns
    -------
    x, *ys : (m,) single precision; a row of NaN in ``ys`` where a gap was

    References
    ----------
    Van Der Donckt et al., MinMaxLTTB, IEEE VIS 2023.
    """
    lead = ys[0]
    finite = np.isfinite(x) & np.isfinite(lead)
    index = np.flatnonzero(finite)
    if index.size > points:
        thinner: Any = MinMaxLTTBDownsampler
        keep = thinner().downsample(
            np.ascontiguousarray(x[index]), np.ascontiguousarray(lead[index]), n_out=points
        )
        index = index[keep.astype(np.int64)]
    missing = np.cumsum(~finite)
    breaks = np.flatnonzero(np.diff(missing[index])) + 1 if index.size else index
    thinned = [np.insert(x[index], breaks, x[index][breaks])]
    thinned += [np.insert(y[index], breaks, np.nan) for y in ys]
    return tuple(single(values) for values in thinned)


def spread(rows: Bools, points: int = SCATTER_POINTS) -> Ints:
    """Return the indices of at most ``points`` of the marked rows, evenly spread."""
    index = np.flatnonzero(rows)
    if index.size <= points:
        return index
    return index[np.linspace(0, index.size - 1, points).astype(np.int64)]


def single(values: Floats) -> Thinned:
    """Return the values with 16 bits of mantissa: no eye sees it, and they pack well."""
    with np.errstate(over="ignore"):
        bits = np.asarray(values, dtype=np.float32).view(np.uint32)
    rounded = (bits + np.uint32(_ROUND_UP)) & np.uint32(_KEPT)
    return np.asarray(np.where(np.isfinite(values), rounded, bits), dtype=np.uint32).view(
        np.float32
    )
