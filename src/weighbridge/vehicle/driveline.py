"""Driveline, road load and sensor of a vehicle: constants that a vehicle file states."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np

from weighbridge.arguments import check_choice
from weighbridge.errors import ConfigError
from weighbridge.vehicle.possible import not_negative, positive, within

Layout = Literal["transverse", "longitudinal"]
Driven = Literal["front", "rear", "all"]

# Angles are written from -180 to 180 or from 0 to 360 degrees [rad].
_TURN: Final = 2.0 * math.pi + 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Driveline:
    """Constants of one driveline.

    Attributes
    ----------
    gearings : effective gearing ``G = i_t i_d / r`` of gears 1..n, engine angle
        per distance travelled; one value for a single-speed vehicle [1/m]
    gearing_stds : standard deviations of the gearings, same length or empty [1/m]
    gearing_range : lowest and highest effective gearing of a stepless gearbox, which has no
        ``gearings``: its gearing is engine over vehicle speed at each instant [1/m]; None where
        there are gears, or they are not known
    engine_inertia, engine_inertia_std : all that turns with the engine or motor
        and its standard deviation [kg m^2]; None where it is not stated, see `Vehicle.road`
    wheel_inertia, wheel_inertia_std : all wheels and what turns with them [kg m^2], likewise
    wheel_radius : effective rolling radius [m]
    layout : how the engine of a car or van lies, "transverse" or "longitudinal"; None where
        it is not known
    driven : which axles are: "front", "rear" or "all"; None where it is not known
    efficiency : wheel over engine power when driving, in (0, 1] [-]; 1 where the
        torque was calibrated at the wheels; None for that of such drivelines, see
        `weighbridge.vehicle.data_sheet.wheel_efficiency`
    speed_scale : indicated over true vehicle speed [-]
    idle_speed : engine idle speed [rad/s]; 0 where it is unknown or the motor stands
    """

    gearings: tuple[float, ...] = ()
    gearing_stds: tuple[float, ...] = ()
    gearing_range: tuple[float, float] | None = None
    engine_inertia: float | None = None
    engine_inertia_std: float | None = None
    wheel_inertia: float | None = None
    wheel_inertia_std: float | None = None
    wheel_radius: float = 0.31
    layout: Layout | None = None
    driven: Driven | None = None
    efficiency: float | None = None
    speed_scale: float = 1.0
    idle_speed: float = 0.0

    def __post_init__(self) -> None:
        for g in self.gearings:
            positive("a gearing", g)
            within("a gearing", g, 0.01, 10_000.0, "per m")
        if list(self.gearings) != sorted(self.gearings, reverse=True):
            raise ConfigError(f"gearings must fall from first to last gear, got {self.gearings}")
        if self.gearing_stds and len(self.gearing_stds) != len(self.gearings):
            raise ConfigError("gearing_stds must be as many as gearings")
        if self.gearing_range is not None:
            for g in self.gearing_range:
                within("one of gearing_range", g, 0.01, 10_000.0, "per m")
            if not self.gearing_range[0] < self.gearing_range[1]:
                raise ConfigError(f"gearing_range must rise, got {self.gearing_range}")
            if self.gearings:
                raise ConfigError("give gearings, or the gearing_range of a stepless gearbox")
        not_negative("engine_inertia", self.engine_inertia)
        not_negative("wheel_inertia", self.wheel_inertia)
        within("engine_inertia", self.engine_inertia, 0.0, 10_000.0, "kg m^2")
        within("wheel_inertia", self.wheel_inertia, 0.0, 10_000.0, "kg m^2")
        within("engine_inertia_std", self.engine_inertia_std, 0.0, 10_000.0, "kg m^2")
        within("wheel_inertia_std", self.wheel_inertia_std, 0.0, 10_000.0, "kg m^2")
        positive("wheel_radius", self.wheel_radius)
        within("wheel_radius", self.wheel_radius, 0.05, 3.0, "m")
        not_negative("idle_speed", self.idle_speed)
        within("idle_speed", self.idle_speed, 0.0, 1_000.0, "rad/s")
        if self.layout is not None:
            check_choice("layout", self.layout, get_args(Layout))
        if self.driven is not None:
            check_choice("driven", self.driven, get_args(Driven))
        if self.efficiency is not None and not 0.0 < self.efficiency <= 1.0:
            raise ConfigError(f"efficiency must be in (0, 1], got {self.efficiency}")
        within("efficiency", self.efficiency, 0.05, 1.0)
        if not 0.8 <= self.speed_scale <= 1.2:
            raise ConfigError(f"speed_scale must be in [0.8, 1.2], got {self.speed_scale}")

    @property
    def single_speed(self) -> bool:
        """Whether there is one fixed gear."""
        return len(self.gearings) == 1

    @property
    def stepless(self) -> bool:
        """Whether the gearing moves between two ends."""
        return self.gearing_range is not None

    @property
    def usual_gearing(self) -> float:
        """Geometric mean of the gearings [1/m]; 0 where there are not several."""
        known = self.gearing_range or self.gearings
        if len(known) < 2:
            return 0.0
        return float(np.exp(np.mean(np.log(known))))


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadLoad:
    """Air drag and rolling resistance.

    Attributes
    ----------
    drag_area : drag coefficient times frontal area C_d A [m^2]; None where it is not stated, see
        `Vehicle.road`
    rolling_coefficient : rolling resistance coefficient C_r [-], likewise; at standstill
        where it grows with speed
    rolling_speed_coefficient : its growth with speed [s/m]
    drag_area_std, rolling_coefficient_std : their standard deviations; None where not stated
    """

    drag_area: float | None = None
    rolling_coefficient: float | None = None
    rolling_speed_coefficient: float = 0.0
    drag_area_std: float | None = None
    rolling_coefficient_std: float | None = None

    def __post_init__(self) -> None:
        if self.drag_area is not None and not 0.0 <= self.drag_area < 20.0:
            raise ConfigError(f"drag_area must be in [0, 20) m^2, got {self.drag_area}")
        rolling = self.rolling_coefficient
        if rolling is not None and not 0.0 <= rolling < 0.1:
            raise ConfigError(f"rolling_coefficient must be in [0, 0.1), got {rolling}")
        if not 0.0 <= self.rolling_speed_coefficient < 0.002:
            raise ConfigError(
                "rolling_speed_coefficient must be in [0, 0.002) s/m, "
                f"got {self.rolling_speed_coefficient}"
            )
        within("drag_area_std", self.drag_area_std, 0.0, 1_000.0, "m^2")
        within("rolling_coefficient_std", self.rolling_coefficient_std, 0.0, 10.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mounting:
    """How the inertial sensor sits in the vehicle.

    Attributes
    ----------
    roll, pitch, yaw : of the rotation from sensor to body axes (forward, right,
        down), ``x_b = Rz(yaw) Ry(pitch) Rx(roll) x_s`` [rad]
    std : standard deviations of the three [rad]
    squat : pitch of the body per forward acceleration k [rad per m/s^2]
    squat_std : its standard deviation
    """

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    std: tuple[float, float, float] | None = None
    squat: float | None = None
    squat_std: float | None = None

    def __post_init__(self) -> None:
        for name in ("roll", "pitch", "yaw"):
            within(name, getattr(self, name), -_TURN, _TURN, "rad")
        for std in self.std or ():
            within("one of std", std, 0.0, _TURN, "rad")
        within("squat", self.squat, -1.0, 1.0, "rad per m/s^2")
        within("squat_std", self.squat_std, 0.0, 1.0, "rad per m/s^2")
