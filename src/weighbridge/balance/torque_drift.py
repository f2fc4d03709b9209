"""Does the torque come later and later against the motion? A queue that fills, a clock of its own.

The clocks of whole tables are brought together by speed and accelerometer
(`weighbridge.navigation.clock_drift`). A torque that drifts against the other signals of its
table shows in the force alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.balance.force_balance import force_balance
from weighbridge.balance.law import drag_force
from weighbridge.balance.table import ForceBalance, ForceTable
from weighbridge.errors import DriveError
from weighbridge.limits import CERTAIN, FEWEST_PIECES, MANY
from weighbridge.messages import Problem, phrase, refused
from weighbridge.navigation import BY_SPEED, Motion
from weighbridge.signals import Drive, Floats, Signal, median_of_three, median_slope, spread
from weighbridge.signals.interpolation import interpolate
from weighbridge.signals.lag import STEP, best_lag
from weighbridge.vehicle import Vehicle, source_of

PIECE: Final = 240.0
"""Force and motion are compared over so long [s], every half of it anew."""

SHIFTS: Final[Floats] = STEP * np.arange(-10.0, 41.0)
"""Lags that are tried [s]."""

AGREES: Final = 0.85
"""Correlation of force and specific force from which on a lag is believed [-]: simulated drives had
0.89 to 1.00 in traffic, with 3 s of drift as well. On a motorway with 0.74 to 0.84 the lags of an
undamaged diesel scatter by 0.3 s: with 0.7 two of its drives in the corpus were refused."""

DRIFTS: Final = 0.3
"""Smaller changes over a drive are left [s]: the lags of the pieces of twelve undamaged drives
stayed within 0.22 s."""

WANDERS: Final = 0.8
"""A lag that changes by more, in no even way, is no clock [s]."""


@dataclass(frozen=True, slots=True)
class ForceLags:
    """How late the force is against the motion, by pieces of a drive.

    Attributes
    ----------
    time : (k,) middles of the pieces [s]
    lag : (k,) beyond the delay that the balance reckons with [s]
    """

    time: Floats
    lag: Floats


def force_lags(table: ForceTable, vehicle: Vehicle, motion: Motion) -> ForceLags:
    """Find the lag of best correlation in each piece; pieces that show none are left out."""
    specific = np.where(motion.valid, motion.specific_force, np.nan)
    force = table.traction_force - drag_force(table, vehicle)
    usable = table.usable & np.isfinite(force)
    found: list[tuple[float, float]] = []
    if table.time.size < 2:
        return ForceLags(np.empty(0), np.empty(0))
    stride = max(1, round(STEP / float(np.median(np.diff(table.time)))))
    for begin in np.arange(table.time[0], table.time[-1] - 0.5 * PIECE, 0.5 * PIECE):
        first, last = np.searchsorted(table.time, (begin, begin + PIECE))
        here = np.flatnonzero(usable[first:last])[::stride] + first
        if here.size < MANY:
            continue
        moved = interpolate(table.time[here] - SHIFTS[:, None], motion.time, specific)
        whole = np.isfinite(moved).all(axis=0)
        if np.count_nonzero(whole) < MANY:
            continue
        lag = best_lag(force[here][whole], moved[:, whole], SHIFTS)
        if np.isfinite(lag.at) and lag.correlation >= AGREES:
            found.append((float(begin) + 0.5 * PIECE, lag.at))
    time, lags = np.array(found).reshape(-1, 2).T
    return ForceLags(time, lags)


def smoothed_steps(
    drive: Drive, vehicle: Vehicle, balance: ForceBalance
) -> tuple[Drive, tuple[Problem, ...], ForceBalance]:
    """Move the stamps of a torque that drifts, so that it stays as late as it began.

    Parameters
    ----------
    drive, vehicle
    balance : of these, roughly at the delay of the torque

    Returns
    -------
    drive : as it was where nothing drifts
    notes : what was moved
    balance : of that drive, at the same delay

    Raises
    ------
    DriveError
        The lag wanders in no even way.
    """
    source, motion = source_of(vehicle), balance.motion
    if motion.source in BY_SPEED or drive.info.trusted or source.combined is not None:
        return drive, (), balance
    carrier = source.carrier(drive)
    before = force_lags(balance.table, vehicle, motion)
    slope, scatter = _line(before)
    reach = float(np.ptp(before.time)) if before.time.size else 0.0
    if abs(slope) * reach <= max(DRIFTS, CERTAIN * scatter):
        if before.lag.size >= FEWEST_PIECES and np.ptp(median_of_three(before.lag)) > WANDERS:
            raise _wanders(drive, carrier, before)
        return drive, (), balance
    moved = carrier.time - slope * (carrier.time - before.time[0])
    rising = np.concatenate(([True], np.diff(np.maximum.accumulate(moved)) > 0.0))
    corrected = drive.with_signals(Signal(carrier.name, moved[rising], carrier.values[rising]))
    balance = force_balance(corrected, vehicle, motion, delay=balance.delay)
    after = force_lags(balance.table, vehicle, motion)
    if after.lag.size >= FEWEST_PIECES and np.ptp(median_of_three(after.lag)) > WANDERS:
        raise _wanders(drive, carrier, before)
    grows = phrase("later_and_later" if slope > 0.0 else "earlier_and_earlier")
    note = Problem.of(
        "torque.late_drift", carrier.name, grows=grows, change=abs(slope) * reach, reach=reach
    )
    return corrected, (note,), balance


def _wanders(drive: Drive, carrier: Signal, found: ForceLags) -> DriveError:
    low, high = float(found.lag.min()), float(found.lag.max())
    return refused("torque.late_wanders", carrier.name, drive=drive.name, low=low, high=high)


def _line(found: ForceLags) -> tuple[float, float]:
    """Robust slope of the lag over time [-] and scatter of a piece about the line [s]."""
    if found.lag.size < FEWEST_PIECES:
        return 0.0, 0.0
    slope = median_slope(found.time, found.lag)
    left = found.lag - slope * found.time
    return slope, spread(left - np.median(left))
