"""Do hills take as much force as heights say? Heights in feet make roads 3.3 times as steep."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from weighbridge.balance.averaging import windows
from weighbridge.balance.law import force_on_mass, mass_column
from weighbridge.balance.table import ForceBalance
from weighbridge.constants import GRAVITY, INDEPENDENT
from weighbridge.limits import FEWEST_BLOCKS
from weighbridge.messages import Problem, phrase
from weighbridge.signals import UNITS
from weighbridge.vehicle import Vehicle

STEEPEST: Final = 0.6
"""Force of hills over what heights say, relative to that of acceleration, at least [-]: 0.57 to
1.34 in 18 undamaged drives of eleven vehicles, none of them below 0.6 for sure; 0.15 to 0.41 with
their heights in feet."""

FLATTEST: Final = 2.0
"""The same at most [-]: 2.0 with noise of 1.5 m on the heights of a van, and 2.4 to 4.3 where
heights in metres are taken for feet."""

SURE: Final = 3.0
"""Standard deviations by which it is beyond [-]: of the corpus 13 drives are, all with
heights in another unit."""

ALIKE: Final = 0.35
"""A ratio is that of a unit within so much of its logarithm [-]: of the drives above within 0.3."""


def height_scale(
    balance: ForceBalance, vehicle: Vehicle, signal: str, unit: str | None = None
) -> Problem | None:
    """Say that heights or grades are another factor of the road's, None if not.

    The force on the mass goes with acceleration and with grade alike. So the mass is the same by
    both, whatever the vehicle's scale of torque; heights in another unit make two of it.

    Parameters
    ----------
    balance : with grade by heights, and acceleration by speed
    vehicle
    signal : altitude or grade, whichever shows the hills
    unit : in which the drive's file states it; None where it is not known

    References
    ----------
    Standard deviation by leaving out blocks: Efron, Stein, Annals of Statistics 9, 1981.
    """
    table = balance.table
    if balance.motion.source != "speed_grade":
        return None
    force, along = force_on_mass(table, vehicle), GRAVITY * np.sin(table.grade)
    rest = mass_column(table, vehicle) - along
    cut = windows(table.time, table.usable & np.isfinite(force + rest + along))
    if cut.count.size < 2:
        return None
    time, y = cut.mean(table.time), cut.mean(force)
    columns = cut.mean(np.column_stack([rest, along]))
    block = np.unique(((time - time[0]) / INDEPENDENT).astype(np.int64), return_inverse=True)[1]
    count = int(block.max()) + 1
    if count < FEWEST_BLOCKS:
        return None
    square, product = np.zeros((count, 2, 2)), np.zeros((count, 2))
    np.add.at(square, block, columns[:, :, None] * columns[:, None, :])
    np.add.at(product, block, columns * y[:, None])
    # The first of these sums leaves no block out.
    kept = 1.0 - np.eye(count + 1, count, -1)
    squares, products = np.tensordot(kept, square, 1), kept @ product
    if not np.all(np.linalg.det(squares) > 0.0):
        return None
    by_motion, by_hills = np.linalg.solve(squares, products[:, :, None])[:, :, 0].T
    if not np.all(by_motion > 0.0):
        return None
    ratios = by_hills / by_motion
    ratio = float(ratios[0])
    std = float(np.sqrt((count - 1) / count * np.sum((ratios[1:] - ratios[1:].mean()) ** 2)))
    # Hills of heights that are noise alone, on a flat road, take no force either way.
    steep = ratio + SURE * std < STEEPEST and abs(ratio) > SURE * std
    flat = ratio - SURE * std > FLATTEST
    if not (steep or flat):
        return None
    feet, factor = unit == "ft", UNITS["ft"].factor
    as_feet = ratio / (factor if steep else 1.0 / factor)
    like_feet = as_feet > 0.0 and abs(np.log(as_feet)) < ALIKE
    remedy = "check_or_leave_out"
    if signal == "altitude" and steep != feet and like_feet:
        remedy = "altitude_feet" if steep else "altitude_metres"
    found: dict[str, Any] = {"ratio": 1.0 / ratio, "std": std / ratio**2, "remedy": phrase(remedy)}
    return Problem.of("altitude.scale", signal, **found)
