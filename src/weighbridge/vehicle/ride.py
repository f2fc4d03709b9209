"""Suspension of a vehicle and the sensors of its ride."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from weighbridge.errors import ConfigError
from weighbridge.vehicle.possible import not_negative, positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Ride:
    """Suspension of a two-axle vehicle, and the sensors of its ride.

    Attributes
    ----------
    front_stiffness, rear_stiffness : of the springs at each wheel [N/m]
    front_damping, rear_damping : of the dampers at each wheel [N s/m]
    front_track, rear_track : between left and right wheel [m]
    front_axle, rear_axle : distance from the centre of gravity of the sprung mass [m]
    front_unsprung, rear_unsprung : mass of axle and wheels [kg]
    sprung_mass, roll_inertia, pitch_inertia : roughly, where an estimate begins [kg],
        [kg m^2]
    zero_mass : sprung mass with which the travel sensors read zero at rest [kg]; None
        where it is not known
    force_std : relative standard deviation of what all springs and dampers have in
        common [-]; None where it is not known
    travel_noise, rate_noise : of one sample of a suspension sensor [m], [m/s]
    vertical_velocity_noise : of one sample [m/s]
    roll_rate_noise, pitch_rate_noise : of one sample [rad/s]
    """

    front_stiffness: float = math.nan
    rear_stiffness: float = math.nan
    front_damping: float = math.nan
    rear_damping: float = math.nan
    front_track: float = math.nan
    rear_track: float = math.nan
    front_axle: float = math.nan
    rear_axle: float = math.nan
    front_unsprung: float = math.nan
    rear_unsprung: float = math.nan
    sprung_mass: float = math.nan
    roll_inertia: float = math.nan
    pitch_inertia: float = math.nan
    zero_mass: float | None = None
    force_std: float | None = None
    travel_noise: float = 2e-4
    rate_noise: float = 5e-3
    vertical_velocity_noise: float = 5e-3
    roll_rate_noise: float = 2e-3
    pitch_rate_noise: float = 2e-3

    def __post_init__(self) -> None:
        for name, (low, high, unit) in RIDE_RANGE.items():
            value = getattr(self, name)
            if math.isnan(value):
                raise ConfigError(
                    f"{name} is missing: the ride needs it, between {low:g} and {high:g} {unit}"
                )
            if not low <= value <= high:
                raise ConfigError(
                    f"{name} must be between {low:g} and {high:g} {unit}, got {value:g}"
                )
        positive("zero_mass", self.zero_mass)
        if self.force_std is not None and not 0.0 <= self.force_std < 1.0:
            raise ConfigError(f"force_std must be in [0, 1), got {self.force_std}")
        for name in ("vertical_velocity_noise", "roll_rate_noise", "pitch_rate_noise"):
            positive(name, getattr(self, name))
        for name in ("travel_noise", "rate_noise"):
            not_negative(name, getattr(self, name))


RIDE_RANGE: Final[dict[str, tuple[float, float, str]]] = {
    "front_stiffness": (2e3, 5e6, "N/m"),
    "rear_stiffness": (2e3, 5e6, "N/m"),
    "front_damping": (0.0, 5e5, "N s/m"),
    "rear_damping": (0.0, 5e5, "N s/m"),
    "front_track": (0.3, 5.0, "m"),
    "rear_track": (0.3, 5.0, "m"),
    "front_axle": (0.1, 20.0, "m"),
    "rear_axle": (0.1, 20.0, "m"),
    "front_unsprung": (1.0, 1e4, "kg"),
    "rear_unsprung": (1.0, 1e4, "kg"),
    "sprung_mass": (50.0, 1e5, "kg"),
    "roll_inertia": (5.0, 1e6, "kg m^2"),
    "pitch_inertia": (5.0, 1e7, "kg m^2"),
}
"""What the ride of a road vehicle needs, and between which values it can be: from a light
quadricycle to an overloaded two-axle truck."""
