"""Means of usable rows over short windows, the same for both sides of the balance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.signals import Bools, Floats, Ints

WINDOW: Final = 2.5
"""Length of a window [s]: vibration and polling noise average out, starts and hills stay."""

PAUSE: Final = 0.8
"""Usable rows further apart belong to different windows [s]."""

FEWEST: Final = 0.6
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
    index = np.flatnonzero(usable)
    if index.size < 2:
        nothing = np.zeros(0, dtype=np.int64)
        return Windows(nothing, nothing, nothing)
    instants = time[index]
    period = float(np.median(np.diff(time)))
    broken = np.diff(instants) > max(PAUSE, 2.5 * period)
    stretch = np.concatenate(([0], np.cumsum(broken)))
    begins = instants[np.concatenate(([0], np.flatnonzero(broken) + 1))][stretch]
    within = ((instants - begins) // length).astype(np.int64)
    new = np.concatenate(([False], (np.diff(stretch) != 0) | (np.diff(within) != 0)))
    window = np.cumsum(new)
    count = np.bincount(window)
    enough = count >= max(2, int(FEWEST * length / period))
    renumbered = np.cumsum(enough) - 1
    kept = enough[window]
    return Windows(index[kept], renumbered[window[kept]], count[enough])
