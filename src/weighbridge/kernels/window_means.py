"""Which usable rows share a short window, and their means, row by row."""

from typing import NamedTuple

import numpy as np

from weighbridge.kernels._jit import kernel


class WindowParams(NamedTuple):
    """How rows are cut into windows.

    Attributes
    ----------
    length : of a window [s]
    pause : usable rows further apart belong to different windows [s]
    enough : rows without which a window is dropped
    long_gap : rows further apart count as standing between them [s]
    """

    length: float
    pause: float
    enough: int
    long_gap: float


class WindowState(NamedTuple):
    """Window that is open, and how long the vehicle stood before it.

    Attributes
    ----------
    sums : (k,) of its rows
    rows : number of its rows
    begin : instant of the first usable row of its stretch [s]
    place : number of the window within the stretch
    last : instant of its last row [s]
    stood : longest standstill before its first row, since the window before [s]
    time : instant of the last row, usable or not; NaN before the first [s]
    moving : whether the vehicle moved at it
    moved : whether it has moved at all
    rest : how long it has stood since it last moved [s]
    longest : longest standstill since the open window began [s]
    """

    sums: np.ndarray
    rows: int
    begin: float
    place: int
    last: float
    stood: float
    time: float
    moving: bool
    moved: bool
    rest: float
    longest: float


def initial_state(columns):
    """Start before the first row, of windows of so many ``columns``."""
    nothing = np.zeros(columns)
    return WindowState(nothing, 0, 0.0, 0, np.nan, 0.0, np.nan, False, False, 0.0, 0.0)


@kernel
def _place(time, begin, last, params):
    """Find the window of a usable row: when its stretch began, and its number within it.

    ``begin`` and ``last`` are those of the usable row before it; NaN is no row.
    """
    if not time - last <= params.pause:
        return time, 0
    return begin, int((time - begin) // params.length)


@kernel
def assign(time, usable, params):
    """Number the windows of a whole drive, by the same cuts as `run`.

    Parameters
    ----------
    time : (n,) float64
        Rising [s].
    usable : (n,) bool
    params : WindowParams

    Returns
    -------
    window : (n,) int64
        Of each row, from 0 on; -1 where it is in none.
    """
    window = np.full(time.size, -1)
    begin, place, last = 0.0, 0, np.nan
    first, rows, done = 0, 0, 0
    for i in range(time.size):
        if not usable[i]:
            continue
        start, at = _place(time[i], begin, last, params)
        if rows > 0 and (start != begin or at != place):
            if rows >= params.enough:
                done += 1
            else:
                window[first:i] = -1
            rows = 0
        if rows == 0:
            first = i
        window[i] = done
        rows += 1
        begin, place, last = start, at, time[i]
    if rows < params.enough:
        window[first:] = -1
    return window


@kernel
def _rested(state, time, moving, params):
    """Take the standstill until ``time`` in; ``moving`` is whether the vehicle moves then."""
    rest, longest = state.rest, state.longest
    gap = time - state.time
    if not np.isnan(gap) and (not state.moving or gap > params.long_gap):
        rest += gap
    if moving:
        if state.moved:
            longest = max(longest, rest)
        rest = 0.0
    return rest, longest


@kernel
def run(state, time, usable, moving, values, params):
    """Sum rows into windows and return those that are complete.

    A window is complete as soon as a usable row of another one comes, or a row so late that
    none of it can.

    Parameters
    ----------
    state : WindowState
    time : (n,) float64
        Rising [s].
    usable, moving : (n,) bool
    values : (n, k) float64
        What is averaged; read where it is usable.
    params : WindowParams

    Returns
    -------
    state : WindowState
    means : (m, k) float64
        Of the windows that became complete.
    count : (m,) int64
        Rows in each.
    stood : (m,) float64
        How long the vehicle stood before each, since the one before [s].
    """
    columns = values.shape[1]
    means = np.empty((time.size + 1, columns))
    counts = np.empty(time.size + 1, dtype=np.int64)
    stood = np.empty(time.size + 1)
    done = 0
    sums = state.sums.copy()
    count, begin, place, last = state.rows, state.begin, state.place, state.last
    before = state.stood
    for i in range(time.size):
        rest, longest = _rested(state, time[i], moving[i], params)
        start, at = begin, place
        if usable[i]:
            start, at = _place(time[i], begin, last, params)
        late = time[i] - last > params.pause
        if count > 0 and (late or at != place):
            if count >= params.enough:
                for c in range(columns):
                    means[done, c] = sums[c] / count
                counts[done] = count
                stood[done] = before
                done += 1
            else:
                longest = max(longest, before)
            sums[:] = 0.0
            count = 0
        if usable[i]:
            if count == 0:
                before, longest = longest, 0.0
            begin, place = start, at
            for c in range(columns):
                sums[c] += values[i, c]
            count += 1
            last = time[i]
        state = WindowState(
            sums, count, begin, place, last, before, time[i], moving[i],
            state.moved or moving[i], rest, longest,
        )  # fmt: skip
    return state, means[:done], counts[:done], stood[:done]
