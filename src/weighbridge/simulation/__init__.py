"""Simulated vehicles on simulated roads, seen through simulated sensors."""

from weighbridge.simulation.car import COMPACT, ELECTRIC, MIDSIZE, SimulatedCar, random_car
from weighbridge.simulation.fleet import FleetSettings, plan_fleet
from weighbridge.simulation.named import ABOUT, SCENARIOS, make_scenario, usual_polling
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
    Braking,
    Effects,
    Habits,
    Loading,
    Polling,
    Scenario,
    Sensors,
)
from weighbridge.simulation.simulate import SimulatedDrive, Truth, simulate_car
from weighbridge.simulation.trailer import Trailer, random_trailer
from weighbridge.simulation.vehicles import (
    BUS,
    DIESEL_AUTOMATIC,
    TRUCK18,
    VAN,
    VehicleKind,
    random_habits,
    random_vehicle,
    with_random_details,
)

__all__ = [
    "ABOUT",
    "BUS",
    "COMPACT",
    "DIESEL_AUTOMATIC",
    "ELECTRIC",
    "MIDSIZE",
    "SCENARIOS",
    "TRUCK18",
    "VAN",
    "Braking",
    "Effects",
    "FleetSettings",
    "Habits",
    "Loading",
    "Polling",
    "Route",
    "Scenario",
    "Sensors",
    "SimulatedCar",
    "SimulatedDrive",
    "Trailer",
    "Truth",
    "VehicleKind",
    "bus_route",
    "flat_route",
    "highway_route",
    "hilly_route",
    "jensen_route",
    "make_scenario",
    "mixed_route",
    "plan_fleet",
    "random_car",
    "random_habits",
    "random_trailer",
    "random_vehicle",
    "short_route",
    "simulate_car",
    "straight_route",
    "usual_polling",
    "with_random_details",
]
