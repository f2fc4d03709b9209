"""From a vehicle calibrated by eq. 48 to one calibrated as the joint estimator weighs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.balance.delay import best_delay
from weighbridge.balance.force_balance import ForceBalance
from weighbridge.calibration.inverse import DriveRows, InverseFit, fit
from weighbridge.estimators import joint
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle.model import RoadLoad, Vehicle

LAGS: Final = (0.0, 0.1, 0.2, 0.3, 0.45)
"""Time constants of the reading's smoothing that are tried [s]."""

TRANSFER_STD: Final = 0.008
"""What a joint calibration loses on other drives, relative [-]: simulated, twelve
calibrations of nine cars on one ordinary drive each, ten drives weighed with each: their
means scatter by 0.6 %, the drives of one calibration by 0.5 % around them."""

BalanceAt = Callable[[int, float, float], tuple[ForceBalance, Floats, Bools]]
"""Balance, reading and usable rows of drive k at a delay and a lag [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointProblem:
    """What is fitted, and to what.

    Attributes
    ----------
    balance_at : rows of each drive at a delay and lag
    masses : known mass of each drive [kg]
    order, curved : of the torque regression
    torque_noise : of one reading [N m]
    """

    balance_at: BalanceAt
    masses: Sequence[float]
    order: int
    curved: bool
    torque_noise: float


def refine(
    vehicle: Vehicle,
    problem: JointProblem,
    rebalance: Callable[[Vehicle], Sequence[ForceBalance]],
) -> Vehicle:
    """Fit torque, road load, delay and lag anew by likelihood.

    Parameters
    ----------
    vehicle : calibrated by eq. 48
    problem : the drives
    rebalance : balances of the drives with a given vehicle

    Raises
    ------
    DriveError
        The drives are too short.
    """

    def solve(delay: float, lag: float, rounds: int) -> InverseFit:
        rows = []
        for k, mass in enumerate(problem.masses):
            balance, reading, usable = problem.balance_at(k, delay, lag)
            rows.append(
                DriveRows(
                    view=balance.merged,
                    regressor=reading,
                    engine_speed=balance.force.engine_speed,
                    usable=usable,
                    mass=mass,
                )
            )
        line = vehicle.driveline
        return fit(
            rows,
            vehicle.kind,
            line.wheel_radius,
            order=problem.order,
            curved=problem.curved,
            torque_noise=problem.torque_noise,
            inertias=(line.engine_inertia, line.wheel_inertia) if line.single_speed else None,
            rounds=rounds,
        )

    def misfit(delay: float, lag: float) -> float:
        found = solve(delay, lag, 1)
        return -found.log_likelihood / found.windows

    start = vehicle.timing.torque_delay or 0.0
    best = (np.inf, start, 0.0)
    for lag in LAGS:
        delay = best_delay(
            lambda d, lag=lag: misfit(d, lag),  # type: ignore[misc]
            start=start - lag - 0.25,
            end=start - lag + 0.25,
        )
        if np.isfinite(delay):
            best = min(best, (misfit(delay, lag), delay, lag))
    _, delay, lag = best
    return _self_weighed(
        _with(vehicle, solve(delay, lag, 3), delay, lag, problem), problem, rebalance
    )


def _with(
    vehicle: Vehicle, found: InverseFit, delay: float, lag: float, problem: JointProblem
) -> Vehicle:
    straight = found.coefficients.size - 2 * problem.curved
    values = [float(w) for w in found.coefficients]
    stds = [float(s) for s in found.stds]
    road = np.maximum(found.road, 0.0)
    return replace(
        vehicle,
        torque=replace(
            vehicle.torque,
            coefficients=tuple(values[:straight]),
            coefficient_stds=tuple(stds[:straight]),
            curvature=tuple(values[straight:]),
            curvature_stds=tuple(stds[straight : found.coefficients.size]),
        ),
        road_load=RoadLoad(
            drag_area=float(road[0]),
            rolling_coefficient=float(road[1]),
            drag_area_std=stds[-4],
            rolling_coefficient_std=stds[-3],
        ),
        driveline=replace(
            vehicle.driveline,
            engine_inertia=float(road[2]),
            engine_inertia_std=stds[-2],
            wheel_inertia=float(road[3]),
            wheel_inertia_std=stds[-1],
        ),
        timing=replace(vehicle.timing, torque_delay=delay, torque_lag=lag),
        provenance=replace(vehicle.provenance, notes="calibrated for method joint"),
    )


def _self_weighed(
    vehicle: Vehicle,
    problem: JointProblem,
    rebalance: Callable[[Vehicle], Sequence[ForceBalance]],
) -> Vehicle:
    """Scale the torque so that the drives weigh what they are known to."""

    def found(scale: float) -> tuple[float, float]:
        tried = replace(vehicle, torque=vehicle.torque.scaled(scale))
        ratios, stds = [], []
        for balance, mass in zip(rebalance(tried), problem.masses, strict=True):
            track = joint.estimate(balance, tried)
            if np.isfinite(track.mass):
                ratios.append(track.mass / mass)
                stds.append(track.bound_std / mass)
        if not ratios:
            return 1.0, TRANSFER_STD
        weight = 1.0 / np.square(stds)
        return float(np.average(ratios, weights=weight)), float(1.0 / np.sqrt(weight.sum()))

    ratio, std = found(1.0)
    slope = (found(1.02)[0] - ratio) / 0.02
    scale = 1.0 + (1.0 - ratio) / slope if slope > 0.2 else 1.0 / ratio
    return replace(
        vehicle,
        torque=vehicle.torque.scaled(scale),
        provenance=replace(vehicle.provenance, mass_scale_std=float(np.hypot(std, TRANSFER_STD))),
    )
