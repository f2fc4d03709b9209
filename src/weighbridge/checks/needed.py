"""What a mass is made from: what is wrong with it is serious."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.signals import QUANTITIES, Drive, scalar_from_si
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.vehicle import TORQUE_SOURCES, Vehicle, sources_of

MOTION: Final = frozenset(
    (
        *IMU_SIGNALS,
        "longitudinal_accel",
        "vehicle_speed",
        "engine_speed",
        "latitude",
        "longitude",
        "gnss_speed",
        "grade",
    )
)
"""Signals a mass is made from beside the torque's: what is wrong with them is serious."""


def of_torque() -> frozenset[str]:
    """Signals of torque: only what is wrong with those of the source in use is serious."""
    return frozenset(
        name
        for source in TORQUE_SOURCES.values()
        for names in (source.signals, *source.others)
        for name in names
        if name not in source.steady
    ).difference(MOTION)


def needed(drive: Drive, vehicle: Vehicle | None) -> frozenset[str]:
    """Signals a mass would be made from.

    The torque is that of the vehicle file; without one, of the source that a calibration takes.
    """
    sources = [source for source in sources_of(vehicle) if not source.lacking(drive)]
    if vehicle is not None and vehicle.torque.stated:
        sources = [vehicle.torque.of_source]
    elif len(sources) > 1 and sources[0].needs_reference and not drive.has("reference_torque"):
        # A vehicle file may yet give the reference torque.
        return MOTION.union(sources[0].found(drive), sources[1].found(drive))
    return MOTION.union(*(source.found(drive) for source in sources[:1]))


def show(name: str, value: float) -> str:
    """Write an SI value in the quantity's own unit."""
    suffix = QUANTITIES[name].suffix
    return f"{scalar_from_si(value, suffix):.4g} {suffix}" if suffix else f"{value:.4g}"


def moves(drive: Drive) -> bool:
    """Say whether any source saw the vehicle move."""
    for name in ("vehicle_speed", "gnss_speed"):
        s = drive.get(name)
        if s is not None and len(s) and float(np.max(np.abs(s.values))) > 1.0:
            return True
    lat, lon = drive.get("latitude"), drive.get("longitude")
    if lat is None or lon is None or not len(lat) or not len(lon):
        return False
    return float(np.ptp(lat.values)) > 3e-5 or float(np.ptp(lon.values)) > 3e-5
