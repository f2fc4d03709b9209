"""Training of Jensen et al. 2022 as printed (sec. 6): its filter, plain squares, its grid.

No lateness, no lean of the body, no reasons against rows but a speed that does not rise.
"""

from __future__ import annotations

import datetime
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance, Reason, force_balance
from weighbridge.calibration.grid import grid_search
from weighbridge.calibration.recording import Recording
from weighbridge.calibration.regression import TorqueRows, build_rows, fit
from weighbridge.errors import ConfigError
from weighbridge.kernels.rotation import matrix_to_euler
from weighbridge.navigation import PrintedFilterSettings, mounting_of, printed_motion
from weighbridge.signals import Bools, Drive, Floats
from weighbridge.vehicle import (
    TORQUE_SOURCES,
    Mounting,
    Provenance,
    RoadLoad,
    Timing,
    TorqueModel,
    Vehicle,
    detect_gearings,
)
from weighbridge.vehicle.fits import RLS

GRID: Final = ("grid_drag_area", "grid_rolling", "grid_engine", "grid_wheels")
"""Settings of the grid, in the order of the road parameters."""

PAPER_STD: Final = 0.025
"""Relative standard deviation left in a mass [-]: the paper's band of 5 % (sec. 8), as 95 %."""

_NOT_THERE: Final = (Reason.STANDING, Reason.NO_MOTION, Reason.NO_TORQUE)
"""Reasons against rows that the paper has as well: they carry nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingSettings:
    """What the paper chooses or varies of its training; the defaults are printed.

    Attributes
    ----------
    order : highest power of engine speed in eq. 49
    grid : solve on the grid of Table 5; the least squares with its limits else
    grid_drag_area, grid_rolling, grid_engine, grid_wheels : lower limit, upper limit and step of
        C_d A [m^2], C_r [-], I_e and I_w [kg m^2] in Table 5
    shifts : rows of shifts and of a slipping clutch count, as in the paper
    gear_width : half width of the intervals of eq. 50 over their centre [-]
    filter : noise, start and windows of the navigation
    """

    order: int = 2
    grid: bool = True
    grid_drag_area: tuple[float, float, float] = (0.30, 1.00, 0.05)
    grid_rolling: tuple[float, float, float] = (0.002, 0.030, 0.002)
    grid_engine: tuple[float, float, float] = (0.02, 1.00, 0.02)
    grid_wheels: tuple[float, float, float] = (2.0, 12.0, 1.0)
    shifts: bool = True
    gear_width: float = 0.02
    filter: PrintedFilterSettings = field(default_factory=PrintedFilterSettings)

    def __post_init__(self) -> None:
        if not 1 <= self.order <= 4:
            raise ConfigError(f"order must be between 1 and 4, got {self.order}")
        if not 0.001 <= self.gear_width <= 0.05:
            raise ConfigError(f"gear_width must be in [0.001, 0.05], got {self.gear_width:g}")
        for name, (low, high, step) in zip(GRID, self._limits, strict=True):
            if not (0.0 <= low <= high and step > 0.0 and (high - low) / step < 1000.0):
                raise ConfigError(
                    f"{name} takes a lower limit, an upper one and a step, less than 1000 steps, "
                    f"got {low:g}, {high:g}, {step:g}"
                )

    @property
    def _limits(self) -> tuple[tuple[float, float, float], ...]:
        return tuple(getattr(self, name) for name in GRID)

    @property
    def axes(self) -> tuple[Floats, ...]:
        """Values of each road parameter on the grid."""
        return tuple(
            np.asarray(low + step * np.arange(round((high - low) / step) + 1), dtype=np.float64)
            for low, high, step in self._limits
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedCar:
    """What the training phase finds (sec. 6).

    Attributes
    ----------
    vehicle : gearings, road load and torque regression
    mounting : (3, 3) sensor to vehicle axes
    r_squared : of eq. 48, unweighted, over the rows of the fit [-]
    balance : of the drive of known mass
    fitted : (n,) rows of it that the fit took
    """

    vehicle: Vehicle
    mounting: Floats
    r_squared: float
    balance: ForceBalance
    fitted: Bools


def calibrate_as_printed(
    drive: Drive, mass: float, base: Vehicle, settings: TrainingSettings | None = None
) -> PrintedCar:
    """Train on one drive of known mass (sec. 6.1, 6.2).

    Parameters
    ----------
    drive : with inertial sensor, GNSS, vehicle and engine speed and engine load; begins at rest
    mass : known [kg]
    base : its wheel radius, class and tare are taken over
    settings : the paper's when None

    Raises
    ------
    DriveError
        The drive lacks a signal, or no gear stands out.
    """
    settings = settings or TrainingSettings()
    mounting = mounting_of(drive, base.mounting, settings.filter)
    motion = printed_motion(drive, mounting, settings.filter)
    engine = drive.signals["engine_speed"]
    inside = (engine.time >= motion.time[0]) & (engine.time <= motion.time[-1])
    time = engine.time[inside]
    speed = np.interp(time, motion.time, motion.speed)
    gears = detect_gearings(time, engine.values[inside], speed, width=settings.gear_width)
    draft = replace(
        base,
        driveline=replace(
            base.driveline,
            gearings=tuple(float(g) for g in gears.gearings),
            gearing_stds=(),
            gearing_range=None,
            efficiency=1.0,
        ),
        torque=TorqueModel(source="measured"),
        mounting=base.mounting or _angles(mounting),
    )
    recording = Recording.of(drive, motion, mass, draft, TORQUE_SOURCES["load"])
    balance = recording.balance(0.0)
    table = balance.table
    used = pulling(balance) & np.isfinite(recording.reading)
    if not settings.shifts:
        used &= ~np.isin(table.reason, (Reason.SHIFTING, Reason.CLUTCH_SLIPPING))
    rows = build_rows(
        table,
        recording.reading,
        table.engine_speed,
        mass=mass,
        wheel_radius=draft.driveline.wheel_radius,
        order=settings.order,
        curved=False,
        rows=used,
    )
    coefficients, road = _solved(rows, draft, settings)
    explained = r_squared(rows, coefficients, road)
    vehicle = replace(
        fitted_vehicle(draft, coefficients, road),
        provenance=Provenance(
            drives=(drive.name,),
            masses=(mass,),
            date=datetime.date.today().isoformat(),
            r_squared=explained,
            samples=int(rows.target.size),
            method=RLS.name,
            motion=motion.source,
            mass_scale_std=PAPER_STD,
        ),
    )
    return PrintedCar(
        vehicle=vehicle,
        mounting=mounting,
        r_squared=explained,
        balance=force_balance(drive, vehicle, motion, delay=0.0, lag=0.0),
        fitted=used,
    )


def pulling(balance: ForceBalance) -> Bools:
    """Rows (n,) with rising speed, in a gear: those of eqs. 4 and 48 by sec. 7.1."""
    table = balance.table
    return np.asarray(
        ~np.isin(table.reason, _NOT_THERE)
        & (table.accel > 0.0)
        & np.isfinite(table.gearing)
        & np.isfinite(table.engine_speed)
    )


def r_squared(rows: TorqueRows, coefficients: Floats, road: Floats) -> float:
    """Part of the torque of the motion that eq. 49 explains, each row counted once [-]."""
    torque = rows.target - rows.design[:, -4:] @ road
    residual = torque - rows.design[:, :-4] @ coefficients
    return float(1.0 - np.sum(residual**2) / np.sum((torque - np.mean(torque)) ** 2))


def fitted_vehicle(draft: Vehicle, coefficients: Floats, road: Floats) -> Vehicle:
    """Return a vehicle with the parameters of eq. 48."""
    return replace(
        draft,
        driveline=replace(
            draft.driveline, engine_inertia=float(road[2]), wheel_inertia=float(road[3])
        ),
        torque=TorqueModel(source="load", coefficients=tuple(float(w) for w in coefficients)),
        road_load=RoadLoad(drag_area=float(road[0]), rolling_coefficient=float(road[1])),
        timing=Timing(torque_delay=0.0),
    )


def _solved(rows: TorqueRows, draft: Vehicle, settings: TrainingSettings) -> tuple[Floats, Floats]:
    """Regression weights and road parameters of eq. 48, plain squares."""
    if settings.grid:
        coefficients, road, _ = grid_search(rows, np.ones(rows.target.size), settings.axes)
        return coefficients, road
    # The first round weighs all rows alike.
    once = fit(rows, *draft.of_class.road_bounds, iterations=1)
    return once.coefficients, once.road


def _angles(mounting: Floats) -> Mounting:
    """Roll, pitch and yaw of a rotation (3, 3) from sensor to vehicle axes."""
    roll, pitch, yaw = matrix_to_euler(mounting)
    return Mounting(roll=float(roll), pitch=float(pitch), yaw=float(yaw))
