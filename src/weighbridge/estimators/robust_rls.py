"""Robust least squares with forgetting (Du et al. 2025, sec. 3.1)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weighbridge.balance import PAUSE, ForceBalance, Reason
from weighbridge.balance.cornering import yaw_rate
from weighbridge.balance.table import ForceTable
from weighbridge.constants import GRAVITY
from weighbridge.errors import ConfigError
from weighbridge.estimators.fit_std import Fitted, judged
from weighbridge.estimators.gate import GateSettings
from weighbridge.estimators.joint.slow_errors import motion_variance
from weighbridge.estimators.judging import (
    UNMODELLED_STD,
    consider_std,
    converged_at,
    nothing,
    segments,
)
from weighbridge.estimators.noisy_motion import USUAL_STD
from weighbridge.estimators.regression import regression
from weighbridge.estimators.track import MassTrack
from weighbridge.kernels import robust_rls as kernel
from weighbridge.signals import Bools, Floats, Ints, huber, spread
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.possible import not_negative, positive, within

NOISE_SHARE: Final = 0.75
"""What noise of the motion costs, see `weighbridge.estimators.noisy_motion.row_noise_std` [-]."""

DEPENDENCE: Final = 5.0
"""Rows nearer than this share their error, in the running standard deviation [s]."""

BLOCKS: Final = (20.0, 60.0)
"""Shortest and longest block of rows that share their error, for the standard deviation of
the final mass [s]: a tenth of the drive, within these."""

NOISE_FLOOR: Final = 0.03
"""Standard deviation of a window over the mass, at least [m/s^2]: what is left of vibration
and of the grade."""

FEWEST_WINDOWS: Final = 20
"""Fewer windows carry no mass."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustRlsFilter:
    """Settings of the filter, which starts others, too.

    Attributes
    ----------
    window : length of the means that are folded in [s]; 0 folds each row in by itself,
        as the paper
    memory : time in which the weight of a row falls to 1/e [s]; 10 s is the
        paper's factor of 0.999 at 100 Hz
    forgetting : weight that the past keeps at each fold, in its place, in (0.9, 1] [-];
        the paper has 0.999 at each row
    start_mass, start_information : mass before the drive [kg] and the squared regressors
        that it is worth, over time [(m/s^2)^2 s]; nothing is known at 0, as in the paper
    kept_information : sum over time of the squared regressor below which nothing
        is forgotten that is not replaced [(m/s^2)^2 s]; 0 forgets as the paper
    first_information : the same, from which a mass is given [(m/s^2)^2 s]
    threshold : Huber's, in standard deviations of the innovation [-]
    threshold_force : the same in their place [N]
    settle_windows : means that are folded in before the threshold holds
    every_row : take every row of the moving vehicle, as the paper: braking, shifts and slip of the
        clutch are left to Huber's weight
    weight_information : Huber's weight counts in the covariance, too; not so in eq. 20
    rolling_coefficient : in place of that of the vehicle file and its growth with speed [-];
        the paper's Table 1 has 0.0005
    sensor_ahead : of the accelerometer, ahead of the rear axle [m]; in a bend it reads the
        yaw rate times its lateral speed, eq. 9 of the paper, which is taken off. None takes
        nothing off, as the paper on a straight road
    offset_std : of an offset of the force over the mass, estimated beside it
        [m/s^2]: rolling resistance, zero of the accelerometer; 0 for the paper's
        single parameter
    offset_memory : time of driving in which what was learnt of the offset falls to
        1/e [s]: engine and tyres warm, the accelerometer drifts
    noisy_motion : the final mass allows for noise of the motion, which draws it down; not so in
        the paper
    count_grade_twice : add the grade to the regressor although the specific
        force has it already, as eq. 14 of the paper is printed; to compare only
    """

    window: float = 0.5
    memory: float = 10.0
    forgetting: float | None = None
    start_mass: float = 0.0
    start_information: float = 0.0
    kept_information: float = 10.0
    first_information: float = 1.0
    threshold: float = 1.5
    threshold_force: float | None = None
    settle_windows: int = 10
    every_row: bool = False
    weight_information: bool = True
    rolling_coefficient: float | None = None
    sensor_ahead: float | None = None
    offset_std: float = 0.03
    offset_memory: float = 100.0
    noisy_motion: bool = True
    count_grade_twice: bool = False

    def __post_init__(self) -> None:
        for name in ("memory", "first_information", "threshold", "offset_memory"):
            positive(name, getattr(self, name))
        for name in (
            "window", "start_mass", "start_information", "kept_information", "offset_std",
            "rolling_coefficient", "settle_windows",
        ):  # fmt: skip
            not_negative(name, getattr(self, name))
        positive("threshold_force", self.threshold_force)
        if self.forgetting is not None and not 0.9 < self.forgetting <= 1.0:
            raise ConfigError(f"forgetting must be in (0.9, 1], got {self.forgetting:g}")
        within("sensor_ahead", self.sensor_ahead, -20.0, 20.0, "m")


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustRlsSettings(GateSettings, RobustRlsFilter):
    """Settings of filter and gate."""

    def __post_init__(self) -> None:
        RobustRlsFilter.__post_init__(self)
        GateSettings.__post_init__(self)


class Known(NamedTuple):
    """Rows and vehicle that a filter takes as they are."""

    balance: ForceBalance
    vehicle: Vehicle


def as_set(balance: ForceBalance, vehicle: Vehicle, settings: RobustRlsFilter) -> Known:
    """Return rows and vehicle as the settings have them: rolling resistance, rows, bends."""
    if settings.rolling_coefficient is not None:
        load = replace(
            vehicle.road_load,
            rolling_coefficient=settings.rolling_coefficient,
            rolling_speed_coefficient=0.0,
        )
        vehicle = replace(vehicle, road_load=load)
    table = balance.table
    if settings.every_row:
        taken = np.where(table.moving, np.uint8(Reason.USED), table.reason)
        table = replace(table, reason=taken)
        balance = replace(balance, table=table)
    if settings.sensor_ahead is not None:
        # The rear axle does not drift: ahead of it the lateral speed is yaw rate times distance.
        turning = np.nan_to_num(yaw_rate(table.time, table.heading, 1.0 / row_period(table.time)))
        force = table.specific_force + settings.sensor_ahead * turning**2
        table = replace(table, specific_force=force)
        balance = replace(balance, table=table)
    return Known(balance, vehicle)


def rows(
    table: ForceTable, vehicle: Vehicle, settings: RobustRlsFilter
) -> tuple[Floats, Floats, Bools]:
    """Regressor, right-hand side and what is usable of both.

    Returns
    -------
    phi : (n,) [m/s^2]
    y : (n,) [N]
    valid : (n,) no reason against the row, and finite numbers
    """
    phi, y = regression(table, vehicle)
    if settings.count_grade_twice:
        phi = phi + GRAVITY * np.sin(table.grade)
    return phi, y, np.asarray(table.usable & np.isfinite(phi) & np.isfinite(y))


def row_period(time: Floats) -> float:
    """Spacing of the rows [s]."""
    return float(np.median(np.diff(time))) if time.size > 1 else 1.0


def parameters(settings: RobustRlsFilter, period: float) -> kernel.RobustRlsParams:
    """Make the kernel's parameters for rows ``period`` apart [s]."""
    window = max(settings.window, period)
    forgetting = settings.forgetting
    if forgetting is None:
        forgetting = float(np.exp(-window / settings.memory))
    return kernel.RobustRlsParams(
        window=window,
        period=period,
        pause=max(PAUSE, 2.5 * period),
        forgetting=forgetting,
        kept_information=settings.kept_information / window,
        threshold=settings.threshold,
        threshold_force=settings.threshold_force or 0.0,
        weight_information=settings.weight_information,
        scale_windows=100.0,
        settle_windows=settings.settle_windows,
        offset_std=settings.offset_std,
        offset_forgetting=float(np.exp(-window / settings.offset_memory)),
        noise_floor=NOISE_FLOOR,
        dependence=max(1.0, DEPENDENCE / window),
    )


def initial_state(settings: RobustRlsFilter, window: float) -> kernel.RobustRlsState:
    """Start as the settings have it: from a mass of zero that is worth next to nothing, usually.

    Parameters
    ----------
    settings
    window : length of what is folded in [s]
    """
    worth = max(settings.start_information / window, 1e-9)
    return kernel.initial_state(settings.start_mass, worth)  # type: ignore[no-untyped-call,no-any-return]


def window_reason(table: ForceTable, valid: Bools, mean_phi: Floats) -> NDArray[np.uint8]:
    """Reasons of the rows: `Reason.TOO_SHORT` for those of windows that never filled."""
    row_reason = table.reason.copy()
    row_reason[(row_reason == 0) & ~valid] = Reason.NO_MOTION
    folded = np.isfinite(mean_phi)
    # Rows of a window share what became of it: it ends at a fold or at an interruption.
    window = np.cumsum(np.concatenate(([0], (folded | ~valid)[:-1]))) if folded.size else folded
    filled = np.zeros(int(window[-1]) + 1 if window.size else 0, dtype=bool)
    filled[window[folded]] = True
    row_reason[valid & ~filled[window]] = Reason.TOO_SHORT
    return row_reason


@dataclass(frozen=True, slots=True)
class WindowFit:
    """The windows of a drive and the mass that they all say together.

    Attributes
    ----------
    time, phi, y : (m,) of the windows
    params : of the kernel
    block : length of the blocks of dependent rows [s]
    motion_var : variance of the noise in ``phi``, which would draw the mass down [m^2/s^4]

    References
    ----------
    Attenuation bias, corrected by the known variance of the regressor's error: Fuller,
    Measurement Error Models, 1987, ch. 1.2.
    """

    time: Floats
    phi: Floats
    y: Floats
    params: kernel.RobustRlsParams
    block: float
    motion_var: float

    def mass(self, begin: float = -np.inf, end: float = np.inf) -> tuple[float, float, int]:
        """Mass of a span of time, its standard deviation [kg] and the blocks behind it.

        Huber's fit of mass and offset, the offset held by its prior. The
        standard deviation comes from leaving out one block at a time; it is not
        below what noise and the prior allow, for an offset that stays the same
        shows in no block.

        References
        ----------
        Huber and Ronchetti, Robust Statistics, 2nd ed., 2009, ch. 7; jackknife
        over blocks: Künsch, Annals of Statistics 17, 1989.
        """
        chosen = (self.time >= begin) & (self.time <= end)
        phi, y = self.phi[chosen], self.y[chosen]
        if not np.any(phi):
            return float("nan"), float("inf"), 0
        mass, noise, weight, ridge = self._huber(phi, y)
        block = self.block if np.isinf(begin) else BLOCKS[0]
        number = ((self.time[chosen] - self.time[chosen][0]) // block).astype(np.int64)
        parts = self._sums(phi, y, weight, number)
        parts = parts[:, parts[2] > 0.0]
        n = parts.shape[1]
        if n < 3:
            return mass, float("inf"), n
        power, first, count = self._sums(phi, y, weight)[:3]
        known = power - first**2 / (count + ridge)
        if not known > 0.0:
            return mass, float("inf"), n
        least = noise * float(np.sqrt(self.params.dependence / known))
        without = _solve(parts.sum(axis=1, keepdims=True) - parts, ridge)[0]
        std = float(np.sqrt((n - 1) / n * np.sum((without - without.mean()) ** 2)))
        return mass, max(std, least), n

    def _huber(self, phi: Floats, y: Floats) -> tuple[float, float, Floats, float]:
        """Mass and noise [kg], [N], weights (k,) of the windows and what holds the offset."""
        mass, offset, ridge = float(np.sum(phi * y) / np.sum(phi**2)), 0.0, np.inf
        weight, noise = np.ones_like(phi), 0.0
        for _ in range(50):
            before = mass
            residual = y - phi * mass - offset
            noise = max(spread(residual), self.params.noise_floor * abs(mass))
            weight = huber(residual, noise, self.params.threshold)
            if self.params.offset_std > 0.0:
                ridge = self.params.dependence * (noise / (self.params.offset_std * mass)) ** 2
            mass, offset = (float(x[0]) for x in _solve(self._sums(phi, y, weight)[:, None], ridge))
            if abs(mass - before) <= 1e-7 * abs(mass):
                break
        return mass, noise, weight, ridge

    @property
    def influence(self) -> Floats:
        """What a newton in each window adds to the mass (m,) [kg/N], its weight as it is."""
        _, _, weight, ridge = self._huber(self.phi, self.y)
        power, first, count, _, _ = self._sums(self.phi, self.y, weight)
        if np.isinf(ridge):
            return np.asarray(weight * self.phi / power)
        determinant = power * (count + ridge) - first**2
        return np.asarray(weight * ((count + ridge) * self.phi - first) / determinant)

    @property
    def attenuation(self) -> float:
        """What noise of the motion would take from the mass, and the fit does not let it [-]."""
        _, _, weight, ridge = self._huber(self.phi, self.y)
        power, first, count, _, _ = self._sums(self.phi, self.y, weight)
        known = power - first**2 / (count + ridge)
        return float(self.motion_var * count / known) if known > 0.0 else float("inf")

    def _sums(self, phi: Floats, y: Floats, weight: Floats, block: Ints | None = None) -> Floats:
        """Weighted sums of phi^2 without its noise, phi, 1, phi y and y: (5,), or (5, blocks)."""
        power = phi * phi - self.motion_var
        rows = np.stack([power, phi, np.ones_like(phi), phi * y, y]) * weight
        if block is None:
            return np.asarray(rows.sum(axis=1))
        return np.stack([np.bincount(block, row) for row in rows])

    @property
    def bound(self) -> float:
        """Cramér-Rao bound if the windows were independent and the model true [kg]."""
        noise = spread(self.y - self.phi * self.mass()[0])
        return noise / float(np.sqrt(np.sum(self.phi**2)))


def _solve(sums: Floats, ridge: float) -> tuple[Floats, Floats]:
    """Mass and offset of `_sums` (5, k), the offset held with ``ridge`` windows."""
    power, first, count, cross, force = sums
    if np.isinf(ridge):
        return cross / power, np.zeros_like(cross)
    determinant = power * (count + ridge) - first**2
    mass = ((count + ridge) * cross - first * force) / determinant
    return mass, (power * force - first * cross) / determinant


def window_fit(
    balance: ForceBalance,
    mean_phi: Floats,
    mean_y: Floats,
    params: kernel.RobustRlsParams,
    settings: RobustRlsFilter,
) -> WindowFit:
    """Collect the windows that the kernel has folded in."""
    time = balance.table.time
    folded = np.isfinite(mean_phi)
    span = float(time[-1] - time[0]) if time.size else 0.0
    block = float(np.clip(0.1 * span, *BLOCKS))
    noise = motion_variance(balance.motion, params.window) if settings.noisy_motion else 0.0
    return WindowFit(time[folded], mean_phi[folded], mean_y[folded], params, block, noise)


def estimate(
    balance: ForceBalance, vehicle: Vehicle, settings: RobustRlsSettings | None = None
) -> MassTrack:
    """Weigh by robust recursive least squares with forgetting.

    The running mass is the filter's. The final answer is Huber's fit to all
    windows of the drive, whose mass does not change unnoticed; a stop where it
    may change begins another segment.

    Parameters
    ----------
    balance, vehicle
    settings : the defaults when None

    References
    ----------
    Du et al. 2025, eqs. 13-20.
    """
    settings = settings or RobustRlsSettings()
    balance, vehicle = as_set(balance, vehicle, settings)
    table = balance.table
    phi, y, valid = rows(table, vehicle, settings)
    params = parameters(settings, row_period(table.time))
    _, running, var, information, mean_phi, mean_y, _ = kernel.run(
        initial_state(settings, params.window), table.time, phi, y, valid, params
    )
    # Once reported, a mass stays reported: forgetting may leave less behind it later.
    most = np.maximum.accumulate(information) if information.size else information
    informed = most * params.window >= settings.first_information
    return finish(
        "robust-rls",
        balance,
        vehicle,
        window_fit(balance, mean_phi, mean_y, params, settings),
        window_reason(table, valid, mean_phi),
        noise_share=NOISE_SHARE,
        gate=settings,
        running=np.where(informed, running, np.nan),
        spread=np.sqrt(var),
        phi=phi,
        y=y,
    )


def finish(
    method: str,
    balance: ForceBalance,
    vehicle: Vehicle,
    fit: WindowFit,
    row_reason: NDArray[np.uint8],
    *,
    noise_share: float,
    gate: GateSettings,
    running: Floats,
    spread: Floats,
    phi: Floats,
    y: Floats,
    final: Callable[[slice], float] | None = None,
) -> MassTrack:
    """Judge a running mass and make the track of it.

    Parameters
    ----------
    method : name of the estimator
    balance, vehicle
    fit : windows of the drive, for standard deviation and bound
    row_reason : (n,) why a row was not used
    noise_share : what noise of the motion costs, see
        `weighbridge.estimators.noisy_motion.row_noise_std` [-]
    gate : what a mass needs
    running, spread : (n,) running mass and its standard deviation from noise [kg]
    phi, y : (n,) regressor and right-hand side
    final : mass of some rows [kg]; that of ``fit`` when None
    """
    table = balance.table
    if fit.time.size < FEWEST_WINDOWS or not np.isfinite(running).any():
        return nothing(method, balance, vehicle, row_reason, int(fit.time.size), gate)
    used = row_reason == Reason.USED
    fitted, scatter, blocks = fit.mass()
    mass = fitted if final is None else final(slice(0, table.time.size))
    slow = consider_std(balance, phi, used, vehicle)
    index = np.maximum(np.searchsorted(table.time, fit.time, side="right") - 1, 0)
    weighed = Fitted(
        mass=mass,
        scatter=scatter,
        blocks=blocks,
        index=index,
        influence=fit.influence,
        noise_std=USUAL_STD * fit.attenuation if final is None else 0.0,
    )
    found = judged(balance, vehicle, used, phi, weighed, slow, noise_share, gate)
    # A running mass that forgets is that of a stretch of time.
    passing = np.hypot(slow, UNMODELLED_STD)

    def part(chosen: slice) -> tuple[float, float]:
        time = table.time[chosen]
        fitted, std, _ = fit.mass(float(time[0]), float(time[-1]))
        return (fitted if final is None else final(chosen)), std

    return MassTrack(
        method=method,
        balance=balance,
        running_mass=running,
        running_std=np.hypot(spread, running * passing),
        residual=np.where(used, y - phi * mass, np.nan),
        row_reason=row_reason,
        mass=mass,
        std=found.std,
        systematic_std=found.systematic_std,
        degrees_of_freedom=found.degrees_of_freedom,
        bound_std=fit.bound,
        converged_at=converged_at(table.time, running, mass, used),
        status=found.status,
        reason=found.reason,
        segments=segments(balance, vehicle, phi, used, part, gate),
    )
