"""How far two clocks are apart, by something that both have recorded."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from weighbridge.limits import PARTS
from weighbridge.signals.moving import moving_mean
from weighbridge.signals.signal import Bools, Floats, Signal

STEP: Final = 0.1
"""Grid on which the signals are compared [s]."""

LEVEL: Final = 60.0
"""Means over so long are taken off, so that a common trend is no agreement [s]."""

SHORTEST: Final = 30.0
"""Least time in common [s]; and `_SHARE` of the shorter signal."""

LIKENESS: Final = 0.72
"""Least correlation at the offset found [-]; the next best has to explain far less as well."""

AMBIGUOUS: Final = 0.5
"""Above this ratio of what is left unexplained, best over next best, two offsets are comparable."""

# Part of the shorter signal that both have in common, at least [-].
_SHARE: Final = 0.3
# Two sensors do not agree better [part of the variance]: below, the ends of a record decide.
_EXACT: Final = 0.005
# Parts of the common time by which the scatter of the offset is found.

# Beyond a day of samples of 0.1 s the transform would fill the memory.
_LONGEST: Final = 86_400.0


@dataclass(frozen=True, slots=True)
class Alignment:
    """Where one clock lies on another: ``time_reference = time_other + offset``.

    Attributes
    ----------
    offset : [s]; NaN where none was found
    std : standard deviation of the offset [s]
    correlation : of the two signals at the offset [-]; negative where one is reversed
    ambiguity : unexplained variance at the best offset over that at the next
        best one, in [0, 1]; 1 where two are equally good
    overlap : time in common at the offset [s]
    refusal : why the offset cannot be used, empty where it can
    """

    offset: float
    std: float
    correlation: float
    ambiguity: float
    overlap: float
    refusal: str = ""

    @property
    def found(self) -> bool:
        """Whether the offset can be used."""
        return not self.refusal


Complexes: TypeAlias = NDArray[np.complex128]


def align(reference: Signal, other: Signal, *, signed: bool = True) -> Alignment:
    """Find the offset of two clocks by two records of the same thing.

    The correlation coefficient of the parts in common is computed for every
    offset (Padfield, "Masked object registration in the Fourier domain", IEEE
    Trans. Image Process. 21(5), 2012, eqs. 4-9). The best one is refined by
    least squares; its standard deviation is that of the mean over blocks of
    the drive, so that errors which last a while are not counted as many.

    Parameters
    ----------
    reference, other : such as speed from the wheels and over ground; they may
        differ by a factor and a constant
    signed : False where one may be reversed, such as a yaw rate about an
        unknown axis

    Returns
    -------
    Alignment
        With a refusal where either is too short or flat, where they do not
        agree at any offset, or agree at several.
    """
    short = min(reference.duration, other.duration)
    if min(len(reference), len(other)) < 8 or short < SHORTEST:
        return _refused(f"only {max(short, 0.0):.0f} s were recorded, {SHORTEST:.0f} s are needed")
    if max(reference.duration, other.duration) > _LONGEST:
        return _refused("a recording is longer than a day")
    a, seen_a = _gridded(reference)
    b, seen_b = _gridded(other)
    if _flat(a, seen_a) or _flat(b, seen_b):
        return _refused("it does not change")
    least = max(SHORTEST, _SHARE * short) / STEP
    rho, count = _correlations(a, seen_a, b, seen_b)
    rho[count < least] = 0.0
    score = rho if signed else np.abs(rho)
    best = int(np.argmax(score))
    top = float(score[best])
    shift = best - (b.size - 1)
    if not top >= LIKENESS:
        return _refused(f"they agree at no offset (the best correlation is {top:.2f})")
    second = float(np.max(np.where(_lobe(score, best), 0.0, score)))
    left, left_second = (max(1.0 - max(x, 0.0) ** 2, _EXACT) for x in (top, second))
    ambiguity = min(left / left_second, 1.0)
    offset = float(reference.time[0] - other.time[0]) + shift * STEP
    offset, std = _refined(reference, other, offset)
    overlap = float(count[best]) * STEP
    refusal = ""
    if ambiguity > AMBIGUOUS:
        refusal = f"two offsets fit alike (correlations {top:.3f} and {second:.3f})"
    elif not math.isfinite(std):
        refusal = "the offset cannot be found from the parts of the drive"
    return Alignment(offset, std, float(rho[best]), ambiguity, overlap, refusal)


def _refused(why: str) -> Alignment:
    return Alignment(math.nan, math.nan, math.nan, math.nan, 0.0, why)


def _gridded(signal: Signal) -> tuple[Floats, Bools]:
    """Values on an even grid with slow means taken off, and where there are any."""
    time = np.arange(signal.time[0], signal.time[-1], STEP)
    values = signal.at(time)
    # The last instant of the grid may lie behind the last sample by rounding.
    seen = (signal.age(time) <= max(2.0 * signal.period, 1.5)) & np.isfinite(values)
    values = np.where(seen, values, 0.0)
    width = max(int(LEVEL / STEP), 1)
    weight = moving_mean(seen.astype(np.float64), width, "constant")
    mean = moving_mean(values, width, "constant") / np.maximum(weight, 1e-9)
    return np.where(seen, values - mean, 0.0), seen


def _flat(values: Floats, seen: Bools) -> bool:
    if not seen.any():
        return True
    return bool(np.ptp(values[seen]) < 1e-9)


def _correlations(a: Floats, seen_a: Bools, b: Floats, seen_b: Bools) -> tuple[Floats, Floats]:
    """Correlation coefficient and samples in common for every shift.

    Returns
    -------
    rho, count : (n_a + n_b - 1,); entry k is for b moved by k - (n_b - 1) samples
    """
    from scipy.fft import irfft, next_fast_len, rfft  # Slow to load, and seldom needed.

    size = a.size + b.size - 1
    length = next_fast_len(size, real=True)

    def spectrum(x: Floats) -> Complexes:
        return np.asarray(rfft(x, length))

    scale_a, scale_b = np.abs(a).max(), np.abs(b).max()
    a, b = a / scale_a, b[::-1] / scale_b
    mask_a, mask_b = spectrum(seen_a.astype(np.float64)), spectrum(seen_b[::-1].astype(np.float64))
    value_a, value_b = spectrum(a), spectrum(b)

    def both(x: Complexes, y: Complexes) -> Floats:
        return np.asarray(irfft(x * y, length)[:size], dtype=np.float64)

    count = np.rint(both(mask_a, mask_b))
    inside = np.maximum(count, 1.0)
    sum_a, sum_b = both(value_a, mask_b), both(mask_a, value_b)
    var_a = both(spectrum(a**2), mask_b) - sum_a**2 / inside
    var_b = both(mask_a, spectrum(b**2)) - sum_b**2 / inside
    cov = both(value_a, value_b) - sum_a * sum_b / inside
    # What is left of a variance by rounding is no variance.
    tiny = 1e-6 * max(float(var_a.max()), float(var_b.max()), 1e-12)
    good = (var_a > tiny) & (var_b > tiny)
    rho = np.where(good, cov / np.sqrt(np.where(good, var_a * var_b, 1.0)), 0.0)
    return np.clip(rho, -1.0, 1.0), count


def _lobe(score: Floats, best: int) -> Bools:
    """Mark the peak itself: down to its first minimum on either side."""
    falling = np.diff(score) < 0.0
    right = best + int(np.argmin(np.append(falling[best:], False)))
    left = best - int(np.argmin(np.append(~falling[:best][::-1], False)))
    inside = np.zeros(score.size, dtype=bool)
    inside[left : right + 1] = True
    return inside


def _refined(reference: Signal, other: Signal, offset: float) -> tuple[float, float]:
    """Offset near the one given at which what is left goes with no change of the signal.

    With the error ``e(t) = reference(t) - c - g other(t - offset)`` the sum of
    ``e other'`` is brought to zero. Its change with the offset is the sum of
    ``reference' other'``: both slopes carry noise, but not the same.
    """
    std = math.nan
    half = 0.5 * max(reference.period, other.period, 2.0 * STEP)
    for _ in range(8):
        start = max(float(reference.time[0]), float(other.time[0]) + offset) + half
        end = min(float(reference.time[-1]), float(other.time[-1]) + offset) - half
        time = np.arange(start, end, STEP)
        moved = time - offset
        seen = reference.age(time) <= max(2.0 * reference.period, 1.5)
        seen &= other.age(moved) <= max(2.0 * other.period, 1.5)
        y, slope_y = reference.at(time), _slope(reference, time, half)
        x, slope_x = other.at(moved), _slope(other, moved, half)
        seen &= np.isfinite(y) & np.isfinite(x) & np.isfinite(slope_x) & np.isfinite(slope_y)
        if np.count_nonzero(seen) < 4 * PARTS:
            return offset, math.nan
        rows = np.column_stack([np.ones(time.size), x])[seen]
        fit, *_ = np.linalg.lstsq(rows, y[seen], rcond=None)
        error = y[seen] - rows @ fit
        slope = slope_x[seen] - slope_x[seen].mean()
        change = float(slope_y[seen] @ slope)
        if change == 0.0:
            return offset, math.nan
        move = -float(error @ slope) / change
        std = _block_scatter(error * slope) / abs(change)
        offset += float(np.clip(move, -2.0, 2.0))
        if abs(move) < 1e-4:
            break
    return offset, std


def _slope(signal: Signal, time: Floats, half: float) -> Floats:
    return (signal.at(time + half) - signal.at(time - half)) / (2.0 * half)


def _block_scatter(terms: Floats) -> float:
    """Standard deviation of a sum by the sums of blocks of the drive.

    The sandwich estimate with blocks as clusters (Liang and Zeger, Biometrika
    73(1), 1986, 13-22).
    """
    sums = np.array([piece.sum() for piece in np.array_split(terms, PARTS)])
    return math.sqrt(float(sums @ sums) * PARTS / (PARTS - 1))
