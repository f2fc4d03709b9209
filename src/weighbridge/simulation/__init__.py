"""Simulated cars on simulated roads, seen through simulated sensors."""

from weighbridge.simulation.car import BUS, COMPACT, ELECTRIC, MIDSIZE, SimulatedCar, random_car
from weighbridge.simulation.route import (
    Route,
    bus_route,
    flat_route,
    highway_route,
    hilly_route,
    jensen_route,
    mixed_route,
    short_route,
    straight_route,
)
from weighbridge.simulation.scenario import (
    ABOUT,
    SCENARIOS,
    Braking,
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
    "BUS",
    "COMPACT",
    "ELECTRIC",
    "MIDSIZE",
    "SCENARIOS",
    "Braking",
    "Effects",
    "Loading",
    "Polling",
    "Route",
    "Scenario",
    "Sensors",
    "SimulatedCar",
    "SimulatedDrive",
    "Truth",
    "bus_route",
    "flat_route",
    "highway_route",
    "hilly_route",
    "jensen_route",
    "make_scenario",
    "mixed_route",
    "random_car",
    "short_route",
    "simulate_car",
    "straight_route",
]
