"""Settings of the joint estimator."""

from __future__ import annotations

from dataclasses import dataclass

from weighbridge.arguments import check_choice
from weighbridge.errors import ConfigError
from weighbridge.estimators.gate import GateSettings
from weighbridge.estimators.joint.terms import TERMS


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSettings(GateSettings):
    """What a user may change of the joint estimator.

    Attributes
    ----------
    gate : windows with a larger normalised innovation are left out [-]
    settle_windows : windows before the gate closes
    fewest_windows : fewer usable windows carry no mass, after a stop no change of it
    change_std : standard deviation of a change of load at a stop, over mass [-]
    load_pitch_std : standard deviation of what a change of load adds to the slow resistance, over
        mass [m/s^2]: the body pitches with its load, and the accelerometer with it; 240 kg in the
        boot of a simulated car make 0.27 deg, 0.046 m/s^2
    terms : names of the states, those of `weighbridge.estimators.joint.terms.TERMS`; a vehicle has
        those of them that apply to it. The mass is the first
    """

    gate: float = 5.0
    settle_windows: int = 40
    fewest_windows: int = 8
    change_std: float = 0.25
    load_pitch_std: float = 0.03
    terms: tuple[str, ...] = TERMS.own

    def __post_init__(self) -> None:
        GateSettings.__post_init__(self)
        if not self.gate > 0.0:
            raise ConfigError(f"gate must be positive, got {self.gate:g}")
        if not (self.settle_windows >= 1 and self.fewest_windows >= 2):
            raise ConfigError(
                "settle_windows must be 1 or more and fewest_windows 2 or more, "
                f"got {self.settle_windows} and {self.fewest_windows}"
            )
        if not (0.0 < self.change_std <= 1.0 and 0.0 <= self.load_pitch_std <= 1.0):
            raise ConfigError(
                "change_std must be in (0, 1] and load_pitch_std in [0, 1], "
                f"got {self.change_std:g} and {self.load_pitch_std:g}"
            )
        for name in self.terms:
            if name not in TERMS.own:
                check_choice("each of terms", name, TERMS)
        if self.terms[:1] != ("mass",) or len(set(self.terms)) < len(self.terms):
            raise ConfigError(
                f"terms must begin with mass and name each once, got {', '.join(self.terms)}"
            )
