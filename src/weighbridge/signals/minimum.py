"""Lowest point of a function of few numbers, such as logarithms of noise levels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from weighbridge.signals.signal import Floats

MOST: Final = 200
"""Values of the function that a search by a simplex takes for each number."""

SLOPE: Final = 1e-4
"""By which a number is moved to find the slope of a smooth function."""

FIRST: Final = 0.5
"""Length of the first step down its slope."""

LONGEST: Final = 1.0
"""A longer step is shortened to this: the logarithm of a level is sought, not of another size."""

HALVED: Final = 6
"""A step that gains nothing is halved so many times at most."""

FEW: Final = 60
"""Steps down the slope."""


def lowest_by_slopes(
    misfit: Callable[[Floats], float], start: Floats, *, close: float, farthest: float
) -> Floats:
    """Go downhill on a smooth function, by a quasi-Newton search with slopes by differences.

    Parameters
    ----------
    misfit : of (k,) numbers of about the same size
    start : (k,) where to begin
    close : the search ends where a step gains less, and promises less
    farthest : of each number, to both sides of 0

    Returns
    -------
    (k,) where it is lowest

    References
    ----------
    Nocedal and Wright, Numerical Optimization, 2nd ed., 2006, algorithm 6.1 and eq. 6.20.
    """
    unit = np.eye(start.size)

    def slopes(x: Floats, here: float) -> Floats:
        return np.array([(misfit(x + by) - here) / SLOPE for by in SLOPE * unit])

    x, here = start, misfit(start)
    down = slopes(x, here)
    inverse = unit * FIRST / max(float(np.linalg.norm(down)), 1e-12)
    for k in range(FEW):
        step = -inverse @ down
        step *= min(1.0, LONGEST / max(float(np.linalg.norm(step)), 1e-12))
        for _ in range(HALVED):
            new = np.clip(x + step, -farthest, farthest)
            value = misfit(new)
            if value < here:
                break
            step = 0.5 * step
        else:
            break
        gained, moved = here - value, new - x
        x, here = new, value
        before, down = down, slopes(x, here)
        turned = down - before
        curved = float(moved @ turned)
        if curved > 0.0:
            if k == 0:
                inverse = unit * curved / float(turned @ turned)
            keep = unit - np.outer(moved, turned) / curved
            inverse = keep @ inverse @ keep.T + np.outer(moved, moved) / curved
        # A short step that was halved gains little as well, but more is to be gained.
        if max(gained, 0.5 * float(down @ inverse @ down)) < close:
            break
    return x


def lowest_by_simplex(
    misfit: Callable[[Floats], float],
    start: Floats,
    steps: Floats,
    *,
    close: float,
    done: Callable[[Floats, float], bool] | None = None,
) -> tuple[Floats, float]:
    """Go downhill by a simplex, which a function with steps does not mislead: a filter with a gate.

    Parameters
    ----------
    misfit : of (k,) numbers
    start : (k,) where to begin
    steps : (k,) from there to the other corners of the first simplex
    close : the search ends where its corners, and their misfits, differ by less
    done : ends it at a point and its misfit

    Returns
    -------
    x : (k,) where it is lowest
    value : of ``misfit`` there

    References
    ----------
    Nelder and Mead, Computer Journal 7, 1965, 308-313.
    """
    corners = start + np.vstack((np.zeros(start.size), np.diag(steps)))
    values = np.array([misfit(corner) for corner in corners])
    for _ in range(MOST * start.size):
        order = np.argsort(values, kind="stable")
        corners, values = corners[order], values[order]
        apart = max(float(np.ptp(values)), float(np.max(np.abs(corners - corners[0]))))
        if apart < close or (done is not None and done(corners[0], float(values[0]))):
            break
        middle = np.mean(corners[:-1], axis=0)
        away = middle - corners[-1]

        def tried(by: float, middle: Floats = middle, away: Floats = away) -> tuple[Floats, float]:
            at = middle + by * away
            return at, misfit(at)

        new, value = tried(1.0)
        if value < values[0]:
            beyond = tried(2.0)
            if beyond[1] < value:
                new, value = beyond
        elif value >= values[-2]:
            inside = tried(0.5 if value < values[-1] else -0.5)
            if inside[1] < min(value, values[-1]):
                new, value = inside
            else:
                corners[1:] = 0.5 * (corners[0] + corners[1:])
                values[1:] = [misfit(corner) for corner in corners[1:]]
                continue
        corners[-1], values[-1] = new, value
    best = int(np.argmin(values))
    return corners[best], float(values[best])
