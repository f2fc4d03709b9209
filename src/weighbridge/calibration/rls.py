"""Torque model and road load by the regression of Jensen 2022, eq. 48."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from weighbridge.balance import ForceBalance, Reason
from weighbridge.balance.delay import EARLIEST, FARTHEST, LATEST
from weighbridge.balance.law import ROAD_PARAMETERS
from weighbridge.calibration.fitted import (
    Fitted,
    check_delay,
    known_std,
    learnt_dragged,
    noted,
    ranges,
    rebalanced,
)
from weighbridge.calibration.problem import Problem
from weighbridge.calibration.recording import DelayedRows
from weighbridge.calibration.regression import (
    TorqueFit,
    TorqueRows,
    build_rows,
    driven_slope,
    fit,
    join_rows,
)
from weighbridge.calibration.uncertain_motion import gain_std
from weighbridge.estimators import block_jackknife
from weighbridge.estimators.judging import cold_share
from weighbridge.estimators.regression import regression
from weighbridge.messages import Problem as Message
from weighbridge.messages import phrase, refused
from weighbridge.results import DelaySearch
from weighbridge.signals import Floats
from weighbridge.signals.lag import find_lag, lag_std_at
from weighbridge.vehicle import (
    Driveline,
    Provenance,
    RoadLoad,
    Timing,
    TorqueModel,
    Vehicle,
    source_of,
)
from weighbridge.vehicle.fits import RLS


def fit_rls(problem: Problem) -> Fitted:
    """Fit torque and road load by eq. 48, and scale the torque by weighing the drives.

    Raises
    ------
    DriveError, ConfigError
        The drives or the settings cannot be used.
    """
    draft = problem.draft
    low, high = _bounds(problem.base, draft.driveline)
    tried = _Search(problem, low, high)
    delay = find_lag(tried.misfit, EARLIEST, LATEST, farthest=FARTHEST)
    found = bool(np.isfinite(delay))
    if not found:
        delay = problem.base.timing.torque_delay or 0.0
    check_delay(problem, delay)
    rows = tuple(_pulling(r.rows(delay)) for r in problem.recordings)
    joined = torque_rows_of(problem, rows)
    fitted = fit(joined, low, high)
    refuse_nonsense(problem, *driven_slope(fitted, joined, curved=problem.curved))
    spread = math.inf
    if found:
        spread = lag_std_at(lambda at: tried.misfit(at) ** 2, delay, fitted.independent_rows)
    speeds, loads = ranges(problem, rows)
    vehicle = replace(
        draft,
        driveline=_fitted_driveline(draft.driveline, fitted),
        torque=replace(
            _fitted_torque(fitted, problem),
            reference_torque=draft.torque.reference_torque,
            engine_efficiency=draft.torque.engine_efficiency,
            load_range=loads,
            speed_range=speeds,
        ),
        road_load=_fitted_road_load(fitted),
        timing=Timing(
            torque_delay=delay if found else problem.base.timing.torque_delay,
            torque_delay_std=spread if math.isfinite(spread) else None,
        ),
        provenance=Provenance(masses=tuple(problem.masses), method=RLS.name),
    )
    vehicle = replace(vehicle, dragged=learnt_dragged(problem, vehicle))
    free = low < high
    held = tuple(
        name
        for name, is_free in zip(ROAD_PARAMETERS, free, strict=True)
        if is_free and name in fitted.at_bound
    )
    notes = (bound_note(held),) if held else ()
    if not found:
        notes = (*notes, Message.of("calibration.delay_unknown"))
    for note in notes:
        vehicle = noted(vehicle, note)
    return Fitted(
        vehicle=_self_weighed(problem, vehicle, fitted, held),
        rows=rows,
        search=tried.result(fitted.independent_rows),
        held=held,
        notes=notes,
    )


def bound_note(held: Sequence[str]) -> Message:
    """Say what it means that parameters of the road lie on a bound."""
    these, bounds = ("these", "these bounds") if len(held) > 1 else ("this", "this bound")
    return Message.of("calibration.held", names=", ".join(held), these=these, bounds=bounds)


class _Search:
    """Misfit of eq. 48 over the delay, and what was tried."""

    def __init__(self, problem: Problem, low: Floats, high: Floats) -> None:
        self.problem, self.low, self.high = problem, low, high
        self.tried: dict[float, float] = {}

    def misfit(self, delay: float) -> float:
        """Robust standard deviation of the residual at a delay [N m]; NaN with too few rows."""
        if delay not in self.tried:
            parts = [r.delayed(delay) for r in self.problem.recordings]
            rows = torque_rows_of(self.problem, [_pulling(part) for part in parts])
            enough = rows.target.size >= 20 * rows.design.shape[1]
            self.tried[delay] = (
                fit(rows, self.low, self.high, iterations=3).residual_std
                if enough
                else float("nan")
            )
        return self.tried[delay]

    def result(self, rows: float) -> DelaySearch:
        """As a Gaussian likelihood of so many independent rows."""
        delay, std = np.array(sorted(self.tried.items())).T
        known = np.isfinite(std)
        misfit = rows * np.log(std[known] / np.min(std[known], initial=np.inf))
        return DelaySearch(delay=delay[known], misfit=misfit)


def _pulling(rows: DelayedRows) -> DelayedRows:
    """Take the rows in which the vehicle gains speed, as the method weighs."""
    return replace(rows, usable=rows.usable & (rows.table.accel > 0.0))


def torque_rows_of(problem: Problem, rows: Sequence[DelayedRows]) -> TorqueRows:
    """Write eq. 48 for the usable rows of all drives."""
    return join_rows(
        [
            build_rows(
                part.table,
                recording.reading,
                part.engine_speed,
                mass=recording.mass,
                wheel_radius=problem.draft.driveline.wheel_radius,
                order=problem.order,
                curved=problem.curved,
                rows=part.usable,
            )
            for recording, part in zip(problem.recordings, rows, strict=True)
        ]
    )


def _bounds(base: Vehicle, driveline: Driveline) -> tuple[Floats, Floats]:
    """Bounds of the road parameters; equal where a parameter is known."""
    low, high = base.of_class.road_bounds
    if driveline.single_speed:
        # One gear cannot separate the inertias from the mass, nor rolling resistance from an
        # offset of the torque.
        road = replace(base, driveline=driveline).road
        low[1:] = high[1:] = (
            road.rolling_coefficient.value,
            road.engine_inertia.value,
            road.wheel_inertia.value,
        )
    return low, high


def _own_masses(
    balances: Sequence[ForceBalance], vehicle: Vehicle, masses: Sequence[float]
) -> tuple[float, float]:
    """Weigh the calibration drives: true over found mass, and its standard deviation.

    Noise in load and acceleration pulls the torque fit and the weighing in
    different directions; what they leave on the drives of known mass is taken
    out here.
    """
    time, phi, whole, rest, cold = [], [], [], [], []
    offset = 0.0
    for balance, mass in zip(balances, masses, strict=True):
        table = balance.table
        x, target = regression(table, vehicle)
        used = (table.reason == Reason.USED) & (table.accel > 0.0)
        used &= np.isfinite(x) & np.isfinite(target)
        if not used.any():
            continue
        instants = table.time[used] - table.time[0]
        cold.append((float(np.sum(x[used] ** 2)), cold_share(table.time, x, used)))
        time.append(instants + offset)
        phi.append(x[used] * mass)
        whole.append(target[used])
        rest.append((table.traction_force - target)[used])
        offset += float(instants[-1]) + 1e3
    every = np.ones(sum(t.size for t in time), dtype=bool)
    joined = np.concatenate(time), np.concatenate(phi)
    found, std, _ = block_jackknife(*joined, np.concatenate(whole), every)
    resisted, _, _ = block_jackknife(*joined, np.concatenate(rest), every)
    weights, shares = np.array(cold).T
    warming = source_of(vehicle).cold_std * float(np.average(shares, weights=weights))
    return (1.0 + resisted) / (found + resisted), float(np.hypot(std / found, warming))


def refuse_nonsense(problem: Problem, slope: float, std: float) -> None:
    """Raise where torque does not rise with its source: nothing can be weighed by it."""
    if not slope > 3.0 * std:
        refuse_diesel_air(problem, slope, std)
        by_air = problem.source.name == "air_flow" and problem.base.engine is None
        unsaid = phrase("and_that", text=phrase("diesel_air")) if by_air else ""
        raise refused(
            "calibration.no_slope",
            drives=problem.names,
            reading=problem.source.signals[0],
            slope=slope,
            std=std,
            unsaid=unsaid,
        )


def refuse_diesel_air(problem: Problem, slope: float, std: float) -> None:
    """Name the cause of a fit that no vehicle has: a diesel's air flow is no torque."""
    if problem.source.name == "air_flow" and problem.base.engine == "diesel":
        raise refused(
            "calibration.diesel_air",
            drives=problem.names,
            diesel=phrase("diesel_air"),
            slope=slope,
            std=std,
        )


def _self_weighed(
    problem: Problem, vehicle: Vehicle, fitted: TorqueFit, held: tuple[str, ...]
) -> Vehicle:
    """Scale the torque so that the drives weigh what they are known to."""
    scale, std = _own_masses(rebalanced(problem, vehicle), vehicle, problem.masses)
    unexplained = 0.3 * max(0.0, 1.0 - fitted.r_squared)
    bounds = 0.03 * sum(name in held for name in ROAD_PARAMETERS[:2])
    gains = gain_std(r.motion for r in problem.recordings)
    parts = (std, problem.source.transfer_std, unexplained, bounds, gains)
    left = float(np.linalg.norm(parts))
    return replace(
        vehicle,
        torque=vehicle.torque.scaled(scale),
        provenance=replace(vehicle.provenance, mass_scale_std=left),
    )


def _fitted_driveline(known: Driveline, fitted: TorqueFit) -> Driveline:
    stds = np.sqrt(np.diag(fitted.cov))
    return replace(
        known,
        engine_inertia=float(fitted.road[2]),
        engine_inertia_std=known_std(stds[-2]),
        wheel_inertia=float(fitted.road[3]),
        wheel_inertia_std=known_std(stds[-1]),
    )


def _fitted_torque(fitted: TorqueFit, problem: Problem) -> TorqueModel:
    straight = fitted.coefficients.size - 2 * problem.curved
    values = [float(w) for w in fitted.coefficients]
    stds = [float(w) for w in np.sqrt(np.diag(fitted.cov))[: fitted.coefficients.size]]
    return TorqueModel(
        source=problem.source.name,
        coefficients=tuple(values[:straight]),
        coefficient_stds=tuple(stds[:straight]),
        curvature=tuple(values[straight:]),
        curvature_stds=tuple(stds[straight:]),
        noise=fitted.residual_std,
        charge=problem.draft.torque.charge,
        charge_exponent=problem.draft.torque.charge_exponent,
        charge_exponent_std=problem.draft.torque.charge_exponent_std,
    )


def _fitted_road_load(fitted: TorqueFit) -> RoadLoad:
    stds = np.sqrt(np.diag(fitted.cov))
    return RoadLoad(
        drag_area=float(fitted.road[0]),
        rolling_coefficient=float(fitted.road[1]),
        drag_area_std=known_std(stds[-4]),
        rolling_coefficient_std=known_std(stds[-3]),
    )
