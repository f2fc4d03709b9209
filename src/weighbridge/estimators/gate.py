"""What a mass needs to be given: settings that the methods share."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

from weighbridge.errors import ConfigError


# Without slots, so that settings can have it as a base beside another one.
@dataclass(frozen=True, kw_only=True)
class GateSettings:
    """What a drive must have for a mass; base of the settings of a method.

    Attributes
    ----------
    fewest_rows : fewer used rows carry no mass
    fewest_blocks : fewer stretches of time say nothing of their scatter
    least_time : time of used rows below which no mass is given [s]. Of 69 cuts with 15 to 60 s,
        vehicles never tuned on and an interval that is narrow enough, all intervals of joint hold,
        4.3 % RMS; of 267 masses by rls, robust-rls, ekf and hybrid from 20 to 60 s 98 to 100 %
        hold. Below, hardly any drive has enough rows
    least_spread : standard deviation of the specific force below which no mass is given [m/s^2].
        What the mass rests on then is the local slope of the torque's map, 15 % off in a simulated
        cruise of 0.07. Of 50 cuts with 0.07 to 0.12 that are narrow enough, seven vehicles never
        tuned on, 49 intervals hold, 9 % RMS; parts of highway drives have 0.14 and more, ordinary
        drives 0.25 to 0.4
    widest : standard deviation over the mass above which no mass is given [-]: the interval of
        95 % is 30 % to both sides then. Of 136 cuts that leave 8 to 15 % by the drive
        alone, of 16 vehicles never tuned on, 96 % of the intervals hold

    Raises
    ------
    ConfigError
        A value is negative or not a number.
    """

    fewest_rows: int = 50
    fewest_blocks: int = 3
    least_time: float = 20.0
    least_spread: float = 0.06
    widest: float = 0.15

    def __post_init__(self) -> None:
        for field in fields(GateSettings):
            value = getattr(self, field.name)
            if not value >= 0.0:
                raise ConfigError(f"{field.name} must be zero or positive, got {value:g}")


GATE: Final = GateSettings()
"""The gate as it is where nobody changes it."""
