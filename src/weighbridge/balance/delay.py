"""How late torque is against motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from weighbridge.balance.averaging import WINDOW
from weighbridge.balance.force_balance import force_rows, usable_rows
from weighbridge.balance.instants import in_band, lagged_motion
from weighbridge.balance.law import force_on_mass
from weighbridge.balance.table import ForceBalance
from weighbridge.constants import GRAVITY
from weighbridge.limits import CERTAIN, SIGNIFICANT
from weighbridge.navigation import BY_SPEED, Motion
from weighbridge.navigation.smoothing import smooth_speed
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

LATE: Final = SIGNIFICANT
"""Standard deviations that torque is later than in the calibration by, on another clock [-]: with
it, and none said against a speed alone, 6 undamaged pairs of the corpus have another clock, 52
before; of the pairs whose clocks are wrong, 31 as before."""

OPEN: Final = (0.0, 0.5)
"""Time constants of a smoothing that a calibration does not exclude [s]: of 59 undamaged drives of
fifteen vehicles, with speed and torque once a second, 29 look smoothed by 0.5 s more."""

ADDED: Final = (1.0, 2.0, 4.0)
"""Time constants by which a torque may be smoothed beyond [s]: with 1 s, vehicles without an
inertial sensor come out 10 to 30 % light, with 2 s 20 to 50 %."""

LATER: Final[Floats] = 0.2 * np.arange(-5.0, 11.0)
"""Shifts of the torque at which a smoothing is looked for [s]."""

FEWEST_ROWS: Final = 100
"""Fewer rows show no lag."""

_NEAR_BY: Final = 0.3
"""Shifts compared with none at first [s]."""

FAR: Final[Floats] = 0.2 * np.arange(-10.0, 21.0)
"""Shifts that are tried where none of these is best [s]."""


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

    Less than `SAME_CLOCK` is no other clock, nor is what drive and calibration are unsure of.
    Little is believed where the misfit is lower there on both sides, more where it explains the
    force better than any lag of the calibration, by `CERTAIN` standard deviations.

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
        return shift if abs(shift) > LATE * unsure else 0.0
    unsure = math.hypot(SAME_CLOCK / LATE, vehicle.timing.torque_delay_std or 0.0)
    return _far(misfit, known, rows, unsure)


def _far(misfit: Callable[[float], float], known: float, rows: float, unsure: float) -> float:
    """Find a shift of any size; 0 where the lag of the calibration explains as much.

    Likelihoods are compared: that of the best lag, and the highest of those that the calibration
    allows for. There each counts for less, the farther it is from the known one.

    Parameters
    ----------
    misfit, rows : of `_misfit`
    known, unsure : lag of the calibration and its standard deviation [s]

    References
    ----------
    Likelihood ratio: Wilks, Annals of Mathematical Statistics 9, 1938.
    """
    scores = np.array([misfit(float(known + shift)) for shift in FAR])
    scores = np.where(np.isfinite(scores), scores, 1.0)
    best = int(np.argmin(scores))
    likelihood = _likelihood(1.0 - scores, rows)
    as_known = float(np.max(likelihood - 0.5 * (FAR / unsure) ** 2))
    at_an_end = best in (0, FAR.size - 1)
    if at_an_end or _by_stds(float(likelihood.max()), as_known) < CERTAIN:
        return 0.0
    near = slice(best - 1, best + 2)
    return parabola(FAR[near], scores[near]).at


def added_lag(drive: Drive, vehicle: Vehicle, begun: ForceBalance) -> float:
    """Find by how much longer the torque is smoothed than in the calibration [s]; 0 if by nothing.

    A motion that passes through the same lag as the torque explains it best. How late the torque is
    stays free, so that another clock is no smoothing. Any lag takes noise off an accelerometer, so
    the acceleration is that of the speed.

    Parameters
    ----------
    drive, vehicle
    begun : balance of these, at the lateness of the torque

    Returns
    -------
    float
        One of `ADDED`, where it explains the force better than `OPEN` by `CERTAIN` standard
        deviations, else 0.

    Raises
    ------
    DriveError
        The drive lacks what the torque source needs.

    References
    ----------
    Likelihood ratio: Wilks, Annals of Mathematical Statistics 9, 1938.
    """
    setup, motion, speed = begun.setup, begun.motion, drive.speed
    assert setup is not None
    if motion.source not in BY_SPEED:
        if speed is None:
            return 0.0
        _, accel, _, _ = smooth_speed(speed, motion.time)
        along = accel + GRAVITY * np.sin(motion.grade)
        motion = replace(motion, accel=accel, specific_force=along)
    period = source_signal(drive, vehicle).period
    lags = [vehicle.timing.torque_lag + added for added in (*OPEN, *ADDED)]
    smoothed = [in_band(lagged_motion(motion, lag), vehicle, period) for lag in lags]
    added = 0.0
    # Few shifts show whether to look closer.
    for shifts, least in ((LATER[::5], 0.0), (LATER, CERTAIN)):
        rows, seen = begun.table.usable, list[tuple[Floats, Floats]]()
        for each in smoothed:
            for later in shifts.tolist():
                table = force_rows(drive, vehicle, each, begun.delay + later, setup)
                seen.append((force_on_mass(table, vehicle), table.specific_force))
                rows = rows & np.isfinite(seen[-1]).all(axis=0)
        if np.count_nonzero(rows) < FEWEST_ROWS:
            return 0.0
        found = [correlation(force[rows], specific[rows]) for force, specific in seen]
        best = np.reshape(found, (-1, shifts.size)).max(axis=1)
        likelihood = _likelihood(best, np.count_nonzero(rows) * period / WINDOW)
        left_open, beyond = np.split(likelihood, [len(OPEN)])
        if not _by_stds(float(beyond.max()), float(left_open.max())) > least:
            return 0.0
        added = ADDED[int(np.argmax(beyond))]
    return added


def _likelihood(correlations: Floats, rows: float) -> Floats:
    """Logarithm of the likelihood of lags (k,), by the variance that each leaves of the force."""
    left = 1.0 - np.maximum(correlations, 0.0) ** 2
    return np.asarray(-0.5 * rows * np.log(left))


def _by_stds(likelihood: float, known: float) -> float:
    """By how many standard deviations one is likelier than what is known, by their logarithms."""
    return math.sqrt(2.0 * max(likelihood - known, 0.0))


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
        if np.count_nonzero(rows) < FEWEST_ROWS:
            return float("nan")
        return 1.0 - correlation(force_on_mass(table, vehicle)[rows], table.specific_force[rows])

    return misfit, np.count_nonzero(common) * period / WINDOW
