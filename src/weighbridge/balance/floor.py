"""The floor of a torque reading: what it shows while the engine is dragged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.signals import Floats, spread
from weighbridge.vehicle import DraggedReading

BIN: Final = 1.12
"""Ratio of the engine speeds at the ends of a bin [-]."""

SLOWEST_ENGINE: Final = 30.0
"""Engine speed at which the first bin begins [rad/s]."""

FEWEST_IN_BIN: Final = 12
"""Samples that a bin needs."""

LOW: Final = 2.0
"""Percentile of the readings in a bin near which its floor lies."""

SPREAD: Final = 0.05
"""Readings so near above that percentile, over the range of the reading, lie on the floor [-]."""

SHARE: Final = 0.06
"""Part of a bin's readings that lie on a floor; of an engine that was never dragged at that speed
fewer are so near its lowest reading [-]."""

HIGHEST: Final = 0.25
"""Floor over the highest reading, at most [-]: idling and dragged engines read a tenth or less."""

SLOPE: Final = 0.02
"""Rise of the floor from one bin to the next, over the range of the reading, at most [-]."""

SCATTER: Final = (0.012, 0.03)
"""Standard deviation of readings on the floor over the range of the reading, at least and at
most [-]."""

DRIFT: Final = 0.03
"""A reading may drift by so much between drives, over its range [-]: by air, heat and what the
alternator takes."""

LEAST_DRAGGED: Final = 10.0
"""Percentile of the readings of a surely dragged engine on which its floor lies."""


@dataclass(frozen=True, slots=True)
class Floor:
    """Reading of a dragged engine over its speed.

    Attributes
    ----------
    engine_speed : (b,) middle of each bin, rising [rad/s]
    level : (b,) reading of the dragged engine
    scatter : standard deviation of such readings
    span : range of the reading from dragged to full
    """

    engine_speed: Floats
    level: Floats
    scatter: float
    span: float

    def at(self, engine_speed: Floats) -> Floats:
        """Floor at engine speeds (n,); at the ends that of the last bin."""
        return np.interp(engine_speed, self.engine_speed, self.level)

    def reading(self, engine_speed: Floats) -> Floats:
        """What a dragged engine reads at engine speeds (n,), or an engine brake, which is less.

        An engine brake reads far less than an engine that is dragged, and neither pushes.
        """
        level = self.at(np.nan_to_num(engine_speed))
        return np.where(level < -HIGHEST * self.span, 0.0, level)

    @classmethod
    def of_vehicle(cls, known: DraggedReading) -> Floor:
        """Return the floor that a calibration has learnt."""
        return cls(np.array(known.engine_speed), np.array(known.level), known.scatter, known.span)

    def lifted(self, other: Floor) -> Floor:
        """Follow another floor where it lies a little higher, and its scatter where it is larger.

        A reading may drift, and another logger be noisier. Where the other floor lies far above,
        its drive did not drag the engine at that speed.
        """
        higher = other.at(self.engine_speed) - self.level
        near = (higher > 0.0) & (higher < DRIFT * self.span)
        return replace(
            self,
            level=self.level + np.where(near, higher, 0.0),
            scatter=max(self.scatter, other.scatter),
        )

    def cut(self, reading: Floats) -> Floor:
        """Rise to the lowest reading of a drive where many samples rest on just that value.

        A reading that cannot go lower says nothing there, as on the floor of a dragged engine.

        Parameters
        ----------
        reading : (n,) while driving; NaN where unknown
        """
        known = reading[np.isfinite(reading)]
        if not known.size:
            return self
        lowest = float(np.min(known))
        rests = np.mean(known <= lowest) >= SHARE
        return replace(self, level=np.maximum(self.level, lowest)) if rests else self

    def raised(self, above: Floats) -> Floor:
        """Rise to what the engine reads where the motion shows that it is dragged.

        Parameters
        ----------
        above : (k,) readings over this floor there; NaN where unknown
        """
        known = above[np.isfinite(above)]
        if known.size < FEWEST_IN_BIN:
            return self
        least = float(np.percentile(known, LEAST_DRAGGED))
        return replace(self, level=self.level + least) if least > DRIFT * self.span else self


def find_floor(reading: Floats, engine_speed: Floats) -> Floor | None:
    """Learn the floor of a reading over engine speed.

    Parameters
    ----------
    reading, engine_speed : (n,) while driving; NaN where unknown [rad/s]

    Returns
    -------
    Floor
        None where there are too few samples, or the engine was never dragged.
    """
    known = np.isfinite(reading) & np.isfinite(engine_speed) & (engine_speed > SLOWEST_ENGINE)
    if np.count_nonzero(known) < 5 * FEWEST_IN_BIN:
        return None
    x, turning = reading[known], engine_speed[known]
    low, high = np.percentile(x, [1.0, 99.5])
    span = float(high - low)
    if not span > 0.0:
        return None
    bins = (np.log(turning / SLOWEST_ENGINE) / np.log(BIN)).astype(np.int64)
    count = int(bins.max()) + 1
    level = np.full(count, np.nan)
    rest = []
    for k in range(count):
        inside = x[bins == k]
        if inside.size < FEWEST_IN_BIN:
            continue
        near = inside[inside <= np.percentile(inside, LOW) + SPREAD * span]
        if np.median(near) > HIGHEST * high:
            continue
        if near.size >= max(0.5 * FEWEST_IN_BIN, SHARE * inside.size):
            level[k] = np.median(near)
            rest.append(near - level[k])
    middle = np.asarray(SLOWEST_ENGINE * BIN ** (np.arange(count) + 0.5), dtype=np.float64)
    shown = np.isfinite(level)
    if not shown.any():
        return None
    # Where an engine was never dragged its lowest readings are no floor: it does not rise
    # faster than the floors beside it allow.
    every = np.arange(count)
    steps = np.abs(every[:, None] - every[shown]) * SLOPE * span
    level = np.min(level[shown] + steps, axis=1)
    scatter = spread(np.concatenate(rest))
    return Floor(middle, level, float(np.clip(scatter, *np.multiply(SCATTER, span))), span)
