"""Linear interpolation at instants that mostly rise: the place of one is found from the last."""

import numpy as np

from weighbridge.kernels._jit import inlined_kernel, kernel

_NEAR = 6  # points ahead that are tried one by one


@inlined_kernel
def _place(at, time, guess):
    """Last index whose instant is not after ``at``, which lies within ``time``."""
    count = time.size
    low, high = 0, guess
    if time[guess] <= at:
        low, high = guess, guess + 1
        while high < count and high <= guess + _NEAR and time[high] <= at:
            low, high = high, high + 1
        if high > guess + _NEAR:
            reach = _NEAR
            while high < count and time[high] <= at:
                reach *= 2
                low, high = high, high + reach
        high = min(high, count)
    while high - low > 1:
        middle = (low + high) // 2
        if time[middle] <= at:
            low = middle
        else:
            high = middle
    return low


@kernel
def interpolate(at, time, values, left, right):
    """Interpolate linearly, as `numpy.interp` does, to the last bit.

    Parameters
    ----------
    at : (m,) float64
        In any order; fast where they rise.
    time, values : (n,) float64
        Of the points, n > 0; times do not fall.
    left, right : float
        Returned before the first point and after the last.

    Returns
    -------
    (m,) float64
    """
    found = np.empty(at.size)
    last = time.size - 1
    j = 0
    begin, end, value, slope = time[0], time[0], values[0], 0.0
    for k in range(at.size):
        x = at[k]
        if not (begin <= x < end):
            if np.isnan(x):
                found[k] = x
                continue
            if x < time[0]:
                found[k] = left
                continue
            if x > time[last]:
                found[k] = right
                continue
            j = _place(x, time, j)
            if j == last:
                found[k] = values[j]
                continue
            begin, end, value = time[j], time[j + 1], values[j]
            slope = (values[j + 1] - value) / (end - begin)
        if x == begin:
            found[k] = value
            continue
        y = slope * (x - begin) + value
        if np.isnan(y):
            y = slope * (x - end) + values[j + 1]
            if np.isnan(y) and value == values[j + 1]:
                y = value
        found[k] = y
    return found


@kernel
def rows_before(at, time):
    """Return the last row that is not after each instant (m,) int64; the first where none is.

    Parameters
    ----------
    at : (m,) float64
        In any order; fast where they rise.
    time : (n,) float64
        Of the rows, n > 0; rising.
    """
    found = np.zeros(at.size, dtype=np.int64)
    last = time.size - 1
    j = 0
    for k in range(at.size):
        if at[k] >= time[0]:
            j = _place(at[k], time, j) if at[k] < time[last] else last
            found[k] = j
    return found


@kernel
def shares(at, time, row, longest):
    """Return how far instants lie from a row to the next [-].

    Parameters
    ----------
    at : (m,) float64
    time : (n,) float64
        Of the rows, n > 1; rising.
    row : (m,) int64
        Of `rows_before`.
    longest : float
        Rows further apart have a silence between them.

    Returns
    -------
    (m,) float64
        In [0, 1]; NaN outside of the rows, and in a silence.
    """
    found = np.empty(at.size)
    for k in range(at.size):
        i = min(row[k], time.size - 2)
        step = time[i + 1] - time[i]
        inside = time[i] <= at[k] <= time[i + 1] and step < longest
        found[k] = (at[k] - time[i]) / step if inside else np.nan
    return found


@kernel
def mixed(values, row, share):
    """Mix values (n,) of rows and of those after them by `shares`: (m,) float64."""
    found = np.empty(row.size)
    for k in range(row.size):
        i = min(row[k], values.size - 2)
        found[k] = values[i] + share[k] * (values[i + 1] - values[i])
    return found


@kernel
def distance_to_nearest(at, time):
    """Return how far the nearest point is (m,).

    Parameters
    ----------
    at : (m,) float64
        In any order; fast where they rise.
    time : (n,) float64
        Of the points, n > 0; rising.
    """
    found = np.empty(at.size)
    last = time.size - 1
    j = 0
    for k in range(at.size):
        x = at[k]
        if np.isnan(x) or x <= time[0]:
            found[k] = abs(time[0] - x)
        elif x >= time[last]:
            found[k] = x - time[last]
        else:
            j = _place(x, time, j)
            found[k] = min(time[j + 1] - x, x - time[j])
    return found


@kernel
def moved_changes(begins, ends, delay, time, integral, whole, width):
    """Change of an integral over spans moved by a delay, less its moving mean.

    Parameters
    ----------
    begins, ends : (m,) float64
        Of the spans [s].
    delay : float
        By which they are earlier [s].
    time, integral : (n,) float64
    whole : (m,) bool
        Spans that count; the others are taken for no change.
    width : int
        Spans of the moving mean, odd.

    Returns
    -------
    (k,) float64
        Of the spans that count.
    """
    changes = interpolate(ends - delay, time, integral, integral[0], integral[-1])
    before = interpolate(begins - delay, time, integral, integral[0], integral[-1])
    count, kept = changes.size, 0
    for k in range(count):
        changes[k] = changes[k] - before[k] if whole[k] else 0.0
        kept += whole[k]
    half = width // 2
    total = np.empty(count + 2 * half + 1)
    total[0] = 0.0
    for k in range(count + 2 * half):
        total[k + 1] = total[k] + changes[min(max(k - half, 0), count - 1)]
    found = np.empty(kept)
    at = 0
    for k in range(count):
        if whole[k]:
            found[at] = changes[k] - (total[k + width] - total[k]) / width
            at += 1
    return found


@kernel
def integral(time, values, level, stride):
    """Integrate a signal less a level, by the trapezoidal rule.

    Parameters
    ----------
    time, values : (n,) float64
        n > 0.
    level : float
    stride : int

    Returns
    -------
    (k,) float64
        From the first sample to every so many, and to the last.
    """
    last = time.size - 1
    found = np.zeros(last // stride + 1 + (last % stride > 0))
    area = 0.0
    for k in range(1, time.size):
        before, here = values[k - 1] - level, values[k] - level
        area += 0.5 * (here + before) * (time[k] - time[k - 1])
        if k % stride == 0:
            found[k // stride] = area
    found[-1] = area
    return found


@kernel
def trapezoid_means(edges, time, values):
    """Means of a signal over neighbouring windows, by the trapezoidal rule.

    Parameters
    ----------
    edges : (m + 1,) float64
        Of the windows, rising.
    time, values : (n,) float64
        n > 0.

    Returns
    -------
    (m,) float64
        The signal is taken for zero outside its samples.
    """
    area = np.empty(edges.size)
    k = 0
    # Area up to a sample, and up to the next.
    begun, ended = 0.0, 0.0
    if time.size > 1:
        ended = (values[1] + values[0]) * 0.5 * (time[1] - time[0])
    for i in range(edges.size):
        at = edges[i]
        while k + 1 < time.size and time[k + 1] <= at:
            k += 1
            begun = ended
            if k + 1 < time.size:
                piece = (values[k + 1] + values[k]) * 0.5 * (time[k + 1] - time[k])
                ended = begun + piece
        if at <= time[0] or k + 1 == time.size or at == time[k]:
            area[i] = begun
        else:
            slope = (ended - begun) / (time[k + 1] - time[k])
            area[i] = slope * (at - time[k]) + begun
    mean = np.empty(edges.size - 1)
    for i in range(mean.size):
        mean[i] = (area[i + 1] - area[i]) / (edges[i + 1] - edges[i])
    return mean


@kernel
def seen_windows(edges, time, limit):
    """Return which windows have samples throughout.

    Parameters
    ----------
    edges : (m + 1,) float64
        Of the windows, rising.
    time : (n,) float64
        Of the samples, n > 0.
    limit : float
        Longest gap in a window or at it.

    Returns
    -------
    (m,) bool
    """
    count = 0
    for k in range(1, time.size):
        count += time[k] - time[k - 1] > limit
    before, after = np.empty(count), np.empty(count)
    at = 0
    for k in range(1, time.size if count else 0):
        if time[k] - time[k - 1] > limit:
            before[at], after[at] = time[k - 1], time[k]
            at += 1
    seen = np.empty(edges.size - 1, dtype=np.bool_)
    begun, ended = 0, 0
    for i in range(seen.size):
        # Gaps that began before the window's end, and those that ended by its begin.
        while begun < count and before[begun] < edges[i + 1]:
            begun += 1
        while ended < count and after[ended] <= edges[i]:
            ended += 1
        inside = edges[i] >= time[0] - limit and edges[i + 1] <= time[-1] + limit
        seen[i] = inside and begun <= ended
    return seen


@kernel
def longest_repeat(time, values):
    """Return how long one value is repeated without a break, at the longest.

    Parameters
    ----------
    time, values : (n,) float64
    """
    longest, begin = 0.0, 0
    for k in range(1, time.size):
        if values[k] != values[k - 1]:
            longest = max(longest, time[k - 1] - time[begin])
            begin = k
    return max(longest, time[-1] - time[begin]) if time.size else 0.0
