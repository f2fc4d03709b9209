"""Mass beside the slow errors that look like it: disturbance, wind, rolling resistance."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.optimize import minimize

from weighbridge.balance import ForceBalance, Reason
from weighbridge.balance.averaging import Windows, windows
from weighbridge.balance.force_balance import MergedView
from weighbridge.estimators.judging import (
    consider_std,
    converged_at,
    judge,
    nothing,
    segments,
)
from weighbridge.estimators.rls import block_jackknife, regression
from weighbridge.estimators.track import MassTrack
from weighbridge.kernels import disturbance as kernel
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle.model import Vehicle

TIME_CONSTANTS: Final = (30.0, 900.0, 600.0, 600.0)
"""How long disturbance, resistance and wind north and east last [s]: gusts, grade and
torque errors half a minute, rolling resistance and offsets a quarter of an hour, mean wind
ten minutes."""

DISTURBANCE_STD: Final = 0.04
"""Standard deviation of the disturbance before the drive has told, over mass [m/s^2]."""

RESISTANCE_STD: Final = 0.017
"""Of the slow resistance, over mass [m/s^2]: a fifth of the rolling resistance of a car."""

WIND_STD: Final = 2.0
"""Of each component of the wind at the vehicle [m/s]."""

MOTION_STD: Final = 0.03
"""Fast error of the specific force before the drive has told [m/s^2]."""

GATE: Final = 5.0
"""Windows with a larger normalised innovation are left out [-]."""

FEWEST_WINDOWS: Final = 40
"""Fewer usable windows carry no mass."""


def design(view: MergedView, vehicle: Vehicle) -> tuple[Floats, Floats]:
    """Rows of the model ``y = phi m + d + c + wind``.

    The drag of a wind small against the speed is linear in it:
    ``rho C_d A v`` times its component along the road.

    Returns
    -------
    rows : (n, 5) for mass, disturbance, resistance and headwind north and east
    y : (n,) traction less drag and rotating inertia [N]
    """
    phi, y = regression(view, vehicle)
    slope = view.air_density * vehicle.road_load.drag_area * view.speed
    north, east = view.direction
    one = np.ones_like(phi)
    return np.column_stack([phi, one, one, slope * north, slope * east]), y


def usable_rows(view: MergedView, rows: Floats, y: Floats) -> Bools:
    """Rows without a reason against them and with finite numbers."""
    return np.asarray(view.usable & np.isfinite(y) & np.isfinite(rows).all(axis=1))


def noise_variance(view: MergedView, cut: Windows, torque_noise: float, mass: float) -> Floats:
    """Variance of the fast noise of each window's mean force [N^2], both sides."""
    torque = cut.mean((torque_noise * np.nan_to_num(view.gearing)) ** 2)
    return np.asarray((torque + (mass * MOTION_STD) ** 2) / cut.count + (mass * 0.008) ** 2)


def filter_params(mass: float, disturbance_std: float) -> kernel.DisturbanceParams:
    """Make the kernel's parameters for a vehicle of about this mass [kg]."""
    return kernel.DisturbanceParams(
        time_constant=np.array([np.inf, *TIME_CONSTANTS]),
        std=np.array([0.0, mass * disturbance_std, mass * RESISTANCE_STD, WIND_STD, WIND_STD]),
        gate=GATE,
        settle=FEWEST_WINDOWS,
    )


def first_guess(phi: Floats, y: Floats) -> float:
    """Robust slope of force on specific force: where the filter starts [kg].

    The filter is linear, so the start only has to be of the right size.
    """
    strong = np.abs(phi) > np.median(np.abs(phi))
    slope = float(np.median(y[strong] / phi[strong]))
    return float(np.clip(slope, 200.0, 60_000.0))


def estimate(balance: ForceBalance, vehicle: Vehicle) -> MassTrack:
    """Weigh by a Kalman filter of mass, disturbance, rolling resistance and wind.

    Usable rows, braking and overrun aside, are averaged over windows of
    `weighbridge.balance.averaging.WINDOW`, both sides over the same rows. The
    levels of fast noise and of the disturbance are those of highest
    likelihood. The mass of a drive is a constant, so the filter's last word
    is the smoothed one.

    Parameters
    ----------
    balance, vehicle

    References
    ----------
    Kalman filter with Gauss-Markov disturbances and maximum likelihood for
    their levels: Gelb, Applied Optimal Estimation, 1974, ch. 3, 4; Schweppe,
    IEEE Trans. Information Theory 11, 1965. Parameters that no data of the
    drive can improve are considered, not estimated: Schmidt, 1966.
    """
    view = balance.merged
    rows, y = design(view, vehicle)
    usable = usable_rows(view, rows, y)
    cut = windows(view.time, usable)
    reason = view.reason.copy()
    reason[usable] = Reason.TOO_SHORT
    reason[cut.index] = Reason.USED
    if cut.count.size < FEWEST_WINDOWS:
        return nothing("joint", balance, vehicle, reason, int(cut.count.size))

    time, mean_rows, mean_y = cut.mean(view.time), cut.mean(rows), cut.mean(y)
    guess = first_guess(mean_rows[:, 0], mean_y)
    torque_noise = vehicle.torque.noise or 0.03 * float(
        np.nanmax(np.abs(balance.force.torque[cut.index]))
    )
    variance = noise_variance(view, cut, torque_noise, guess)

    def run(level: Floats) -> tuple[kernel.DisturbanceState, Floats, Floats, Floats, Bools]:
        fast, slow = np.exp(level)
        params = filter_params(guess, DISTURBANCE_STD * slow)
        prior = np.diag(np.concatenate(([guess**2], params.std[1:] ** 2)))
        start = kernel.initial_state(  # type: ignore[no-untyped-call]
            [guess, 0.0, 0.0, 0.0, 0.0], prior, time[0]
        )
        return kernel.run(  # type: ignore[no-any-return]
            start, time, mean_rows, mean_y, fast**2 * variance, params
        )

    def misfit(level: Floats) -> float:
        # A weak prior keeps the levels within a factor of about three.
        return -run(level)[0].log_likelihood + 0.5 * float(np.sum(level**2))

    level = minimize(misfit, np.zeros(2), method="Nelder-Mead", options={"maxiter": 60}).x
    state, mass_track, mass_var, _, taken = run(level)
    left_out = np.zeros(view.time.size, dtype=bool)
    left_out[cut.index] = ~taken[cut.window]
    reason[left_out] = Reason.BAD_FIT
    used = reason == Reason.USED

    mass = float(state.x[0])
    bound = float(np.sqrt(state.cov[0, 0]))
    slow = consider_std(balance, rows[:, 0], used, vehicle)
    std = float(np.hypot(bound, mass * slow))
    last = np.searchsorted(time, view.time, side="right") - 1
    known = last >= 0
    running = np.where(known, mass_track[np.maximum(last, 0)], np.nan)
    running_std = np.where(known, np.sqrt(mass_var[np.maximum(last, 0)]), np.nan)
    status, why = judge(view, vehicle, used, mass, std, cut.count.size)

    def part(chosen: slice) -> tuple[float, float]:
        wanted = (time >= view.time[chosen][0]) & (time <= view.time[chosen][-1])
        return block_jackknife(
            time[wanted], mean_rows[wanted, 0], mean_y[wanted], taken[wanted], 20.0
        )[:2]

    return MassTrack(
        method="joint",
        balance=balance,
        running_mass=running,
        running_std=np.hypot(running_std, running * slow),
        residual=np.where(used, y - rows[:, 0] * mass, np.nan),
        reason=reason,
        mass=mass,
        std=std,
        degrees_of_freedom=float("inf"),
        bound_std=bound,
        converged_at=converged_at(view.time, running, mass, used),
        status=status,
        why=why,
        segments=segments(balance, vehicle, rows[:, 0], used, part),
    )
