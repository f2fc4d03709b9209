"""Sprung mass, roll inertia and pitch inertia from the ride: filter, suspension, what is needed."""

from weighbridge.inertia.filter import (
    AXES,
    METHODS,
    InertiaFilter,
    InertiaTrack,
    Method,
    RideSamples,
)
from weighbridge.inertia.ride_checks import ride_samples
from weighbridge.inertia.settings import UNKNOWN_FORCE_STD, InertiaSettings
from weighbridge.inertia.suspension import PARTS, SuspensionCheck

__all__ = [
    "AXES",
    "METHODS",
    "PARTS",
    "UNKNOWN_FORCE_STD",
    "InertiaFilter",
    "InertiaSettings",
    "InertiaTrack",
    "Method",
    "RideSamples",
    "SuspensionCheck",
    "ride_samples",
]
