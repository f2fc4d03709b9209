"""Density and pressure of the air a vehicle drives through, and breathes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

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

CHARGE_TEMPERATURE: Final = 298.0
"""At which the calculated load of SAE J1979 takes the highest charge [K]."""

FEWEST_AT_REST: Final = 3
"""Samples of the manifold before the engine turns that show the pressure of the air."""


def standard_pressure(altitude: Floats) -> Floats:
    """Pressure of the standard atmosphere [Pa] at ``altitude`` [m] (ISO 2533)."""
    ratio = 1.0 - TEMPERATURE_LAPSE * np.asarray(altitude) / STANDARD_TEMPERATURE
    return np.asarray(STANDARD_PRESSURE * ratio**_EXPONENT)


@dataclass(frozen=True, slots=True)
class Air:
    """What a whole drive shows of the air.

    Attributes
    ----------
    temperature : [K]
    pressure_ratio : pressure over that of the standard atmosphere [-]
    height : altitude where it is unknown [m]
    known : a pressure or a height was known; else it is that of sea level
    """

    temperature: float
    pressure_ratio: float
    height: float = 0.0
    known: bool = True

    def density(self, altitude: Floats) -> Floats:
        """Density [kg/m^3] at altitudes (n,) [m]; where they are NaN, at that of the drive."""
        pressure = standard_pressure(_height(altitude, self.height)) * self.pressure_ratio
        return np.asarray(pressure / (GAS_CONSTANT_DRY_AIR * self.temperature))

    def charge(self, altitude: Floats) -> Floats:
        """Highest charge of an engine without a turbo over that at 101.325 kPa and 298 K (n,) [-].

        Parameters
        ----------
        altitude : (n,) [m]

        References
        ----------
        Calculated load, PID 04 of SAE J1979: the air flow is divided by its highest at that engine
        speed, times the pressure over 101.3 kPa and the root of 298 K over the temperature.
        """
        pressure = standard_pressure(_height(altitude, self.height)) * self.pressure_ratio
        heat = np.sqrt(CHARGE_TEMPERATURE / self.temperature)
        return np.asarray(pressure / STANDARD_PRESSURE * heat)


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
    known_height = altitude[np.isfinite(altitude)]
    usual = float(np.median(known_height)) if known_height.size else 0.0
    height = _height(altitude, usual)
    barometer = drive.get("barometric_pressure")
    known = drive.info.barometric_pressure
    if barometer is not None and len(barometer):
        known = float(np.median(barometer.values))
    if known is None:
        known = _at_rest(drive)
    ratio = 1.0
    if known is not None:
        ratio = known / float(np.median(standard_pressure(height)))
    if temperature is None:
        temperature = STANDARD_TEMPERATURE - TEMPERATURE_LAPSE * float(np.median(height))
    return Air(temperature, ratio, usual, known is not None or known_height.size > 0)


def _at_rest(drive: Drive) -> float | None:
    """Pressure in the manifold before the engine turns [Pa]: that of the air; None without."""
    manifold, turning = drive.get("intake_pressure"), drive.get("engine_speed")
    if manifold is None or turning is None or not len(turning):
        return None
    rest = manifold.values[turning.at(manifold.time) == 0.0]
    return float(np.median(rest)) if rest.size >= FEWEST_AT_REST else None


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


def _height(altitude: Floats, usual: float) -> Floats:
    """Altitudes (n,), and the usual one where they are unknown [m]."""
    return np.where(np.isfinite(altitude), altitude, usual)
