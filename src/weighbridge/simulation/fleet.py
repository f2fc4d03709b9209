"""A fleet to simulate: vehicles of several classes, days of drives with loads between the stops.

The plan is drawn first, whole, from one seed; every drive is then simulated by itself, so that
any number of processes makes the same files.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Final, Literal, get_args

import numpy as np

from weighbridge.errors import ConfigError
from weighbridge.signals import Drive, Signal, resolution
from weighbridge.simulation.car import SimulatedCar
from weighbridge.simulation.named import TORQUE_POLLING, usual_polling
from weighbridge.simulation.route import RoadKind, Route, mixed_route
from weighbridge.simulation.scenario import Loading, Scenario, Sensors
from weighbridge.simulation.simulate import SimulatedDrive, simulate_car
from weighbridge.simulation.trailer import Trailer, random_trailer
from weighbridge.simulation.vehicles import BUS, random_habits, random_vehicle, with_random_details

Kind = Literal["truck", "van", "bus", "car"]

Fault = Literal[
    "", "no inertial sensor", "frozen torque", "cut short", "speed in mph", "broken file"
]
"""What is wrong with a recording; empty where nothing is."""

FAULTS: Final[tuple[Fault, ...]] = tuple(f for f in get_args(Fault) if f)

_GROSS: Final[dict[Kind, float]] = {"truck": 2.0, "van": 1.67, "bus": 1.75, "car": 1.32}
"""Permitted mass over the empty one [-]: 18 t, 3.5 t, 12.3 t and 2.1 t of the named vehicles."""

_ORDER: Final[tuple[Kind, ...]] = ("truck", "van", "truck", "bus", "car")
_SHARE: Final = {"overload": 0.08, "empty": 0.25, "stop": 0.2, "fault": 0.04}
_SLIP_SCATTER: Final = 0.2  # of the tyres' slip, from drive to drive, relative [-]; chosen
_TICKETS: Final = 0.3  # part of the departures that go over a weighbridge [-]
_NO_FILE: Final = 10  # every tenth vehicle has no file
_DRIFTING: Final = 3  # every third vehicle, where a drift is asked for
_TORQUES: Final = ("engine_torque", "engine_torque_fraction")
_DEPOT: Final = (math.radians(51.2), math.radians(9.5))
_SPREAD: Final = math.radians(0.6)
_FASTEST: Final = 25.0  # no drive is longer than at this speed all the time [m/s]


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetSettings:
    """How large a simulated fleet is.

    Attributes
    ----------
    vehicles, days, drives : of the fleet, of each vehicle, of each vehicle and day
    minutes : length of a drive
    seed : of everything random
    start : first day, ISO 8601
    trailers : part of the drives of trucks with a trailer [-]
    drift : how much more torque every third vehicle reads on its last day than on its first, even
        in between; its true torque stays [-]
    """

    vehicles: int = 50
    days: int = 5
    drives: int = 4
    minutes: float = 20.0
    seed: int = 1
    start: str = "2026-05-04"
    trailers: float = 0.1
    drift: float = 0.0

    def __post_init__(self) -> None:
        for name, high in (("vehicles", 9999), ("days", 366), ("drives", 24)):
            value = getattr(self, name)
            if not 1 <= value <= high:
                raise ConfigError(f"{name} must be 1 to {high}, got {value}")
        if not 2.0 <= self.minutes <= 120.0:
            raise ConfigError(f"minutes must be 2 to 120, got {self.minutes:g}")
        if not 0.0 <= self.trailers <= 1.0:
            raise ConfigError(f"trailers must be in [0, 1], got {self.trailers:g}")
        if not abs(self.drift) <= 0.5:
            raise ConfigError(f"drift must be -50 to 50 %, got {100.0 * self.drift:g} %")
        if self.drives * (self.minutes + 20.0) > 24 * 60:
            raise ConfigError(
                f"{self.drives} drives of {self.minutes:g} minutes do not fit into a day"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetVehicle:
    """One vehicle of a simulated fleet.

    Attributes
    ----------
    id : name of its folder and of its file
    kind : its class
    car : as simulated
    gross : permitted mass [kg]
    has_file : whether a vehicle file is written
    depot : latitude and longitude at which its days begin [rad]
    """

    id: str
    kind: Kind
    car: SimulatedCar
    gross: float
    has_file: bool
    depot: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedDay:
    """The drives of one vehicle on one day, each from where the one before ended.

    Attributes
    ----------
    vehicle
    seed : of the drives
    starts : when each begins
    payloads : at each start, of the vehicle itself [kg]
    stops : load taken on at a stop halfway; 0 where there is none [kg]
    trailers : behind it; None without one
    tickets : whether the departure was weighed
    faults : of each recording
    minutes : length of a drive
    torque_scale : of the torque's reading by that of the first day [-]
    """

    vehicle: FleetVehicle
    seed: int
    starts: tuple[datetime, ...]
    payloads: tuple[float, ...]
    stops: tuple[float, ...]
    trailers: tuple[Trailer | None, ...]
    tickets: tuple[bool, ...]
    faults: tuple[Fault, ...]
    minutes: float
    torque_scale: float = 1.0


def plan_fleet(settings: FleetSettings) -> tuple[tuple[FleetVehicle, ...], tuple[PlannedDay, ...]]:
    """Draw the vehicles and days of a fleet; the same for the same settings.

    Parameters
    ----------
    settings

    Raises
    ------
    ConfigError
        The first day is no date.
    """
    try:
        first = datetime.fromisoformat(settings.start).replace(tzinfo=UTC)
    except ValueError:
        raise ConfigError(f"start {settings.start!r} is no date such as 2026-05-04") from None
    vehicles, days = [], []
    for number in range(settings.vehicles):
        # A stream for each vehicle: more of them, or more days, leave those before as they are.
        rng = np.random.default_rng([settings.seed, number])
        vehicle = _vehicle(rng, number)
        vehicles.append(vehicle)
        for day in range(settings.days):
            own = np.random.default_rng([settings.seed, number, day])
            planned = _day(own, vehicle, first + timedelta(days=day), settings)
            if number % _DRIFTING == 1 and settings.days > 1:
                grown = 1.0 + settings.drift * day / (settings.days - 1)
                planned = replace(planned, torque_scale=grown)
            days.append(planned)
    return tuple(vehicles), tuple(days)


def simulate_day(day: PlannedDay) -> list[SimulatedDrive]:
    """Simulate the drives of one vehicle and day, in order.

    Returns
    -------
    list of SimulatedDrive
        Faults are not in them yet, see `with_fault`; the drive does not state its mass.
    """
    place, made = day.vehicle.depot, []
    for number, start in enumerate(day.starts):
        rng = np.random.default_rng([day.seed, number])
        drive = simulate_car(_scenario(day, number, start, place, rng))
        place = float(drive.truth.latitude[-1]), float(drive.truth.longitude[-1])
        made.append(drive)
    return made


def with_fault(drive: Drive, fault: Fault) -> Drive:
    """Return a drive with a fault of its sensors; a broken file is broken after it is written."""
    signals = dict(drive.signals)
    if fault == "no inertial sensor":
        signals = {n: s for n, s in signals.items() if not n.startswith(("accel_", "gyro_"))}
    elif fault == "frozen torque":
        for name in _TORQUES:
            if name in signals:
                signals[name] = _frozen(signals[name])
    elif fault == "cut short":
        return drive.between(drive.start, drive.start + 60.0)
    elif fault == "speed in mph":
        speed = signals["vehicle_speed"]
        signals["vehicle_speed"] = replace(speed, values=speed.values / 1.609344)
    return replace(drive, signals=signals)


def with_torque_scale(drive: Drive, scale: float) -> Drive:
    """Return a drive whose torque reads so many times as much, in the same steps."""
    if scale == 1.0:
        return drive
    return drive.with_signals(
        *(_scaled(drive.signals[name], scale) for name in _TORQUES if name in drive.signals)
    )


def _scaled(signal: Signal, scale: float) -> Signal:
    step = resolution(signal.values) or 1.0
    return replace(signal, values=step * np.round(scale * signal.values / step))


def _frozen(signal: Signal) -> Signal:
    """Hold a signal from a third of the drive on."""
    values = signal.values.copy()
    third = values.size // 3
    values[third:] = values[third]
    return replace(signal, values=values)


def _vehicle(rng: np.random.Generator, number: int) -> FleetVehicle:
    kind = _ORDER[number % len(_ORDER)]
    if kind == "bus":
        car = with_random_details(rng, BUS)
    else:
        car = random_vehicle(rng, "electric" if kind == "car" else kind)
    return FleetVehicle(
        id=f"{kind}{number + 1:03d}",
        kind=kind,
        car=car,
        gross=50.0 * round(_GROSS[kind] * car.mass / 50.0),
        has_file=number % _NO_FILE != _NO_FILE - 1,
        depot=(
            _DEPOT[0] + float(rng.uniform(-_SPREAD, _SPREAD)),
            _DEPOT[1] + float(rng.uniform(-_SPREAD, _SPREAD)),
        ),
    )


def _day(
    rng: np.random.Generator, vehicle: FleetVehicle, day: datetime, settings: FleetSettings
) -> PlannedDay:
    room = vehicle.gross - vehicle.car.mass
    minute = float(rng.uniform(300.0, 420.0))
    latest = 24 * 60 - settings.drives * (settings.minutes + 20.0)
    begin = day + timedelta(minutes=round(min(minute, latest)))
    starts, payloads, stops, trailers, faults, tickets = [], [], [], [], [], []
    for _ in range(settings.drives):
        chance = rng.uniform(size=5)
        load = room * float(rng.uniform(0.25, 0.95))
        if chance[0] < _SHARE["overload"]:
            load = room + vehicle.gross * float(rng.uniform(0.08, 0.3))
        elif chance[1] < _SHARE["empty"]:
            load = 0.0
        towed = vehicle.kind == "truck" and chance[2] < settings.trailers
        trailer = random_trailer(rng, vehicle.car.mass) if towed else None
        load = min(load, 0.9 * room) if towed else load
        stop = 0.0
        if chance[3] < _SHARE["stop"] and settings.minutes >= 10.0:
            stop = -0.9 * load if load > 0.3 * room else 0.6 * room
        fault: Fault = ""
        if chance[4] < _SHARE["fault"]:
            fault = FAULTS[int(rng.integers(len(FAULTS)))]
        starts.append(begin)
        payloads.append(round(load))
        stops.append(round(stop))
        trailers.append(trailer)
        faults.append(fault)
        tickets.append(bool(rng.uniform() < _TICKETS))
        begin += timedelta(minutes=round(settings.minutes + float(rng.uniform(8.0, 20.0))))
    return PlannedDay(
        vehicle=vehicle,
        seed=int(rng.integers(2**31)),
        starts=tuple(starts),
        payloads=tuple(payloads),
        stops=tuple(stops),
        trailers=tuple(trailers),
        tickets=tuple(tickets),
        faults=tuple(faults),
        minutes=settings.minutes,
    )


def _scenario(
    day: PlannedDay,
    number: int,
    start: datetime,
    place: tuple[float, float],
    rng: np.random.Generator,
) -> Scenario:
    vehicle = day.vehicle
    seconds = 60.0 * day.minutes
    route = _route(rng, seconds * min(_FASTEST, vehicle.car.top_speed), place)
    stop = day.stops[number]
    # At half the time by the usual speed: the stop is within the drive.
    halfway = Loading(distance=4.0 * seconds, duration=120.0, load=stop)
    return Scenario(
        name=f"{start:%Y-%m-%dT%H%M}",
        car=vehicle.car,
        route=route,
        payload=day.payloads[number],
        trailer=day.trailers[number],
        loading=(halfway,) if stop else (),
        seed=int(rng.integers(2**31)),
        habits=random_habits(rng),
        sensors=Sensors(imu_rate=10.0),
        polling=TORQUE_POLLING if vehicle.kind == "van" else usual_polling(vehicle.car),
        wind_speed=float(rng.uniform(0.0, 6.0)),
        wind_from=float(rng.uniform(0.0, 2.0 * math.pi)),
        ambient_temperature=float(rng.uniform(275.0, 298.0)),
        slip_factor=math.exp(_SLIP_SCATTER * float(rng.standard_normal())),
        start_rest=15.0,
        duration=seconds,
        start_time=start.isoformat(),
    )


def _route(rng: np.random.Generator, length: float, place: tuple[float, float]) -> Route:
    """Draw a road out of a town into the country, at least as long as a drive."""
    out = 100.0 * math.ceil(length / 200.0)
    way: tuple[tuple[RoadKind, float], ...] = (
        ("city", round(0.12 * out)),
        ("country", round(0.5 * out)),
        ("hills", round(0.13 * out)),
        ("highway", round(0.25 * out)),
    )
    route = mixed_route(
        int(rng.integers(2**31)),
        out=way,
        back=way[::-1],
        heading=float(rng.uniform(0.0, 2.0 * math.pi)),
        name="town and country",
    )
    return replace(route, latitude=place[0], longitude=place[1])
