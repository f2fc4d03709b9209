"""Sprung mass, roll inertia and pitch inertia from the ride: filter, suspension, what is needed."""

from weighbridge.inertia.filter import (
    AXES,
    METHODS,
    InertiaFilter,
    InertiaTrack,
    Method,
    RideSamples,
    accelerations,
    estimate,
    fixed_params,
    inverse_interval,
)
from weighbridge.inertia.integration import integration_std
from weighbridge.inertia.ride_checks import ride_samples
from weighbridge.inertia.settings import UNKNOWN_FORCE_STD, InertiaSettings
from weighbridge.inertia.suspension import PARTS, SuspensionCheck, check_suspension

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
    "accelerations",
    "check_suspension",
    "estimate",
    "fixed_params",
    "integration_std",
    "inverse_interval",
    "ride_samples",
]
