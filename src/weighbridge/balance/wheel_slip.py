"""How much the driven wheels slip for the force that they pass on, by GNSS speed."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from weighbridge.balance.table import ForceTable
from weighbridge.constants import GRAVITY
from weighbridge.limits import SURE
from weighbridge.signals import Drive, Floats

AROUND: Final = 0.5
"""Time around a fix over which the rows are averaged [s]: shorter than a gear change, longer than
the steps of an engine speed."""

SLOWEST: Final = 4.0
"""Slower, a receiver's noise is as large as any slip [m/s]."""

FEWEST: Final = 60
"""Fixes that show a slip, at least; a minute at 1 Hz."""


class WheelSlip(NamedTuple):
    """Slip of the driven wheels per traction over the weight of all that is moved.

    Attributes
    ----------
    slip, std : and its standard deviation [-]
    late, late_std : how much later a speed of the receiver is than one of the engine [s]
    correlation : of the errors of slip and lateness [-]
    """

    slip: float
    std: float
    late: float
    late_std: float
    correlation: float


def wheel_slip(table: ForceTable, mass: float, drive: Drive) -> WheelSlip | None:
    """Find the slip of the driven wheels, ``s = c F / (m g)``.

    The engine in gear turns with the driven wheels, ``w / gearing = v (1 + s)``; the receiver has
    the speed over ground v. A speed that is late differs by the acceleration times its lateness,
    and a wrong rolling radius by a constant part. All three are fitted by least squares.

    Parameters
    ----------
    table : rows of the drive
    mass : of all that is moved [kg]
    drive : with a ``gnss_speed``

    Returns
    -------
    None where fewer than `FEWEST` fixes show it

    References
    ----------
    Slip in proportion to normalised traction, found from wheel speeds: Gustafsson, Slip-based
    tire-road friction estimation, Automatica 33, 1997, eqs. 1 to 8.
    """
    fixes = drive.signals.get("gnss_speed")
    if fixes is None or not mass > 0.0:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        wheel = table.engine_speed / table.gearing
    rows = np.column_stack([wheel, table.traction_force / (mass * GRAVITY), table.accel])
    good = table.usable & np.isfinite(rows).all(axis=1) & (wheel > SLOWEST)
    before, after = np.searchsorted(
        table.time, fixes.time[:, None] + AROUND / 2 * np.array([-1, 1])
    ).T
    count = after - before
    whole = (count > 1) & (_over(good.astype(float), before, after) == count)
    before, after, count = before[whole], after[whole], count[whole]
    speed, pull, accel = (
        _over(np.where(good, values, 0.0), before, after) / count for values in rows.T
    )
    measured = fixes.values[whole]
    columns = np.column_stack([np.ones_like(speed), pull, accel / speed])
    # The noise of a speed does not depend on it.
    y, weight = 1.0 - measured / speed, speed.copy()
    used = np.isfinite(y) & (measured > SLOWEST)
    for _ in range(3):
        if np.count_nonzero(used) < FEWEST:
            return None
        a = columns[used] * weight[used, None]
        found, _, rank, _ = np.linalg.lstsq(a, y[used] * weight[used], rcond=None)
        if rank < columns.shape[1]:
            return None
        left = (y - columns @ found) * weight
        noise = 1.4826 * float(np.median(np.abs(left[used])))
        taken, used = used, np.abs(left) < SURE * noise
    a = columns[taken] * weight[taken, None]
    cov = noise**2 * np.linalg.inv(a.T @ a)
    std, late_std = np.sqrt(cov[1, 1]), np.sqrt(cov[2, 2])
    return WheelSlip(
        slip=float(found[1]),
        std=float(std),
        late=float(found[2]),
        late_std=float(late_std),
        correlation=float(cov[1, 2] / (std * late_std)),
    )


def _over(values: Floats, before: np.ndarray, after: np.ndarray) -> Floats:
    """Sum of the values from each of ``before`` to each of ``after`` (k,)."""
    summed = np.concatenate(([0.0], np.cumsum(values)))
    return np.asarray(summed[after] - summed[before])
