"""Jensen et al. 2022 by the paper's own rules: its filter, its fit, its recursive least squares.

Nothing of ours is in the way from the samples to the running mass: no lateness, no lean of the
body, no reasons against rows but a speed that does not rise, plain squares on the grid of Table 5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from weighbridge.balance import ForceBalance, Reason, force_balance
from weighbridge.calibration.grid import grid_search
from weighbridge.calibration.recording import Recording
from weighbridge.calibration.regression import TorqueRows, build_rows, fit
from weighbridge.errors import ConfigError
from weighbridge.estimators.rls import RlsSettings, estimate
from weighbridge.estimators.track import MassTrack
from weighbridge.papers.jensen2022_filter import (
    PrintedFilterSettings,
    level_mounting,
    printed_motion,
)
from weighbridge.signals import Bools, Drive, Floats
from weighbridge.vehicle.driveline import Driveline, RoadLoad
from weighbridge.vehicle.gear import detect_gearings
from weighbridge.vehicle.model import Vehicle
from weighbridge.vehicle.torque_model import Timing, TorqueModel
from weighbridge.vehicle.torque_sources import TORQUE_SOURCES

TYRE_RADIUS: Final = 0.319
"""Outer tyre radius [m] (Table 1)."""

GRID: Final = ("grid_drag_area", "grid_rolling", "grid_engine", "grid_wheels")
"""Settings of the grid, in the order of the road parameters."""

_NOT_THERE: Final = (Reason.STANDING, Reason.NO_MOTION, Reason.NO_TORQUE)
"""Reasons against rows that the paper has as well: they carry nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedSettings:
    """What the paper chooses or varies; the defaults are printed.

    Attributes
    ----------
    forgetting, initial_mass, initial_gain : of eqs. 7-9 [-], [kg], [s^4/m^2]
    order : highest power of engine speed in eq. 49
    grid : solve on the grid of Table 5; the least squares with its limits else
    grid_drag_area, grid_rolling, grid_engine, grid_wheels : lower limit, upper limit and step of
        C_d A [m^2], C_r [-], I_e and I_w [kg m^2] in Table 5
    gear_width : half width of the intervals of eq. 50 over their centre [-]
    engine_efficiency : of eq. 51, which the paper chose by the largest torque [-]
    filter : noise, start and windows of the navigation
    """

    forgetting: float = 0.9995
    initial_mass: float = 1000.0
    initial_gain: float = 1000.0
    order: int = 2
    grid: bool = True
    grid_drag_area: tuple[float, float, float] = (0.30, 1.00, 0.05)
    grid_rolling: tuple[float, float, float] = (0.002, 0.030, 0.002)
    grid_engine: tuple[float, float, float] = (0.02, 1.00, 0.02)
    grid_wheels: tuple[float, float, float] = (2.0, 12.0, 1.0)
    gear_width: float = 0.02
    engine_efficiency: float = 0.33
    filter: PrintedFilterSettings = field(default_factory=PrintedFilterSettings)

    def __post_init__(self) -> None:
        if not 1 <= self.order <= 4:
            raise ConfigError(f"order must be between 1 and 4, got {self.order}")
        if not 0.001 <= self.gear_width <= 0.05:
            raise ConfigError(f"gear_width must be in [0.001, 0.05], got {self.gear_width:g}")
        if not 0.05 <= self.engine_efficiency <= 0.6:
            raise ConfigError(
                f"engine_efficiency must be in [0.05, 0.6], got {self.engine_efficiency:g}"
            )
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

    @property
    def rls(self) -> RlsSettings:
        """Settings of the estimator: no gate, no guard, every row with rising speed."""
        return RlsSettings(
            forgetting=self.forgetting,
            initial_mass=self.initial_mass,
            initial_gain=self.initial_gain,
            gate=math.inf,
            wind_up_guard=False,
            every_row=True,
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
    drive: Drive, mass: float, settings: PrintedSettings | None = None
) -> PrintedCar:
    """Train on one drive of known mass (sec. 6.1, 6.2).

    Parameters
    ----------
    drive : with inertial sensor, GNSS, vehicle and engine speed and engine load; begins at rest
    mass : known [kg]
    settings : the paper's when None

    Raises
    ------
    DriveError
        The drive lacks a signal, or no gear stands out.
    """
    settings = settings or PrintedSettings()
    mounting = level_mounting(drive, settings.filter)
    motion = printed_motion(drive, mounting, settings.filter)
    engine = drive.signals["engine_speed"]
    inside = (engine.time >= motion.time[0]) & (engine.time <= motion.time[-1])
    time = engine.time[inside]
    speed = np.interp(time, motion.time, motion.speed)
    gears = detect_gearings(time, engine.values[inside], speed, width=settings.gear_width)
    draft = Vehicle(
        name=drive.info.vehicle or "car",
        driveline=Driveline(
            gearings=tuple(float(g) for g in gears.gearings),
            wheel_radius=TYRE_RADIUS,
            efficiency=1.0,
        ),
        torque=TorqueModel(source="measured"),
    )
    recording = Recording.of(drive, motion, mass, draft, TORQUE_SOURCES["load"])
    balance = recording.balance(0.0)
    table = balance.table
    used = pulling(balance) & np.isfinite(recording.reading)
    rows = build_rows(
        table,
        recording.reading,
        table.engine_speed,
        mass=mass,
        wheel_radius=TYRE_RADIUS,
        order=settings.order,
        curved=False,
        rows=used,
    )
    coefficients, road = _solved(rows, draft, settings)
    vehicle = fitted_vehicle(draft, coefficients, road)
    return PrintedCar(
        vehicle=vehicle,
        mounting=mounting,
        r_squared=r_squared(rows, coefficients, road),
        balance=force_balance(drive, vehicle, motion, delay=0.0, lag=0.0),
        fitted=used,
    )


def weigh_as_printed(
    drive: Drive, car: PrintedCar, settings: PrintedSettings | None = None
) -> MassTrack:
    """Weigh a drive by the paper's filter and recursive least squares (secs. 3-5).

    Its ``running_mass`` is the paper's; the final mass is of all rows at once, as of `rls`.

    Raises
    ------
    DriveError
        The drive lacks a signal, or does not begin at rest.
    """
    settings = settings or PrintedSettings()
    motion = printed_motion(drive, car.mounting, settings.filter)
    balance = force_balance(drive, car.vehicle, motion, delay=0.0, lag=0.0)
    return estimate(balance, car.vehicle, settings.rls)


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


def _solved(rows: TorqueRows, draft: Vehicle, settings: PrintedSettings) -> tuple[Floats, Floats]:
    """Regression weights and road parameters of eq. 48, plain squares."""
    if settings.grid:
        coefficients, road, _ = grid_search(rows, np.ones(rows.target.size), settings.axes)
        return coefficients, road
    # The first round weighs all rows alike.
    once = fit(rows, *draft.of_class.road_bounds, iterations=1)
    return once.coefficients, once.road
