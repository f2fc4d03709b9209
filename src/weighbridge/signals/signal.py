"""One measured quantity on its own clock."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from weighbridge.arguments import as_floats, check_number, check_text
from weighbridge.errors import ConfigError
from weighbridge.signals.interpolation import interpolate

Floats: TypeAlias = NDArray[np.float64]
Bools: TypeAlias = NDArray[np.bool_]
Ints: TypeAlias = NDArray[np.int64]

HELD: Final = 10.0
"""A stage that goes forward holds a value for so long, where no next one is in sight [s]."""


@dataclass(frozen=True, slots=True, repr=False)
class Signal:
    """One quantity with its own sampling times.

    Attributes
    ----------
    name : canonical name, see `weighbridge.signals.catalogue`
    time : (n,) strictly increasing, finite [s]
    values : (n,) finite, in SI
    ahead : how far past an instant `at` and `age` look for a sample [s]; finite for stages that
        go forward, see `weighbridge.signals.recent.looking`
    usual : median time between samples, where more of them were seen than are here [s]

    Lists and arrays of whole numbers become arrays of doubles.

    Raises
    ------
    ArgumentTypeError
        Times or values are no numbers.
    ConfigError
        They are not as many.
    """

    name: str
    time: Floats
    values: Floats
    ahead: float = math.inf
    usual: float | None = None
    _period: float | None = field(default=None, init=False, repr=False, compare=False)
    _longest_repeat: float | None = field(default=None, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_text("name of a signal", self.name)
        check_number("ahead of a signal", self.ahead)
        check_number("usual of a signal", self.usual, optional=True)
        for name in ("time", "values"):
            given = getattr(self, name)
            floats = as_floats(f"{name} of signal {self.name!r}", given)
            if floats is not given:
                object.__setattr__(self, name, floats)
        if self.time.shape != self.values.shape or self.time.ndim != 1:
            raise ConfigError(
                f"signal {self.name!r} has times of shape {self.time.shape} and values of shape "
                f"{self.values.shape}; give one row of each, as many"
            )

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
        if self.usual is not None:
            return self.usual
        if self._period is None:
            steps = np.diff(self.time)
            usual = float(np.median(steps, overwrite_input=True)) if steps.size else float("nan")
            object.__setattr__(self, "_period", usual)
            return usual
        return self._period

    @property
    def longest_repeat(self) -> float:
        """Longest time over which one value is repeated [s]."""
        if self._longest_repeat is None:
            from weighbridge.kernels.interpolation import longest_repeat

            found = longest_repeat(self.time, self.values) if len(self) > 1 else 0.0
            object.__setattr__(self, "_longest_repeat", float(found))
            return float(found)
        return self._longest_repeat

    def at(self, time: Floats) -> Floats:
        """Interpolate linearly; NaN outside the samples [SI]."""
        time = as_floats("time", time)
        if self.time.size == 0:
            return np.full(np.shape(time), np.nan)
        straight = interpolate(time, self.time, self.values, left=np.nan, right=np.nan)
        if math.isinf(self.ahead):
            return straight
        place = np.searchsorted(self.time, time, side="right")
        later = self.time[np.minimum(place, self.time.size - 1)]
        between = (place < self.time.size) & (later - time <= self.ahead)
        old = time - self.time[np.maximum(place - 1, 0)] > HELD
        return np.where(between, straight, np.where(old, np.nan, self.held(time)))

    def held(self, time: Floats) -> Floats:
        """Hold the last value seen; NaN before the first sample [SI]."""
        time = as_floats("time", time)
        index = np.searchsorted(self.time, time, side="right") - 1
        if self.time.size == 0:
            return np.full(np.shape(time), np.nan)
        return np.where(index >= 0, self.values[np.maximum(index, 0)], np.nan)

    def age(self, time: Floats) -> Floats:
        """Distance to the nearest sample [s]; infinite without samples."""
        from weighbridge.kernels.interpolation import distance_to_nearest

        time = as_floats("time", time)
        if self.time.size == 0:
            return np.full(np.shape(time), np.inf)
        found: Floats = distance_to_nearest(
            np.ascontiguousarray(time).ravel(), np.ascontiguousarray(self.time)
        )
        found = found.reshape(np.shape(time))
        if math.isfinite(self.ahead):
            place = np.searchsorted(self.time, time, side="right")
            before = np.where(place > 0, time - self.time[np.maximum(place - 1, 0)], np.inf)
            found = np.where(found <= self.ahead, found, before)
        return found[()]
