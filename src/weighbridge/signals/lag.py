"""The lag at which two things go together best: by series, or by any misfit."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, NamedTuple

import numpy as np

from weighbridge.signals.correlation import correlations
from weighbridge.signals.signal import Floats

STEP: Final = 0.2
"""Between the lags that a search tries first [s]: half of it is missed by no parabola."""

FINER: Final = ((0.1, 1), (0.02, 4))
"""Steps with which it goes on downhill [s], and how many of each it takes to one side at most."""

FLAT: Final = 0.1
"""A misfit is looked at so far beside its lowest point for how sure the lag is [s]."""

FURTHER: Final = 0.8
"""By how much a search goes on at a time beyond an end that fits best [s]."""


class Lag(NamedTuple):
    """Where two series go together best.

    Attributes
    ----------
    at : [s]; NaN where the best lies at an end of what was tried
    correlation : there [-]
    """

    at: float
    correlation: float


def best_lag(fixed: Floats, moved: Iterable[Floats], shifts: Floats) -> Lag:
    """Find the shift of strongest correlation, of either sign, between those tried by a parabola.

    Parameters
    ----------
    fixed : (n,)
    moved : (n,) each, the other series at each of the shifts
    shifts : (k,) even and rising [s]
    """
    found = correlations(fixed, moved)
    best = int(np.argmax(np.abs(found)))
    if best in (0, shifts.size - 1):
        return Lag(float("nan"), float(found[best]))
    near = slice(best - 1, best + 2)
    return Lag(parabola(shifts[near], -np.abs(found[near])).at, float(found[best]))


def find_lag(
    misfit: Callable[[float], float], start: float, end: float, *, farthest: float = 0.0
) -> float:
    """Minimise a misfit over the lag: an even grid, steps downhill, a parabola.

    Where the best of the grid lies at an end, the grid goes on beyond it.

    Parameters
    ----------
    misfit : of a lag in s; NaN where it cannot be seen
    start, end : of the grid at first [s]
    farthest : lag on either side at which the grid ends [s]

    Returns
    -------
    float
        Lag [s]; NaN where none can be shown or the best lies at an end of all that is tried.
    """
    grid = np.arange(start, end + 0.5 * STEP, STEP)
    scores = np.array([misfit(float(lag)) for lag in grid])
    while np.isfinite(scores).all() and int(np.argmin(scores)) in (0, grid.size - 1):
        more = beyond(grid, scores, farthest)
        if not more.size:
            return float("nan")
        grid = np.concatenate([grid, more])
        scores = np.concatenate([scores, [misfit(float(lag)) for lag in more]])
        order = np.argsort(grid)
        grid, scores = grid[order], scores[order]
    if not np.isfinite(scores).all():
        return float("nan")
    best = int(np.argmin(scores))
    around = grid[best - 1 : best + 2], scores[best - 1 : best + 2]
    for step, most in FINER:
        found = _downhill(misfit, parabola(*around).at, step, most)
        if found is None:
            return float("nan")
        around = found
    return parabola(*around).at


def _downhill(
    misfit: Callable[[float], float], centre: float, step: float, most: int
) -> tuple[Floats, Floats] | None:
    """Go downhill from ``centre`` to three lags whose middle one is lowest; and their misfits.

    None where it is not reached in ``most`` steps to one side.
    """
    found: dict[int, float] = {}
    at = 0
    while abs(at) <= most:
        for k in (at - 1, at, at + 1):
            if k not in found:
                found[k] = misfit(centre + k * step)
        low, middle, high = (found[k] for k in (at - 1, at, at + 1))
        if not np.isfinite([low, middle, high]).all():
            return None
        if middle <= low and middle <= high:
            lags = np.array([centre + step * k for k in (at - 1, at, at + 1)])
            return lags, np.array([low, middle, high])
        at += -1 if low < high else 1
    return None


def beyond(grid: Floats, scores: Floats, farthest: float) -> Floats:
    """Return the lags to try next beyond the better end of a rising grid of `STEP` [s], if any."""
    ahead = STEP * np.arange(1, round(FURTHER / STEP) + 1)
    more = grid[-1] + ahead if scores[-1] < scores[0] else grid[0] - ahead
    return np.asarray(more[np.abs(more) <= farthest + 1e-9])


def lowest(x: Floats, y: Floats) -> tuple[float, float]:
    """Lowest point of values on an even grid, between its points by a parabola."""
    near = int(np.argmin(y))
    if near in (0, x.size - 1):
        return float(x[near]), float(y[near])
    around = slice(near - 1, near + 2)
    at, bend = parabola(x[around], y[around])
    return at, float(y[near] - 0.5 * bend * (at - x[near]) ** 2)


class Parabola(NamedTuple):
    """A parabola through values over a lag.

    Attributes
    ----------
    at : where it is lowest [s]; the middle of the values where it is not bent upwards
    bend : its second derivative
    """

    at: float
    bend: float


def parabola(x: Floats, y: Floats) -> Parabola:
    """Fit a parabola by least squares: exact for three values (n,); more are less rough."""
    middle, unit = x[x.size // 2], 0.5 * float(x[-1] - x[0])
    off = (x - middle) / unit
    powers = np.stack((off * off, off, np.ones_like(off)))
    second, slope, _ = np.linalg.solve(powers @ powers.T, powers @ y)
    bend = 2.0 * float(second) / unit**2
    if not second > 0.0:
        return Parabola(float(middle), bend)
    return Parabola(float(np.clip(middle - 0.5 * unit * slope / second, x[0], x[-1])), bend)


def lag_std(left: float, bend: float, rows: float) -> float:
    """Standard deviation of a lag of least squares [s]; infinite where nothing shows it.

    Parameters
    ----------
    left : variance that is left at the lag, in any unit
    bend : second derivative of that variance over the lag, in that unit over s^2
    rows : independent ones behind it

    References
    ----------
    The Cramér-Rao bound of the Gaussian likelihood ``-n/2 log(variance)``.
    """
    if not bend > 0.0 or not rows > 0.0:
        return float("inf")
    return float(np.sqrt(2.0 * left / (rows * bend)))


def lag_std_at(left: Callable[[float], float], lag: float, rows: float) -> float:
    """`lag_std` of a lag by what is left there and beside it, a variance over the lag [s]."""
    around = lag + FLAT * np.arange(-1.0, 2.0)
    variances = np.array([left(float(one)) for one in around])
    return lag_std(variances[1], parabola(around, variances).bend, rows)
