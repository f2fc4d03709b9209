"""The vehicle: what its file says, gears, torque sources, classes."""

from weighbridge.vehicle.air import Air, air_density, identify_air
from weighbridge.vehicle.classes import VEHICLE_CLASSES, VehicleClass
from weighbridge.vehicle.driveline import Driveline, Mounting, RoadLoad
from weighbridge.vehicle.file import save_vehicle
from weighbridge.vehicle.known import Known, describe
from weighbridge.vehicle.model import Vehicle
from weighbridge.vehicle.provenance import Provenance
from weighbridge.vehicle.ride import Ride
from weighbridge.vehicle.speed_model import SpeedModel
from weighbridge.vehicle.torque_model import (
    DraggedReading,
    SecondSignalRelation,
    Timing,
    TorqueModel,
)
from weighbridge.vehicle.torque_source import TorqueSource, TorqueTerms
from weighbridge.vehicle.torque_sources import TORQUE_SOURCES

__all__ = [
    "TORQUE_SOURCES",
    "VEHICLE_CLASSES",
    "Air",
    "DraggedReading",
    "Driveline",
    "Known",
    "Mounting",
    "Provenance",
    "Ride",
    "RoadLoad",
    "SecondSignalRelation",
    "SpeedModel",
    "Timing",
    "TorqueModel",
    "TorqueSource",
    "TorqueTerms",
    "Vehicle",
    "VehicleClass",
    "air_density",
    "describe",
    "identify_air",
    "save_vehicle",
]
