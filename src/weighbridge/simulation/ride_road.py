"""Random roads after ISO 8608, with left and right tracks that resemble each other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import k1

from weighbridge.arguments import check_choice
from weighbridge.signals import Floats

ROUGHNESS: Final[dict[str, float]] = {c: 16e-6 * 4.0**k for k, c in enumerate("ABCDEFGH")}
"""Geometric mean of the displacement spectrum at 0.1 cycles/m, by class [m^3] (ISO 8608,
annex B, table for G_d(n_0))."""

REFERENCE: Final = 0.1
"""Reference spatial frequency n_0 [cycles/m]."""

BAND: Final = (0.011, 2.83)
"""Spatial frequencies of the standard [cycles/m]; the road has no others."""

_STEP: Final = 0.05
"""Distance between points of the profile [m]: seven to the shortest wave of `BAND`."""


@dataclass(frozen=True, slots=True)
class RideRoad:
    """Height of two tracks along the road.

    Attributes
    ----------
    left, right : height over distance [m]
    length : distance for which they are drawn; they repeat after it [m]
    """

    left: CubicSpline
    right: CubicSpline
    length: float


def coherence(frequency: Floats, track: float) -> Floats:
    """Cross spectrum of two parallel tracks over the spectrum of one [-].

    For an isotropic surface whose spectrum falls with the square of the
    frequency it is ``x K_1(x)`` with ``x = 2 pi n b``.

    Parameters
    ----------
    frequency : (n,) spatial frequency, above zero [cycles/m]
    track : distance between the tracks [m]

    References
    ----------
    Kamash and Robson, The application of isotropy in road surface modelling,
    Journal of Sound and Vibration 57(1), 1978.
    """
    x = 2.0 * math.pi * np.asarray(frequency) * track
    return np.asarray(x * k1(x))


def draw_road(
    road_class: str, length: float, track: float, random: np.random.Generator
) -> RideRoad:
    """Draw a road of one class.

    Both tracks have the spectrum ``G(n) = G(n_0) (n / n_0)^-2`` over `BAND`
    and Gaussian heights.

    Parameters
    ----------
    road_class : "A" (very good) to "H"
    length : at least so long [m]
    track : distance between left and right wheels [m]
    random : where it is drawn from

    Raises
    ------
    ConfigError
        There is no such class.
    """
    check_choice("road class", road_class.upper(), ROUGHNESS)
    roughness = ROUGHNESS[road_class.upper()]
    # Two of the longest waves at least, for the spectrum to have lines there.
    points = math.ceil(max(length, 2.0 / BAND[0]) / _STEP)
    frequency = np.fft.rfftfreq(points, _STEP)
    inside = (frequency >= BAND[0]) & (frequency <= BAND[1])
    n = np.asarray(frequency[inside], dtype=np.float64)
    # Variance of a line of the one-sided spectrum, carried by two Gaussians.
    amplitude = np.sqrt(roughness * (n / REFERENCE) ** -2.0 / (points * _STEP))
    likeness = coherence(n, track)
    lines = amplitude * (random.normal(size=(2, n.size)) + 1j * random.normal(size=(2, n.size)))
    mean = np.sqrt(0.5 * (1.0 + likeness)) * lines[0]
    half = np.sqrt(0.5 * (1.0 - likeness)) * lines[1]
    tracks = []
    for chosen in (mean + half, mean - half):
        spectrum = np.zeros(frequency.size, dtype=complex)
        spectrum[inside] = 0.5 * points * chosen
        height = np.fft.irfft(spectrum, points)
        grid = np.arange(points + 1) * _STEP
        tracks.append(CubicSpline(grid, np.append(height, height[0]), bc_type="periodic"))
    return RideRoad(tracks[0], tracks[1], points * _STEP)
