"""Between geodetic coordinates and local north, east and down, by pymap3d."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pymap3d
from pymap3d.rcurve import geocentric_radius

from weighbridge.signals import Floats


@dataclass(frozen=True, slots=True)
class LocalFrame:
    """Axes north and east at one point of the WGS 84 ellipsoid, down along the plumb line.

    North and east are those of the tangent plane, but down is the height
    below the origin and so follows the curved Earth: 30 km away the tangent
    plane leans by 0.27 deg, which would be taken for a grade.

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
        level = np.full(np.shape(latitude), self.altitude)
        n, e, _ = pymap3d.geodetic2ned(
            latitude,
            longitude,
            level,
            self.latitude,
            self.longitude,
            self.altitude,
            deg=False,
        )
        return np.column_stack([n, e, self.altitude - np.asarray(altitude)])

    def to_geodetic(self, ned: Floats) -> tuple[Floats, Floats, Floats]:
        """Return latitude [rad], longitude [rad] and altitude [m] of positions (n, 3)."""
        radius = float(geocentric_radius(self.latitude, deg=False)) + self.altitude
        drop = radius - np.sqrt(radius**2 - ned[:, 0] ** 2 - ned[:, 1] ** 2)
        lat, lon, _ = pymap3d.ned2geodetic(
            ned[:, 0],
            ned[:, 1],
            drop,
            self.latitude,
            self.longitude,
            self.altitude,
            deg=False,
        )
        return np.asarray(lat), np.asarray(lon), self.height(ned)

    def height(self, ned: Floats) -> Floats:
        """Return the altitude of positions (n, 3) [m]."""
        return np.asarray(self.altitude - ned[:, 2])
