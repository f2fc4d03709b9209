"""The drives of Jensen et al. 2022 for the simulator: Table B.1, the roads of sec. 7.2 and 7.5."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.errors import ConfigError
from weighbridge.signals import Drive, scalar_from_si, scalar_to_si
from weighbridge.simulation import (
    MIDSIZE,
    Braking,
    Effects,
    Route,
    Scenario,
    flat_route,
    make_scenario,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What the paper's drives vary and its text does not give in numbers, or gives as a range.

    Attributes
    ----------
    light_load, heavy_load : of drives 5 and 6, 7 and 8 [kg]
    tyre_under, tyre_over : factor on the rolling resistance at 0.5 bar less and more than 2.15
        bar [-]: pressure to the power -0.45, the middle of the exponents SAE J2452 fits to
        passenger-car tyres
    one_window, two_windows : drag area added by open windows [m^2]: 0.02 and 0.03 of drag
        coefficient on 2.2 m^2 (sec. 7.6)
    wind : factor on the wind of every drive of Table B.1 [-]
    high_wind, low_wind : of the two highway drives, at 10 m [m/s]; the paper's are in figures
    cold : how much of the warming of engine and tyres there is [-]; 0 for warm drives
    ideal : nothing but eq. 1 acts on the car, and the inertial noise is the only error: no wind, no
        slip, no lean of the body, no lateness
    """

    light_load: float = 125.0
    heavy_load: float = 240.0
    tyre_under: float = 1.13
    tyre_over: float = 0.91
    one_window: float = 0.044
    two_windows: float = 0.066
    wind: float = 1.0
    high_wind: float = 9.0
    low_wind: float = 1.5
    cold: float = 1.0
    ideal: bool = False

    def __post_init__(self) -> None:
        for name in (
            "light_load", "heavy_load", "wind", "high_wind", "low_wind", "cold", "one_window",
            "two_windows",
        ):  # fmt: skip
            if not getattr(self, name) >= 0.0:
                raise ConfigError(f"{name} must be zero or positive, got {getattr(self, name):g}")

    def of(self, made: Scenario) -> Scenario:
        """Return a scenario as it is, or that by eq. 1 alone."""
        if not self.ideal:
            return made
        return replace(made, effects=Effects.only(imu_noise=1.0), wind_speed=0.0)


CONDITIONS: Final = Conditions()
"""As the study has them."""


@dataclass(frozen=True, slots=True)
class TestDrive:
    """One row of Table B.1, with the wind of its day.

    Attributes
    ----------
    number : of the drive
    kind : as the table names it
    payload : [kg]
    bar : tyre pressure above the usual one [bar]
    windows : of the front that are open
    temperature : [K]
    wind_speed, wind_from : at 10 m height [m/s], clockwise from north [rad]
    pause : since the end of the drive before; infinite for the first of a day [s]
    """

    number: int
    kind: str
    payload: float
    bar: float
    windows: int
    temperature: float
    wind_speed: float
    wind_from: float
    pause: float

    @property
    def cooled(self) -> float:
        """How far tyres and oil have cooled since the drive before [-]."""
        return -math.expm1(-self.pause / COOLING_TIME)


COOLING_TIME: Final = 2400.0
"""Time in which a parked car's tyres and engine lose 63 % of their warmth [s]: chosen, four
times the ten minutes in which the simulated ones warm, for want of flexing and air flow."""

HIGHWAY_BEARING: Final = math.radians(199.0)
"""Direction of the highway out, clockwise from north [rad]: from Helsingør (56.03 N,
12.60 E) to Gl. Holte (55.82 N, 12.47 E), app. A."""


def _row(
    number: int,
    kind: str,
    celsius: float,
    minutes: float,
    wind: tuple[float, float],
    payload: float = 0.0,
    bar: float = 0.0,
    windows: int = 0,
) -> TestDrive:
    speed, direction = wind
    return TestDrive(
        number,
        kind,
        payload,
        bar,
        windows,
        celsius + 273.15,
        speed,
        math.radians(direction),
        60.0 * minutes,
    )


TABLE_B1: Final = (
    _row(1, "reference", 3, math.inf, (3.0, 250)),
    _row(2, "reference", 4, 7, (3.0, 250)),
    _row(3, "reference", 3, 7, (3.0, 250)),
    _row(4, "reference", 4, math.inf, (3.0, 320)),
    _row(5, "+125 kg load", 4, 10, (4.0, 320), payload=125.0),
    _row(6, "+125 kg load", 4, 28, (5.0, 320), payload=125.0),
    _row(7, "+240 kg load", 4, 9, (5.0, 320), payload=240.0),
    _row(8, "+240 kg load", 4, 24, (5.0, 320), payload=240.0),
    _row(9, "+0.5 bar", 5, math.inf, (9.0, 270), bar=0.5),
    _row(10, "+0.5 bar", 6, 3, (9.0, 270), bar=0.5),
    _row(11, "-0.5 bar", 6, 43, (9.0, 270), bar=-0.5),
    _row(12, "-0.5 bar", 6, 1, (9.0, 270), bar=-0.5),
    _row(13, "reference", 6, 22, (9.0, 270)),
    _row(14, "reference", 3, math.inf, (3.0, 150)),
    _row(15, "one window", 3, 5, (4.0, 150), windows=1),
    _row(16, "one window", 3, 5, (5.0, 150), windows=1),
    _row(17, "two windows", 3, 27, (6.0, 150), windows=2),
    _row(18, "two windows", 3, 6, (6.0, 150), windows=2),
)
"""The 18 drives. Loads, tyres, windows, temperatures and pauses are the paper's. Of the wind
its text gives 5 m/s from 320 degrees on the day of the loads, rising during it, very high
winds from 270 degrees on the day of the tyres, and rising wind from 150 degrees on the
day of the windows; the values for the other drives are chosen (sec. 7.4, app. B, C)."""

HIGHWAY_LIMIT: Final = 25.0
"""Speed limit above which a road is the highway [m/s]."""


def scenario(drive: TestDrive, *, seed: int, conditions: Conditions = CONDITIONS) -> Scenario:
    """Make the scenario of one row of the table."""
    loads = {0.0: 0.0, 125.0: conditions.light_load, 240.0: conditions.heavy_load}
    made = make_scenario("car", payload=loads[drive.payload], seed=seed)
    route = made.route
    highway = route.limit > HIGHWAY_LIMIT
    out = highway & (np.arange(highway.size) < highway.size // 2)
    turn = HIGHWAY_BEARING - float(np.mean(route.heading[out]))
    tyres = {-0.5: conditions.tyre_under, 0.0: 1.0, 0.5: conditions.tyre_over}
    drag = (0.0, conditions.one_window, conditions.two_windows)
    chosen = replace(
        made,
        route=replace(route, heading=route.heading + turn),
        effects=replace(made.effects, warm_up=conditions.cold * drive.cooled),
        name=f"drive {drive.number:02d}",
        tyre_factor=tyres[drive.bar],
        drag_area_addition=drag[drive.windows],
        ambient_temperature=drive.temperature,
        wind_speed=conditions.wind * drive.wind_speed,
        wind_from=drive.wind_from,
    )
    return conditions.of(chosen)


@dataclass(frozen=True, slots=True)
class HighwayTrip:
    """One trip north and back south of sec. 7.5.

    Attributes
    ----------
    wind : "high" or "low"
    wind_from : clockwise from north [rad]
    slowest, fastest : speeds held [m/s]
    """

    wind: str
    wind_from: float
    slowest: float
    fastest: float

    @property
    def speeds(self) -> str:
        """Speeds held, as "110" or "100-120" [km/h]."""
        kmh = [f"{scalar_from_si(v, 'kmh'):.0f}" for v in (self.slowest, self.fastest)]
        return "-".join(dict.fromkeys(kmh))


HIGHWAY_TRIPS: Final = tuple(
    HighwayTrip(
        wind,
        math.radians(direction),
        scalar_to_si(slowest, "kmh"),
        scalar_to_si(fastest, "kmh"),
    )
    for wind, direction in (("high", 320.0), ("low", 90.0))
    for slowest, fastest in ((110.0, 110.0), (120.0, 120.0), (100.0, 120.0))
)
"""The two drives of three trips of fig. 16."""


def highway_scenario(
    trip: HighwayTrip, *, seed: int, conditions: Conditions = CONDITIONS
) -> Scenario:
    """Make the scenario of one trip; where the speed varies, it does so every two kilometres."""
    made = make_scenario("highway", seed=seed)
    route = made.route
    highway = route.limit > HIGHWAY_LIMIT
    out = highway & (np.arange(highway.size) < highway.size // 2)
    turn = HIGHWAY_BEARING - math.pi - float(np.mean(route.heading[out]))
    mean, swing = 0.5 * (trip.fastest + trip.slowest), 0.5 * (trip.fastest - trip.slowest)
    held = mean + swing * np.sin(2.0 * math.pi * np.arange(highway.size) / 4000.0)
    chosen = replace(
        made,
        route=replace(
            route,
            heading=route.heading + turn,
            limit=np.where(highway, held, route.limit),
        ),
        effects=replace(made.effects, warm_up=0.0),
        name=f"highway, {trip.wind} wind, {trip.speeds} km/h",
        wind_speed=conditions.high_wind if trip.wind == "high" else conditions.low_wind,
        wind_from=trip.wind_from,
    )
    return conditions.of(chosen)


GRADIENT_LENGTH: Final = 600.0
"""Of the road [m] (sec. 7.2)."""

INCLINES: Final = ((120.0, 200.0, 0.06), (430.0, 520.0, -0.05))
"""Where each begins and ends [m], and its slope [rad]: chosen, the paper draws them."""

TURNS: Final = ((260.0, 0.5 * math.pi), (395.0, -0.5 * math.pi))
"""Middle [m] and angle [rad]; the second incline lies after a turn."""

TURN_RADIUS: Final = 15.0
"""Of the turns, chosen [m]."""

GRADIENT_LIMIT: Final = scalar_to_si(35.0, "kmh")
"""Speed held on the straight parts, chosen."""

BRAKINGS: Final = tuple(Braking(time=t, duration=2.0, decel=2.0) for t in (45.0, 58.0, 71.0, 84.0))
"""Of run 2, which accelerates and brakes again and again; the drive begins after 25 s at rest."""


def gradient_road() -> Route:
    """Return the road; what the paper does not state of it is chosen."""
    road = flat_route(GRADIENT_LENGTH, limit=GRADIENT_LIMIT)
    at = np.arange(road.grade.size, dtype=np.float64)
    grade, curvature = np.zeros(at.size), np.zeros(at.size)
    for begin, end, slope in INCLINES:
        # A ramp of 15 m: no wheel meets a kink.
        rise = np.clip((at - begin) / 15.0, 0.0, 1.0) * np.clip((end - at) / 15.0, 0.0, 1.0)
        grade += slope * rise
    for middle, angle in TURNS:
        length = 2.0 * abs(angle) * TURN_RADIUS
        inside = np.abs(at - middle) < 0.5 * length
        shape = np.where(inside, np.cos(math.pi * (at - middle) / length) ** 2, 0.0)
        curvature += angle * shape / shape.sum()
    return replace(road, name="600 m, two inclines", grade=grade, heading=np.cumsum(curvature))


def gradient_scenario(run: int, seed: int, conditions: Conditions = CONDITIONS) -> Scenario:
    """Make one of the three runs: 1 and 3 almost at constant speed, 2 with strong accelerations."""
    made = Scenario(name=f"slope, run {run}", car=MIDSIZE, route=gradient_road(), seed=seed)
    calm = replace(made, effects=made.effects.without("traffic"))
    if run != 2:
        return conditions.of(replace(calm, aggressiveness=0.5))
    return conditions.of(replace(calm, aggressiveness=1.5, brakings=BRAKINGS))


def without_weather(drive: Drive) -> Drive:
    """Take the wind out of what is known of a drive."""
    return replace(drive, info=replace(drive.info, wind_speed=None, wind_from=None))
