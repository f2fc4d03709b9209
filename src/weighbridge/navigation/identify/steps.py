"""One step or ramp in a series of means."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.signals import Floats

SIDE: Final = 3
"""Means on either side that show a level."""

_RAMPS: Final = (60.0, 120.0, 300.0, 600.0, 1200.0)
"""Lengths of ramps tried [s],"""

_PARTS: Final = (0.5, 0.95)
"""and over the length of the series [-]."""

_RAMP_SURE: Final = 12.0
"""Further squared error that a ramp must explain, over its variance [-]."""


_AT_ONCE: Final = 1 << 21
"""Values of trial ramps made at a time: all of a long drive's would fill the memory."""


@dataclass(frozen=True, slots=True)
class Step:
    """The step or ramp that explains most.

    Attributes
    ----------
    sureness : squared error explained over its variance [-]
    center, length : of the change, length 0 for a step [s]
    level, size : before the change, and of it, in the unit of the series
    """

    sureness: float
    center: float
    length: float
    level: float
    size: float


def fitted(at: Floats, y: Floats, weight: Floats, floor: float, *, like: float) -> Step:
    """Fit a step and ramps of several lengths by least squares.

    Parameters
    ----------
    at : (n,) rising, at least ``2 SIDE`` [s]
    y : (n,) the series
    weight : (n,) of about 1 in the mean
    floor : standard deviation of the series at least
    like : so many neighbours count as one [-]
    """
    middles = 0.5 * (at[1:] + at[:-1])
    centers = middles[SIDE - 1 : middles.size - SIDE + 1]
    span = float(at[-1] - at[0])
    lengths = [1e-3, *(r for r in _RAMPS if r < 0.8 * span), *(part * span for part in _PARTS)]
    where, long = (x.ravel() for x in np.meshgrid(centers, np.array(lengths)))
    total = float(weight.sum())
    mean = float(weight @ y) / total
    off = y - mean
    means, spread, common = (np.empty(where.size) for _ in range(3))
    each = max(1, _AT_ONCE // at.size)
    for first in range(0, where.size, each):
        part = slice(first, first + each)
        shape = np.clip((at - where[part, None]) / long[part, None] + 0.5, 0.0, 1.0)
        means[part] = (shape @ weight) / total
        shape -= means[part, None]
        common[part] = shape @ (weight * off)
        spread[part] = np.square(shape, out=shape) @ weight
    explained = np.where(spread > 0.1, common**2 / np.maximum(spread, 1e-9), 0.0)
    step = int(np.argmax(explained[: centers.size]))
    ramp = int(np.argmax(explained))
    left = float(weight @ off**2) - float(explained[ramp])
    variance = like * max(left / max(at.size - 3, 1), floor**2)
    best = ramp if explained[ramp] - explained[step] > _RAMP_SURE * variance else step
    size = float(common[best] / max(spread[best], 1e-9))
    return Step(
        sureness=float(explained[best]) / variance,
        center=float(where[best]),
        length=0.0 if best < centers.size else float(long[best]),
        level=mean - size * float(means[best]),
        size=size,
    )
