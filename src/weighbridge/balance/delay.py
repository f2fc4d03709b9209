"""How late torque is against motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from weighbridge.balance.averaging import WINDOW
from weighbridge.balance.force_balance import force_rows, usable_rows
from weighbridge.balance.instants import in_band, lagged_motion
from weighbridge.balance.law import force_on_mass
from weighbridge.balance.table import ForceBalance
from weighbridge.navigation import Motion
from weighbridge.signals import Drive, Floats
from weighbridge.signals.correlation import correlation
from weighbridge.signals.lag import find_lag, lag_std_at, parabola
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.torque import source_signal

EARLIEST: Final = -0.4
"""Torque requested before it acts is early; by more than this only where the motion is late [s]."""

LATEST: Final = 1.2
"""Torque polled, smoothed and sent is late; hardly by more than this [s]."""

FARTHEST: Final = 2.4
"""Where the best lies at an end of the search, it goes on as far as this [s]: a speed of the
instrument cluster, polled once a second, is behind the load by 1 to 1.5 s."""

SAME_CLOCK: Final = 0.15
"""Torque later or earlier than in the calibration by less is on the same clock [s]: in 15 simulated
drives of five vehicles it differed by 0.05 s at most. Masses are 0.2 % light at 0.15 s."""

SURE: Final = 3.0
"""Standard deviations that torque is later than in the calibration by, on another clock [-]: with
it, and none said against a speed alone, 6 undamaged pairs of the corpus have another clock, 52
before; of the pairs whose clocks are wrong, 31 as before."""

_NEAR_BY: Final = 0.3
"""Shifts compared with none at first [s]."""


def estimate_torque_delay(
    drive: Drive, vehicle: Vehicle, motion: Motion, begun: ForceBalance
) -> float:
    """Find the delay at which traction explains specific force best [s]; NaN where none stands out.

    A forward fit and an inverse one differ, but their product, the
    correlation, depends on the delay alone.

    Parameters
    ----------
    drive, vehicle, motion
    begun : balance of these at no delay

    Raises
    ------
    DriveError
        The drive lacks what the torque source needs.
    """
    misfit, _ = _misfit(drive, vehicle, motion, begun, np.array([EARLIEST, -EARLIEST]))
    return find_lag(misfit, EARLIEST, LATEST, farthest=FARTHEST)


def clock_shift(drive: Drive, vehicle: Vehicle, motion: Motion, begun: ForceBalance) -> float:
    """Find how much later the torque is than in ``begun`` [s]; 0 where it is not, or none is seen.

    Less than `SAME_CLOCK` is no other clock, nor is what drive and calibration are unsure of. As
    much as 0.8 s is believed where it leaves half of the misfit or less, little where the misfit is
    lower there on both sides.

    Parameters
    ----------
    drive, vehicle, motion
    begun : balance of these at the lateness of the torque in the calibration

    Raises
    ------
    DriveError
        The drive lacks what the torque source needs.
    """
    known = begun.delay
    shifts = np.array([-0.8, -_NEAR_BY, 0.0, _NEAR_BY, 0.8])
    misfit, rows = _misfit(drive, vehicle, motion, begun, known + shifts[shifts != 0.0])
    scores = np.array([misfit(float(known + shift)) for shift in shifts])
    if not np.isfinite(scores).all():
        return 0.0
    if scores[1:4].min() <= scores.min():
        shift = _little(misfit, known, shifts[1:4], scores[1:4])
        if shift == 0.0:
            return 0.0
        own = lag_std_at(lambda at: misfit(at) * (2.0 - misfit(at)), known + shift, rows)
        unsure = math.hypot(own, vehicle.timing.torque_delay_std or 0.0)
        return shift if abs(shift) > SURE * unsure else 0.0
    as_known = scores[2]
    shifts = np.asarray(0.2 * np.arange(-10, 21), dtype=np.float64)
    scores = np.array([misfit(float(known + shift)) for shift in shifts])
    best = int(np.argmin(np.where(np.isfinite(scores), scores, np.inf)))
    if best in (0, shifts.size - 1) or scores[best] > 0.5 * as_known:
        return 0.0
    near = slice(best - 1, best + 2)
    return parabola(shifts[near], scores[near]).at


def _little(
    misfit: Callable[[float], float], known: float, shifts: Floats, scores: Floats
) -> float:
    """Find a shift of less than half a second; 0 within `SAME_CLOCK`."""
    shift = parabola(shifts, scores).at
    if abs(shift) <= 0.5 * SAME_CLOCK:
        return 0.0
    for reach in (0.2, 0.1):
        shifts = np.asarray(shift + reach * np.arange(-1, 2), dtype=np.float64)
        scores = np.array([misfit(float(known + s)) for s in shifts])
        if not np.isfinite(scores).all():
            return 0.0
        shift = parabola(shifts, scores).at
    return shift if abs(shift) > SAME_CLOCK else 0.0


def _misfit(
    drive: Drive,
    vehicle: Vehicle,
    motion: Motion,
    begun: ForceBalance,
    delays: Floats,
) -> tuple[Callable[[float], float], float]:
    """One less the correlation r of force and specific force, and how many windows are behind it.

    Rows are those usable at all ``delays`` and at that of ``begun``. Of a fit of one by the other
    ``1 - r^2`` is left, as a part of the variance.
    """
    setup = begun.setup
    assert setup is not None
    views = {begun.delay: begun.table}
    period = source_signal(drive, vehicle).period
    lagged = in_band(lagged_motion(motion, vehicle.timing.torque_lag), vehicle, period)
    for delay in map(float, delays):
        views[delay] = usable_rows(drive, vehicle, motion, lagged, delay, setup)
    # Rows that come and go with the delay would make its misfit rough.
    common = np.logical_and.reduce(
        [table.usable & np.isfinite(table.traction_force) for table in views.values()]
    )

    def misfit(delay: float) -> float:
        table = views.get(delay)
        if table is None:
            table = force_rows(drive, vehicle, lagged, delay, setup)
        rows = common & np.isfinite(table.traction_force) & np.isfinite(table.specific_force)
        if np.count_nonzero(rows) < 100:
            return float("nan")
        return 1.0 - correlation(force_on_mass(table, vehicle)[rows], table.specific_force[rows])

    return misfit, np.count_nonzero(common) * period / WINDOW
