"""From a vehicle calibrated by eq. 48 to one calibrated as the joint estimator weighs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.balance.delay import FARTHEST as FARTHEST_DELAY
from weighbridge.balance.delay import beyond, vertex
from weighbridge.balance.table import ForceBalance
from weighbridge.calibration.inverse import (
    DriveRows,
    FitSettings,
    InverseFit,
    TooShort,
    fit,
    fit_with_gusts,
)
from weighbridge.errors import DriveError
from weighbridge.estimators import joint
from weighbridge.estimators.considered import pinned, triangle
from weighbridge.estimators.joint_problem import UNMODELLED
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle.fits import JOINT
from weighbridge.vehicle.model import Driveline, Vehicle
from weighbridge.vehicle.torque import source_of

LAGS: Final = (0.0, 0.1, 0.2, 0.3, 0.45)
"""Time constants of the reading's smoothing that are tried [s]. Longer ones pass for the
smoothness of a polled speed: with up to 1.25 s, 2 Hz without an accelerometer went from 3 to
13 % RMS."""

DELAYS: Final = tuple(0.2 * k for k in range(-2, 7))
"""Sums of delay and lag among which the search begins [s]; it goes on beyond an end that fits
best."""

NOT_TOLD: Final = "the drives do not show how late the torque is"
"""What is noted where the search for the delay ends at its end."""

USUAL_DELAY: Final = 0.3
"""Sum of delay and lag where the drives do not show it [s]."""

TIMING_WINDOW: Final = 1.2
"""Windows of the search [s]: shorter than those of the fit, for delay shows in what is fast."""

TRANSFER_STD: Final = (0.002, 0.003)
"""What a joint calibration loses on other drives, relative [-]: always, and from each
drive of the calibration anew. Simulated, sixteen vehicles, calibrated by one or three
ordinary drives, six others weighed with each; sensors whose scale is 0.3 % off from drive
to drive are most of it."""

FARTHEST: Final = 5.0
"""Standard deviations of its class by which a fitted road load may be off [-]: farther ones were
seen without an accelerometer, where hills and torque noise pass for drag."""

USUAL_SLOPE: Final = 1.2
"""Relative change of a mass per relative change of its torque [-]: what road loads take is not
scaled."""

SLOPES: Final = (0.8, 2.5)
"""The same at least and at most [-]."""

SCALES: Final = (0.5, 2.0)
"""A torque that was fitted is scaled by so much at least and at most [-]."""

SELF_CLOSE: Final = 5e-4
"""The calibration's own drives are weighed so near to their masses, in the mean [-]."""

SELF_ROUNDS: Final = 4

BalanceAt = Callable[[int, float, float], tuple[ForceBalance, Floats, Bools]]
"""Balance, reading and usable rows of drive k at a delay and a lag [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointProblem:
    """What is fitted, and to what.

    Attributes
    ----------
    balance_at : rows of each drive at a delay and lag
    masses : known mass of each drive as it begins [kg]
    order, curved : of the torque regression
    knots : engine speeds of its smooth correction [rad/s]
    torque_noise : of one reading [N m]
    known : driveline of the vehicle file given to the calibration
    by_speed : a drive has no accelerometer
    """

    balance_at: BalanceAt
    masses: Sequence[float]
    order: int
    curved: bool
    knots: tuple[float, ...]
    torque_noise: float
    known: Driveline
    by_speed: bool = False


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
        The drives cannot be weighed.
    """
    line = vehicle.driveline
    settings = FitSettings(
        source=source_of(vehicle),
        order=problem.order,
        curved=problem.curved,
        knots=problem.knots,
        bounds=source_of(vehicle).terms,
        torque_noise=problem.torque_noise,
        wheel_radius=line.wheel_radius,
        prior=_prior(vehicle, problem.known),
    )
    quick = replace(settings, window=TIMING_WINDOW, rounds=1, knots=())

    def rows_at(delay: float, lag: float) -> list[DriveRows]:
        found = []
        for k, mass in enumerate(problem.masses):
            balance, reading, usable = problem.balance_at(k, delay, lag)
            found.append(
                DriveRows(
                    view=balance.merged,
                    regressor=reading,
                    engine_speed=balance.merged.engine_speed,
                    usable=usable,
                    mass=mass,
                    motion=balance.motion,
                )
            )
        return found

    def misfits(pairs: Sequence[tuple[float, float]]) -> Floats:
        tried = [rows_at(delay, lag) for delay, lag in pairs]
        # Other rows would make other likelihoods: only those count that are usable at all.
        shared = [
            np.logical_and.reduce([rows[k].usable for rows in tried])
            for k in range(len(problem.masses))
        ]
        return np.array(
            [
                -fit(
                    [replace(row, usable=u) for row, u in zip(rows, shared, strict=True)], quick
                ).log_likelihood
                for rows in tried
            ]
        )

    try:
        delay, lag, told = _timing(misfits)
        found = fit_with_gusts(rows_at(delay, lag), settings)
    except TooShort as short:
        return _self_weighed(_as_it_is(vehicle, str(short)), problem, rebalance, None)
    mean, std = settings.prior
    if np.any(np.abs(found.road - mean)[:2] > FARTHEST * std[:2]):
        why = (
            f"the drives make its drag area {found.road[0]:.1f} m^2 and its rolling coefficient "
            f"{found.road[1]:.3f}, which no {vehicle.kind} has"
        )
        if problem.by_speed:
            # The torque of eq. 48 is worse still: noise of the motion and hills draw it.
            raise DriveError(
                f"without an accelerometer {why}: hills and braking pass for resistance; calibrate "
                "with an inertial sensor or GNSS heights, on more or longer drives, or with a "
                "brake switch"
            )
        return _self_weighed(_as_it_is(vehicle, why), problem, rebalance, None)
    fitted = _with(vehicle, found, delay, lag, problem)
    if not told:
        fitted = noted(fitted, NOT_TOLD)
    return _self_weighed(fitted, problem, rebalance, found.cov)


def _as_it_is(vehicle: Vehicle, why: str) -> Vehicle:
    """Keep the torque of eq. 48, to be scaled alone."""
    made = replace(vehicle, provenance=replace(vehicle.provenance, method=JOINT.name))
    return noted(made, f"scaled, not fitted anew: {why}")


def noted(vehicle: Vehicle, note: str) -> Vehicle:
    """Add a note for readers of the vehicle file, once."""
    notes = vehicle.provenance.notes
    if notes is not None and note in notes:
        return vehicle
    notes = f"{notes}; {note}" if notes else note
    return replace(vehicle, provenance=replace(vehicle.provenance, notes=notes))


def _prior(vehicle: Vehicle, known: Driveline) -> tuple[Floats, Floats]:
    """Road load and inertias of the class, and what the given vehicle file says of them."""
    mean, std = vehicle.of_class.road_prior(single_speed=vehicle.driveline.single_speed)
    for k, given, given_std in (
        (2, known.engine_inertia, known.engine_inertia_std),
        (3, known.wheel_inertia, known.wheel_inertia_std),
    ):
        mean[k] = mean[k] if given is None else given
        std[k] = std[k] if given_std is None else given_std
    return mean, std


def _timing(
    misfits: Callable[[Sequence[tuple[float, float]]], Floats],
) -> tuple[float, float, bool]:
    """Find delay and lag of least misfit: their sum first, then both, then the delay finely.

    Parameters
    ----------
    misfits : of pairs of delay and lag [s], all by the same rows

    Returns
    -------
    delay, lag : [s]
    told : whether the drives show them
    """
    middle = LAGS[len(LAGS) // 2]
    totals = np.array(DELAYS)
    scores = misfits([(float(t) - middle, middle) for t in totals])
    while int(np.argmin(scores)) in (0, totals.size - 1):
        more = beyond(totals, scores, DELAYS[1] - DELAYS[0], FARTHEST_DELAY)
        if not more.size:
            break
        totals = np.sort(np.concatenate([totals, more]))
        scores = misfits([(float(t) - middle, middle) for t in totals])
    # At the ends both sides have little in common, and little to disagree about.
    lowest = [k for k in range(1, totals.size - 1) if scores[k] <= min(scores[k - 1 : k + 2])]
    total = float(totals[min(lowest, key=lambda k: scores[k])]) if lowest else USUAL_DELAY

    pairs = [(total - x + shift, x) for x in LAGS for shift in (-0.2, -0.1, 0.0, 0.1, 0.2)]
    delay, lag = pairs[int(np.argmin(misfits(pairs)))]
    delays = np.asarray(delay + 0.03 * np.arange(-4, 5), dtype=np.float64)
    scores = misfits([(float(d), lag) for d in delays])
    best = int(np.clip(np.argmin(scores), 1, delays.size - 2))
    around = slice(best - 1, best + 2)
    return vertex(delays[around], scores[around]), lag, bool(lowest)


def _with(
    vehicle: Vehicle, found: InverseFit, delay: float, lag: float, problem: JointProblem
) -> Vehicle:
    bent = found.coefficients.size - len(problem.knots)
    straight = bent - 2 * problem.curved
    values = [float(w) for w in found.coefficients]
    stds = [float(s) for s in found.stds]
    road = np.maximum(found.road, 0.0)
    return replace(
        vehicle,
        torque=replace(
            vehicle.torque,
            coefficients=tuple(values[:straight]),
            coefficient_stds=tuple(stds[:straight]),
            curvature=tuple(values[straight:bent]),
            curvature_stds=tuple(stds[straight:bent]),
            knots=problem.knots,
            knot_slopes=tuple(values[bent:]),
        ),
        road_load=replace(
            vehicle.road_load,
            rolling_speed_coefficient=0.0,
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
        provenance=replace(vehicle.provenance, method=JOINT.name, mass_scale_std=None),
    )


def _self_weighed(
    vehicle: Vehicle,
    problem: JointProblem,
    rebalance: Callable[[Vehicle], Sequence[ForceBalance]],
    cov: Floats | None,
) -> Vehicle:
    """Scale the torque so that the drives weigh what they are known to.

    ``cov`` is that of the fit, if there was one. The scale pins what the drives weigh in the
    mean; what is left open moves drives that use the torque otherwise.
    """

    def found(scale: float) -> tuple[float, float, Floats, int]:
        tried = replace(vehicle, torque=vehicle.torque.scaled(scale))
        ratios, stds = [], []
        moved: list[Floats] = []
        for balance, mass in zip(rebalance(tried), problem.masses, strict=True):
            track = joint.estimate(balance, tried, load_changes=False)
            if np.isfinite(track.mass) and track.sensitivity is not None:
                left = mass - float(balance.merged.fuel_burnt[-1])
                ratios.append(track.mass / left)
                stds.append(track.bound_std / left)
                moved.append(track.sensitivity / left)
        if not ratios:
            raise DriveError(
                "the drives of the calibration cannot be weighed: drive longer, with more starts"
            )
        weight = 1.0 / np.square(stds)
        return (
            float(np.average(ratios, weights=weight)),
            float(1.0 / np.sqrt(np.mean(weight))),
            np.average(np.array(moved), axis=0, weights=weight),
            len(ratios),
        )

    scale, slope = 1.0, USUAL_SLOPE
    tried = [(scale, *found(scale))]
    for _ in range(SELF_ROUNDS):
        before, ratio = scale, tried[-1][1]
        if abs(ratio - 1.0) < SELF_CLOSE:
            break
        scale = float(np.clip(scale + (1.0 - ratio) / slope, *SCALES))
        if scale == before:
            break
        tried.append((scale, *found(scale)))
        # Levels of noise may fall into another optimum, and the mass jump with them.
        slope = float(np.clip((tried[-1][1] - ratio) / (scale - before), *SLOPES))
    scale, ratio, bound, direction, count = min(tried, key=lambda t: abs(t[1] - 1.0))
    each = float(np.hypot(TRANSFER_STD[1], UNMODELLED * bound))
    # Where the torque could not be fitted anew, what its own fit left open stays.
    known = math.hypot(TRANSFER_STD[0], vehicle.provenance.mass_scale_std or 0.0, ratio - 1.0)
    open_cov: tuple[float, ...] = ()
    if cov is not None:
        # The torque coefficients are scaled, and their errors with them.
        units = np.concatenate((np.full(len(cov) - 4, scale), np.ones(4)))
        open_cov = triangle(pinned(cov * np.outer(units, units), direction))
    return replace(
        vehicle,
        torque=vehicle.torque.scaled(scale),
        provenance=replace(
            vehicle.provenance,
            fit_cov=open_cov,
            mass_scale_std=float(np.hypot(known, each / np.sqrt(count))),
        ),
    )
