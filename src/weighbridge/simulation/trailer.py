"""Trailers that can be simulated behind a vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from weighbridge.errors import ConfigError

TrailerKind = Literal["box", "flat"]
"""A box as high as the truck, or a low bed with plant or containers below the height of the cab."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trailer:
    """What a trailer adds to the vehicle that draws it.

    Attributes
    ----------
    kind : one of `TrailerKind`
    mass : with its load [kg]
    drag_area : C_d A of both above that of the vehicle alone, without side wind [m^2]
    rolling_coefficient : of its tyres, warm, at 25 degC and walking pace [-]
    wheel_inertia, wheel_radius : of all its wheels with brakes [kg m^2], effective radius [m]
    hitch_load : part of its mass that the coupling carries [-]
    hitch_pitch : how far that load pitches the body of the vehicle, over the same load on its
        bed [-]
    hitch_pull : how far its inertia pitches the body, over the same mass on the bed [-]
    """

    kind: TrailerKind
    mass: float
    drag_area: float
    rolling_coefficient: float = 0.0055
    wheel_inertia: float = 43.3
    wheel_radius: float = 0.50
    hitch_load: float = 0.05
    hitch_pitch: float = 3.0
    hitch_pull: float = 0.5

    def __post_init__(self) -> None:
        for name in ("mass", "wheel_radius"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ConfigError(f"{name} of a simulated trailer must be positive, got {value}")
        for name in ("drag_area", "rolling_coefficient", "wheel_inertia", "hitch_load"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ConfigError(
                    f"{name} of a simulated trailer must be zero or positive, got {value}"
                )

    @property
    def wheel_mass(self) -> float:
        """Inertia of its wheels as a mass [kg]."""
        return self.wheel_inertia / self.wheel_radius**2


DRAG_AREAS: Final[dict[TrailerKind, tuple[float, float]]] = {"box": (1.2, 1.8), "flat": (0.3, 0.8)}
"""What each kind adds, from and to [m^2]. Box: 1.5 m^2 for the standard trailer T2 of the European
Commission's VECTO (Body_Trailers_Weights.csv; 5.4 t empty, 18 t permitted), and 20 % to either side
for gap and shape. Flat: chosen, without a published figure: what stands behind a box truck and is
lower than it adds axles, sides and wake only."""

SHARES: Final[dict[TrailerKind, float]] = {"box": 0.75, "flat": 0.25}
"""Part of the trailers of a fleet that are of each kind [-]; chosen."""

MASSES: Final = (0.6, 1.0)
"""Of a trailer with its load over the empty truck, from and to [-]: 5.4 to 9 t behind 9 t."""


def random_trailer(rng: np.random.Generator, tare: float) -> Trailer:
    """Draw a drawbar trailer for a truck.

    Rolling coefficient and tyres are those of VECTO's trailers (DeclarationData.Trailer: 0.0055,
    385/65 R22.5; 21.7 kg m^2 an axle, two axles). A coupling carries at most a tenth of a
    centre-axle trailer (Regulation (EU) 2021/535, Annex XIII) and nothing of one with a turntable;
    it is some 2.5 m behind the rear axle, where a load on the bed is some 1 m before it.

    Parameters
    ----------
    rng : numpy.random.Generator
    tare : mass of the empty truck [kg]
    """
    kinds = list(SHARES)
    kind = kinds[int(rng.choice(len(kinds), p=list(SHARES.values())))]
    return Trailer(
        kind=kind,
        mass=round(tare * float(rng.uniform(*MASSES))),
        drag_area=float(rng.uniform(*DRAG_AREAS[kind])),
        rolling_coefficient=float(rng.uniform(0.0048, 0.0062)),
        hitch_load=float(rng.uniform(0.0, 0.1)),
    )
