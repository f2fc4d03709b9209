"""The vehicle: what its file says, gears, torque sources, classes."""

from weighbridge.vehicle.air import Air, air_density, identify_air
from weighbridge.vehicle.classes import VEHICLE_CLASSES, VehicleClass
from weighbridge.vehicle.data_sheet import (
    by_data_sheet,
    friction_coefficients,
    scale_std,
    wheel_efficiency,
)
from weighbridge.vehicle.driveline import Driveline, Mounting, RoadLoad
from weighbridge.vehicle.engine_delay import find_engine_delay, gathered_delay
from weighbridge.vehicle.file import save_vehicle
from weighbridge.vehicle.fuel import FUEL_STD, Burnt, fuel_burnt, fuel_flow, full_load_torque
from weighbridge.vehicle.gear import (
    GearDetection,
    detect_gearings,
    effective_gearing,
    idling,
    number_reported_gears,
    predict_gear,
    reported_gear_numbers,
    shifting,
    stepless_range,
)
from weighbridge.vehicle.known import Known, describe
from weighbridge.vehicle.model import Vehicle
from weighbridge.vehicle.power_balance import by_power, find_power_balance
from weighbridge.vehicle.provenance import Provenance
from weighbridge.vehicle.ride import Ride
from weighbridge.vehicle.speed_model import SpeedModel
from weighbridge.vehicle.torque import (
    cold_torque_std,
    engine_torque,
    in_air,
    part_of_a_hybrid,
    reading_of,
    rows_of,
    source_of,
    sources_of,
    torque_rows,
)
from weighbridge.vehicle.torque_model import (
    DraggedReading,
    SecondSignalRelation,
    Timing,
    TorqueModel,
)
from weighbridge.vehicle.torque_source import TorqueSource, TorqueTerms
from weighbridge.vehicle.torque_sources import TORQUE_SOURCES

__all__ = [
    "FUEL_STD",
    "TORQUE_SOURCES",
    "VEHICLE_CLASSES",
    "Air",
    "Burnt",
    "DraggedReading",
    "Driveline",
    "GearDetection",
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
    "by_data_sheet",
    "by_power",
    "cold_torque_std",
    "describe",
    "detect_gearings",
    "effective_gearing",
    "engine_torque",
    "find_engine_delay",
    "find_power_balance",
    "friction_coefficients",
    "fuel_burnt",
    "fuel_flow",
    "full_load_torque",
    "gathered_delay",
    "identify_air",
    "idling",
    "in_air",
    "number_reported_gears",
    "part_of_a_hybrid",
    "predict_gear",
    "reading_of",
    "reported_gear_numbers",
    "rows_of",
    "save_vehicle",
    "scale_std",
    "shifting",
    "source_of",
    "sources_of",
    "stepless_range",
    "torque_rows",
    "wheel_efficiency",
]
