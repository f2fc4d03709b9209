"""Does the torque follow as fast as the motion? One that is smoothed weighs too little."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from weighbridge.balance.law import force_on_mass
from weighbridge.balance.table import ForceBalance
from weighbridge.constants import INDEPENDENT
from weighbridge.limits import FEWEST_BLOCKS, SIGNIFICANT
from weighbridge.messages import Problem
from weighbridge.navigation import BY_SPEED
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle import Vehicle

FAST: Final = (2.0, 1.0)
"""Changes over these times are lost where the torque is smoothed, over 3 s or over 1 s [s]."""

SLOW: Final = (8.0, 4.0)
"""Changes over this time stay [s]; the second where stops and shifts leave too few of the first."""

SMOOTHED: Final = 0.7
"""Force per acceleration over `FAST` against `SLOW` below which no mass is given [-]: 0.90 to 1.14
in 14 undamaged drives of six vehicles of two simulators, 0.10 to 0.39 with the torque through a low
pass of 3 s; over the shorter time 1.01 in four undamaged drives, 0.61 and 0.63 with 1 s. By speed
alone, over the longer time, 0.72 to 1.62 in 20 undamaged drives of twelve vehicles, 0.26 to 0.49
with 3 s."""

FEWEST_ROWS: Final = 200
"""Fewer changes show nothing. With 100, an electric car with spikes on its accelerometer came out
18 % light; over the shorter time its noise is seen."""

FOLLOWS: Final = 0.5
"""Least correlation of force and acceleration over `SLOW` [-]: beneath, they say nothing."""

MOSTLY_MOTION: Final = 0.5
"""Part of the changes of acceleration that may not be noise, at least [-]."""

THERE: Final = 0.6
"""Part of the time before and after that rows have to cover [-]."""


LONGEST_PERIOD: Final = 0.6
"""Torque that comes less often does not show `FAST` [s]."""


def smoothed_torque(
    balance: ForceBalance,
    vehicle: Vehicle,
    *,
    beside: Floats | float = 0.0,
    noise: Callable[[float], float] = lambda _: 0.0,
) -> Problem | None:
    """Say that quick changes of the force lack in the torque, None if not.

    Means of the rows before and after an instant are compared, over a short and a long time: what
    the force changes by for each change of the specific force is the mass, over both. A torque that
    was filtered lacks the quick changes. Noise of the motion lowers the mass over the short time
    too, and is allowed for as far as it is known. What is not known of it, the speed shows: it has
    no part in the noise of the accelerometer.

    Parameters
    ----------
    balance, vehicle
    beside : (n,) force that is known to be accessories' [N]
    noise : variance of the mean specific force over a time [s] [m^2/s^4]; of a motion by speed
        that of its speed counts

    Returns
    -------
    ``torque.smoothed``, or ``imu.noise`` where it is the accelerometer

    References
    ----------
    Regression with errors of known variance in the regressor, and with a third variable as
    instrument: Fuller, Measurement Error Models, 1987, ch. 1.2, 1.4.
    """
    table, source = balance.table, balance.motion.source
    if source not in ("inertial", *BY_SPEED) or table.time.size < FEWEST_ROWS:
        return None
    if not float(np.median(np.diff(table.time))) <= LONGEST_PERIOD:
        return None

    def variance(span: float) -> float:
        # Speeds at both ends make the mean acceleration.
        by_speed = 2.0 * (balance.motion.speed_std / span) ** 2
        return noise(span) if source == "inertial" else by_speed

    force = force_on_mass(table, vehicle) - beside
    use = table.usable & np.isfinite(force) & np.isfinite(table.specific_force)
    signals = table.time, use, force, table.specific_force
    slow = None
    for span in SLOW:
        slow = slow or _slopes(*signals, span, variance(span))
    if slow is None:
        return None
    for span in FAST if source == "inertial" else FAST[:1]:
        fast = _slopes(*signals, span, variance(span))
        if fast is None or not _lacking(fast, slow):
            continue
        quick, lasting = (float(force.sum() / motion.sum()) for force, motion in (fast, slow))
        quick = max(quick, 0.0)
        found: dict[str, Any] = {"within": 2.0 * span, "quick": quick, "slow": lasting}
        if source == "inertial":
            by_speed = _slopes(*signals, span, variance(span), balance.wheel_speed)
            if by_speed is not None and _there(by_speed, slow):
                return Problem.of("imu.noise", **found)
        return Problem.of("torque.smoothed", **found, source=vehicle.torque.of_source.name)
    return None


def _lacking(fast: tuple[Floats, Floats], slow: tuple[Floats, Floats]) -> bool:
    """Whether quick changes of force are less than slow ones show."""
    if min(np.count_nonzero(fast[1]), np.count_nonzero(slow[1])) < FEWEST_BLOCKS:
        return False
    ratio, std = _ratio(fast, slow)
    return ratio + SIGNIFICANT * std < SMOOTHED


def _there(fast: tuple[Floats, Floats], slow: tuple[Floats, Floats]) -> bool:
    """Whether quick changes of force are there."""
    ratio, std = _ratio(fast, slow)
    return ratio - std > SMOOTHED


def _slopes(
    time: Floats,
    use: Bools,
    force: Floats,
    specific: Floats,
    span: float,
    noise: float,
    speed: Floats | None = None,
) -> tuple[Floats, Floats] | None:
    """Sums over blocks of force times acceleration, and of acceleration squared.

    Both are changes of the mean over ``span`` from before an instant to after it; ``noise`` is the
    variance of such a mean, of which two are in each change. With ``speed`` (n,), both are
    multiplied by its acceleration instead.

    Returns
    -------
    common, square : (k,); None where they show nothing
    """
    if speed is not None:
        use = use & np.isfinite(speed)
    before, after = np.searchsorted(time, time - span), np.searchsorted(time, time + span)
    here = np.arange(time.size)
    count = np.concatenate(([0], np.cumsum(use)))
    whole = (count[after] - count[before] == after - before) & (here - before >= 2)
    whole &= after - here >= 2
    whole &= time[np.maximum(here - 1, 0)] - time[before] > THERE * span
    whole &= time[after - 1] - time > THERE * span
    if np.count_nonzero(whole) < FEWEST_ROWS:
        return None

    def change(x: Floats) -> Floats:
        total = np.concatenate(([0.0], np.cumsum(np.where(use, x, 0.0))))
        later = (total[after] - total[here])[whole] / (after - here)[whole]
        return np.asarray(later - (total[here] - total[before])[whole] / (here - before)[whole])

    by_force, by_motion = change(force), change(specific)
    common, square = by_force * by_motion, by_motion**2 - 2.0 * noise
    if square.sum() < MOSTLY_MOTION * float(by_motion @ by_motion):
        return None
    least = FOLLOWS * np.sqrt(float(by_motion @ by_motion) * float(by_force @ by_force))
    if common.sum() < least and span > max(FAST):
        return None
    if speed is not None:
        # The mean acceleration is the difference of its ends.
        v, t = ([x[k[whole]] for k in (before, here, after - 1)] for x in (speed, time))
        accel = (v[2] - v[1]) / (t[2] - t[1]) - (v[1] - v[0]) / (t[1] - t[0])
        common, square = by_force * accel, by_motion * accel
    block = ((time[whole] - time[0]) / INDEPENDENT).astype(np.int64)
    return np.bincount(block, common).astype(float), np.bincount(block, square).astype(float)


def _ratio(fast: tuple[Floats, Floats], slow: tuple[Floats, Floats]) -> tuple[float, float]:
    """Mass over fast against slow changes, and its standard deviation by the jackknife."""
    size = max(fast[0].size, slow[0].size)
    sums = [np.pad(x, (0, size - x.size)) for x in (*fast, *slow)]
    informative = np.flatnonzero((sums[1] > 0.0) | (sums[3] > 0.0))
    common, square, slow_common, slow_square = (
        x.sum() - np.append(x[informative], 0.0) for x in sums
    )
    ratios = (common / square) / (slow_common / slow_square)
    left = ratios[:-1] - float(np.mean(ratios[:-1]))
    return float(ratios[-1]), float(
        np.sqrt((informative.size - 1) / informative.size * (left @ left))
    )
