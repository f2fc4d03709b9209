"""How far slow errors move a mass that is a weighted sum of forces."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.balance.force_balance import highest_torque
from weighbridge.estimators.considered import fit_consider_std, force_columns
from weighbridge.estimators.gate import GateSettings
from weighbridge.estimators.joint.problem import states_of
from weighbridge.estimators.joint.settings import JointSettings
from weighbridge.estimators.joint.terms import Sizes, design, terms_of
from weighbridge.estimators.judging import Evidence, judge
from weighbridge.estimators.noisy_motion import row_noise_std, too_noisy
from weighbridge.estimators.track import Status
from weighbridge.kernels.first_order import fading
from weighbridge.messages import Problem
from weighbridge.signals import Bools, Floats, Ints
from weighbridge.vehicle import Vehicle

BIN: Final = 2.5
"""Time over which a slow error counts as one [s]: it is short beside the shortest of
`weighbridge.estimators.joint.terms`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """A mass that is a weighted sum of forces.

    Attributes
    ----------
    mass : [kg]
    scatter : its standard deviation by blocks of time [kg]
    blocks : how many
    index : (m,) rows of the force table, rising
    influence : (m,) what a newton at each row adds to the mass [kg/N]
    noise_std : of the part that was added for noise of the motion, relative [-]
    """

    mass: float
    scatter: float
    blocks: int
    index: Ints
    influence: Floats
    noise_std: float = 0.0


def slow_std(
    balance: ForceBalance, vehicle: Vehicle, index: Ints, influence: Floats, mass: float
) -> tuple[float, float]:
    """Standard deviations of a mass ``sum(influence * force)`` by slow errors of the force [kg].

    The errors are those that the joint estimator has as states, as large as it takes them before
    a drive, and what the fit of the calibration leaves open. A fit that does not estimate them
    beside the mass has their whole effect; for the rows it uses, its mass cannot be surer than
    this, which is not below their Cramér-Rao bound.

    Parameters
    ----------
    balance, vehicle
    index : (m,) rows of the force table, rising
    influence : (m,) what a newton at each row adds to the mass [kg/N]
    mass : rough [kg]

    Returns
    -------
    passing : by what differs from drive to drive
    lasting : by what a file without the covariance of its fit leaves open, which stays with
        the vehicle

    References
    ----------
    Variance of a linear estimate under coloured noise: Gelb, Applied Optimal Estimation, 1974,
    ch. 4; Gauss-Markov covariance, ch. 3.8.
    """
    table = balance.table
    if not (index.size and np.isfinite(mass) and mass > 0.0):
        return float("inf"), 0.0
    rows, _ = design(table, vehicle, unmeasured_grade=balance.motion.unmeasured_grade)
    sizes, usual = Sizes(mass, highest_torque(table.torque[index])), JointSettings()
    states = states_of(_known_road_load(vehicle), sizes, usual)
    terms = terms_of(vehicle)
    effect = influence[:, None] * np.nan_to_num(rows[index])
    whole = effect.sum(axis=0)
    time = table.time[index]
    number = ((time - time[0]) // BIN).astype(np.int64)
    passing = 0.0
    for k, term in enumerate(terms):
        if term.lasting:
            continue
        binned = np.bincount(number, effect[:, k]).astype(np.float64)
        keep = float(np.exp(-BIN / term.time_constant))
        passing += states.std[k] ** 2 * _correlated(binned, keep)
    if vehicle.provenance.fit_cov:
        moved = influence @ force_columns(balance, vehicle, mass)[index]
        passing += (mass * fit_consider_std(vehicle, moved, mass)) ** 2
        return float(np.sqrt(passing)), 0.0
    # What a file says of its own road load is in the resistance and the last states.
    open_ = states_of(vehicle, sizes, usual).std
    lasting = np.array([term.lasting for term in terms])
    stays = np.where(lasting, open_, np.sqrt(np.maximum(open_**2 - states.std**2, 0.0))) * whole
    # The methods that ask have `weighbridge.estimators.judging.consider_std` for the cold.
    stays[[term.name in ("mass", "cold_torque") for term in terms]] = 0.0
    return float(np.sqrt(passing)), float(np.linalg.norm(stays))


def honest_std(scatter: float, blocks: int, slow: float, systematic: float) -> tuple[float, float]:
    """Standard deviation of a mass [kg] and the degrees of freedom behind it.

    Parameters
    ----------
    scatter : between blocks of time, which does not see what all of them share [kg]
    blocks : how many
    slow : `slow_std`, below which the scatter is not believed [kg]
    systematic : what no row can take away [kg]

    References
    ----------
    Degrees of freedom of a sum of variances: Welch, Biometrika 34, 1947; Satterthwaite,
    Biometrics Bulletin 2, 1946.
    """
    freedom = float(max(blocks - 1, 1))
    std = float(np.hypot(max(scatter, slow), systematic))
    if not (np.isfinite(std) and scatter > 0.0):
        return std, freedom
    return std, freedom * (std / scatter) ** 4


class Judged(NamedTuple):
    """How sure a fit is, and whether it carries a mass.

    Attributes
    ----------
    std, degrees_of_freedom : as of `honest_std`
    systematic_std : part of ``std`` that vehicle file and equipment leave, whatever the drive [kg]
    status, reason : as of `weighbridge.estimators.judging.judge`
    """

    std: float
    degrees_of_freedom: float
    systematic_std: float
    status: Status
    reason: Problem | None


def judged(
    balance: ForceBalance,
    vehicle: Vehicle,
    used: Bools,
    phi: Floats,
    fitted: Fitted,
    slow: float,
    noise_share: float,
    gate: GateSettings,
) -> Judged:
    """Find how sure a fit of a published method is, and whether it carries a mass.

    Parameters
    ----------
    balance, vehicle
    used : (n,)
    phi : (n,) regressor of the mass [m/s^2]
    fitted
    slow : `weighbridge.estimators.judging.consider_std` [-]
    noise_share : of the estimator, which takes the motion as exact: see `row_noise_std` [-]
    gate : what a mass needs
    """
    passing, lasting = slow_std(balance, vehicle, fitted.index, fitted.influence, fitted.mass)
    inertial = balance.motion.source == "inertial"
    noisy = row_noise_std(balance.table, phi, used, noise_share) if inertial else 0.0
    noisy = float(np.hypot(noisy, fitted.noise_std))
    passing = float(np.hypot(passing, fitted.mass * noisy))
    systematic = float(np.hypot(fitted.mass * slow, lasting))
    std, freedom = honest_std(fitted.scatter, fitted.blocks, passing, systematic)
    evidence = Evidence(
        table=balance.table,
        used=used,
        phi=phi,
        mass=fitted.mass,
        std=std,
        blocks=fitted.blocks,
        systematic_std=systematic,
        degrees_of_freedom=freedom,
        motion=balance.motion,
        gate=gate,
    )
    status, reason = judge(evidence, vehicle)
    # Of a cruise the noise is not the first thing to say.
    if evidence.spread >= gate.least_spread and (noise := too_noisy(noisy)):
        status, reason = Status.INCONSISTENT, noise
    return Judged(std, freedom, systematic, status, reason)


def _known_road_load(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle as if its drag area and rolling resistance were known exactly."""
    load = replace(vehicle.road_load, drag_area_std=0.0, rolling_coefficient_std=0.0)
    return replace(vehicle, road_load=load)


def _correlated(effect: Floats, keep: float) -> float:
    """Sum of ``effect_i effect_j keep^|i - j|`` over all pairs."""
    before = fading(effect, keep)
    return float(effect @ effect + 2.0 * (effect @ before))
