"""Means of usable rows over short windows, row by row."""

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
    """Sum rows into windows and tell those that are complete.

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
        over = count > 0 and time[i] - last > params.pause
        at = 0
        if usable[i] and count > 0 and not over:
            at = int((time[i] - begin) // params.length)
            over = at != place
        if over:
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
                if not (time[i] - last <= params.pause):
                    begin, at = time[i], 0
                before, longest = longest, 0.0
                place = at
            for c in range(columns):
                sums[c] += values[i, c]
            count += 1
            last = time[i]
        state = WindowState(
            sums, count, begin, place, last, before, time[i], moving[i],
            state.moved or moving[i], rest, longest,
        )  # fmt: skip
    return state, means[:done], counts[:done], stood[:done]
