"""Density and pressure of the air a vehicle drives through."""

from __future__ import annotations

from dataclasses import dataclass

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


@dataclass(frozen=True, slots=True)
class Air:
    """What a whole drive tells of the air.

    Attributes
    ----------
    temperature : [K]
    pressure_ratio : pressure over that of the standard atmosphere [-]
    """

    temperature: float
    pressure_ratio: float

    def density(self, altitude: Floats) -> Floats:
        """Density [kg/m^3] at altitudes (n,) [m]; where they are NaN, at sea level."""
        pressure = standard_pressure(_height(altitude)) * self.pressure_ratio
        return np.asarray(pressure / (GAS_CONSTANT_DRY_AIR * self.temperature))


def identify_air(drive: Drive, altitude: Floats) -> Air:
    """Find the air from what the drive knows, else take the standard atmosphere.

    Temperature and pressure come from the drive's signals, then from
    ``drive.toml``; pressure then follows the altitude.

    Parameters
    ----------
    drive
    altitude : (n,) of its rows [m]; may be NaN
    """
    temperature = drive.info.ambient_temperature
    signal = drive.get("ambient_temperature")
    if signal is not None and len(signal):
        temperature = float(np.median(signal.values))
    height = _height(altitude)
    barometer = drive.get("barometric_pressure")
    known = drive.info.barometric_pressure
    if barometer is not None and len(barometer):
        known = float(np.median(barometer.values))
    ratio = 1.0
    if known is not None:
        ratio = known / float(np.median(standard_pressure(height)))
    if temperature is None:
        temperature = STANDARD_TEMPERATURE - TEMPERATURE_LAPSE * float(np.median(height))
    return Air(temperature, ratio)


def air_density(drive: Drive, altitude: Floats) -> Floats:
    """Density (n,) [kg/m^3] on a drive at altitudes (n,) [m]."""
    return identify_air(drive, altitude).density(altitude)


def dynamic_pressure(density: Floats | float, air_speed: Floats) -> Floats:
    """Pressure of the air against a vehicle ``rho v |v| / 2`` (n,) [Pa].

    Parameters
    ----------
    density : of the air, one or (n,) [kg/m^3]
    air_speed : (n,) against the air, negative where it blows from behind [m/s]
    """
    return np.asarray(0.5 * density * air_speed * np.abs(air_speed))


def _height(altitude: Floats) -> Floats:
    return np.where(np.isfinite(altitude), altitude, 0.0)
