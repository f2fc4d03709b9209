"""Extended Kalman filter on speed alone (Galvão et al.).

S. L. J. Galvão, R. M. Fontes, D. D. Santana, R. Requião: An Extended Kalman Filter
implementation for estimating the mass of passengers vehicles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance, Reason
from weighbridge.balance.speed_balance import kernel_parameters, model_of
from weighbridge.errors import ConfigError
from weighbridge.estimators.judging import converged_at
from weighbridge.estimators.track import MassTrack, Status
from weighbridge.kernels import speed_ekf as kernel
from weighbridge.limits import SOME
from weighbridge.messages import Problem
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle import Vehicle

TAIL: Final = 0.75
"""Part of the samples, the last, that counts as converged [-]: the paper's filter settles
in a quarter of the drive."""

GROUPS: Final = 10
"""Equal groups that the converged samples are cut into; chosen, the paper does not say."""

LARGEST_SHARE: Final = 0.5
"""A mass that is the start by more than this was not found in the drive [-]."""

STARTS: Final = (0.8, 1.25)
"""Starts over the calibration's mass between which the answer's share of its start is
measured [-]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedEkfSettings:
    """Settings of the filter.

    Attributes
    ----------
    initial_mass : the mass of the vehicle's calibration when None [kg]
    initial_slope : sin(theta + beta) at the start [-]
    process_var : diagonal of Q for speed, inverse mass and slope
    initial_var : diagonal of P0 for the same; that of Q where empty, as in the paper
    speed_var : R [m^2/s^2]
    tail : part of the samples, the last, whose masses are averaged [-]
    groups : equal groups that these are cut into
    """

    initial_mass: float | None = None
    initial_slope: float = 0.01
    process_var: tuple[float, float, float] = (0.1, 1e-12, 0.005)
    initial_var: tuple[float, ...] = ()
    speed_var: float = 1e-4
    tail: float = TAIL
    groups: int = GROUPS

    def __post_init__(self) -> None:
        if self.initial_mass is not None and not self.initial_mass > 0.0:
            raise ConfigError(f"initial_mass must be positive, got {self.initial_mass}")
        if not (min(self.process_var) >= 0.0 and self.speed_var > 0.0):
            raise ConfigError(
                "process_var must not be negative and speed_var must be positive, "
                f"got {self.process_var} and {self.speed_var}"
            )
        if len(self.initial_var) not in (0, 3) or min(self.initial_var, default=1.0) <= 0.0:
            raise ConfigError(f"initial_var takes three numbers above 0, got {self.initial_var}")
        if not 0.0 < self.tail <= 1.0:
            raise ConfigError(f"tail must be in (0, 1], got {self.tail}")
        if not self.groups >= 1:
            raise ConfigError(f"groups must be at least 1, got {self.groups}")


PRINTED: Final = SpeedEkfSettings(initial_mass=1500.0, process_var=(0.1, 1e-10, 0.005))
"""Start and noise as the paper prints them (sec. 5.3)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterRun:
    """What the filter made of one drive; arrays (n,), one value per sample.

    Attributes
    ----------
    mass, std : running mass and the filter's own standard deviation [kg]
    slope : sin(theta + beta) [-]
    innovation, innovation_var : of the speed [m/s], [m^2/s^2]; NaN where it was off
    used : where the estimation was on
    answer : mean of the converged masses [kg]; NaN without a sample
    """

    mass: Floats
    std: Floats
    slope: Floats
    innovation: Floats
    innovation_var: Floats
    used: Bools
    answer: float


def run_filter(
    balance: ForceBalance,
    vehicle: Vehicle,
    settings: SpeedEkfSettings | None = None,
    *,
    flat: bool = False,
) -> FilterRun:
    """Run the filter over the windows of a drive.

    Parameters
    ----------
    balance : of `weighbridge.balance.speed_balance`
    vehicle : with a speed model
    settings : ours when None
    flat : start with an inverse mass as uncertain as it is large, and let it be
        constant: what the drive says without a start
    """
    settings = settings or SpeedEkfSettings()
    model = model_of(vehicle)
    mass = model.mass if settings.initial_mass is None else settings.initial_mass
    params = kernel_parameters(model, settings.process_var, settings.speed_var)
    state = kernel.initial_state(mass, settings.initial_slope, params)  # type: ignore[no-untyped-call]
    if settings.initial_var:
        state = state._replace(cov=np.diag(settings.initial_var))
    if flat:
        constant = params.process_var * np.array([1.0, 0.0, 1.0])
        params = params._replace(process_var=constant)
        cov = np.diag([0.0, 1.0 / mass**2, settings.process_var[2]])
        state = state._replace(cov=cov)
    table = balance.table
    used = table.reason == Reason.USED
    speed = np.nan_to_num(table.speed)
    _, x, var, innovation, innovation_var = kernel.run(state, speed, used, params)
    running = 1.0 / x[:, 1]
    return FilterRun(
        mass=running,
        std=np.sqrt(var[:, 1]) * running**2,
        slope=x[:, 2],
        innovation=innovation,
        innovation_var=innovation_var,
        used=used,
        answer=mean_mass(running, used, settings.tail, settings.groups),
    )


def mean_mass(mass: Floats, used: Bools, tail: float = TAIL, groups: int = GROUPS) -> float:
    """Average the converged masses, groups that still move left out (sec. 4).

    The last ``tail`` of the samples used is cut into ``groups`` equal groups; those
    whose standard deviation is not above the average one count.

    Parameters
    ----------
    mass : (n,) running [kg]
    used : (n,)
    tail : part of the samples used [-]
    groups : how many

    Returns
    -------
    [kg]; NaN without a sample
    """
    rows = mass[used]
    rows = rows[rows.size - int(np.ceil(tail * rows.size)) :]
    if rows.size == 0:
        return float("nan")
    parts = np.array_split(rows, min(groups, rows.size))
    spread = np.array([np.std(part) for part in parts])
    # Equal spreads differ from their mean by rounding.
    calm = spread <= spread.mean() * (1.0 + 1e-9)
    return float(np.mean(np.concatenate([p for p, keep in zip(parts, calm, strict=True) if keep])))


def start_share(balance: ForceBalance, vehicle: Vehicle, settings: SpeedEkfSettings) -> float:
    """Measure which part of the answer is the mass the filter was started from [-].

    1 where the answer moves as far as the start does, 0 where it does not care.
    """
    model = model_of(vehicle)
    starts = [model.mass * factor for factor in STARTS]
    ends = []
    for start in starts:
        done = run_filter(balance, vehicle, replace(settings, initial_mass=start))
        ends.append(done.answer)
    return (ends[1] - ends[0]) / (starts[1] - starts[0])


def estimate(
    balance: ForceBalance, vehicle: Vehicle, settings: SpeedEkfSettings | None = None
) -> MassTrack:
    """Weigh by speed alone, and say how much of the answer is the filter's start.

    Parameters
    ----------
    balance : of `weighbridge.balance.speed_balance`
    vehicle : with a speed model
    settings : ours when None
    """
    settings = settings or SpeedEkfSettings()
    model = model_of(vehicle)
    done = run_filter(balance, vehicle, settings)
    table = balance.table
    used = done.used
    count = int(np.count_nonzero(used))
    mass, std, share, bound = float("nan"), float("inf"), float("nan"), float("nan")
    if count:
        mass = done.answer
        std = float(np.hypot(done.std[-1], model.scale_std * mass))
        share = start_share(balance, vehicle, settings)
        free = run_filter(balance, vehicle, settings, flat=True)
        bound = float(free.std[-1] * (mass / free.mass[-1]) ** 2)
    status, why = _judge(vehicle, count, mass, std, share)
    running = np.where(np.cumsum(used) > 0, done.mass, np.nan)
    return MassTrack(
        method="speed-ekf",
        balance=balance,
        running_mass=running,
        running_std=np.hypot(done.std, model.scale_std * running),
        residual=np.where(used, done.innovation * mass / model.sample_time, np.nan),
        row_reason=table.reason,
        mass=mass,
        std=std,
        systematic_std=model.scale_std * mass,
        degrees_of_freedom=float("inf"),
        bound_std=bound,
        converged_at=converged_at(table.time, running, mass, used),
        status=status,
        reason=why,
        segments=(),
    )


def _judge(
    vehicle: Vehicle, count: int, mass: float, std: float, share: float
) -> tuple[Status, Problem | None]:
    model = model_of(vehicle)
    if count < SOME:
        return Status.NOT_EXCITED, Problem.of(
            "speed.few_samples", count=count, period=model.sample_time, least=SOME
        )
    low, high = vehicle.of_class.mass_range
    if not low < mass < high:
        return Status.INCONSISTENT, Problem.of(
            "speed.impossible", mass=mass, kind=vehicle.kind, low=low, high=high
        )
    if share > LARGEST_SHARE:
        return Status.NOT_EXCITED, Problem.of(
            "speed.no_mass", mass=mass, first=model.mass, share=100.0 * share
        )
    if not std <= 0.15 * mass:
        return Status.NOT_EXCITED, Problem.of("speed.wide", mass=mass, std=std)
    return Status.CONVERGED, None
