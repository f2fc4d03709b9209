"""Robust least squares and Kalman filter blended by speed (Du et al. 2025, sec. 3.3)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.errors import ConfigError
from weighbridge.estimators import ekf, robust_rls
from weighbridge.estimators.gate import GateSettings
from weighbridge.estimators.track import MassTrack
from weighbridge.kernels import hybrid_mass as kernel
from weighbridge.vehicle.model import Vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class HybridSettings(GateSettings):
    """Settings of both filters, of their blend and of the gate.

    Attributes
    ----------
    ekf : of the Kalman filter and of the least squares that start it
    blend_speed, blend_width : middle and width of the logistic curve by which the
        share of the least squares falls with speed [m/s]
    """

    ekf: ekf.EkfFilter = field(default_factory=ekf.EkfFilter)
    blend_speed: float = 6.0
    blend_width: float = 1.0

    def __post_init__(self) -> None:
        GateSettings.__post_init__(self)
        if not self.blend_width > 0.0:
            raise ConfigError(f"blend_width must be positive, got {self.blend_width}")


def parameters(settings: HybridSettings, vehicle: Vehicle, period: float) -> kernel.HybridParams:
    """Make the kernel's parameters for a vehicle and rows ``period`` apart [s]."""
    rls = robust_rls.parameters(settings.ekf.start, period)
    return kernel.HybridParams(
        rls=rls,
        ekf=ekf.parameters(settings.ekf, vehicle, period),
        first_information=settings.ekf.start.first_information / rls.window,
        start_std=settings.ekf.start_std,
        blend_speed=settings.blend_speed,
        blend_width=settings.blend_width,
    )


def estimate(
    balance: ForceBalance, vehicle: Vehicle, settings: HybridSettings | None = None
) -> MassTrack:
    """Weigh by both filters and blend their masses by the speed of the moment.

    The final answer blends the final answers of both, by the mean share over
    the rows, each counted with what it says of the mass.

    Parameters
    ----------
    balance, vehicle
    settings : the defaults when None

    References
    ----------
    Du et al. 2025, eq. 34.
    """
    settings = settings or HybridSettings()
    table = balance.table
    phi, y, valid = robust_rls.rows(table, vehicle, settings.ekf.start)
    params = parameters(settings, vehicle, robust_rls.row_period(table.time))
    rows = ekf.columns(balance, vehicle, valid)
    start = kernel.initial_state(robust_rls.initial_state(), params)  # type: ignore[no-untyped-call]
    _, mass, var, share, _, _, mean_phi, mean_y, _, _ = kernel.run(start, rows, phi, y, params)
    fit = robust_rls.window_fit(table.time, mean_phi, mean_y, params.rls)
    row_reason = robust_rls.window_reason(table, valid, mean_phi)
    counted = np.where(row_reason == 0, np.nan_to_num(phi) ** 2, 0.0)

    def final(chosen: slice) -> float:
        weight = counted[chosen]
        if not weight.sum() > 0.0:
            return float("nan")
        mean_share = float(np.average(share[chosen], weights=weight))
        time = table.time[chosen]
        fitted = fit.mass(float(time[0]), float(time[-1]))[0]
        filtered = ekf.constant_mass(rows, chosen, fit.mass()[0], params.ekf)
        return mean_share * fitted + (1.0 - mean_share) * filtered

    return robust_rls.finish(
        "hybrid",
        balance,
        vehicle,
        fit,
        row_reason,
        gate=settings,
        running=mass,
        spread=np.sqrt(var),
        phi=phi,
        y=y,
        final=final,
    )
