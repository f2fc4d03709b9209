"""What published methods share that take the grade of the road as unknown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from weighbridge.balance import ForceBalance, Reason
from weighbridge.balance.law import force_on_mass, mass_column
from weighbridge.constants import INDEPENDENT
from weighbridge.estimators.fit_std import Fitted, judged
from weighbridge.estimators.gate import GateSettings
from weighbridge.estimators.judging import consider_std, converged_at, nothing, segments
from weighbridge.estimators.track import MassTrack
from weighbridge.signals import Floats, Ints
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.possible import not_negative

FEWEST_ROWS = 20
"""With fewer rows no method begins."""


# Without slots, so that settings can have it as a base.
@dataclass(frozen=True, kw_only=True)
class UnmeasuredGradeSettings(GateSettings):
    """Settings of rows and gate.

    Attributes
    ----------
    settle : after a brake, a shift or a stop, rows are left out for so long [s]: the torque builds
        up, and shafts swing. Simulated trucks came out 15 to 20 % heavy by rows without grade
        where they were taken, and within 5 % without them
    """

    settle: float = 1.0

    def __post_init__(self) -> None:
        GateSettings.__post_init__(self)
        not_negative("settle", self.settle)


class Rows(NamedTuple):
    """Rows that a method takes.

    Attributes
    ----------
    time : (n,) of all rows [s]
    force : (n,) that moves, lifts and rolls the mass [N]
    accel : (n,) rate of change of the speed [m/s^2]
    reason : (n,) why a row is not taken
    taken : (m,) those that count, rising
    """

    time: Floats
    force: Floats
    accel: Floats
    reason: NDArray[np.uint8]
    taken: Ints


def settled_rows(
    balance: ForceBalance, vehicle: Vehicle, settings: UnmeasuredGradeSettings
) -> Rows:
    """Return the rows without a reason against them, ``settle`` after each interruption."""
    table = balance.table
    force = force_on_mass(table, vehicle)
    reason = table.reason.copy()
    known = np.isfinite(force) & np.isfinite(table.accel) & np.isfinite(table.speed)
    reason[(reason == Reason.USED) & ~known] = Reason.NO_MOTION
    taken = reason == Reason.USED
    since = np.where(taken, -np.inf, table.time)
    interrupted = np.maximum.accumulate(since) if since.size else since
    reason[taken & (table.time - interrupted < settings.settle)] = Reason.TOO_SHORT
    index = np.flatnonzero(reason == Reason.USED)
    return Rows(table.time, force, table.accel, reason, index)


def blocks_of(time: Floats, length: float = INDEPENDENT) -> Ints:
    """Return the number of the block of each row (n,)."""
    return np.asarray((time - time[0]) // length, dtype=np.int64)


def finish(
    method: str,
    balance: ForceBalance,
    vehicle: Vehicle,
    rows: Rows,
    settings: UnmeasuredGradeSettings,
    *,
    running: Floats,
    running_std: Floats,
    mass_of: Callable[[slice, float], tuple[float, float, int]],
) -> MassTrack:
    """Judge the mass of a method and make its track.

    Parameters
    ----------
    method : name of the estimator
    balance, vehicle, rows, settings
    running, running_std : (n,) mass as the rows until then have it, and its standard deviation
        [kg]; NaN where a row adds nothing: the mass before it stays
    mass_of : mass of some rows and its standard deviation [kg], and the blocks of a length [s]
        behind them
    """
    table = balance.table
    used = rows.reason == Reason.USED
    phi = mass_column(table, vehicle)
    mass, scatter, blocks = mass_of(slice(0, table.time.size), INDEPENDENT)
    if not (np.isfinite(mass) and mass > 0.0):
        return nothing(method, balance, vehicle, rows.reason, blocks, settings)
    slow = consider_std(balance, phi, used, vehicle)
    running = running[
        np.maximum.accumulate(np.where(np.isfinite(running), np.arange(used.size), 0))
    ]
    fitted = Fitted(
        mass=mass,
        scatter=scatter,
        blocks=blocks,
        index=rows.taken,
        influence=phi[used] / np.sum(phi[used] ** 2),
    )
    # Nothing measured the grade: noise of the specific force costs nothing.
    found = judged(balance, vehicle, used, phi, fitted, slow, 0.0, settings)
    return MassTrack(
        method=method,
        balance=balance,
        running_mass=running,
        running_std=np.hypot(running_std, running * slow),
        residual=np.where(used, rows.force - phi * mass, np.nan),
        row_reason=rows.reason,
        mass=mass,
        std=found.std,
        systematic_std=found.systematic_std,
        degrees_of_freedom=found.degrees_of_freedom,
        bound_std=float("nan"),
        converged_at=converged_at(table.time, running, mass, used),
        status=found.status,
        reason=found.reason,
        segments=segments(
            balance, vehicle, phi, used, lambda part: mass_of(part, 20.0)[:2], settings
        ),
    )
