"""Means of usable rows over short windows, the same for both sides of the balance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.kernels import window_means
from weighbridge.signals import Bools, Floats, Ints

WINDOW: Final = 2.5
"""Length of a window [s]: vibration and polling noise average out, starts and hills stay."""

PAUSE: Final = 0.8
"""Usable rows further apart belong to different windows [s]."""

LEAST_FULL: Final = 0.6
"""Part of a window that must be there [-]."""


@dataclass(frozen=True, slots=True)
class Windows:
    """Which rows go into which window.

    Attributes
    ----------
    index : (n,) rows that are in a window
    window : (n,) the window of each of them, 0..m-1
    count : (m,) rows in each window
    """

    index: Ints
    window: Ints
    count: Ints

    def mean(self, values: Floats) -> Floats:
        """Average the rows of each window: (k,) to (m,), (k, j) to (m, j)."""
        chosen = values[self.index]
        if chosen.ndim == 1:
            return np.bincount(self.window, chosen, self.count.size) / self.count
        return np.column_stack(
            [
                np.bincount(self.window, chosen[:, j], self.count.size) / self.count
                for j in range(chosen.shape[1])
            ]
        )


def window_params(
    period: float, *, length: float = WINDOW, long_gap: float = np.inf
) -> window_means.WindowParams:
    """Say how rows are cut into windows, of a whole drive as on the way.

    Parameters
    ----------
    period : between rows, as a rule [s]
    length : of a window [s]
    long_gap : rows further apart count as standing between them [s]
    """
    return window_means.WindowParams(
        length=length,
        pause=max(PAUSE, 2.5 * period),
        enough=max(2, int(LEAST_FULL * length / period)),
        long_gap=long_gap,
    )


def windows(time: Floats, usable: Bools, *, length: float = WINDOW) -> Windows:
    """Cut the usable rows into windows that no unusable row interrupts.

    Both sides of the force balance are averaged over the same rows, so that
    the noise of each falls while nothing is lost of what they share.

    Parameters
    ----------
    time : (k,) rising [s]
    usable : (k,)
    length : of a window [s]
    """
    if np.count_nonzero(usable) < 2:
        nothing = np.zeros(0, dtype=np.int64)
        return Windows(nothing, nothing, nothing)
    cuts = window_params(float(np.median(np.diff(time))), length=length)
    number = window_means.assign(np.ascontiguousarray(time), np.ascontiguousarray(usable), cuts)
    index = np.flatnonzero(number >= 0)
    return Windows(index, number[index], np.bincount(number[index]))
