"""Extended Kalman filter of speed, grade and mass (Du et al. 2025, sec. 3.2)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.balance import PAUSE, ForceBalance, Reason
from weighbridge.balance.instants import SLOWEST_GEARED
from weighbridge.balance.law import drag_factor, mass_column, ratio_force, rotating_mass
from weighbridge.constants import GRAVITY
from weighbridge.errors import ConfigError
from weighbridge.estimators import robust_rls
from weighbridge.estimators.gate import GateSettings
from weighbridge.estimators.track import MassTrack
from weighbridge.kernels import mass_ekf as kernel
from weighbridge.kernels import robust_rls as rls_kernel
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.possible import not_negative, positive

NOISE_SHARE: Final = 0.5
"""What noise of the motion costs, see `weighbridge.estimators.noisy_motion.row_noise_std` [-]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EkfFilter:
    """Settings of the filter, which is half of the hybrid, too; the paper gives none.

    Attributes
    ----------
    start : the least squares whose first estimate starts the filter
    start_mass : that it starts from, in place of theirs [kg]
    start_std : of the mass it starts from, relative [-]
    start_speed_std, start_grade_std : of speed [m/s] and grade [rad] there; with ``start_std`` and
        ``grade_offset`` the paper's P0
    speed_noise : error of the speed that stays for a second [m/s]
    grade_noise : error of the grade that stays for a second [rad]
    accel_walk : what unknown forces and torque errors do to the speed in one
        second, over mass [m/s]; an error of 0.03 m/s^2 that lasts 5 s is as much
        as white noise of this level
    grade_walk : change of the road's slope in one second [rad]
    mass_walk, load_walk : change of the mass in one second, driving and
        standing, relative [-]
    grade_offset : of the measured grade, at the start [rad]: zero of the
        accelerometer, lean of the vehicle
    offset_walk : change of that offset in one second [rad]
    gate : speed innovations beyond this many standard deviations are left out [-]; inf leaves none
        out, as the paper
    jacobian_window : the model is linearised in the mass at the measured specific force, its mean
        over so long about the row [s]. 0 for that of the model, as the paper: then noise of the
        force draws the mass up. Noise of single rows would draw it down
    """

    start: robust_rls.RobustRlsFilter = field(default_factory=robust_rls.RobustRlsFilter)
    start_mass: float | None = None
    start_std: float = 0.3
    start_speed_std: float = 100.0
    start_grade_std: float = 0.063
    speed_noise: float = 0.01
    grade_noise: float = 0.004
    accel_walk: float = 0.1
    grade_walk: float = 0.003
    mass_walk: float = 0.0005
    load_walk: float = 0.01
    grade_offset: float = 0.003
    offset_walk: float = 1e-4
    gate: float = 5.0
    jacobian_window: float = 2.0

    def __post_init__(self) -> None:
        for name in (
            "start_std", "start_speed_std", "start_grade_std", "speed_noise", "grade_noise",
            "accel_walk",
        ):  # fmt: skip
            positive(name, getattr(self, name))
        if not self.gate > 0.0:
            raise ConfigError(f"gate must be positive, got {self.gate}")
        positive("start_mass", self.start_mass)
        for name in ("grade_walk", "mass_walk", "load_walk", "grade_offset", "offset_walk",
                     "jacobian_window"):  # fmt: skip
            not_negative(name, getattr(self, name))


@dataclass(frozen=True, slots=True, kw_only=True)
class EkfSettings(GateSettings, EkfFilter):
    """Settings of filter and gate."""

    def __post_init__(self) -> None:
        EkfFilter.__post_init__(self)
        GateSettings.__post_init__(self)


def columns(
    balance: ForceBalance, vehicle: Vehicle, valid: Bools, settings: EkfFilter
) -> kernel.Columns:
    """Collect what the filter needs of each row."""
    table = balance.table
    if settings.jacobian_window > 0.0:
        measured = mass_column(table, vehicle)
        regressor = around(table.time, measured, valid, settings.jacobian_window)
    else:
        regressor = np.full(table.time.size, np.nan)
    return kernel.Columns(
        time=table.time,
        traction=np.asarray(table.traction_force - ratio_force(table, vehicle)),
        drag=drag_factor(table, vehicle),
        headwind=table.air_speed - table.speed,
        rotating=rotating_mass(vehicle, table.gearing),
        speed=table.speed,
        grade=table.grade,
        driven=valid & np.isfinite(table.grade),
        standing=np.asarray(table.speed < SLOWEST_GEARED),
        regressor=regressor,
    )


def around(time: Floats, values: Floats, valid: Bools, length: float) -> Floats:
    """Mean of the valid rows within half of ``length`` [s] of each (n,); NaN where there is none.

    Parameters
    ----------
    time : (n,) rising [s]
    values : (n,)
    valid : (n,)
    length : [s]
    """
    known = valid & np.isfinite(values)
    total = np.concatenate(([0.0], np.cumsum(np.where(known, values, 0.0))))
    count = np.concatenate(([0], np.cumsum(known)))
    first = np.searchsorted(time, time - 0.5 * length, side="left")
    last = np.searchsorted(time, time + 0.5 * length, side="right")
    inside = count[last] - count[first]
    mean = (total[last] - total[first]) / np.maximum(inside, 1)
    return np.where(inside > 0, mean, np.nan)


def parameters(settings: EkfFilter, vehicle: Vehicle, period: float) -> kernel.MassEkfParams:
    """Make the kernel's parameters for a vehicle and rows ``period`` apart [s]."""
    lightest, heaviest = vehicle.of_class.mass_range
    mass = vehicle.tare or vehicle.of_class.typical_mass
    return kernel.MassEkfParams(
        gravity=GRAVITY,
        rolling=vehicle.road.rolling_coefficient.value,
        rolling_speed=vehicle.road_load.rolling_speed_coefficient,
        speed_density=settings.speed_noise**2,
        grade_density=settings.grade_noise**2,
        accel_walk=settings.accel_walk**2,
        grade_walk=settings.grade_walk**2,
        mass_walk=(settings.mass_walk * mass) ** 2,
        load_walk=(settings.load_walk * mass) ** 2,
        start_speed_var=settings.start_speed_std**2,
        start_grade_var=settings.start_grade_std**2,
        offset_var=settings.grade_offset**2,
        offset_walk=settings.offset_walk**2,
        gate=settings.gate,
        pause=max(PAUSE, 2.5 * period),
        lightest=lightest,
        heaviest=heaviest,
    )


def constant_mass(
    rows: kernel.Columns, chosen: slice, mass: float, params: kernel.MassEkfParams
) -> float:
    """Mass of some rows over which it does not change [kg]: the filter's last word.

    Parameters
    ----------
    rows : of the drive
    chosen : its rows
    mass : to start from [kg]
    params : of the running filter
    """
    part = kernel.Columns(*(values[chosen] for values in rows))
    if part.time.size == 0 or not np.isfinite(mass):
        return float("nan")
    still = params._replace(mass_walk=0.0, load_walk=0.0)
    start = kernel.initial_state(mass, (0.5 * mass) ** 2, kernel.row_at(part, 0), params)
    return float(kernel.run(start, part, 0, still)[0].x[kernel.MASS])


def filter_reason(balance: ForceBalance, valid: Bools, taken: Bools) -> NDArray[np.uint8]:
    """Reasons of the rows: `Reason.BAD_FIT` where the filter left one out.

    The first row of a stretch only says where the speed starts.
    """
    row_reason = balance.table.reason.copy()
    row_reason[(row_reason == 0) & ~valid] = Reason.NO_MOTION
    first = valid & ~np.concatenate(([False], valid[:-1]))
    row_reason[valid & ~taken] = Reason.BAD_FIT
    row_reason[first & ~taken] = Reason.TOO_SHORT
    return row_reason


def estimate(
    balance: ForceBalance, vehicle: Vehicle, settings: EkfSettings | None = None
) -> MassTrack:
    """Weigh by an extended Kalman filter of speed, grade and mass.

    It starts from the first estimate of the robust least squares. The running
    mass may walk; the final answer is that of the same filter with a mass that
    does not. The standard deviation is that of the least squares: both see the
    same errors, which last longer than the filter's white noise.

    Parameters
    ----------
    balance, vehicle
    settings : the defaults when None

    References
    ----------
    Du et al. 2025, eqs. 21-33.
    """
    settings = settings or EkfSettings()
    balance, vehicle = robust_rls.as_set(balance, vehicle, settings.start)
    table = balance.table
    phi, y, valid = robust_rls.rows(table, vehicle, settings.start)
    rls_params = robust_rls.parameters(settings.start, robust_rls.row_period(table.time))
    _, theta, _, information, mean_phi, mean_y, _ = rls_kernel.run(
        robust_rls.initial_state(settings.start, rls_params.window),
        table.time,
        phi,
        y,
        valid,
        rls_params,
    )
    fit = robust_rls.window_fit(balance, mean_phi, mean_y, rls_params, settings.start)
    params = parameters(settings, vehicle, robust_rls.row_period(table.time))
    rows = columns(balance, vehicle, valid, settings)
    informed = np.flatnonzero(information * rls_params.window >= settings.start.first_information)
    n = table.time.size
    mass, var, taken = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, dtype=bool)
    first = settings.start_mass
    if (informed.size or first is not None) and n:
        k = 0 if first is not None else int(informed[0])
        first = float(theta[k]) if first is None else first
        start = kernel.initial_state(
            first, (settings.start_std * first) ** 2, kernel.row_at(rows, k), params
        )
        _, mass, var, _, taken = kernel.run(start, rows, k, params)
    return robust_rls.finish(
        "ekf",
        balance,
        vehicle,
        fit,
        filter_reason(balance, valid, taken),
        noise_share=NOISE_SHARE,
        gate=settings,
        running=mass,
        spread=np.sqrt(var),
        phi=phi,
        y=y,
        final=lambda chosen: constant_mass(rows, chosen, fit.mass()[0], params),
    )
