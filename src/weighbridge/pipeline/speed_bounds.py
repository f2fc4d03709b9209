"""What speed alone does say beside a grade: an upper bound of the mass, and drag over mass.

Neither is a weighing: a bound is no estimate, and a coast-down shows no mass.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final

import numpy as np

from weighbridge.arguments import check_all, check_number, check_type
from weighbridge.balance.law import rotating_mass
from weighbridge.constants import GRAVITY
from weighbridge.errors import ConfigError, DriveError
from weighbridge.estimators.track import Status
from weighbridge.limits import SIGNIFICANT
from weighbridge.navigation import Motion, find_motion, without_accelerometer
from weighbridge.signals import Drive, Floats
from weighbridge.signals.instants import instant
from weighbridge.signals.student import student_quantile
from weighbridge.vehicle import Vehicle, air_density
from weighbridge.visible import visible_json

WINDOW: Final = 10.0
"""Over which power is averaged [s]: what a driver holds at full load on a climb."""

SLOWEST: Final = 4.0
"""Windows with a slower sample are left out: clutch and converter slip [m/s]."""

COAST_WINDOW: Final = 4.0
"""Over which a coast-down is differenced [s]."""

Span = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class MassBound:
    """An upper bound of the mass, from the power of the engine.

    Attributes
    ----------
    mass : upper bound of the mass with 95 % probability [kg]; NaN without a climb
    nearest, nearest_std : mass that the window of the bound would say if it was driven at full
        power, and its standard deviation [kg]
    start : when that window begins [s]
    windows : how many were hard enough to bound a mass
    status : never `Status.CONVERGED`, because nothing proves full power
    reason : in a sentence
    """

    mass: float
    nearest: float
    nearest_std: float
    start: float
    windows: int
    status: Status
    reason: str

    def to_json(self, name: str) -> str:
        """Return what ``weighbridge bound --json`` prints of the drive with this name."""
        return _json(
            drive=name,
            status=str(self.status),
            reason=self.reason,
            bound_kg=self.mass,
            nearest_kg=self.nearest,
            nearest_std_kg=self.nearest_std,
            start_s=self.start,
            windows=self.windows,
        )


def _json(**values: object) -> str:
    """Write an object; numbers that are none are null."""
    known = {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in values.items()}
    return visible_json(json.dumps(known, ensure_ascii=False))


def _check_given(drive: Drive, vehicle: Vehicle) -> None:
    check_type("drive", drive, Drive, "a drive, as read_drive returns it")
    check_type("vehicle", vehicle, Vehicle, "a vehicle, as Vehicle.load returns it")


def mass_bound(
    drive: Drive, vehicle: Vehicle, power: float, *, power_std: float = 0.05
) -> MassBound:
    """Find an upper bound of the mass from speed, grade and the engine's full power.

    No window of a drive asks for more power than the engine has: kinetic and potential energy and
    rolling resistance, all in proportion to the mass, and air drag. Each window bounds the mass;
    the lowest bound counts, each taken high enough that all of them hold together.

    Parameters
    ----------
    drive : with a speed, and a grade (of a map) or heights
    vehicle : road load, wheel inertia
    power : full power at the wheels [W]
    power_std : its standard deviation, relative [-]

    Raises
    ------
    ConfigError
        The power is not positive.
    DriveError
        There is no speed, or neither grade nor heights.

    References
    ----------
    Bonferroni's inequality: Miller, Simultaneous Statistical Inference, 1981, ch. 1.
    """
    _check_given(drive, vehicle)
    check_number("power", power)
    check_number("power_std", power_std)
    if not (math.isfinite(power) and power > 0.0):
        raise ConfigError(f"power must be a positive number of W, got {power}")
    if not 0.0 <= power_std < 0.5:
        raise ConfigError(f"power_std must be in [0, 0.5), got {power_std}")
    motion = _graded(drive, vehicle)
    start, gain, gain_std, force_work = _windows(drive, motion, vehicle)
    hard = gain > np.maximum(SIGNIFICANT * gain_std, 1e-9)
    if not hard.any():
        return MassBound(
            mass=math.nan, nearest=math.nan, nearest_std=math.nan, start=math.nan, windows=0,
            status=Status.NOT_EXCITED,
            reason="no climb or start is steep enough beside its errors: nothing bounds the mass",
        )  # fmt: skip
    start, gain, gain_std, force_work = (x[hard] for x in (start, gain, gain_std, force_work))
    most = (power * WINDOW - force_work) / gain
    std = np.hypot(power_std * power * WINDOW / gain, most * gain_std / gain)
    bound = most + -NormalDist().inv_cdf(0.05 / most.size) * std
    best = int(np.argmin(bound))
    return MassBound(
        mass=float(bound[best]),
        nearest=float(most[best]),
        nearest_std=float(std[best]),
        start=float(start[best]),
        windows=int(most.size),
        status=Status.NOT_EXCITED,
        reason=(
            f"speed and grade say at most {bound[best]:.0f} kg by a full power of "
            f"{power / 1e3:.0f} kW: a bound, for nothing shows that the engine gave all of it"
        ),
    )


def _graded(drive: Drive, vehicle: Vehicle) -> Motion:
    """Find the motion by speed, with a grade.

    Raises
    ------
    DriveError
        Nothing shows the grade.
    """
    motion = find_motion(without_accelerometer(drive), vehicle)
    if motion.source != "speed_grade":
        raise DriveError(
            f"{drive.name}: no grade and no altitude over a long enough way; without them a climb "
            "is not seen: add grade_pct of a map, or altitude_m"
        )
    return motion


def _windows(
    drive: Drive, motion: Motion, vehicle: Vehicle
) -> tuple[Floats, Floats, Floats, Floats]:
    """Cut a drive into windows and return the energy that each takes.

    Returns
    -------
    start : (n,) [s]
    gain, gain_std : (n,) energy over the mass, and its standard deviation [J/kg]
    rest : (n,) energy that is not in proportion to the mass: drag and wheels [J]
    """
    size = max(2, round(WINDOW * motion.rate))
    begin = np.arange(0, motion.time.size - size, size)
    end = begin + size
    dt = 1.0 / motion.rate
    speed, road = motion.speed, vehicle.road

    def summed(values: Floats) -> Floats:
        total = np.concatenate(([0.0], np.cumsum(values)))
        return np.asarray((total[end] - total[begin]) * dt)

    bad = summed((~motion.valid | (speed < SLOWEST)).astype(np.float64)) > 0.0
    way = summed(speed)
    kinetic = 0.5 * (speed[end] ** 2 - speed[begin] ** 2)
    rolling = road.rolling_coefficient.value + vehicle.road_load.rolling_speed_coefficient * speed
    gain = kinetic + GRAVITY * summed(
        speed * (np.sin(motion.grade) + rolling * np.cos(motion.grade))
    )
    rough = np.hypot(road.rolling_coefficient.std, np.sqrt(summed(motion.grade_std**2) / WINDOW))
    fast = motion.speed_std * np.hypot(speed[end], speed[begin])
    density = air_density(drive, np.nan_to_num(motion.altitude))
    drag = 0.5 * road.drag_area.value * summed(density * speed**3)
    turning = rotating_mass(vehicle, 0.0) * kinetic
    gain_std = np.hypot(fast, GRAVITY * way * rough)
    keep = ~bad
    return motion.time[begin][keep], gain[keep], gain_std[keep], (drag + turning)[keep]


@dataclass(frozen=True, slots=True, kw_only=True)
class CoastDown:
    """Result of coasting in both directions.

    Attributes
    ----------
    drag_over_mass, drag_over_mass_std : C_d A over the mass [m^2/kg]
    rolling, rolling_std : rolling resistance coefficient, driveline drag taken in [-]
    degrees_of_freedom : of the standard deviations
    status : `Status.NOT_EXCITED`, because coasting gives no mass
    """

    drag_over_mass: float
    drag_over_mass_std: float
    rolling: float
    rolling_std: float
    degrees_of_freedom: float
    status: Status = Status.NOT_EXCITED

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Interval of ``drag_over_mass`` that holds with a probability [m^2/kg]."""
        return self._between(self.drag_over_mass, self.drag_over_mass_std, level)

    def rolling_interval(self, level: float = 0.95) -> tuple[float, float]:
        """Interval of ``rolling`` that holds with a probability [-]."""
        return self._between(self.rolling, self.rolling_std, level)

    def _between(self, value: float, std: float, level: float) -> tuple[float, float]:
        half = student_quantile(self.degrees_of_freedom, 0.5 + 0.5 * level) * std
        return value - half, value + half

    def to_json(self, name: str) -> str:
        """Return what ``weighbridge coast --json`` prints of the drive with this name."""
        return _json(
            drive=name,
            status=str(self.status),
            drag_over_mass_m2_per_kg=self.drag_over_mass,
            drag_over_mass_interval95_m2_per_kg=self.interval(),
            rolling_coefficient=self.rolling,
            rolling_coefficient_interval95=self.rolling_interval(),
        )


def coast_down(
    drive: Drive, there: Sequence[Span], back: Sequence[Span], *, vehicle: Vehicle | None = None
) -> CoastDown:
    """Find C_d A over mass from coast-downs out of gear in opposite directions.

    In each span the retardation, grade taken off, is a line in the dynamic pressure: its slope is
    C_d A / m, times the part of the inertia that rolls. Wind along the road adds opposite parts to
    the slopes of the two directions, which the mean of both takes out.

    Parameters
    ----------
    drive : with a speed, and a grade or heights
    there, back : spans of time in the one direction and in the other [s]; two of each at least
    vehicle : wheel inertia and tare; those usual for a car when None

    Raises
    ------
    ConfigError
        There are fewer spans than two in a direction, or one is too short.
    DriveError
        There is no speed, or neither grade nor heights.

    References
    ----------
    SAE J1263, Road Load Measurement and Dynamometer Simulation Using Coastdown Techniques.
    """
    vehicle = Vehicle() if vehicle is None else vehicle
    _check_given(drive, vehicle)
    for name, spans in (("there", there), ("back", back)):
        check_all(name, spans, (tuple, list), "pairs of instants")
        for span in spans:
            check_all(name, span, (int, float), "instants")
            if len(span) != 2:
                raise ConfigError(f"{name} must be several pairs of instants, got {span!r:.40}")
    if min(len(there), len(back)) < 2:
        raise ConfigError(
            f"{drive.name}: {len(there)} coast-downs there and {len(back)} back; two of each are "
            "needed, for their scatter is the interval"
        )
    motion = _graded(drive, vehicle)
    density = air_density(drive, np.nan_to_num(motion.altitude))
    mass = vehicle.tare or vehicle.of_class.typical_mass
    rolls = 1.0 + float(rotating_mass(vehicle, 0.0)) / mass
    lines = [
        np.array([_line(drive, motion, density, span, rolls) for span in spans])
        for spans in (there, back)
    ]
    found = 0.5 * (lines[0].mean(axis=0) + lines[1].mean(axis=0))
    var = sum(0.25 * part.var(axis=0, ddof=1) / len(part) for part in lines)
    std = np.sqrt(np.asarray(var))
    return CoastDown(
        drag_over_mass=float(found[1]),
        drag_over_mass_std=float(std[1]),
        rolling=float(found[0] / GRAVITY),
        rolling_std=float(std[0] / GRAVITY),
        degrees_of_freedom=float(min(len(there), len(back)) - 1),
    )


def _line(drive: Drive, motion: Motion, density: Floats, span: Span, rolls: float) -> Floats:
    """Retardation at standstill [m/s^2] and its slope over dynamic pressure [m^2/kg] of a span."""
    size = max(2, round(COAST_WINDOW * motion.rate))
    inside = np.flatnonzero((motion.time >= span[0]) & (motion.time <= span[1]) & motion.valid)
    if inside.size < 3 * size:
        raise ConfigError(
            f"{drive.name}: from {instant(span[0])} to {instant(span[1])} there are "
            f"{inside.size / motion.rate:.0f} s of speed; a coast-down needs "
            f"{3.0 * COAST_WINDOW:.0f} s"
        )
    begin = inside[:-size:size]
    end = begin + size
    accel = (motion.speed[end] - motion.speed[begin]) / (motion.time[end] - motion.time[begin])
    hill = [float(np.mean(np.sin(motion.grade[a:b]))) for a, b in zip(begin, end, strict=True)]
    pressure = [
        float(np.mean(0.5 * density[a:b] * motion.speed[a:b] ** 2))
        for a, b in zip(begin, end, strict=True)
    ]
    slowed = -rolls * accel - GRAVITY * np.array(hill)
    slope, rest = np.polyfit(pressure, slowed, 1)
    return np.array([rest, slope])
