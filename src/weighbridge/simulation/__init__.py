"""Simulated cars on simulated roads, seen through simulated sensors."""

from weighbridge.simulation.car import COMPACT, ELECTRIC, MIDSIZE, SimulatedCar, random_car
from weighbridge.simulation.route import (
    Route,
    flat_route,
    highway_route,
    hilly_route,
    jensen_route,
    mixed_route,
    short_route,
)
from weighbridge.simulation.scenario import (
    ABOUT,
    SCENARIOS,
    Effects,
    Loading,
    Polling,
    Scenario,
    Sensors,
    make_scenario,
)
from weighbridge.simulation.simulate import SimulatedDrive, Truth, simulate_car

__all__ = [
    "ABOUT",
    "COMPACT",
    "ELECTRIC",
    "MIDSIZE",
    "SCENARIOS",
    "Effects",
    "Loading",
    "Polling",
    "Route",
    "Scenario",
    "Sensors",
    "SimulatedCar",
    "SimulatedDrive",
    "Truth",
    "flat_route",
    "highway_route",
    "hilly_route",
    "jensen_route",
    "make_scenario",
    "mixed_route",
    "random_car",
    "short_route",
    "simulate_car",
]
