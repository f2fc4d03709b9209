"""Scenarios with a name: what ``weighbridge simulate`` offers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from weighbridge.arguments import suggestion
from weighbridge.data import toml_of
from weighbridge.errors import ConfigError
from weighbridge.simulation.car import COMPACT, ELECTRIC, MIDSIZE, SimulatedCar
from weighbridge.simulation.route import (
    Route,
    bus_route,
    highway_route,
    hilly_route,
    jensen_route,
    short_route,
    straight_route,
)
from weighbridge.simulation.scenario import Braking, Effects, Loading, Polling, Scenario, Sensors
from weighbridge.simulation.vehicles import (
    BUS,
    DIESEL_AUTOMATIC,
    POWER_SPLIT,
    STEPLESS,
    TRUCK18,
    VAN,
)

Maker = Callable[[float, int], Scenario]
"""Makes a scenario from payload [kg] and seed."""

_LISTED: Final = toml_of("simulation", "scenarios.toml")


def _polling(name: str) -> Polling:
    """Return what control units are asked for, of `scenarios.toml`."""
    listed: dict[str, Any] = dict(_LISTED["polling"][name])
    return Polling(**listed | {k: tuple(listed[k]) for k in ("fast", "slow") if k in listed})


def _calibrating(name: str, car: SimulatedCar, route_seed: int = 4) -> Maker:
    """Return what drives a vehicle through all gears, loads and engine speeds."""

    def make(payload: float, seed: int) -> Scenario:
        return Scenario(
            name=name,
            car=car,
            route=hilly_route(route_seed),
            payload=payload,
            seed=seed,
            calibration=True,
            aggressiveness=1.2,
            wind_speed=2.0,
            polling=usual_polling(car),
        )

    return make


TORQUE_POLLING: Final = _polling("torque")
"""Of a vehicle that sends its engine's torque in percent by OBD."""


def usual_polling(car: SimulatedCar) -> Polling:
    """Return what the control units of such a vehicle are usually asked for.

    Parameters
    ----------
    car : SimulatedCar

    Returns
    -------
    Polling
        J1939 for bus and truck, motor torque for an electric car, engine torque and battery for a
        hybrid, torque percent for a stepless box, calculated load (with air flow for petrol) for
        the others.
    """
    if car.kind in ("bus", "truck"):
        return _polling("truck")
    if car.electric:
        return _polling("electric")
    if car.split is not None:
        return _polling("hybrid")
    if car.transmission == "stepless":
        return TORQUE_POLLING
    return _polling("diesel") if car.engine == "diesel" else Polling()


def _on_the_road(name: str, car: SimulatedCar, route: Callable[[], Route]) -> Maker:
    def make(payload: float, seed: int) -> Scenario:
        return Scenario(
            name=name,
            car=car,
            route=route(),
            payload=payload,
            seed=seed,
            polling=usual_polling(car),
        )

    return make


_car: Final = _on_the_road("car", MIDSIZE, jensen_route)


def _loading(payload: float, seed: int) -> Scenario:
    stop = Loading(distance=11_000.0, duration=90.0, load=240.0)
    return replace(_car(payload, seed), name="car-loading", loading=(stop,))


def _bus(payload: float, seed: int) -> Scenario:
    return Scenario(
        name="bus",
        car=BUS,
        route=straight_route(),
        payload=payload,
        seed=seed,
        brakings=(
            Braking(time=115.0, duration=3.5, decel=1.6),
            Braking(time=147.0, duration=4.0, decel=2.0),
        ),
        effects=replace(Effects(), traffic=0.0),
        sensors=Sensors(imu_rate=100.0),
        polling=_polling("bus"),
        wind_speed=2.0,
        start_rest=3.0,
        duration=180.0,
    )


def _bus_urban(payload: float, seed: int) -> Scenario:
    route, places = bus_route()
    return Scenario(
        name="bus-urban",
        car=BUS,
        route=route,
        payload=payload,
        loading=_passengers(places, payload, seed),
        seed=seed,
        sensors=Sensors(imu_rate=100.0),
        polling=_polling("bus"),
    )


def _passengers(places: Iterable[float], payload: float, seed: int) -> tuple[Loading, ...]:
    """Let passengers of 71 kg on and off a bus for at most 80."""
    rng = np.random.default_rng([seed, 71])
    aboard = max(0, round(payload / 71.0))
    stops = []
    for place in places:
        leaving = int(rng.binomial(aboard, 0.25))
        coming = min(int(rng.poisson(9.0)), 80 - aboard + leaving)
        aboard += coming - leaving
        stops.append(
            Loading(
                distance=float(place),
                duration=8.0 + 1.6 * max(leaving, coming),
                load=71.0 * (coming - leaving),
            )
        )
    return tuple(stops)


SCENARIOS: Final[dict[str, Maker]] = {
    "car": _car,
    "car-calibration": _calibrating("car-calibration", MIDSIZE),
    "car-short": _on_the_road("car-short", MIDSIZE, short_route),
    "car-loading": _loading,
    "highway": _on_the_road("highway", MIDSIZE, highway_route),
    "compact": _on_the_road("compact", COMPACT, partial(jensen_route, 6)),
    "compact-calibration": _calibrating("compact-calibration", COMPACT, 7),
    "electric": _on_the_road("electric", ELECTRIC, partial(jensen_route, 8)),
    "bus": _bus,
    "bus-urban": _bus_urban,
    "bus-calibration": _calibrating("bus-calibration", BUS, 13),
    "diesel": _on_the_road("diesel", DIESEL_AUTOMATIC, partial(jensen_route, 14)),
    "diesel-calibration": _calibrating("diesel-calibration", DIESEL_AUTOMATIC, 15),
    "cvt": _on_the_road("cvt", STEPLESS, partial(jensen_route, 20)),
    "cvt-calibration": _calibrating("cvt-calibration", STEPLESS, 21),
    "hybrid": _on_the_road("hybrid", POWER_SPLIT, partial(jensen_route, 22)),
    "hybrid-calibration": _calibrating("hybrid-calibration", POWER_SPLIT, 23),
    "van": _on_the_road("van", VAN, partial(jensen_route, 16)),
    "van-calibration": _calibrating("van-calibration", VAN, 17),
    "truck": _on_the_road("truck", TRUCK18, partial(jensen_route, 18)),
    "truck-calibration": _calibrating("truck-calibration", TRUCK18, 19),
}
"""Makers of the named scenarios, from payload [kg] and seed."""

ABOUT: Final[dict[str, str]] = _LISTED["about"]
"""One line for each named scenario."""


def make_scenario(
    name: str,
    *,
    payload: float | None = None,
    mass: float | None = None,
    seed: int = 1,
    wind: float | None = None,
    wind_from: float | None = None,
    without: Iterable[str] = (),
) -> Scenario:
    """Make a named scenario; `dataclasses.replace` changes the rest.

    Parameters
    ----------
    name : str
        One of `SCENARIOS`.
    payload : float, optional
        Beside driver and fuel, none by default [kg].
    mass : float, optional
        At the start, instead of the payload [kg].
    seed : int
        Of driver, weather and sensors.
    wind : float, optional
        Mean wind at 10 m height [m/s].
    wind_from : float, optional
        Direction it blows from, clockwise from north [rad].
    without : iterable of str
        Effects to switch off, see `Effects`.

    Returns
    -------
    Scenario

    Raises
    ------
    ConfigError
        There is no scenario or effect of that name, or a value cannot be.
    """
    maker = SCENARIOS.get(name)
    if maker is None:
        raise ConfigError(f"unknown scenario {name!r}{suggestion(name, SCENARIOS)}")
    if payload is not None and mass is not None:
        raise ConfigError("give a payload or a mass, not both")
    made = maker(payload or 0.0, seed)
    if mass is not None:
        made = replace(made, payload=mass - made.car.mass)
    if wind is not None:
        made = replace(made, wind_speed=wind)
    if wind_from is not None:
        made = replace(made, wind_from=wind_from)
    return replace(made, effects=made.effects.without(*without))
