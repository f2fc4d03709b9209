"""Gearing: ratios found from engine and vehicle speed, and the gear of the moment."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.limits import FEW, LOCKED, MANY
from weighbridge.messages import refused
from weighbridge.signals import Bools, Floats, Ints, Signal, spread

LOWEST_GEARING: Final = 1.8
"""Below any gear of a road vehicle, engine angle per distance [1/m]: a motor in the hub turns as
the wheel does, of 0.55 m at most."""

HIGHEST_GEARING: Final = 140.0
"""Above any first gear of a road vehicle, trucks' crawlers too [1/m]."""

MOSTLY_IN_GEAR: Final = 0.6
"""Part of the steady samples that lies at a ratio of a gearbox with gears [-]."""


BIN: Final = 0.01
"""Width of the bins in which the logarithms of ratios are counted [-]."""

GEARS_TAKE: Final = 10
"""Bins that all gears of a gearbox take together."""

ON_RATIOS: Final = 0.49
"""Part of the seconds on the move, beside those at the last ratio, that so many bins hold of a
gearbox with gears [-]: 0.60 at least in 44 vehicles with gears of two simulators, 0.49 where the
clutch slips; 0.47 at most in 16 stepless ones."""

BEYOND_LAST: Final = 1.05
"""Ratios within this factor of the lowest are the last one [-]."""

STANDS: Final = 20.0
"""Slower than this an engine does not run [rad/s]: engines idle at 50 and more."""

RATE_SPAN: Final = 0.2
"""The rate of an engine speed is looked at over so long before and after [s]: with 0.4 s the masses
of six pairs of the corpus with a stepless gearbox change by 0.2 % at most."""

BESIDE: Final = 3.0
"""Samples of a ratio that are further apart do not show that it held still [s]."""

REPORTED_NEAR: Final = 0.06
"""A gear reported belongs to the gearing its median ratio is this near to [-]."""


def spin_rate(engine: Signal, time: Floats) -> Floats:
    """How fast an engine speed rises around instants (n,) [rad/s^2]; NaN where unknown.

    Parameters
    ----------
    engine : its speed, looked at no further ahead than it may be
    time : (n,) [s]
    """
    span = max(RATE_SPAN, engine.period)
    nearer = replace(engine, ahead=max(engine.ahead - span, 0.0))
    return np.asarray((nearer.at(time + span) - engine.at(time - span)) / (2.0 * span))


@dataclass(frozen=True, slots=True)
class GearDetection:
    """Gearings found and the distribution they were found in (Jensen 2022, fig. 6).

    Attributes
    ----------
    gearings : (n,) of gears 1..n, falling [1/m]
    stds : (n,) their standard deviations [1/m]
    counts : (n,) samples behind each
    grid : (m,) centres of the intervals of eq. 50 [1/m]
    density : (m,) samples within each [-]
    """

    gearings: Floats
    stds: Floats
    counts: Ints
    grid: Floats
    density: Floats


def effective_gearing(engine_speed: Floats, speed: Floats) -> Floats:
    """Engine angle per distance travelled (Jensen 2022, eq. 10).

    Parameters
    ----------
    engine_speed : (n,) [rad/s]
    speed : (n,) [m/s]

    Returns
    -------
    (n,) [1/m]; NaN where the vehicle does not move forward
    """
    moving = speed > 0.1
    return np.where(moving, engine_speed / np.where(moving, speed, 1.0), np.nan)


def ratio_density(
    gearing: Floats, weight: Floats, *, width: float = 0.02, points: int = 1200
) -> tuple[Floats, Floats]:
    """Count samples in intervals that widen with the ratio (Jensen 2022, eq. 50).

    Parameters
    ----------
    gearing : (n,) finite, positive [1/m]
    weight : (n,) what each sample counts
    width : half width of an interval over its centre [-]
    points : number of intervals, evenly spaced in the logarithm

    Returns
    -------
    grid : (points,) centres [1/m]
    density : (points,) weighted counts
    """
    grid = np.geomspace(LOWEST_GEARING, HIGHEST_GEARING, points)
    order = np.argsort(gearing)
    cumulative = np.concatenate(([0.0], np.cumsum(weight[order])))
    rising = gearing[order]
    high = np.searchsorted(rising, grid * (1.0 + width), side="right")
    low = np.searchsorted(rising, grid * (1.0 - width), side="left")
    return grid, cumulative[high] - cumulative[low]


def ratio_counts(gearing: Floats) -> Ints:
    """Count ratios (n,) above `LOWEST_GEARING` in bins of the logarithm, each `BIN` wide."""
    return np.bincount((np.log(gearing / LOWEST_GEARING) / BIN).astype(np.int64))


def detect_gearings(
    time: Floats,
    engine_speed: Floats,
    speed: Floats,
    *,
    idle_speed: float | None = None,
    speed_step: float = 0.0,
    width: float = 0.02,
    most: int = 18,
) -> GearDetection:
    """Find the gearings as peaks of the ratio's distribution.

    Samples count where the ratio holds still, so that shifts and a slipping
    clutch leave no peak, and less where a coarse speed blurs it.

    Parameters
    ----------
    time : (n,) rising [s]
    engine_speed : (n,) [rad/s]
    speed : (n,) [m/s]
    idle_speed : engine speed that is idling; found from standstill when None [rad/s]
    speed_step : quantisation of ``speed`` [m/s]
    width : half width of an interval over its centre [-]
    most : largest number of gears

    Raises
    ------
    DriveError
        No ratio stands out: too short a drive, or a stepless gearbox.

    References
    ----------
    Jensen et al. 2022, sec. 6.2, eq. 50.
    """
    gearing = effective_gearing(engine_speed, speed)
    if idle_speed is None:
        idle_speed = _idle_speed(engine_speed, speed)
    slowest = max(1.5, 6.0 * speed_step)
    usable = (
        np.isfinite(gearing)
        & (speed > slowest)
        & (engine_speed > 1.12 * idle_speed)
        & (gearing > LOWEST_GEARING)
        & (gearing < HIGHEST_GEARING)
    )
    kept = usable & steady(time, gearing, width + 0.5 * speed_step / np.maximum(speed, 1.0))
    if np.count_nonzero(kept) < 30:
        raise refused("gear.few_samples", count=np.count_nonzero(kept))
    blur = np.hypot(width, 0.29 * speed_step / speed[kept])
    grid, density = ratio_density(gearing[kept], width / blur, width=width)
    peaks = _standing_out(grid, density, width, most)
    if peaks.size == 0:
        raise refused("gear.none")
    near = np.abs(np.log(gearing[kept][:, None] / grid[peaks])).min(axis=1) < 2.0 * width
    if np.mean(near) < MOSTLY_IN_GEAR:
        raise refused("gear.unclear", share=100.0 * np.mean(near))
    values, stds, counts = [], [], []
    for centre in grid[peaks]:
        refined, std, count = _refine(gearing[kept], speed[kept], centre, width, speed_step)
        values.append(refined)
        stds.append(std)
        counts.append(count)
    order = np.argsort(values)[::-1]
    return GearDetection(
        np.array(values)[order],
        np.array(stds)[order],
        np.array(counts, dtype=np.int64)[order],
        grid,
        density,
    )


def stepless_range(
    time: Floats, engine_speed: Floats, speed: Floats, *, idle_speed: float | None = None
) -> tuple[float, float] | None:
    """Return the lowest and the highest gearing where the ratios keep to no gears.

    Parameters
    ----------
    time : (n,) rising [s]
    engine_speed : (n,), as late as the speed [rad/s]
    speed : (n,) [m/s]
    idle_speed : as of `detect_gearings`

    Returns
    -------
    Both as far as they were used [1/m]; None where there are gears, or too few samples
    """
    if idle_speed is None:
        idle_speed = _idle_speed(engine_speed, speed)
    # Means over a second, so that noise is no creeping ratio.
    _, first = np.unique(np.floor(time), return_index=True)
    size = np.diff(first, append=time.size)
    engine_speed, speed = (np.add.reduceat(v, first) / size for v in (engine_speed, speed))
    gearing = effective_gearing(engine_speed, speed)
    turning = (engine_speed > 1.12 * idle_speed) & (speed > LOCKED)
    gearing = gearing[turning & (gearing > LOWEST_GEARING) & (gearing < HIGHEST_GEARING)]
    if gearing.size < MANY:
        return None
    # A stepless gearbox rests at its last ratio, a gearbox with gears at others as well.
    others = gearing[gearing > BEYOND_LAST * np.percentile(gearing, 1.0)]
    if others.size < MANY:
        return None
    if np.sum(np.sort(ratio_counts(others))[-GEARS_TAKE:]) >= ON_RATIOS * others.size:
        return None
    low, high = np.percentile(gearing, [0.2, 99.8])
    return float(low), float(high)


def _standing_out(grid: Floats, density: Floats, width: float, most: int) -> Ints:
    """Places of the peaks of a density that stand out from their surroundings, rising.

    A gear is such a peak, be it ever so rarely used: shifting smears samples evenly, gears pile
    them up.
    """
    step = float(np.log(grid[1] / grid[0]))
    least = max(5.0, 0.002 * density.sum() / (2.0 * width) * step)
    peaks = _apart(density, _maxima(density), int(0.07 / step))
    prominence = density[peaks] - np.array([_saddle(density, peak) for peak in peaks])
    peaks = peaks[(prominence >= least) & (prominence > 0.55 * density[peaks])]
    if peaks.size > most:
        peaks = np.sort(peaks[np.argsort(density[peaks])[-most:]])
    return peaks


def _maxima(values: Floats) -> Ints:
    """Places above both neighbours; of a level stretch that is, its middle."""
    first = np.flatnonzero(np.diff(values, prepend=np.nan) != 0.0)
    last = np.append(first[1:], values.size) - 1
    level = values[first]
    inner = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] > level[2:])) + 1
    return np.asarray((first[inner] + last[inner]) // 2)


def _apart(values: Floats, peaks: Ints, distance: int) -> Ints:
    """Leave out the peaks that are nearer than so many places to a higher one that is kept."""
    kept: list[int] = []
    for peak in peaks[np.argsort(-values[peaks], kind="stable")]:
        if all(abs(peak - other) >= distance for other in kept):
            kept.append(int(peak))
    return np.sort(np.array(kept, dtype=np.int64))


def _saddle(values: Floats, peak: int) -> float:
    """Higher one of the two lowest values between a peak and what is higher, or the end."""
    higher = np.flatnonzero(values > values[peak])
    before, after = higher[higher < peak], higher[higher > peak]
    left = values[before[-1] + 1 if before.size else 0 : peak + 1].min()
    right = values[peak : after[0] if after.size else values.size].min()
    return float(max(left, right))


def predict_gear(
    engine_speed: Floats, speed: Floats, gearings: Floats, *, tolerance: float = 0.06
) -> tuple[Ints, Floats]:
    """Name the gear whose gearing is nearest (Jensen 2022, eq. 11).

    Parameters
    ----------
    engine_speed : (n,) [rad/s]
    speed : (n,) [m/s]
    gearings : (m,) falling [1/m]
    tolerance : largest relative distance that still counts as in gear [-]

    Returns
    -------
    gear : (n,) 1..m; 0 where no gear is engaged or the vehicle stands
    mismatch : (n,) relative distance of the ratio to the nearest gearing [-];
        NaN where the vehicle stands
    """
    gearing = effective_gearing(engine_speed, speed)
    rising = np.sort(gearings)
    # Halfway in the logarithm, so that the relative distance decides.
    edges = np.sqrt(rising[1:] * rising[:-1])
    finite = np.isfinite(gearing)
    nearest = np.searchsorted(edges, np.where(finite, gearing, rising[0]))
    mismatch = np.where(finite, gearing / rising[nearest] - 1.0, np.nan)
    engaged = finite & (np.abs(mismatch) <= tolerance)
    return np.where(engaged, gearings.size - nearest, 0).astype(np.int64), mismatch


def reported_gear_numbers(reported: Ints, gearing: Floats, gearings: Floats) -> dict[int, int]:
    """Find which gears of the vehicle file the gears are that a gearbox reports.

    A file fitted to drives that never used the first gears counts from the
    lowest one used, and a gearbox from its own first gear. Each gear reported is
    the gearing that its median ratio lies at; where it lies at none the
    number is taken as reported.

    Parameters
    ----------
    reported : (n,) as the gearbox counts, 1 and up forward
    gearing : (n,) of the moment [1/m]; NaN where unknown
    gearings : (m,) of gears 1..m [1/m]

    Returns
    -------
    Number 1..m of each gear reported; 0 where it is none of the file's
    """
    numbers = {}
    for k in np.unique(reported[reported >= 1]).tolist():
        ratio = gearing[(reported == k) & np.isfinite(gearing) & (gearing > 0.0)]
        numbers[k] = k if k <= gearings.size else 0
        if ratio.size >= 5:
            distance = np.abs(np.log(np.median(ratio) / gearings))
            best = int(np.argmin(distance))
            if distance[best] < REPORTED_NEAR:
                numbers[k] = best + 1
    return numbers


def number_reported_gears(reported: Ints, numbers: Mapping[int, int]) -> Ints:
    """Number the gears a gearbox reports (n,) by those of the vehicle file; 0 where none."""
    gear = np.zeros(reported.size, dtype=np.int64)
    for k, number in numbers.items():
        gear[reported == k] = number
    return gear


def steady(time: Floats, gearing: Floats, tolerance: Floats) -> Bools:
    """Return where the ratio agrees with the one before and the one after.

    Parameters
    ----------
    time : (n,) rising [s]
    gearing : (n,) [1/m]; not positive or NaN where there is none
    tolerance : (n,) relative change that still agrees [-]
    """
    log = np.log(np.where(gearing > 0.0, gearing, np.nan))
    change = np.abs(np.diff(log))
    near = np.isfinite(change) & (np.diff(time) < BESIDE)
    agrees = near & (change < 0.5 * (tolerance[1:] + tolerance[:-1]))
    held = np.zeros(time.size, dtype=bool)
    held[1:-1] = agrees[1:] & agrees[:-1]
    return held


def shifting(time: Floats, gear: Ints, *, margin: float, ahead: float = math.inf) -> Bools:
    """Mark samples within ``margin`` [s] of a change of gear.

    Parameters
    ----------
    time : (n,) rising [s]
    gear : (n,) with 0 for none engaged
    ahead : how far past a sample the next gear may be seen [s]
    """
    change = np.flatnonzero(np.diff(gear) != 0)
    instants = np.concatenate(([-np.inf], 0.5 * (time[change] + time[change + 1]), [np.inf]))
    seen = np.concatenate(([-np.inf], time[change + 1], [np.inf]))
    after = np.searchsorted(instants, time)
    later = (instants[after] - time <= margin) & (seen[after] - time <= ahead)
    return np.asarray(later | (time - instants[after - 1] <= margin))


def idling(engine_speed: Floats, speed: Floats) -> float:
    """Most usual speed of an engine that runs while the vehicle stands.

    Parameters
    ----------
    engine_speed : (n,) [rad/s]
    speed : (n,) of the vehicle [m/s]

    Returns
    -------
    [rad/s]; 0 where none is seen
    """
    running = np.sort(engine_speed[_standing(engine_speed, speed)])
    # The densest 2 %: starts, stops and a foot on the accelerator spread wide.
    end = np.searchsorted(running, 1.02 * running, side="right")
    count = end - np.arange(running.size)
    if np.max(count, initial=0) < FEW:
        return 0.0
    densest = int(np.argmax(count))
    return float(np.median(running[densest : end[densest]]))


def _standing(engine_speed: Floats, speed: Floats) -> Bools:
    return np.asarray((speed < 0.3) & (engine_speed > 30.0))


def _idle_speed(engine_speed: Floats, speed: Floats) -> float:
    standing = _standing(engine_speed, speed)
    if np.count_nonzero(standing) >= 10:
        return float(np.median(engine_speed[standing]))
    running = engine_speed[engine_speed > 30.0]
    return float(np.percentile(running, 1)) if running.size else 0.0


def _refine(
    gearing: Floats, speed: Floats, centre: float, width: float, speed_step: float
) -> tuple[float, float, int]:
    """Weighted robust mean around a peak: value, standard deviation, samples."""
    value = float(centre)
    near = np.abs(gearing / value - 1.0) < 2.0 * width
    for _ in range(3):
        near = np.abs(gearing / value - 1.0) < 1.5 * width + 0.5 * speed_step / speed
        if not near.any():
            return value, float(centre * width), 0
        weight = speed[near] ** 2 if speed_step > 0.0 else np.ones(np.count_nonzero(near))
        value = _weighted_median(gearing[near], weight)
    scatter = spread(gearing[near] - value)
    count = int(np.count_nonzero(near))
    return value, max(scatter, 1e-4 * value) * float(np.sqrt(np.pi / (2.0 * count))), count


def _weighted_median(values: Floats, weight: Floats) -> float:
    order = np.argsort(values)
    cumulative = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(cumulative, 0.5 * cumulative[-1])])
