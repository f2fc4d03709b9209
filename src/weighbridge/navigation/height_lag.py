"""How late heights are against speed and torque, where no inertial sensor feels the hills."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from weighbridge.limits import CERTAIN, DRIVES, FEWEST_BLOCKS, MANY
from weighbridge.signals import Bools, Drive, Floats, lowest, robust_fits

READINGS: Final = ("engine_torque", "engine_torque_fraction", "engine_load")
"""What goes with the torque; the first that was recorded is taken."""

LAGS: Final[tuple[Floats, ...]] = (np.arange(-8.0, 8.5, 1.0), np.arange(-30.0, 30.5, 1.0))
"""Lags of the heights that are tried, and those where an end of them is best [s]."""

OF_READING: Final = 0.3
"""How late the torque usually is [s]: one that is later makes the lag smaller by the rest."""

WINDOW: Final = 4.0
"""Means over so long are compared [s]: heights show hills no faster."""

BLOCK: Final = 60.0
"""Blocks that are left out one after another for how sure the lag is [s]."""

LEAST: Final = 1.5
"""Smaller lags are left [s]: in hills 1 s was worth 2 % of the mass at most."""

GAIN: Final = 0.1
"""Part of what is left unexplained that the lag explains at least [-]: 0.097 at most in 224
undamaged drives of 24 vehicles, two hybrids' engines; 0.08 to 0.43 with heights 3 s late in hills
that matter."""


class HeightLag(NamedTuple):
    """How late heights are.

    Attributes
    ----------
    lag, std : and its standard deviation [s]
    gain : part of what is left without it that it explains [-]
    """

    lag: float
    std: float
    gain: float

    @property
    def shown(self) -> bool:
        """Whether it is surely one."""
        least = max(LEAST, CERTAIN * self.std)
        return abs(self.lag) > least and self.gain > GAIN


def find_height_lag(
    drive: Drive, time: Floats, speed: Floats, accel: Floats, grade: Floats, valid: Bools
) -> HeightLag | None:
    """Find how late the grade of heights is, by what the engine gives; None where nothing shows it.

    The torque at the wheels goes with acceleration, grade and drag. Its scale and that of each is
    left free, so that no vehicle need be known.

    Parameters
    ----------
    drive : with a reading that goes with the torque
    time, speed, accel, grade : (n,) even, of the motion by speed [s], [m/s], [m/s^2], [rad]
    valid : (n,) rows of sound speed

    References
    ----------
    Standard deviation by leaving out blocks: Efron, Stein, Annals of Statistics 9, 1981.
    """
    reading = next((s for name in READINGS if (s := drive.get(name)) is not None), None)
    if reading is None or len(reading) < MANY:
        return None
    engine = drive.get("engine_speed")
    known = valid & (speed > DRIVES) & np.isfinite(accel + grade)
    known &= (time > reading.time[0]) & (time < reading.time[-1] - OF_READING)
    known &= reading.age(time) < 2.0 * reading.period + OF_READING
    gearing = np.ones(time.size)
    if engine is not None and len(engine) > MANY:
        known &= engine.age(time) < 2.0 * engine.period
        gearing = np.asarray(engine.at(time) / np.maximum(speed, DRIVES))
        known &= np.isfinite(gearing)
    window = ((time - time[0]) / WINDOW).astype(np.int64)[known]
    count = np.bincount(window, minlength=1)
    whole = count > 0.9 * count.max(initial=0)
    if np.count_nonzero(whole) < MANY:
        return None

    def means(x: Floats) -> Floats:
        return np.asarray(np.bincount(window, x[known])[whole] / count[whole])

    rest = np.column_stack([means(accel), means(speed**2), np.ones(np.count_nonzero(whole))])
    force = means(reading.at(time + OF_READING) * gearing)
    begins = WINDOW * np.flatnonzero(whole)
    block = np.unique((begins / BLOCK).astype(np.int64), return_inverse=True)[1]
    blocks = int(block.max()) + 1
    if blocks < FEWEST_BLOCKS:
        return None
    for lags in LAGS:
        columns = np.array(
            [np.column_stack([rest, means(np.interp(time + lag, time, grade))]) for lag in lags]
        )
        y = np.tile(force, (lags.size, 1))
        fit, weight = robust_fits(columns, y)
        left = weight * (y - np.einsum("bnk,bk->bn", columns, fit)) ** 2
        by_block = np.array([np.bincount(block, row, minlength=blocks) for row in left])
        total = by_block.sum(axis=1)
        usual = float(total[np.abs(lags) <= LEAST].min())
        gain = 1.0 - float(total.min()) / max(usual, 1e-300)
        if gain <= GAIN or int(np.argmin(total)) not in (0, lags.size - 1):
            break
    others = np.array([lowest(lags, total - by_block[:, k])[0] for k in range(blocks)])
    std = float(np.sqrt((blocks - 1) / blocks * np.sum((others - others.mean()) ** 2)))
    return HeightLag(lowest(lags, total)[0], std, gain)
