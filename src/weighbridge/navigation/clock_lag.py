"""How late one table of a drive is against another, by what both show of the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.kernels.interpolation import integral
from weighbridge.limits import CERTAIN
from weighbridge.signals import Bools, Floats, Signal, moving_mean, resolution
from weighbridge.signals.interpolation import interpolate
from weighbridge.signals.lag import lag_std, parabola

STEP: Final = 0.2
"""Grid on which force and speed are compared [s]."""

REACH: Final = (5.0, 30.0)
"""Lags looked at, on either side [s]: the second where the first shows none (2000 ppm over
eight hours)."""

# Changes of speed are compared over this time [s]: the rate of a speed in steps of 1 km/h is
# noise over shorter times, and a peak over longer ones is blunt.
_SPAN: Final = 2.0
# Means over so long are taken off: grade and bias [s].
_LEVEL: Final = 20.0
# Pieces of a drive, and how far they lie apart [s].
_PIECE: Final = 180.0
_HOP: Final = 90.0
# A shorter drive is one piece, down to this [s]: of 196 undamaged cuts of sixteen vehicles 1 was
# moved, and weighed; at 60 s 4 were, and 2 lost their mass. With the bus 3 s late 180 are moved.
_SHORTEST: Final = 90.0
# A step is found to within so long: means over `_LEVEL` hold both of its sides [s].
_ABOUT: Final = 15.0
# Stamps so close are enough for the integrals [s].
_FINE: Final = 0.02
# Gaps across which force and speed are not followed [s].
_FORCE_GAP: Final = 0.5
_SPEED_GAP: Final = 3.0
# Part of a piece that must be seen, and spread of the changes of speed in it [m/s].
_SEEN: Final = 0.5
_LIVELY: Final = 0.25
# The same in steps of the speed [-]: the rounding of its changes alone spreads by 0.41 of a step,
# and the axes explain half of the variance from 0.58 on.
_STEPS: Final = 0.7
# Where less of a piece is seen, means are those of what was seen and felt together [-].
_WHOLE: Final = 0.9
# Part of the variance that the three axes explain, at least; by chance they explain 0.2 at most.
_EXPLAINED: Final = 0.5
# The same over a whole drive, whose clocks may overlap in part only.
_SOME: Final = 0.2
# Unexplained at the best lag over unexplained at the next best: above, either may be the one.
_AMBIGUOUS: Final = 0.75
# The next best lies beyond the peak of the best [s].
_PEAK: Final = 3.0


@dataclass(frozen=True, slots=True)
class Lags:
    """Lag of a table against another, by pieces of the drive.

    Attributes
    ----------
    time : (k,) middles of the pieces, by the table's own clock [s]
    lag : (k,) stamp minus the instant of the same motion by the other clock [s]
    std : (k,) standard deviation of the lag [s]
    missed : (j,) middles of pieces lively enough to show a lag that showed none [s]
    """

    time: Floats
    lag: Floats
    std: Floats
    missed: Floats

    @property
    def pieces(self) -> int:
        """Number of pieces lively enough to show a lag."""
        return self.lag.size + self.missed.size


@dataclass(frozen=True, slots=True)
class Integrated:
    """What a clock is compared with: integrals whose changes are those of the speed.

    They are of the specific force along each sensor axis, or a speed itself.

    Attributes
    ----------
    times : (n,) stamps of each [s], thinned to what the grid needs
    integrals : (n,) at them, of an axis less its median [m/s]
    start, end : first and last stamp of all [s]
    samples : of that which has fewest
    gap : time between stamps over which nothing is known [s]
    """

    times: tuple[Floats, ...]
    integrals: tuple[Floats, ...]
    start: float
    end: float
    samples: int
    gap: float

    @classmethod
    def of(cls, accel: Sequence[Signal]) -> Integrated:
        """Integrate the axes of an accelerometer of any mounting."""
        strides = tuple(max(1, round(_FINE / s.period)) for s in accel)
        clocks = {(id(s.time), k): s.time for s, k in zip(accel, strides, strict=True)}
        thinned = {key: _every(time, key[1]) for key, time in clocks.items()}
        return cls(
            times=tuple(thinned[id(s.time), k] for s, k in zip(accel, strides, strict=True)),
            integrals=tuple(_integral(s, k) for s, k in zip(accel, strides, strict=True)),
            start=min(float(s.time[0]) for s in accel),
            end=max(float(s.time[-1]) for s in accel),
            samples=min(len(s) for s in accel),
            gap=_FORCE_GAP,
        )

    @classmethod
    def of_speed(cls, speed: Signal) -> Integrated:
        """Take a speed, whose changes another speed has as well."""
        return cls(
            times=(speed.time,),
            integrals=(speed.values,),
            start=float(speed.time[0]),
            end=float(speed.time[-1]),
            samples=len(speed),
            gap=max(_SPEED_GAP, 3.0 * speed.period),
        )


def find_lags(force: Integrated, speed: Signal, *, centre: float = 0.0) -> Lags:
    """Find the lag of a speed against an accelerometer of any mounting or a speed, by pieces.

    In each piece the changes of speed are regressed on those of the integrals, moved by every lag
    in turn; the best is refined by a parabola.

    Parameters
    ----------
    force : of the accelerometer, or another speed
    speed : by the clock that is examined
    centre : lag around which is looked [s]
    """
    start, end = float(speed.time[0]), float(speed.time[-1])
    count = int((end - start) / STEP)
    hop, size = round(_HOP / STEP), min(round(_PIECE / STEP), count)
    if size < round(_SHORTEST / STEP) or force.samples < 50:
        return Lags(*(np.empty(0) for _ in range(4)))
    grid: Floats = np.asarray(start + STEP * np.arange(count), dtype=np.float64)
    shown, seen = _speed_changes(speed, grid)
    x = _high_passed(shown, seen)
    spread = max(_LIVELY, _STEPS * resolution(speed.values))
    lively = [
        first
        for first in range(0, count - size + 1, hop)
        if np.mean(seen[first : first + size]) > _SEEN
        and float(np.sqrt(np.mean(x[first : first + size] ** 2))) > spread
    ]
    # The force reaches beyond the speed on both sides by the lags looked at.
    most = round(REACH[-1] / STEP)
    wide: Floats = np.asarray(start - centre + STEP * np.arange(-most, count + most))
    changes, felt = _force_changes(force, wide)
    axes = np.column_stack([*_high_passed(np.array(changes), felt)])
    lively = [k for k in lively if np.mean(felt[k + most : k + most + size]) > _SEEN]
    found: dict[int, tuple[float, float]] = {}
    for reach in (round(r / STEP) for r in REACH):
        for first in lively:
            there = slice(first + most - reach, first + most + size + reach)
            part = slice(first, first + size)
            if first not in found:
                if np.mean(seen[part]) < _WHOLE:
                    reported = _explained_in_gaps(
                        shown[part], seen[part], [c[there] for c in changes], felt[there]
                    )
                else:
                    reported = _explained(x[part], axes[there], felt[there])
                peak = _peak(*reported, size)
                if peak is not None:
                    found[first] = peak
    at, middle = sorted(found), 0.5 * STEP * size
    return Lags(
        grid[at] + middle,
        # Force later in the row is force at a smaller lag.
        centre - np.array([found[k][0] for k in at]),
        np.array([found[k][1] for k in at]),
        grid[[k for k in lively if k not in found]] + middle,
    )


def whole_lag(force: Integrated, speed: Signal, own: tuple[float, float]) -> float | None:
    """Find one lag of a whole drive, of which no piece may show it clearly [s].

    Parameters
    ----------
    force, speed : as of `find_lags`
    own : lags that a sensor may have itself [s]

    Returns
    -------
    None where the best of ``own`` explains the changes of the speed as well, within `CERTAIN`
    standard deviations

    References
    ----------
    Likelihood ratio: Wilks, Annals of Mathematical Statistics 9, 1938.
    """
    start, most = float(speed.time[0]), round(REACH[-1] / STEP)
    count = int((float(speed.time[-1]) - start) / STEP)
    if count < round(_SHORTEST / STEP) or force.samples < 50:
        return None
    grid: Floats = np.asarray(start + STEP * np.arange(-most, count + most), dtype=np.float64)
    shown, seen = _speed_changes(speed, grid[most : most + count])
    changes, felt = _force_changes(force, grid)
    axes = np.column_stack([*_high_passed(np.array(changes), felt)])
    explained, enough = _explained(_high_passed(shown, seen), axes, felt)
    # Force later in the row is force at a smaller lag.
    lags: Floats = np.asarray(STEP * np.arange(most, -most - 1, -1), dtype=np.float64)
    seconds = STEP * np.count_nonzero(seen)
    likelihood = -0.5 * seconds / _SPAN * np.log1p(-np.minimum(explained, 1.0 - 1e-9))
    best = int(np.argmax(np.where(enough, likelihood, -np.inf)))
    usual = likelihood[(lags >= own[0]) & (lags <= own[1])].max()
    if best in (0, lags.size - 1) or likelihood[best] - usual < 0.5 * CERTAIN**2:
        return None
    near = slice(best - 1, best + 2)
    return parabola(lags[near][::-1], -likelihood[near][::-1]).at


def find_offset(force: Integrated, speed: Signal) -> float | None:
    """Find one lag for a whole drive among all that leave the records together [s].

    Returns
    -------
    Coarse, to be refined by `find_lags`; None where no lag explains much.
    """
    from scipy.fft import irfft, next_fast_len, rfft  # Slow to load, and seldom needed.

    first, last = force.start, force.end
    start, end = float(speed.time[0]), float(speed.time[-1])
    if min(last - first, end - start) < _PIECE:
        return None
    x, seen = _speed_changes(speed, np.arange(start, end, STEP))
    x = _high_passed(x, seen)
    changes, felt = _force_changes(force, np.arange(first, last, STEP))
    axes = np.column_stack([*_high_passed(np.array(changes), felt)])
    gram = axes.T @ axes
    gram += _ridge(gram)
    size = next_fast_len(x.size + axes.shape[0], real=True)
    spectrum = np.conj(rfft(x, size))
    cross = np.column_stack([irfft(rfft(f, size) * spectrum, size) for f in axes.T])
    explained = np.einsum("ij,ij->i", cross, np.linalg.solve(gram, cross.T).T)
    best = int(np.argmax(explained))
    if explained[best] < _SOME * max(float(x @ x), 1e-12):
        return None
    shift = best if best < axes.shape[0] else best - size
    return start - (first + shift * STEP)


def locate_step(
    force: Integrated, speed: Signal, cut: tuple[float, float], lags: tuple[float, float]
) -> tuple[float, float]:
    """Narrow the time in which the lag of a speed steps from one value to another [s].

    Parameters
    ----------
    force : of the accelerometer
    speed : by the clock that steps
    cut : in which the step lies, by that clock [s]
    lags : before and after it [s]

    Returns
    -------
    start, end : about the instant at which the force at the one lag, and then at the other,
        explains the speed best
    """
    start = max(cut[0] - _PIECE, float(speed.time[0]))
    end = min(cut[1] + _PIECE, float(speed.time[-1]))
    grid = np.arange(start, end, STEP)
    x, seen = _speed_changes(speed, grid)
    x = _high_passed(x, seen)
    sides = []
    for lag in lags:
        changes, felt = _force_changes(force, grid - lag)
        sides.append(np.column_stack([*_high_passed(np.array(changes), felt)]))
        seen &= felt
    sure = seen & ((grid < cut[0]) | (grid > cut[1]))
    rows = np.where((grid < cut[0])[:, None], sides[0], sides[1])[sure]
    if rows.shape[0] < 100:
        return cut
    fit, *_ = np.linalg.lstsq(rows, x[sure], rcond=None)
    before, after = (np.where(seen, (x - side @ fit) ** 2, 0.0) for side in sides)
    cost = np.cumsum(before) + np.sum(after) - np.cumsum(after)
    cost[(grid < cut[0]) | (grid > cut[1])] = np.inf
    at = float(grid[int(np.argmin(cost))])
    return max(at - _ABOUT, cut[0]), min(at + _ABOUT, cut[1])


def _speed_changes(speed: Signal, grid: Floats) -> tuple[Floats, Bools]:
    """Change of speed over `_SPAN` about each instant (n,), and where it was seen."""
    half = 0.5 * _SPAN
    change = speed.at(grid + half) - speed.at(grid - half)
    seen = np.isfinite(change)
    for side in (-half, 0.0, half):
        seen &= speed.age(grid + side) < 0.5 * max(_SPEED_GAP, 3.0 * speed.period)
    return np.where(seen, change, 0.0), seen


def _force_changes(force: Integrated, grid: Floats) -> tuple[list[Floats], Bools]:
    """Integral of each axis over `_SPAN` about each instant, (n,) each, and where it was felt."""
    felt = np.ones(grid.size, dtype=bool)
    changes = [_change(*axis, grid) for axis in zip(force.times, force.integrals, strict=True)]
    for time in {id(time): time for time in force.times}.values():
        step = np.diff(time)
        holes = np.concatenate(([0.0], np.cumsum(np.where(step > force.gap, step, 0.0))))
        felt &= (grid - _SPAN > time[0]) & (grid + _SPAN < time[-1])
        felt &= _change(time, holes, grid) == 0.0
    return [np.where(felt, c, 0.0) for c in changes], felt


def _every(y: Floats, stride: int) -> Floats:
    """Every so many samples, and the last."""
    if stride == 1:
        return y
    return y[::stride].copy() if (y.size - 1) % stride == 0 else np.append(y[::stride], y[-1])


def _integral(s: Signal, stride: int) -> Floats:
    """Integral of a signal at every so many samples, and at the last."""
    # Less gravity, so that the sum stays small.
    level = float(np.median(s.values[:: max(1, len(s) // 1000)]))
    found: Floats = integral(s.time, s.values, level, stride)
    return found


def _change(time: Floats, y: Floats, grid: Floats) -> Floats:
    half = 0.5 * _SPAN
    return np.asarray(interpolate(grid + half, time, y) - interpolate(grid - half, time, y))


def _high_passed(y: Floats, seen: Bools) -> Floats:
    """Take off the moving mean of what was seen, of y (n,) or (k, n); 0 where nothing was."""
    width = round(_LEVEL / STEP) | 1
    weight = np.maximum(moving_mean(seen.astype(np.float64), width, "edge"), 1e-9)
    return np.where(seen, y - moving_mean(y, width, "edge") / weight, 0.0)


def _peak(explained: Floats, enough: Bools, size: int) -> tuple[float, float] | None:
    """Shift of the force, from the middle, that explains the speed best [s], and its std.

    Parameters
    ----------
    explained : (k,) part of the variance by shift [-]
    enough : (k,) shifts at which enough was felt
    size : instants of the piece
    """
    explained = np.where(enough, explained, 0.0)
    best = int(np.argmax(explained))
    if not 0 < best < explained.size - 1 or explained[best] < _EXPLAINED:
        return None
    near = round(_PEAK / STEP)
    beyond = np.concatenate((explained[: max(best - near, 0)], explained[best + near + 1 :]))
    left = 1.0 - explained
    if beyond.size and left[best] > _AMBIGUOUS * (1.0 - float(beyond.max())):
        return None
    lags = STEP * (np.arange(best - 1.0, best + 2.0) - (explained.size - 1) // 2)
    around = left[best - 1 : best + 2]
    at, bend = parabola(lags, around)
    if bend <= 0.0:
        return None
    return at, lag_std(max(float(around[1]), 1e-3), bend, size * STEP / _SPAN)


def _ridge(gram: Floats) -> Floats:
    """Keep sums of products (k, k) solvable where an axis feels nothing."""
    size = len(gram)
    return np.asarray((1e-6 * np.trace(gram) / size + 1e-12) * np.eye(size))


def _explained(x: Floats, force: Floats, felt: Bools) -> tuple[Floats, Bools]:
    """Part of the variance that the axes explain at each shift, and where it is known.

    Parameters
    ----------
    x : (n,) changes of speed
    force : (n + 2 r, 3) changes of the integrated force
    felt : (n + 2 r,) where there are any
    """
    cross = np.column_stack([np.correlate(axis, x, "valid") for axis in force.T])
    products = force[:, :, None] * force[:, None, :]
    total = np.concatenate((np.zeros_like(products[:1]), np.cumsum(products, axis=0)))
    gram = total[x.size :] - total[: -x.size] + _ridge(total[-1])
    fit = np.linalg.solve(gram, cross[:, :, None])[:, :, 0]
    seen = np.concatenate(([0], np.cumsum(felt)))
    enough = (seen[x.size :] - seen[: -x.size]) >= _SEEN * x.size
    return np.einsum("ij,ij->i", cross, fit) / max(float(x @ x), 1e-12), enough


def _explained_in_gaps(
    shown: Floats, seen: Bools, changes: Sequence[Floats], felt: Bools
) -> tuple[Floats, Bools]:
    """As `_explained`, of a speed with gaps: what is felt in them counts nothing.

    Parameters
    ----------
    shown, seen : (n,) changes of speed with their means, and where there are any
    changes, felt : (n + 2 r,) each, the same of the integrated force
    """
    shifts = felt.size - shown.size + 1
    explained, enough = np.zeros(shifts), np.zeros(shifts, dtype=bool)
    for k in range(shifts):
        both = seen & felt[k : k + shown.size]
        enough[k] = np.count_nonzero(both) >= _SEEN * np.count_nonzero(seen)
        if not enough[k]:
            continue
        moved = np.array([shown, *(c[k : k + shown.size] for c in changes)])
        x, *axes = _high_passed(np.where(both, moved, 0.0), both)
        rows = np.column_stack(axes)
        gram = rows.T @ rows
        gram += _ridge(gram)
        cross = rows.T @ x
        explained[k] = float(cross @ np.linalg.solve(gram, cross)) / max(float(x @ x), 1e-12)
    return explained, enough
