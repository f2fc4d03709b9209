"""Samples of torque or load that no engine makes: dropouts and full scale.

A reading that falls to zero for one sample and returns is no torque, unless the gear changes
there.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.signals import QUANTITIES, Bools, Drive, Floats, Signal
from weighbridge.signals.runs import runs_of

LONGEST: Final = 0.5
"""Runs beyond are no isolated samples [s], or `FEW` samples of a slow reading."""

FEW: Final = 3
"""Samples of a run that may still be isolated."""

FAR: Final = 0.2
"""Part of the range by which both neighbours of a false sample are away from it [-]."""

ALIKE: Final = 0.5
"""Difference of the neighbours over their distance from it, at most [-]."""

SAME_GEAR: Final = 0.04
"""Change of engine over vehicle speed across it, at most, in one gear [-]."""

AROUND: Final = 1.0
"""That ratio is compared so long before and after [s]."""

OFTEN: Final = 0.003
"""Part of the samples at one level from which they are no chance [-]: none of 43 undamaged drives
of three simulators reached it."""

FEWEST_SAMPLES: Final = 5
"""Fewer runs at one level are left alone."""

CUT: Final = 0.97
"""Highest reading over that of the calibration from which nothing is cut off [-]."""

MUCH: Final = 0.02
"""Part of the samples at one end of a reading from which on it is cut off there [-]: twelve
simulated vehicles had 0.002 at most at the top, electric ones 0.0015 at the bottom. Of the 718
undamaged pairs of the corpus none is found, of 16 whose torque a device cuts off 14."""

BESIDE: Final = 0.1
"""They are more than all samples within this part of the range beside it [-]."""

FULL_LOAD: Final = (0.99, 1.01)
"""A reading in percent that ends here is not cut off: an engine holds its full load [-]. Without
this, three of the 718 undamaged pairs of the corpus lose rows, and are 0.1 to 1.3 % farther off."""

PILED: Final = 0.005
"""Part of the samples that repeat the highest reading where it is cut off [-]."""


def isolated(drive: Drive, name: str) -> Bools:
    """Mark samples of one level that stand alone, again and again.

    Parameters
    ----------
    drive
    name : of torque or load

    Returns
    -------
    (n,) all False where they are too few to be a fault
    """
    signal = drive.signals[name]
    values = signal.values
    marked = np.zeros(values.size, dtype=bool)
    if values.size < 200:
        return marked
    reach = FAR * float(np.ptp(values))
    runs = runs_of(signal)
    inner = (runs.first > 0) & (runs.first + runs.length < values.size)
    inner &= (runs.duration <= LONGEST) | (runs.length <= FEW)
    first, last = runs.first[inner], (runs.first + runs.length)[inner]
    before, after, level = values[first - 1], values[last], values[first]
    apart = np.minimum(np.abs(before - level), np.abs(after - level))
    alone = (apart > reach) & (np.abs(after - before) < ALIKE * apart)
    alone &= signal.time[last] - signal.time[first - 1] < 3.0 * LONGEST
    alone &= _same_gear(drive, signal.time[first] - AROUND, signal.time[last] + AROUND)
    # Dropouts fall to a level of their own, again and again.
    levels, which = np.unique(level, return_inverse=True)
    often = np.bincount(which, weights=alone, minlength=levels.size)
    alone &= (often >= max(FEWEST_SAMPLES, OFTEN * values.size))[which]
    if not alone.any():
        return marked
    edges = np.zeros(values.size + 1, dtype=np.int64)
    np.add.at(edges, first[alone], 1)
    np.add.at(edges, last[alone], -1)
    return np.asarray(np.cumsum(edges)[:-1] > 0)


def _same_gear(drive: Drive, before: Floats, after: Floats) -> Bools:
    """Whether engine over vehicle speed is the same at both instants, as far as is known."""
    engine, speed = drive.get("engine_speed"), drive.get("vehicle_speed")
    if engine is None or speed is None or not len(engine) or not len(speed):
        return np.ones(before.size, dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.log(engine.at(after) / speed.at(after)) - np.log(
            engine.at(before) / speed.at(before)
        )
    return np.asarray(~(np.abs(change) > SAME_GEAR))


def piled(signal: Signal, *, lowest: bool = False) -> Bools:
    """Mark samples that pile up at the highest or lowest value of a reading.

    Nothing need be known of the vehicle: what ends by itself thins out towards its ends.

    Parameters
    ----------
    signal
    lowest : look at the lowest value in place of the highest

    Returns
    -------
    (n,) all False where the reading ends by itself
    """
    values = signal.values
    end = float((values.min if lowest else values.max)()) if values.size else 0.0
    at_end = values == end
    count = np.count_nonzero(at_end)
    nothing = np.zeros(values.size, dtype=bool)
    if values.size < 200 or count < MUCH * values.size:
        return nothing
    if QUANTITIES[signal.name].suffix == "pct" and FULL_LOAD[0] <= abs(end) <= FULL_LOAD[1]:
        return nothing
    from_end = np.abs(values - end)
    span, others = float(np.percentile(from_end, 95.0)), from_end[~at_end]
    # Of a coarse reading, at least its next step.
    beside = np.count_nonzero(others <= max(BESIDE * span, others.min(initial=np.inf)))
    runs = runs_of(signal)
    often = np.count_nonzero((values[runs.first] == end) & (runs.length > 1))
    return at_end if count >= beside and often >= FEWEST_SAMPLES else nothing


_OFTEN: Final = 3
"""A reading that is cut off is held at its top so often at least."""


def clipped(signal: Signal, highest: float) -> Bools:
    """Mark samples at the top of a reading that was cut off below what the engine gives.

    Parameters
    ----------
    signal
    highest : reading that the calibration has seen; infinite where it is not known

    Returns
    -------
    (n,) all False where the reading ends by itself
    """
    values = signal.values
    nothing = np.zeros(values.size, dtype=bool)
    if values.size < 200 or not np.isfinite(highest):
        return nothing
    top = float(values.max())
    runs = runs_of(signal)
    at_top = values[runs.first] == top
    held = runs.length[at_top & (runs.length > 1)]
    piled = int(np.sum(held))
    # A driver who accelerates once or twice holds the pedal at a top as well.
    if held.size < _OFTEN or top >= CUT * highest or piled < PILED * values.size:
        return nothing
    return np.asarray(values == top)
