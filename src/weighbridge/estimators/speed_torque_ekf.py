"""Extended Kalman filter on speed and recorded torque, without an accelerometer (Galvão et al.).

S. L. J. Galvão, R. M. Fontes, D. D. Santana, R. Requião: An Extended Kalman Filter
implementation for estimating the mass of passengers vehicles. Its eq. 13 has the torque of the
engine as the input; here that is the torque recorded, not one in proportion to the speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from weighbridge.balance import ForceBalance, Reason, law
from weighbridge.balance.force_balance import highest_torque
from weighbridge.constants import GRAVITY
from weighbridge.errors import ConfigError
from weighbridge.estimators.considered import fit_consider_std, force_columns
from weighbridge.estimators.gate import GateSettings
from weighbridge.estimators.joint.problem import UNMODELLED
from weighbridge.estimators.joint.slow_errors import inertia_relative_std
from weighbridge.estimators.judging import (
    HIDDEN_BRAKE_STD,
    USUAL_SLOPE,
    Evidence,
    converged_at,
    grade_apart,
    judge,
    lacks_accelerometer,
    nothing,
    segments,
)
from weighbridge.estimators.regression import regression
from weighbridge.estimators.speed_samples import (
    ROLLING_STD,
    sampled,
    span_means,
    span_of,
)
from weighbridge.estimators.track import MassTrack
from weighbridge.kernels import speed_torque_ekf as kernel
from weighbridge.signals import Bools, Floats, resolution
from weighbridge.signals.minimum import lowest_by_simplex
from weighbridge.vehicle import Vehicle, by_data_sheet, cold_torque_std, scale_std
from weighbridge.vehicle.data_sheet import offset_std

METHOD: Final = "speed-torque-ekf"

LEVELS: Final = (0.05, 0.05)
"""Noise of the speed beside its resolution [m/s] and of the acceleration [m/s^2 in one second],
before the drive has shown."""

SLOPE_STD: Final = 0.004
"""Standard deviation of the slope beside what the grade's says, before the drive [-]: with
it gusts and errors of the torque pass for hills, 0.04 m/s^2."""

UNMEASURED_GRADE: Final = 0.02
"""The same where no grade is used [-]."""

LEVEL_STD: Final = 1.0
"""Standard deviation of the logarithms of these before the drive has shown [-]."""

ROUNDS: Final = 3
"""Passes over the drive, each linearised about the mass of the one before."""

CLOSE: Final = 0.003
"""Masses of two passes nearer than this are the same [-]."""

MOTION_STD: Final = 0.025
"""Relative standard deviation that speeds leave in a mass without an accelerometer [-]."""

OTHER_MOTION_STD: Final = 0.02
"""The same where the vehicle file was made with an accelerometer [-]: its torque and delay are
those against that sensor. 58 drives of twelve vehicles of the second model were off by 3.2 %
(RMS), of which 2.1 % are of the calibration."""

GRADE_STD: Final = 6.0
"""The same over how much surer or less sure the grade was in the calibration [1/rad]: made with a
map, drives by heights were 6 % light, without a grade 10 %; made by heights and without, 4 %."""

BOUNDS_SHARE: Final = 0.5
"""Standard deviation over the distance between the masses by both Jacobians, where no calibration
has taken the bias of either out [-]: six recorded drives by whole km/h, gently driven."""

STRETCH: Final = 30.0
"""Slow errors make rows of less than this one piece of evidence [s]."""

TRIED: Final = 0.01
"""Part of the force by which a parameter is moved to see what it does to the mass [-]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedTorqueSettings(GateSettings):
    """Settings of filter and gate; what is None is found from the drive or the vehicle file.

    Attributes
    ----------
    initial_mass : tare, else usual mass of the class when None [kg]
    initial_std : its standard deviation, relative [-]
    initial_slope_std, initial_rolling_std : of these states at the start [-], with ``initial_std``
        the paper's P0; the sizes of both errors when None. The speed starts at its first sample,
        with its noise
    sample_time : between samples of the speed [s]; the paper's is 7 s
    speed_noise : of one sample of the speed [m/s]; the paper's R is its square
    accel_noise : white noise of the acceleration, in one second [m/s^2]
    slope_std : of the slope beside the measured grade, where it is stationary [-]
    slope_length : way over which that slope lasts [m]; inf for a random walk
    slope_walk : its growth as a random walk over one metre [-]
    rolling_std : slow error of the rolling coefficient [-]
    rolling_time : how long that lasts [s]
    mass_walk : change of the inverse mass in one second, relative [-]
    gate : innovations beyond so many standard deviations are left out [-]
    measured_grade : take grades of a map or by heights; off, the slope is a state alone
    measured_jacobian : linearise in the mass at the best estimate of the acceleration, that of
        `blended`. Off, at that of the model, as the paper does: then the driver's answer to hills
        and gusts is in the regressor
    constant_errors : estimate drag area, cold start and offset of the torque beside the mass
    """

    initial_mass: float | None = None
    initial_std: float = 0.3
    initial_slope_std: float | None = None
    initial_rolling_std: float | None = None
    sample_time: float = 1.0
    speed_noise: float | None = None
    accel_noise: float | None = None
    slope_std: float | None = None
    slope_length: float = 100.0
    slope_walk: float = 0.0
    rolling_std: float = ROLLING_STD
    rolling_time: float = 900.0
    mass_walk: float = 0.0
    gate: float = 4.0
    measured_grade: bool = True
    measured_jacobian: bool = True
    constant_errors: bool = True

    def __post_init__(self) -> None:
        GateSettings.__post_init__(self)
        for name in ("initial_std", "sample_time", "slope_length", "rolling_time", "gate"):
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"{name} must be positive, got {getattr(self, name)}")
        for name in ("initial_mass", "speed_noise"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ConfigError(f"{name} must be a positive number, got {value}")
        for name in (
            "initial_slope_std", "initial_rolling_std", "accel_noise", "slope_std", "slope_walk",
            "rolling_std", "mass_walk",
        ):  # fmt: skip
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value >= 0.0):
                raise ConfigError(f"{name} must be zero or positive, got {value}")
        if not self.sample_time <= 30.0:
            raise ConfigError(f"sample_time must be 30 s or less, got {self.sample_time}")


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterRun:
    """What the filter made of one drive; arrays one value per sample of the speed.

    Attributes
    ----------
    time : (n,) [s]
    table : what the filter was given
    params : of the last pass
    mass, std : at the end, by the filter's own covariance [kg]
    running_mass, running_std : (n,) of a pass from the settings' mass [kg]
    x : (n, 4 + k) states of the last pass
    innovation : (n,) of the speed [m/s]; NaN where nothing was predicted
    taken : (n,) samples that updated the mass
    """

    time: Floats
    table: kernel.Columns
    params: kernel.SpeedTorqueParams
    mass: float
    std: float
    running_mass: Floats
    running_std: Floats
    x: Floats
    innovation: Floats
    taken: Bools


def run_filter(
    balance: ForceBalance, vehicle: Vehicle, settings: SpeedTorqueSettings | None = None
) -> FilterRun:
    """Run the filter over a drive until the mass it is linearised about is the one it finds.

    Levels of noise that the settings do not state are those of highest likelihood.

    Parameters
    ----------
    balance, vehicle
    settings : the defaults when None
    """
    settings = settings or SpeedTorqueSettings()
    time, table = sampled(
        balance,
        vehicle,
        settings.sample_time,
        measured_grade=settings.measured_grade,
        measured_jacobian=settings.measured_jacobian,
        constant_errors=settings.constant_errors,
    )
    first = settings.initial_mass or vehicle.tare or vehicle.of_class.typical_mass
    low, high = vehicle.of_class.mass_range
    mass, levels, measured = first, np.zeros(3), table
    slope_var: Floats | float = math.nan
    for _ in range(ROUNDS):
        levels = _likeliest(balance, vehicle, settings, table, mass, levels)
        params = parameters(balance, vehicle, settings, mass, levels)
        table = blended(measured, params, mass, slope_var)
        start = initial_state(balance, vehicle, settings, mass, params)
        _, x, var, innovation, _, taken = kernel.run(start, table, params)
        slope_var = var[:, kernel.SLOPE]
        before, found = mass, float(1.0 / x[-1, kernel.INVERSE])
        mass = float(np.clip(found, low, high)) if found > 0.0 else high
        if abs(mass / before - 1.0) < CLOSE:
            break
    begin = initial_state(balance, vehicle, settings, first, params)
    _, forward, forward_var, _, _, _ = kernel.run(begin, table, params)
    running = 1.0 / forward[:, kernel.INVERSE]
    return FilterRun(
        time=time,
        table=table,
        params=params,
        mass=found,
        std=float(np.sqrt(var[-1, kernel.INVERSE])) * found**2,
        running_mass=running,
        running_std=np.sqrt(forward_var[:, kernel.INVERSE]) * running**2,
        x=x,
        innovation=innovation,
        taken=taken,
    )


def parameters(
    balance: ForceBalance,
    vehicle: Vehicle,
    settings: SpeedTorqueSettings,
    mass: float,
    levels: Floats,
) -> kernel.SpeedTorqueParams:
    """Make the kernel's parameters.

    Parameters
    ----------
    balance, vehicle, settings
    mass : rough [kg]
    levels : (3,) logarithms of the noise of speed, acceleration and slope over their usual sizes
    """
    motion = balance.motion
    quantum = resolution(motion.measured_speed.values) if motion.measured_speed is not None else 0.0
    usual = (
        float(np.hypot(LEVELS[0], quantum / np.sqrt(12.0))),
        LEVELS[1],
        float(np.hypot(SLOPE_STD, motion.unmeasured_grade))
        if settings.measured_grade
        else UNMEASURED_GRADE,
    )
    stated = (settings.speed_noise, settings.accel_noise, settings.slope_std)
    speed, accel, slope = (
        float(size * np.exp(level)) if said is None else said
        for said, size, level in zip(stated, usual, levels, strict=True)
    )
    road = vehicle.road.rolling_coefficient
    return kernel.SpeedTorqueParams(
        gravity=GRAVITY,
        rolling=road.value,
        rolling_speed=vehicle.road_load.rolling_speed_coefficient,
        speed_var=speed**2,
        accel_density=accel**2,
        gust_speed=law.GUST_SPEED,
        slope_var=slope**2,
        slope_length=settings.slope_length,
        slope_walk=settings.slope_walk**2,
        rolling_var=float(settings.rolling_std**2 + road.std**2),
        rolling_time=settings.rolling_time,
        mass_walk=(settings.mass_walk / mass) ** 2,
        gate=settings.gate,
    )


def blended(
    table: kernel.Columns,
    params: kernel.SpeedTorqueParams,
    mass: float,
    slope_var: Floats | float = math.nan,
) -> kernel.Columns:
    """Take as acceleration the best estimate, of the measured one and the model's.

    What multiplies the mass has noise in both: that of speed and slope in the measured one, that
    of force and gusts in the model's. Alone, the first draws the mass down and the second up.
    Weighed by their variances both cancel, as in Deming's regression.

    Parameters
    ----------
    table : with the measured acceleration; NaN stays
    params : with the levels of noise
    mass : rough [kg]
    slope_var : what is not known of the slope beside the measured grade, one or (n,): its variance
        as a pass before left it; that of the prior where NaN [-]

    References
    ----------
    Deming, Statistical Adjustment of Data, 1943, ch. 11.
    """
    speed, length = np.nan_to_num(table.speed), np.maximum(table.length, 1e-9)
    air = speed + table.headwind
    rolling = params.rolling + params.rolling_speed * speed
    lifted = params.gravity * (np.sin(table.grade) + rolling * np.cos(table.grade))
    pulled = (table.force - table.drag * air * np.abs(air)) / mass
    model = (pulled - lifted) / (1.0 + table.rotating / mass)
    gusts = 0.5 * (1.0 + (speed / params.gust_speed) ** 2)
    of_force = gusts * params.accel_density / length + table.force_var / mass**2
    unknown = np.where(np.isfinite(slope_var), slope_var, params.slope_var)
    of_motion = 2.0 * params.speed_var / length**2 + params.gravity**2 * unknown
    share = of_force / (of_force + of_motion)
    return table._replace(accel=share * table.accel + (1.0 - share) * model)


def initial_state(
    balance: ForceBalance,
    vehicle: Vehicle,
    settings: SpeedTorqueSettings,
    mass: float,
    params: kernel.SpeedTorqueParams,
) -> kernel.SpeedTorqueState:
    """Start at a mass [kg], with slope and errors of the force unknown but for their sizes."""
    constant = constant_std(balance, vehicle) if settings.constant_errors else np.zeros(0)
    own = (settings.initial_slope_std, settings.initial_rolling_std)
    usual = (params.slope_var, params.rolling_var)
    slope, rolling = (var if std is None else std**2 for std, var in zip(own, usual, strict=True))
    x = np.zeros(kernel.CONSTANT + constant.size)
    x[kernel.INVERSE] = 1.0 / mass
    inverse = (settings.initial_std / mass) ** 2
    cov = np.diag(np.concatenate(([params.speed_var, inverse, slope, rolling], constant**2)))
    return kernel.SpeedTorqueState(x, cov, False)


def constant_std(balance: ForceBalance, vehicle: Vehicle) -> Floats:
    """Standard deviations of the errors of `constant_columns` before the drive has shown (k,)."""
    table = balance.table
    torque = highest_torque(table.torque[table.usable])
    stds = [vehicle.road.drag_area.std, cold_torque_std(vehicle) * torque]
    if by_data_sheet(vehicle):
        stds += offset_std(vehicle, torque)
    return np.array(stds)


def _likeliest(
    balance: ForceBalance,
    vehicle: Vehicle,
    settings: SpeedTorqueSettings,
    table: kernel.Columns,
    mass: float,
    levels: Floats,
) -> Floats:
    """Find the levels of noise of highest likelihood, those that are stated aside (3,)."""
    stated = (settings.speed_noise, settings.accel_noise, settings.slope_std)
    free = np.array([said is None for said in stated])
    if not free.any():
        return levels

    def whole(some: Floats) -> Floats:
        every = levels.copy()
        every[free] = some
        return every

    def misfit(some: Floats) -> float:
        params = parameters(balance, vehicle, settings, mass, whole(some))
        start = initial_state(balance, vehicle, settings, mass, params)
        likelihood = float(kernel.log_likelihood(start, table, params))
        return -likelihood + 0.5 * float(np.sum((some / LEVEL_STD) ** 2))

    first = levels[free]
    return whole(lowest_by_simplex(misfit, first, np.full(first.size, 0.5), close=0.1)[0])


def estimate(
    balance: ForceBalance, vehicle: Vehicle, settings: SpeedTorqueSettings | None = None
) -> MassTrack:
    """Weigh by an extended Kalman filter of speed, inverse mass and slope; the torque is its input.

    The mass is that of the whole drive. Its standard deviation holds the filter's own, what
    the calibration does not determine by its effect on this drive's mass, and what speeds leave.

    Parameters
    ----------
    balance : best of a motion by speed
    vehicle
    settings : the defaults when None

    References
    ----------
    Galvão et al., eqs. 8 to 14 and 21 to 26. Levels of noise by likelihood: Schweppe, IEEE Trans.
    Information Theory 11, 1965. Consider parameters: Schmidt, 1966.
    """
    settings = settings or SpeedTorqueSettings()
    table = balance.table
    done = run_filter(balance, vehicle, settings)
    span = span_of(table.time, done.time)
    row_reason = _reasons(balance, done, span)
    used = row_reason == Reason.USED
    stretches = int(np.unique(done.time[done.taken] // STRETCH).size)
    if not used.any():
        return nothing(METHOD, balance, vehicle, row_reason, stretches, settings)
    phi, _ = regression(table, vehicle)
    mass = done.mass
    moved = sensitivity(balance, vehicle, settings, done)
    systematic = math.hypot(
        systematic_std(balance, vehicle),
        inertia_relative_std(vehicle, mass, table.accel, phi, used) if mass > 0.0 else 0.0,
        UNMODELLED * fit_consider_std(vehicle, moved, mass),
        jacobian_std(balance, vehicle, settings, mass),
    )
    std = math.hypot(UNMODELLED * done.std, mass * systematic)
    evidence = Evidence(
        table=table, used=used, phi=phi, mass=mass, std=std, blocks=stretches,
        systematic_std=abs(mass) * systematic, gate=settings,
    )  # fmt: skip
    status, reason = judge(evidence, vehicle)
    before = np.searchsorted(done.time, table.time, side="right") - 1
    after_first = np.cumsum(done.taken)[np.maximum(before, 0)] > 0
    running = np.where(after_first, done.running_mass[np.maximum(before, 0)], np.nan)
    spread = UNMODELLED * done.running_std[np.maximum(before, 0)]
    pull = done.innovation * mass / np.maximum(done.table.length, 1e-9)

    def part(chosen: slice) -> tuple[float, float]:
        return _mass_of_part(balance, vehicle, settings, done, table.time[chosen])

    return MassTrack(
        method=METHOD,
        balance=balance,
        running_mass=running,
        running_std=np.where(after_first, np.hypot(spread, running * systematic), np.nan),
        residual=np.where(used, -pull[span], np.nan),
        row_reason=row_reason,
        mass=mass,
        std=std,
        systematic_std=abs(mass) * systematic,
        degrees_of_freedom=float("inf"),
        bound_std=done.std,
        converged_at=converged_at(table.time, running, mass, used),
        status=status,
        reason=reason,
        segments=segments(balance, vehicle, phi, used, part, settings),
        sensitivity=moved,
    )


def _reasons(balance: ForceBalance, done: FilterRun, span: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Why a row did not count: left out by the gate, or its span holds rows that are not usable."""
    reason = balance.table.reason.copy()
    usable = balance.table.usable
    inside = (balance.table.time > done.time[0]) & (balance.table.time <= done.time[-1])
    predicted = np.isfinite(done.innovation)
    reason[usable & ~predicted[span]] = Reason.TOO_SHORT
    reason[usable & predicted[span] & ~done.taken[span]] = Reason.BAD_FIT
    reason[usable & ~inside] = Reason.NO_MOTION
    return reason


def systematic_std(balance: ForceBalance, vehicle: Vehicle) -> float:
    """Relative standard deviation that no row of this drive can take away [-]."""
    made = vehicle.provenance
    return math.hypot(
        made.mass_scale_std if made.mass_scale_std is not None else scale_std(vehicle),
        MOTION_STD,
        OTHER_MOTION_STD if lacks_accelerometer(vehicle, balance.motion) else 0.0,
        GRADE_STD * grade_apart(vehicle, balance.motion),
        HIDDEN_BRAKE_STD if balance.brake_hidden else 0.0,
        balance.coarse_std,
        USUAL_SLOPE * balance.air_std,
    )


def jacobian_std(
    balance: ForceBalance, vehicle: Vehicle, settings: SpeedTorqueSettings, mass: float
) -> float:
    """Relative standard deviation by the noise of speed, grade and torque that bias the mass [-].

    Noise of speed and grade draws the mass down with the Jacobian at the measured acceleration, and
    noise of the torque draws it up with that at the model's, so that the two bound it. A
    calibration takes the bias of its method out.

    References
    ----------
    R. Frisch, Statistical Confluence Analysis, 1934: both regressions bound the slope.
    """
    if vehicle.provenance.mass_scale_std is not None or not mass > 0.0:
        return 0.0
    turned = replace(settings, measured_jacobian=not settings.measured_jacobian)
    other = run_filter(balance, vehicle, turned).mass
    return BOUNDS_SHARE * abs(math.log(other / mass)) if other > 0.0 else 1.0


def sensitivity(
    balance: ForceBalance, vehicle: Vehicle, settings: SpeedTorqueSettings, done: FilterRun
) -> Floats:
    """How far one unit of each parameter of the calibration moves the mass (k,) [kg per unit].

    The filter is run again with the force moved by a small part along each column of
    `weighbridge.estimators.considered.force_columns`.
    """
    table = balance.table
    size = float(np.sqrt(np.mean(done.table.force**2)))
    start = initial_state(balance, vehicle, settings, done.mass, done.params)
    still = done.table._replace(on=done.table.on & (done.taken | ~np.isfinite(done.innovation)))
    params = done.params._replace(gate=math.inf)
    moved = []
    for column in force_columns(balance, vehicle, done.mass).T:
        mean = span_means(table.time, np.where(table.usable, column, 0.0), done.time)
        scale = float(np.sqrt(np.mean(mean**2)))
        if not (scale > 0.0 and size > 0.0):
            moved.append(0.0)
            continue
        by = TRIED * size / scale
        ends = []
        for sign in (-1.0, 1.0):
            pushed = still._replace(force=still.force + sign * by * mean)
            end = kernel.run(start, pushed, params)[0]
            ends.append(1.0 / float(end.x[kernel.INVERSE]))
        moved.append((ends[1] - ends[0]) / (2.0 * by))
    return np.array(moved)


def _mass_of_part(
    balance: ForceBalance,
    vehicle: Vehicle,
    settings: SpeedTorqueSettings,
    done: FilterRun,
    time: Floats,
) -> tuple[float, float]:
    """Mass of some rows alone and its standard deviation by noise [kg]."""
    chosen = (done.time >= time[0]) & (done.time <= time[-1])
    if not (np.any(done.taken & chosen) and done.mass > 0.0):
        return float("nan"), float("inf")
    table = kernel.Columns(*(np.ascontiguousarray(column[chosen]) for column in done.table))
    start = initial_state(balance, vehicle, settings, done.mass, done.params)
    end = kernel.run(start, table, done.params)[0]
    inverse, var = float(end.x[kernel.INVERSE]), float(end.cov[kernel.INVERSE, kernel.INVERSE])
    if not inverse > 0.0:
        return float("nan"), float("inf")
    return 1.0 / inverse, UNMODELLED * math.sqrt(var) / inverse**2
