"""An estimator: the median of force over specific force."""

from dataclasses import dataclass

import numpy as np

from weighbridge.balance import Reason
from weighbridge.estimators import Estimator, MassTrack
from weighbridge.estimators.gate import GateSettings
from weighbridge.estimators.judging import Evidence, consider_std, judge, nothing
from weighbridge.estimators.regression import regression


@dataclass(frozen=True, slots=True, kw_only=True)
class MedianSettings(GateSettings):
    """``least``: smallest specific force of a row that counts [m/s^2]; and what a mass needs."""

    least: float = 0.5


def estimate(balance, vehicle, settings=None):
    """Return the mass of the whole drive; the running mass is the same in every row."""
    settings = settings or MedianSettings()
    rows = balance.table
    phi, y = regression(rows, vehicle)
    used = rows.usable & np.isfinite(phi) & np.isfinite(y) & (phi > settings.least)
    row_reason = rows.reason.copy()
    row_reason[(row_reason == Reason.USED) & ~used] = Reason.NOT_ACCELERATING
    # Rows share wind and grade for seconds: a hundredth of them are independent.
    independent = np.count_nonzero(used) // 100
    if independent < 2:
        return nothing("median", balance, vehicle, row_reason, independent, settings)
    ratio = y[used] / phi[used]
    mass = float(np.median(ratio))
    own = float(1.48 * np.median(np.abs(ratio - mass)) / np.sqrt(independent))
    systematic = mass * consider_std(balance, phi, used, vehicle)
    std = float(np.hypot(own, systematic))
    found = Evidence(
        table=rows, used=used, phi=phi, mass=mass, std=std, blocks=independent,
        systematic_std=systematic, motion=balance.motion, gate=settings,
    )  # fmt: skip
    status, reason = judge(found, vehicle)
    return MassTrack(
        method="median",
        balance=balance,
        running_mass=np.full(used.size, mass),
        running_std=np.full(used.size, std),
        residual=np.where(used, y - phi * mass, np.nan),
        row_reason=row_reason,
        mass=mass,
        std=std,
        systematic_std=systematic,
        degrees_of_freedom=float("inf"),
        bound_std=own,
        converged_at=float("nan"),
        status=status,
        reason=reason,
        segments=(),
    )


median = Estimator(name="median", estimate=estimate, settings=MedianSettings, fits=("rls", "joint"))
