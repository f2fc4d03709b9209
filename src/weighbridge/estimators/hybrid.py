"""Robust least squares and Kalman filter blended (Du et al. 2025, sec. 3.3)."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

import numpy as np

from weighbridge.arguments import check_choice
from weighbridge.balance import ForceBalance
from weighbridge.errors import ConfigError
from weighbridge.estimators import ekf, robust_rls
from weighbridge.estimators.gate import GateSettings
from weighbridge.estimators.track import MassTrack
from weighbridge.kernels import hybrid_mass as kernel
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.possible import not_negative, positive, within


class Blend(StrEnum):
    """What gives the share of the least squares.

    Attributes
    ----------
    SPEED : the speed of the moment, as in the paper
    VARIANCE : the inverse of the variances that the two have themselves
    COVARIANCE : the same, their errors correlated
    INTERSECTION : the smaller variance, which is covariance intersection of two numbers
    INNOVATIONS : how well each foretold the forces until then
    SHARE : nothing, it is a number
    """

    SPEED = "speed"
    VARIANCE = "variance"
    COVARIANCE = "covariance"
    INTERSECTION = "intersection"
    INNOVATIONS = "innovations"
    SHARE = "share"


KERNEL_BLENDS: Final = {
    Blend.SPEED: kernel.SPEED,
    Blend.VARIANCE: kernel.VARIANCE,
    Blend.COVARIANCE: kernel.COVARIANCE,
    Blend.INTERSECTION: kernel.INTERSECTION,
    Blend.INNOVATIONS: kernel.INNOVATIONS,
    Blend.SHARE: kernel.SHARE,
}
"""What the kernel calls them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HybridSettings(GateSettings):
    """Settings of both filters, of their blend and of the gate.

    Attributes
    ----------
    ekf : of the Kalman filter and of the least squares that start it
    blend : what gives the share of the least squares; ``speed`` is the paper's
    blend_speed, blend_width : of ``speed``, middle and width of the logistic curve by which
        the share falls [m/s]
    blend_share : of ``share``, the share itself [-]; below zero the Kalman filter is moved
        away from the least squares
    blend_correlation : of ``covariance``, the correlation of both errors [-]
    blend_memory : of ``innovations``, time of driving in which the weight of a forecast
        falls to 1/e [s]
    blend_caution : of ``innovations``, squared noises by which both must have differed
        before the share is half of what the forecasts say [-]
    """

    ekf: ekf.EkfFilter = field(default_factory=ekf.EkfFilter)
    blend: Blend = Blend.INNOVATIONS
    blend_speed: float = 6.0
    blend_width: float = 1.0
    blend_share: float = 0.5
    blend_correlation: float = 0.7
    blend_memory: float = 10.0
    blend_caution: float = 30.0

    def __post_init__(self) -> None:
        GateSettings.__post_init__(self)
        check_choice("blend", self.blend, Blend)
        if not self.blend_width > 0.0:
            raise ConfigError(f"blend_width must be positive, got {self.blend_width}")
        positive("blend_memory", self.blend_memory)
        not_negative("blend_caution", self.blend_caution)
        within("blend_share", self.blend_share, -1.0, 1.0)
        within("blend_correlation", self.blend_correlation, 0.0, 1.0)


def parameters(settings: HybridSettings, vehicle: Vehicle, period: float) -> kernel.HybridParams:
    """Make the kernel's parameters for a vehicle and rows ``period`` apart [s]."""
    rls = robust_rls.parameters(settings.ekf.start, period)
    return kernel.HybridParams(
        rls=rls,
        ekf=ekf.parameters(settings.ekf, vehicle, period),
        first_information=settings.ekf.start.first_information / rls.window,
        start_mass=settings.ekf.start_mass or 0.0,
        start_std=settings.ekf.start_std,
        blend=KERNEL_BLENDS[Blend(settings.blend)],
        blend_speed=settings.blend_speed,
        blend_width=settings.blend_width,
        share=settings.blend_share,
        correlation=settings.blend_correlation,
        forgetting=float(np.exp(-rls.window / settings.blend_memory)),
        caution=settings.blend_caution,
    )


def estimate(
    balance: ForceBalance, vehicle: Vehicle, settings: HybridSettings | None = None
) -> MassTrack:
    """Weigh by both filters and blend their masses.

    The final answer blends the final answers of both, by the mean share over
    the rows, each counted with what it says of the mass. With ``innovations`` it
    is their mean: both have seen every row, and their errors are alike.

    Parameters
    ----------
    balance, vehicle
    settings : the defaults when None

    References
    ----------
    Du et al. 2025, eq. 34. Equal weights of alike estimates: Bates and Granger, Operational
    Research Quarterly 20, 1969.
    """
    settings = settings or HybridSettings()
    balance, vehicle = robust_rls.as_set(balance, vehicle, settings.ekf.start)
    table = balance.table
    phi, y, valid = robust_rls.rows(table, vehicle, settings.ekf.start)
    params = parameters(settings, vehicle, robust_rls.row_period(table.time))
    rows = ekf.columns(balance, vehicle, valid, settings.ekf)
    begin = robust_rls.initial_state(settings.ekf.start, params.rls.window)
    start = kernel.initial_state(begin, params)  # type: ignore[no-untyped-call]
    _, mass, var, share, _, _, mean_phi, mean_y, _, _ = kernel.run(start, rows, phi, y, params)
    fit = robust_rls.window_fit(balance, mean_phi, mean_y, params.rls, settings.ekf.start)
    row_reason = robust_rls.window_reason(table, valid, mean_phi)
    counted = np.where(row_reason == 0, np.nan_to_num(phi) ** 2, 0.0)

    def final(chosen: slice) -> float:
        weight = counted[chosen]
        if not weight.sum() > 0.0:
            return float("nan")
        mean_share = float(np.average(share[chosen], weights=weight))
        if Blend(settings.blend) is Blend.INNOVATIONS:
            mean_share = 0.5
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
        noise_share=ekf.NOISE_SHARE,
        gate=settings,
        running=mass,
        spread=np.sqrt(var),
        phi=phi,
        y=y,
        final=final,
    )
