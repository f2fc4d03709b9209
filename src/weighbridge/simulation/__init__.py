"""Simulated vehicles on simulated roads, seen through simulated sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from weighbridge.first_use import at_first_uses

if TYPE_CHECKING:
    from weighbridge.simulation.car import COMPACT as COMPACT
    from weighbridge.simulation.car import ELECTRIC as ELECTRIC
    from weighbridge.simulation.car import MIDSIZE as MIDSIZE
    from weighbridge.simulation.car import SimulatedCar as SimulatedCar
    from weighbridge.simulation.car import random_car as random_car
    from weighbridge.simulation.fleet import FleetSettings as FleetSettings
    from weighbridge.simulation.fleet import plan_fleet as plan_fleet
    from weighbridge.simulation.named import ABOUT as ABOUT
    from weighbridge.simulation.named import SCENARIOS as SCENARIOS
    from weighbridge.simulation.named import make_scenario as make_scenario
    from weighbridge.simulation.named import usual_polling as usual_polling
    from weighbridge.simulation.ride import TRUCK as TRUCK
    from weighbridge.simulation.ride import RideScenario as RideScenario
    from weighbridge.simulation.ride import RideSensors as RideSensors
    from weighbridge.simulation.ride import RideVehicle as RideVehicle
    from weighbridge.simulation.ride import SimulatedRide as SimulatedRide
    from weighbridge.simulation.ride import simulate_ride as simulate_ride
    from weighbridge.simulation.ride import system as system
    from weighbridge.simulation.route import Route as Route
    from weighbridge.simulation.route import bus_route as bus_route
    from weighbridge.simulation.route import flat_route as flat_route
    from weighbridge.simulation.route import highway_route as highway_route
    from weighbridge.simulation.route import hilly_route as hilly_route
    from weighbridge.simulation.route import jensen_route as jensen_route
    from weighbridge.simulation.route import mixed_route as mixed_route
    from weighbridge.simulation.route import short_route as short_route
    from weighbridge.simulation.route import straight_route as straight_route
    from weighbridge.simulation.scenario import Braking as Braking
    from weighbridge.simulation.scenario import Effects as Effects
    from weighbridge.simulation.scenario import Habits as Habits
    from weighbridge.simulation.scenario import Loading as Loading
    from weighbridge.simulation.scenario import Polling as Polling
    from weighbridge.simulation.scenario import Scenario as Scenario
    from weighbridge.simulation.scenario import Sensors as Sensors
    from weighbridge.simulation.simulate import SimulatedDrive as SimulatedDrive
    from weighbridge.simulation.simulate import Truth as Truth
    from weighbridge.simulation.simulate import simulate_car as simulate_car
    from weighbridge.simulation.trailer import Trailer as Trailer
    from weighbridge.simulation.trailer import random_trailer as random_trailer
    from weighbridge.simulation.vehicles import BUS as BUS
    from weighbridge.simulation.vehicles import DIESEL_AUTOMATIC as DIESEL_AUTOMATIC
    from weighbridge.simulation.vehicles import TRUCK18 as TRUCK18
    from weighbridge.simulation.vehicles import VAN as VAN
    from weighbridge.simulation.vehicles import VehicleKind as VehicleKind
    from weighbridge.simulation.vehicles import random_habits as random_habits
    from weighbridge.simulation.vehicles import random_vehicle as random_vehicle
    from weighbridge.simulation.vehicles import with_random_details as with_random_details

__getattr__, __dir__, __all__ = at_first_uses(
    __name__,
    {
        "car": "COMPACT ELECTRIC MIDSIZE SimulatedCar random_car",
        "fleet": "FleetSettings plan_fleet",
        "named": "ABOUT SCENARIOS make_scenario usual_polling",
        "ride": "TRUCK RideScenario RideSensors RideVehicle SimulatedRide simulate_ride system",
        "route": "Route bus_route flat_route highway_route hilly_route jensen_route mixed_route "
        "short_route straight_route",
        "scenario": "Braking Effects Habits Loading Polling Scenario Sensors",
        "simulate": "SimulatedDrive Truth simulate_car",
        "trailer": "Trailer random_trailer",
        "vehicles": "BUS DIESEL_AUTOMATIC TRUCK18 VAN VehicleKind random_habits random_vehicle "
        "with_random_details",
    },
)
