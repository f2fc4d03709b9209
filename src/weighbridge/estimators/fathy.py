"""Mass from the quick changes of force and motion, where there are any (Fathy et al. 2008)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.constants import INDEPENDENT
from weighbridge.errors import ConfigError
from weighbridge.estimators.judging import nothing
from weighbridge.estimators.rls import jackknife
from weighbridge.estimators.track import MassTrack
from weighbridge.estimators.unmeasured_grade import (
    FEWEST_ROWS,
    UnmeasuredGradeSettings,
    blocks_of,
    finish,
    settled_rows,
)
from weighbridge.kernels.first_order import first_order
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.possible import positive

METHOD = "fathy-events"


@dataclass(frozen=True, slots=True, kw_only=True)
class FathySettings(UnmeasuredGradeSettings):
    """Settings of filters, supervisor and gate; only the abstract was at hand: all are chosen.

    Attributes
    ----------
    slow, fast : time constants between which force and acceleration pass [s]: slower changes are
        those of hills, drag and rolling resistance, quicker ones are noise
    least_change, full_change : a change of the acceleration counts nothing below the first, in
        full from the second on, and in proportion between [m/s^2]
    """

    slow: float = 5.0
    fast: float = 0.1
    least_change: float = 0.05
    full_change: float = 0.1

    def __post_init__(self) -> None:
        UnmeasuredGradeSettings.__post_init__(self)
        for name in ("slow", "fast", "least_change", "full_change"):
            positive(name, getattr(self, name))
        if not (self.fast < self.slow and self.least_change < self.full_change):
            raise ConfigError("fast must be below slow, and least_change below full_change")


def estimate(
    balance: ForceBalance, vehicle: Vehicle, settings: FathySettings | None = None
) -> MassTrack:
    """Weigh by least squares of band-passed force on band-passed acceleration, in events alone.

    Over a few seconds of acceleration the inertia of the vehicle outweighs all else. A supervisor
    weighs each row by how far its acceleration departs from the slow one.

    Parameters
    ----------
    balance, vehicle
    settings : the defaults when None

    References
    ----------
    Fathy, Kang and Stein, Online vehicle mass estimation using recursive least squares and
    supervisory data extraction, American Control Conference, 2008, 1842-1848. Its abstract states
    conservative errors, in the sense of three standard deviations.
    """
    settings = settings or FathySettings()
    rows = settled_rows(balance, vehicle, settings)
    index = rows.taken
    if index.size < FEWEST_ROWS:
        return nothing(METHOD, balance, vehicle, rows.reason, 0, settings)
    taken = np.isin(np.arange(rows.time.size), index)
    quick = []
    for values in (rows.accel, rows.force):
        # The filters begin anew after each interruption.
        smooth = first_order(rows.time, np.where(taken, values, np.nan), settings.fast)
        quick.append(np.nan_to_num(smooth - first_order(rows.time, smooth, settings.slow)))
    accel, force = quick
    trust = (np.abs(accel) - settings.least_change) / (settings.full_change - settings.least_change)
    weight = np.clip(trust, 0.0, 1.0)
    cross, power = weight * accel * force, weight * accel**2

    def mass_of(part: slice, block: float) -> tuple[float, float, int]:
        number = blocks_of(rows.time[part], block)
        return jackknife(number, cross[part], power[part])

    with np.errstate(invalid="ignore"):
        running = np.cumsum(cross) / np.cumsum(power)
    return finish(
        METHOD,
        balance,
        vehicle,
        rows,
        settings,
        running=running,
        running_std=np.full(running.size, mass_of(slice(0, running.size), INDEPENDENT)[1]),
        mass_of=mass_of,
    )
