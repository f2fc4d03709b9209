"""Density and pressure of the air a vehicle drives through."""

from __future__ import annotations

import numpy as np

from weighbridge.constants import (
    GAS_CONSTANT_DRY_AIR,
    GRAVITY,
    STANDARD_PRESSURE,
    STANDARD_TEMPERATURE,
    TEMPERATURE_LAPSE,
)
from weighbridge.signals import Drive, Floats

_EXPONENT = GRAVITY / (GAS_CONSTANT_DRY_AIR * TEMPERATURE_LAPSE)


def standard_pressure(altitude: Floats) -> Floats:
    """Pressure of the standard atmosphere [Pa] at ``altitude`` [m] (ISO 2533)."""
    ratio = 1.0 - TEMPERATURE_LAPSE * np.asarray(altitude) / STANDARD_TEMPERATURE
    return np.asarray(STANDARD_PRESSURE * ratio**_EXPONENT)


def air_density(drive: Drive, time: Floats, altitude: Floats) -> Floats:
    """Density from what the drive knows, else from the standard atmosphere.

    Temperature and pressure come from the drive's signals, then from
    ``drive.toml``; pressure then follows the altitude.

    Parameters
    ----------
    time : (n,) [s]
    altitude : (n,) [m]; may be NaN

    Returns
    -------
    (n,) [kg/m^3]
    """
    temperature = drive.info.ambient_temperature
    signal = drive.get("ambient_temperature")
    if signal is not None and len(signal):
        temperature = float(np.median(signal.values))
    height = np.where(np.isfinite(altitude), altitude, 0.0)
    pressure = standard_pressure(height)
    barometer = drive.get("barometric_pressure")
    known = drive.info.barometric_pressure
    if barometer is not None and len(barometer):
        known = float(np.median(barometer.values))
    if known is not None:
        pressure = pressure * (known / float(np.median(pressure)))
    if temperature is None:
        temperature = STANDARD_TEMPERATURE - TEMPERATURE_LAPSE * float(np.median(height))
    return np.asarray(pressure / (GAS_CONSTANT_DRY_AIR * temperature))


def dynamic_pressure(density: Floats | float, air_speed: Floats) -> Floats:
    """Pressure of the air against a vehicle ``rho v |v| / 2`` (n,) [Pa].

    Parameters
    ----------
    density : of the air, one or (n,) [kg/m^3]
    air_speed : (n,) against the air, negative where it blows from behind [m/s]
    """
    return np.asarray(0.5 * density * air_speed * np.abs(air_speed))
