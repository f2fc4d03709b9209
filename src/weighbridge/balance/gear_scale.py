"""Do the gears of a drive lie on those of its vehicle file as a whole, or a step beside them?

Where the steps of a gearbox are even, engine speeds times such a step lie near gearings, too.
No two steps are quite the same, so that only the right scale puts every gear on its place.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.balance.gear_fit import held_ratios
from weighbridge.balance.table import ForceBalance
from weighbridge.limits import MANY, SOME
from weighbridge.messages import Problem
from weighbridge.signals import Bools, Floats
from weighbridge.signals.instants import span
from weighbridge.vehicle import Vehicle

NEAR: Final = 0.02
"""A ratio this near to a gearing lies on it [-]: in simulated drives of four vehicles half of the
ratios were nearer than 0.002, and those of a wrong scale 0.016 and more away."""

WORN: Final = 0.06
"""Scales this near to one are tyres and rounding [-]."""

FARTHEST: Final = 3.3
"""Largest scale that is tried, and its inverse the least [-]."""

STEP: Final = 0.0025
"""Between logarithms of scales and ratios [-]."""

FITS: Final = 0.8
"""Part of the ratios that the right scale puts on gearings [-]."""

BETTER: Final = 0.1
"""Part of them by which it must be ahead of the scale as it is [-]: of undamaged drives 0.97 and
more lie on gearings, of a simulated car's 0.6 to 0.8 a gear step off."""

PART: Final = 60.0
"""Parts of a drive this long are judged together [s]."""

OFF: Final = 0.3
"""Part of the ratios on gearings below which a part of a drive is off them [-]."""

LEAST: Final = 0.1
"""Part of the ratios that a gear, or what is off, must have [-]."""


def scale_contradiction(balance: ForceBalance, vehicle: Vehicle) -> Problem | None:
    """Say by what engine over vehicle speed is off the gearings, None if not.

    Parameters
    ----------
    balance, vehicle
    """
    gearings = np.log(np.array(vehicle.driveline.gearings))
    if gearings.size < 2:
        return None
    time, ratio = held_ratios(balance)
    if time.size < MANY:
        return None
    scale, share, own = _best(ratio, gearings)
    if share > FITS and share > own + BETTER:
        return Problem.of(
            "gear.scale", scale=scale, vehicle=vehicle.name, share=100.0 * share, own=100.0 * own
        )
    return _changing(time, ratio, gearings, vehicle.name)


def _changing(time: Floats, ratio: Floats, gearings: Floats, name: str) -> Problem | None:
    """Say where a part of the drive is off the gearings by one scale; None where none is."""
    _, number = np.unique(time // PART, return_inverse=True)
    count = np.bincount(number)
    on = np.bincount(number, weights=_on(ratio, gearings, 2.0 * NEAR))
    off = ((count >= SOME) & (on < OFF * count))[number]
    if np.count_nonzero(off) < max(LEAST * off.size, MANY):
        return None
    scale, share, own = _best(ratio[off], gearings)
    # A gear that the file lacks is off, too; a scale moves several.
    moved = ratio[off] - np.log(scale)
    nearest = np.argmin(np.abs(moved[:, None] - gearings), axis=1)
    gears = np.count_nonzero(np.bincount(nearest) > LEAST * moved.size)
    if share <= FITS or gears < 2:
        return None
    begin, end = float(time[off][0]), float(time[off][-1])
    if own > share - BETTER:
        # No other unit: a speed that drifts by some percent.
        return Problem.of("gear.drift", start=begin, end=end, span=span(begin, end), vehicle=name)
    return Problem.of(
        "gear.unit_changes", start=begin, end=end, span=span(begin, end), scale=scale, vehicle=name
    )


def _best(ratio: Floats, gearings: Floats) -> tuple[float, float, float]:
    """Scale that puts most ratios on gearings, their part, and the part at a scale of one."""
    reach = np.log(FARTHEST)
    low = min(float(ratio.min()), float(gearings.min())) - reach - 1.0
    bins = int((max(float(ratio.max()), float(gearings.max())) + reach + 1.0 - low) / STEP) + 1
    count = np.bincount(((ratio - low) / STEP).astype(np.int64), minlength=bins)[:bins]
    total = np.concatenate(([0], np.cumsum(count)))
    logs = np.arange(-reach, reach, STEP)
    at = (gearings[None, :] + logs[:, None] - low) / STEP
    half = NEAR / STEP
    inside = total[np.rint(at + half).astype(np.int64)] - total[np.rint(at - half).astype(np.int64)]
    shares = np.minimum(inside.sum(axis=1) / ratio.size, 1.0)
    usual = np.abs(logs) <= WORN
    other = np.where(usual, 0.0, shares)
    # The middle of all scales that put as many on gearings.
    best = np.flatnonzero(other > other.max() - 0.005)
    middle = int(best[best.size // 2])
    return float(np.exp(logs[middle])), float(shares[middle]), float(shares[usual].max())


def _on(ratio: Floats, gearings: Floats, near: float) -> Bools:
    return np.asarray(np.abs(ratio[:, None] - gearings).min(axis=1) < near)
