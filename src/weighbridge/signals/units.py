"""Units at the edge: the only place that converts between a file's unit and SI."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.arguments import suggestion
from weighbridge.constants import STANDARD_GRAVITY
from weighbridge.errors import ConfigError
from weighbridge.signals.signal import Floats


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit as written in a file: ``si = value * factor + offset``.

    Attributes
    ----------
    dimension : the SI unit it converts to, as text
    factor, offset : the affine conversion to SI
    """

    dimension: str
    factor: float
    offset: float = 0.0


UNITS: Final[dict[str, Unit]] = {
    "s": Unit("s", 1.0),
    "ms": Unit("s", 1e-3),
    "us": Unit("s", 1e-6),
    "ns": Unit("s", 1e-9),
    "min": Unit("s", 60.0),
    "m": Unit("m", 1.0),
    "mm": Unit("m", 1e-3),
    "km": Unit("m", 1e3),
    "ft": Unit("m", 0.3048),
    "mps": Unit("m/s", 1.0),
    "mmps": Unit("m/s", 1e-3),
    "kmh": Unit("m/s", 1.0 / 3.6),
    "mph": Unit("m/s", 0.44704),
    "kn": Unit("m/s", 1852.0 / 3600.0),
    "mps2": Unit("m/s^2", 1.0),
    "g": Unit("m/s^2", STANDARD_GRAVITY),
    "mg": Unit("m/s^2", 1e-3 * STANDARD_GRAVITY),
    "radps": Unit("rad/s", 1.0),
    "degps": Unit("rad/s", math.pi / 180.0),
    "mdegps": Unit("rad/s", 1e-3 * math.pi / 180.0),
    "rpm": Unit("rad/s", math.pi / 30.0),
    "rad": Unit("rad", 1.0),
    "deg": Unit("rad", math.pi / 180.0),
    "dege7": Unit("rad", 1e-7 * math.pi / 180.0),
    "semicircle": Unit("rad", math.pi / 2**31),
    "nm": Unit("N m", 1.0),
    "lbft": Unit("N m", 4.4482216152605 * 0.3048),
    "n": Unit("N", 1.0),
    "npm": Unit("N/m", 1.0),
    "npmm": Unit("N/m", 1e3),
    "nspm": Unit("N s/m", 1.0),
    "pct": Unit("-", 0.01),
    "ratio": Unit("-", 1.0),
    "pa": Unit("Pa", 1.0),
    "kpa": Unit("Pa", 1e3),
    "hpa": Unit("Pa", 1e2),
    "mbar": Unit("Pa", 1e2),
    "bar": Unit("Pa", 1e5),
    "psi": Unit("Pa", 4.4482216152605 / 0.0254**2),
    "k": Unit("K", 1.0),
    "degc": Unit("K", 1.0, 273.15),
    "degf": Unit("K", 5.0 / 9.0, 459.67 * 5.0 / 9.0),
    "gps": Unit("kg/s", 1e-3),
    "kgps": Unit("kg/s", 1.0),
    "kgph": Unit("kg/s", 1.0 / 3600.0),
    "lbpmin": Unit("kg/s", 0.45359237 / 60.0),
    "lph": Unit("m^3/s", 1e-3 / 3600.0),
    "v": Unit("V", 1.0),
    "a": Unit("A", 1.0),
    "kg": Unit("kg", 1.0),
    "t": Unit("kg", 1e3),
    "kgm2": Unit("kg m^2", 1.0),
    "m2": Unit("m^2", 1.0),
    "w": Unit("W", 1.0),
    "kw": Unit("W", 1e3),
}
"""Every unit suffix known, by how it is written at the end of a column name."""


def unit(suffix: str) -> Unit:
    """Look a unit suffix up.

    Raises
    ------
    ConfigError
        The suffix is not known.
    """
    found = UNITS.get(suffix.lower())
    if found is None:
        raise ConfigError(f"unknown unit {suffix!r}{suggestion(suffix, UNITS)}")
    return found


def to_si(values: Floats, suffix: str) -> Floats:
    """Convert an array from the unit ``suffix`` to SI; no copy where they agree."""
    u = unit(suffix)
    if u.factor == 1.0 and u.offset == 0.0:
        return values
    return np.asarray(values * u.factor + u.offset)


def from_si(values: Floats, suffix: str) -> Floats:
    """Convert an array from SI to the unit ``suffix``."""
    u = unit(suffix)
    return np.asarray((values - u.offset) / u.factor)


def scalar_to_si(value: float, suffix: str) -> float:
    """Convert one number from the unit ``suffix`` to SI."""
    u = unit(suffix)
    return value * u.factor + u.offset


def scalar_from_si(value: float, suffix: str) -> float:
    """Convert one number from SI to the unit ``suffix``."""
    u = unit(suffix)
    return (value - u.offset) / u.factor
