"""What the filters of the ride assume beside the vehicle file."""

from __future__ import annotations

from dataclasses import dataclass, fields
from numbers import Real
from typing import Final

from weighbridge.arguments import check_all, check_number
from weighbridge.errors import ConfigError

UNKNOWN_FORCE_STD: Final = 0.05
"""Relative standard deviation of what all springs and dampers have in common where the vehicle
file does not say [-]: chosen, for data-sheet values of springs (some 3 %) and dampers
(some 10 %), of which springs carry most of the force."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InertiaSettings:
    """Assumptions of the filters besides the vehicle file.

    Attributes
    ----------
    range : least and largest parameter over that of the vehicle file [-]
    start_std : standard deviation of the inverse parameter at the start, relative [-]
    start_velocity_std : of the velocities at the start [m/s], [rad/s]; for the filters without
        jumps
    start_variances : diagonal of P0 in full, in place of both: of vertical velocity [m^2/s^2], roll
        and pitch rate [rad^2/s^2], mass [kg^2], roll and pitch inertia [kg^2 m^4]; none or six, for
        the filters without jumps
    jump_rate : jumps expected per time [1/s]
    jump_std : standard deviation of the inverse parameter after a jump, relative [-]
    spawn : time between two hypotheses of a jump [s]
    push_drift : growth of the angular acceleration that braking, starting or turning
        causes, over the root of time; without offset_std not used [rad/s^2.5]
    push_rate : beginnings and ends of braking and turning expected per time [1/s]
    drift : relative growth of the inverse parameter's standard deviation over the root
        of time [1/s^0.5]
    offset_std : standard deviation of the constant acceleration that sensor offsets and
        the weight of the payload seem to cause; 0 for none, as printed [m/s^2], [rad/s^2].
        The filters without jumps take the mean off the travel instead
    offset_drift : its growth over the root of time [m/s^2.5], [rad/s^2.5]
    process : spectral density of the fixed process noise of velocities [m^2/s^3] and of
        parameters relative to the vehicle file's [1/s]; for the filters without jumps
    process_densities : Q in full, in place of ``process``: of vertical velocity [m^2/s^3],
        roll and pitch rate [rad^2/s^3], mass [kg^2/s], roll and pitch inertia [kg^2 m^4/s];
        none or six
    noise_densities : R in full, in place of the vehicle file's noise over a step: of vertical
        velocity [m^2/s], roll and pitch rate [rad^2 s]; none or three, for the filters without
        jumps
    """

    range: tuple[float, float] = (0.125, 8.0)
    start_std: float = 1.0
    start_velocity_std: float = 10.0
    start_variances: tuple[float, ...] = ()
    jump_rate: float = 1e-4
    jump_std: float = 1.0
    spawn: float = 2e-3
    push_drift: float = 1.0
    push_rate: float = 0.3
    drift: float = 3e-5
    offset_std: float = 10.0
    offset_drift: float = 3e-3
    process: tuple[float, float] = (1e-6, 0.01)
    process_densities: tuple[float, ...] = ()
    noise_densities: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(field.default, tuple):
                check_all(field.name, value, Real, "numbers")
            else:
                check_number(field.name, value)
        for name in ("range", "process"):
            if len(getattr(self, name)) != 2:
                raise ConfigError(f"{name} must be two numbers, got {getattr(self, name)}")
        low, high = self.range
        if not 0.0 < low < 1.0 < high:
            raise ConfigError(f"range must be two numbers around 1, got {self.range}")
        for name in ("start_std", "start_velocity_std", "jump_rate", "jump_std", "spawn"):
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"{name} must be positive, got {getattr(self, name)}")
        for name, count in (
            ("start_variances", 6), ("process_densities", 6), ("noise_densities", 3),
        ):  # fmt: skip
            densities = getattr(self, name)
            if len(densities) not in (0, count) or any(not d > 0.0 for d in densities):
                raise ConfigError(f"{name} must be {count} positive numbers, got {densities}")
