"""An independent simulator of road vehicles, to weigh what it drives."""

from .gearboxes import VARIANTS, random_variant
from .make import make_drive, simulate
from .sensing import Logger
from .vehicle import KINDS, Vehicle, random_vehicle

__all__ = [
    "KINDS",
    "VARIANTS",
    "Logger",
    "Vehicle",
    "make_drive",
    "random_variant",
    "random_vehicle",
    "simulate",
]
