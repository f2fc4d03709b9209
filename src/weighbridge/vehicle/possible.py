"""Refusals of numbers that no vehicle can have."""

from __future__ import annotations

import itertools
import math
from typing import Final

from weighbridge.arguments import check_number
from weighbridge.errors import ConfigError

MASSES: Final = (10.0, 1_000_000.0)
"""Masses that may are in a vehicle file, of any class and with any payload [kg]."""


def curve(x_name: str, x: tuple[float, ...], y_name: str, y: tuple[float, ...]) -> None:
    """Refuse a curve with other counts of ``x`` and ``y``, or whose ``x`` does not rise."""
    if len(y) != len(x):
        raise ConfigError(f"{y_name} must be as many as {x_name}, {len(x)}, got {len(y)}")
    if any(b <= a for a, b in itertools.pairwise(x)):
        raise ConfigError(f"{x_name} must rise, got {x}")


def positive(name: str, value: float | None) -> None:
    """Refuse what is not above zero."""
    check_number(name, value, optional=True)
    if value is not None and not (math.isfinite(value) and value > 0.0):
        raise ConfigError(f"{name} must be a positive number, got {value}")


def not_negative(name: str, value: float | None) -> None:
    """Refuse what is below zero."""
    check_number(name, value, optional=True)
    if value is not None and not (math.isfinite(value) and value >= 0.0):
        raise ConfigError(f"{name} must be zero or positive, got {value}")


def within(name: str, value: float | None, low: float, high: float, unit: str = "") -> None:
    """Refuse what no vehicle has, wide enough for any: its powers would be no numbers."""
    check_number(name, value, optional=True)
    if value is not None and not low <= value <= high:
        raise ConfigError(
            f"{name} must be between {low:g} and {high:g}{' ' * bool(unit)}{unit}, got {value:g}"
        )
