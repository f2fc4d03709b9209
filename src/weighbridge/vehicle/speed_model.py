"""The model of a vehicle that is weighed by its speed alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

from weighbridge.errors import ConfigError
from weighbridge.vehicle.possible import MASSES, not_negative, positive, within


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedSampling:
    """How the speed is sampled, and when the estimation is on; the defaults are ours.

    Attributes
    ----------
    sample_time : T_s between samples [s]; the paper's is 7 s
    averaged : part of it, before the sample, over which the speed is averaged [-]; 0 for the speed
        at the sample alone. The paper does not say
    slowest : samples below are off: clutch, first gears and stops [m/s]
    hardest : samples that slow down by more are off, for they are braked: no car in a high gear
        coasts down like that on a low grade [m/s^2]

    References
    ----------
    Galvão et al., secs. 4 and 5.1, which name neither limit.
    """

    sample_time: float = 7.0
    averaged: float = 1.0
    slowest: float = 5.0
    hardest: float = 0.4

    def __post_init__(self) -> None:
        if not 1.0 <= self.sample_time <= 60.0:
            raise ConfigError(f"sample_time must be in [1, 60] s, got {self.sample_time:g}")
        within("averaged", self.averaged, 0.0, 1.0)
        not_negative("slowest", self.slowest)
        positive("hardest", self.hardest)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedModel(SpeedSampling):
    """Model of ``--method speed-ekf``, in which torque is proportional to speed.

    Attributes
    ----------
    mass : known mass of the drive it was fitted to; the filter starts there [kg]
    force_gain : a1, traction force per engine torque [1/m]
    drag : a2, air density times drag area [kg/m]
    rolling_coefficient : f_r; a3 and the angle beta follow from it [-]
    rotating_mass : m_r, what the rotating parts weigh like [kg]
    corrections : p1 to p7 of the fit, in SI
    r_squared : part of the speed's changes that the fit explains [-]
    samples : windows of the fit
    scale_std : relative standard deviation that the model leaves in every mass [-]

    References
    ----------
    Galvão et al., An Extended Kalman Filter implementation for estimating the mass
    of passengers vehicles, eqs. 10-18.
    """

    mass: float
    force_gain: float
    drag: float
    rolling_coefficient: float = 0.010
    rotating_mass: float
    corrections: tuple[float, ...]
    r_squared: float | None = None
    samples: int | None = None
    scale_std: float

    def __post_init__(self) -> None:
        SpeedSampling.__post_init__(self)
        for name in ("mass", "force_gain", "scale_std"):
            positive(name, getattr(self, name))
        for name in ("drag", "rotating_mass"):
            not_negative(name, getattr(self, name))
        within("mass", self.mass, *MASSES, "kg")
        within("rotating_mass", self.rotating_mass, 0.0, MASSES[1], "kg")
        within("force_gain", self.force_gain, 1e-6, 1e6, "per m")
        within("drag", self.drag, 0.0, 1e3, "kg/m")
        within("scale_std", self.scale_std, 1e-15, 1e3)
        if not 0.0 <= self.rolling_coefficient < 0.1:
            raise ConfigError(
                f"rolling_coefficient must be in [0, 0.1), got {self.rolling_coefficient}"
            )
        if len(self.corrections) != 7 or not all(math.isfinite(p) for p in self.corrections):
            raise ConfigError(
                f"corrections must be seven numbers, p1 to p7, got {len(self.corrections)}"
            )
