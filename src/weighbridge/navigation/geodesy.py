"""Between geodetic coordinates and a local north-east-down frame, by pymap3d."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pymap3d

from weighbridge.signals import Floats


@dataclass(frozen=True, slots=True)
class LocalFrame:
    """North, east, down axes at one point of the WGS 84 ellipsoid.

    Attributes
    ----------
    latitude, longitude : of the origin [rad]
    altitude : of the origin [m]
    """

    latitude: float
    longitude: float
    altitude: float

    def to_ned(self, latitude: Floats, longitude: Floats, altitude: Floats) -> Floats:
        """Return positions (n, 3) north, east, down [m]."""
        n, e, d = pymap3d.geodetic2ned(
            latitude,
            longitude,
            altitude,
            self.latitude,
            self.longitude,
            self.altitude,
            deg=False,
        )
        return np.column_stack([n, e, d])

    def to_geodetic(self, ned: Floats) -> tuple[Floats, Floats, Floats]:
        """Return latitude [rad], longitude [rad] and altitude [m] of positions (n, 3)."""
        lat, lon, alt = pymap3d.ned2geodetic(
            ned[:, 0],
            ned[:, 1],
            ned[:, 2],
            self.latitude,
            self.longitude,
            self.altitude,
            deg=False,
        )
        return np.asarray(lat), np.asarray(lon), np.asarray(alt)
