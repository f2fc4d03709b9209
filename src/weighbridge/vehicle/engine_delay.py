"""How late the engine speed is: its ratio to the vehicle speed holds still in a gear."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.limits import DRIVES, LOCKED, SOME
from weighbridge.signals import Bools, Floats, Ints, huber, spread
from weighbridge.signals.interpolation import interpolate
from weighbridge.vehicle.gear import (
    HIGHEST_GEARING,
    LOWEST_GEARING,
    effective_gearing,
    predict_gear,
    ratio_counts,
    steady,
)

USUAL_STD: Final = 0.2
"""Standard deviation of how much sooner or later than the vehicle speed it is [s]: control units
answer within 0.02 to 0.4 s, each in its own time."""

ALIKE: Final = 0.01
"""A lateness that is nearer to the usual one is the usual one [s]: no gear moves by 1 %."""

ROUNDS: Final = 4
"""Of moving the engine speed and looking again: a wrong delay puts rows beside their gears."""

SETTLED: Final = 1e-5
"""A smaller move is the last [s]."""

REWEIGHTED: Final = 5
"""Rounds of weighing rows by how far they lie off."""

ROBUST: Final = 1.5
"""Residual over its scatter beyond which a row counts less [-] (Huber). With 1.345 the RMS by
an accelerometer alone rises by 3 % of itself."""


STEADY: Final = 0.02
"""Change of the ratio from one sample to the next that is still one gear [-]."""

HALF: Final = 0.25
"""The rate of the speed is looked at over so long before and after [s]."""

LASTING: Final = 2.5
"""Errors of neighbouring rows are alike for so long [s]."""

SHIFTS: Final = np.arange(-4.0, 4.01, 0.25)
"""Delays beside the usual one that are tried [s]."""

ENOUGH_SHIFTED: Final = 2000
"""Rows that are looked at for each of them."""

NARROWER: Final = 0.3
"""Entropy by which the ratios must gather more than at the usual delay [nat]. An engine speed that
is 2.5 s late has 0.7 to 2.7 to gain in 15 vehicles with gears, by 1 Hz and by 10 Hz."""


def find_engine_delay(
    stamps: Floats,
    engine_speed: Floats,
    motion: tuple[Floats, Floats],
    gearings: Floats,
    usual: float,
) -> float:
    """Lateness of an engine speed against a motion [s].

    In a gear the engine turns with the wheels. Read late by t, the logarithm of their ratio
    lies t times dv/dt / v too low. A taller ratio in a start would pass for a slipping clutch,
    or for a shorter gear.

    Parameters
    ----------
    stamps, engine_speed : (n,) [s], [rad/s]
    motion : (m,) instants, rising [s], and speeds of the vehicle [m/s]
    gearings : (k,) falling, roughly [1/m]
    usual : lateness before the drive has shown [s]

    Returns
    -------
    Where the ratios gather at another delay than the usual one, the search begins there.

    References
    ----------
    Errors in time are errors in proportion to the rate: Ljung, System Identification, 2nd ed.,
    1999, sec. 7.5; robust weights: Huber, Robust Statistics, 1981.
    """
    delay = gathered_delay(stamps, engine_speed, motion, usual)
    for _ in range(ROUNDS):
        rows = _in_gear(stamps - delay, engine_speed, motion, gearings)
        if rows is None:
            return usual
        slope, variance = _slope(*rows)
        # The slope is how much too early the rows are looked at; it counts from the usual one.
        trust = USUAL_STD**2 / (USUAL_STD**2 + variance)
        before, delay = delay, usual + trust * (delay - slope - usual)
        if abs(delay - before) < SETTLED:
            break
    return float(delay) if abs(delay - usual) > ALIKE else usual


def gathered_delay(
    stamps: Floats, engine_speed: Floats, motion: tuple[Floats, Floats], usual: float
) -> float:
    """Lateness at which the ratios of engine to vehicle speed gather most, gears being unknown [s].

    Parameters
    ----------
    stamps, engine_speed, motion, usual : as of `find_engine_delay`

    Returns
    -------
    ``usual`` where no other delay gathers them clearly more: a stepless gearbox, one gear, or a
    short drive
    """
    step = max(1, stamps.size // ENOUGH_SHIFTED)
    stamps, engine_speed = stamps[::step], engine_speed[::step]
    entropies = [_entropy(stamps - usual - shift, engine_speed, motion) for shift in SHIFTS]
    best = int(np.argmin(entropies))
    gain = entropies[int(np.argmin(np.abs(SHIFTS)))] - entropies[best]
    # Infinite where too few rows are left at the usual delay: then none shows more than it.
    return usual + float(SHIFTS[best]) if NARROWER < gain < np.inf else usual


def _entropy(time: Floats, engine_speed: Floats, motion: tuple[Floats, Floats]) -> float:
    """Entropy of the ratios of engine to vehicle speed [nat]; infinite of too few."""
    speed = interpolate(time, *motion, left=0.0, right=0.0)
    ratio = effective_gearing(engine_speed, speed)
    used = (speed > LOCKED) & (ratio > LOWEST_GEARING) & (ratio < HIGHEST_GEARING)
    if np.count_nonzero(used) < SOME:
        return np.inf
    counts = ratio_counts(ratio[used])
    share = counts[counts > 0] / np.count_nonzero(used)
    return float(-np.sum(share * np.log(share)))


def _in_gear(
    time: Floats, engine_speed: Floats, motion: tuple[Floats, Floats], gearings: Floats
) -> tuple[Floats, Floats, Ints, float] | None:
    """Rows in gear: dv/dt / v, logarithm of the ratio, gear, rows per independent one."""
    instants, speeds = motion
    inside = (time > instants[0]) & (time < instants[-1]) & np.isfinite(engine_speed)
    time, engine_speed = time[inside], engine_speed[inside]
    if time.size < SOME:
        return None
    speed = interpolate(time, instants, speeds)
    ratio = effective_gearing(engine_speed, speed)
    gear, _ = predict_gear(engine_speed, speed, gearings)
    held = steady(time, ratio, np.full(time.size, STEADY)) & (gear > 0) & (speed > DRIVES)
    held &= _often(gear, held)
    if np.count_nonzero(held) < SOME:
        return None
    ahead, behind = (interpolate(time[held] + by, instants, speeds) for by in (HALF, -HALF))
    rate = (ahead - behind) / (2.0 * HALF * speed[held])
    alike = max(1.0, LASTING / float(np.median(np.diff(time))))
    return rate, np.log(ratio[held]), gear[held], alike


def _often(gear: Ints, held: Bools) -> Bools:
    """Rows (n,) whose gear has enough of them."""
    count = np.bincount(gear[held], minlength=int(gear.max(initial=0)) + 1)
    return np.asarray(count[gear] >= SOME)


def _slope(rate: Floats, log_ratio: Floats, gear: Ints, alike: float) -> tuple[float, float]:
    """Slope of the logarithm of the ratio on dv/dt / v within gears [s], and its variance."""
    weight = np.ones(rate.size)
    for _ in range(REWEIGHTED):
        total = np.maximum(np.bincount(gear, weights=weight), 1e-300)
        x = rate - (np.bincount(gear, weights=weight * rate) / total)[gear]
        y = log_ratio - (np.bincount(gear, weights=weight * log_ratio) / total)[gear]
        power = float(np.sum(weight * x * x))
        if not power > 0.0:
            return 0.0, np.inf
        slope = float(np.sum(weight * x * y)) / power
        scatter = spread(y - slope * x) + 1e-9
        weight = huber(y - slope * x, scatter, ROBUST)
    return slope, alike * scatter**2 / power
