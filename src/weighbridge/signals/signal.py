"""One measured quantity on its own clock."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Bools: TypeAlias = NDArray[np.bool_]
Ints: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, slots=True, repr=False)
class Signal:
    """One quantity, sampled on a clock of its own.

    Attributes
    ----------
    name : canonical name, see `weighbridge.signals.catalogue`
    time : (n,) strictly increasing, finite [s]
    values : (n,) finite, in SI
    """

    name: str
    time: Floats
    values: Floats

    def __repr__(self) -> str:
        if not len(self):
            return f"Signal {self.name!r}: no samples"
        rate = f" at {1.0 / self.period:.3g} Hz" if self.period > 0.0 else ""
        return (
            f"Signal {self.name!r}: {len(self)} samples{rate} from {self.time[0]:.6g} to "
            f"{self.time[-1]:.6g} s, {self.values.min():.4g} to {self.values.max():.4g} in SI"
        )

    def __len__(self) -> int:
        return int(self.time.size)

    @property
    def duration(self) -> float:
        """Time between the first and the last sample [s]."""
        return float(self.time[-1] - self.time[0]) if self.time.size else 0.0

    @property
    def period(self) -> float:
        """Median time between samples [s]; NaN below two samples."""
        return float(np.median(np.diff(self.time))) if self.time.size > 1 else float("nan")

    def at(self, time: Floats) -> Floats:
        """Interpolate linearly; NaN outside the samples [SI]."""
        if self.time.size == 0:
            return np.full(np.shape(time), np.nan)
        return np.interp(time, self.time, self.values, left=np.nan, right=np.nan)

    def held(self, time: Floats) -> Floats:
        """Hold the last value seen; NaN before the first sample [SI]."""
        index = np.searchsorted(self.time, time, side="right") - 1
        if self.time.size == 0:
            return np.full(np.shape(time), np.nan)
        return np.where(index >= 0, self.values[np.maximum(index, 0)], np.nan)

    def age(self, time: Floats) -> Floats:
        """Distance to the nearest sample [s]; infinite without samples."""
        if self.time.size == 0:
            return np.full(np.shape(time), np.inf)
        right = np.clip(np.searchsorted(self.time, time), 0, self.time.size - 1)
        left = np.maximum(right - 1, 0)
        return np.minimum(np.abs(self.time[right] - time), np.abs(time - self.time[left]))
