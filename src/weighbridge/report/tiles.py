"""Street map below a track, from a tile server that the user names; off unless asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import urlsplit

import numpy as np
import pymap3d

from weighbridge.errors import ConfigError
from weighbridge.signals import Floats, from_si
from weighbridge.visible import visible

MOST: Final = 30
"""Tiles of a map, at most."""

FINEST: Final = 17
"""Highest zoom that is asked for."""

AROUND: Final = 0.1
"""What is shown around the track, over its larger extent [-]."""

_FORBIDDEN: Final = set(" \t\"'<>;,\\")


@dataclass(frozen=True, slots=True)
class Tiles:
    """A server of map tiles (Web Mercator, ``{z}/{x}/{y}``).

    Attributes
    ----------
    template : address of a tile, with ``{z}``, ``{x}`` and ``{y}``

    Raises
    ------
    ConfigError
        The template is no such address.
    """

    template: str

    def __post_init__(self) -> None:
        parts = urlsplit(self.template)
        named = all(name in self.template for name in ("{z}", "{x}", "{y}"))
        if (
            not named
            or parts.scheme not in ("https", "http")
            or not parts.netloc
            or _FORBIDDEN & set(self.template)
            or visible(self.template) != self.template
        ):
            raise ConfigError(
                f"tiles {visible(self.template)!r}: is no address of map tiles; give one with "
                "{z}, {x} and {y}, such as https://tiles.example.org/{z}/{x}/{y}.png"
            )

    @property
    def origin(self) -> str:
        """Scheme and host that a browser may load pictures from."""
        parts = urlsplit(self.template)
        return f"{parts.scheme}://{parts.netloc}"

    @property
    def credit(self) -> str:
        """Whose pictures they are, a sentence."""
        host = urlsplit(self.template).netloc
        osm = ", © OpenStreetMap contributors" if "openstreetmap" in host else ""
        return f"Map tiles from {host}{osm}."

    def images(
        self, latitude: Floats, longitude: Floats, middle: tuple[float, float]
    ) -> list[dict[str, Any]]:
        """Return the tiles around a track as plotly images.

        Parameters
        ----------
        latitude, longitude : (n,) of the track [rad]
        middle : latitude and longitude where east and north are zero [rad]
        """
        west, east, south, north = _bounds(latitude, longitude)
        zoom = _zoom(west, east, south, north)
        (left, top), (right, bottom) = _tile(north, west, zoom), _tile(south, east, zoom)
        images = []
        for column in range(math.floor(left), math.floor(right) + 1):
            for row in range(math.floor(top), math.floor(bottom) + 1):
                x, y = _east_north(column, row, zoom, middle)
                x_end, y_end = _east_north(column + 1, row + 1, zoom, middle)
                address = self.template.replace("{z}", str(zoom))
                images.append(
                    {
                        "source": address.replace("{x}", str(column)).replace("{y}", str(row)),
                        "xref": "x", "yref": "y", "x": x, "y": y, "sizex": x_end - x,
                        "sizey": y - y_end, "sizing": "stretch", "layer": "below", "opacity": 0.7,
                    }
                )  # fmt: skip
        return images


def _bounds(latitude: Floats, longitude: Floats) -> tuple[float, float, float, float]:
    """West, east, south and north of a square around the track [rad]."""
    stretch = math.cos(float(np.mean(latitude)))
    middle_lat = 0.5 * float(np.min(latitude) + np.max(latitude))
    middle_lon = 0.5 * float(np.min(longitude) + np.max(longitude))
    extent = max(float(np.ptp(latitude)), stretch * float(np.ptp(longitude)), 1e-5)
    half = (0.5 + AROUND) * extent
    return (
        middle_lon - half / stretch,
        middle_lon + half / stretch,
        middle_lat - half,
        middle_lat + half,
    )


def _zoom(west: float, east: float, south: float, north: float) -> int:
    """Return the finest zoom whose tiles are few enough."""
    for zoom in range(FINEST, 0, -1):
        (left, top), (right, bottom) = _tile(north, west, zoom), _tile(south, east, zoom)
        columns = math.floor(right) - math.floor(left) + 1
        if columns * (math.floor(bottom) - math.floor(top) + 1) <= MOST:
            return zoom
    return 0


def _tile(latitude: float, longitude: float, zoom: int) -> tuple[float, float]:
    """Column and row of a place in Web Mercator (EPSG:3857), with their fractions."""
    count = 2.0**zoom
    down = 0.5 * (1.0 - math.asinh(math.tan(latitude)) / math.pi)
    return count * (longitude / math.tau + 0.5), count * down


def _east_north(
    column: int, row: int, zoom: int, middle: tuple[float, float]
) -> tuple[float, float]:
    """Place of the north-west corner of a tile, from the middle [km]."""
    count = 2.0**zoom
    longitude = math.tau * (column / count - 0.5)
    latitude = math.atan(math.sinh(math.pi * (1.0 - 2.0 * row / count)))
    east, north, _ = pymap3d.geodetic2enu(latitude, longitude, 0.0, *middle, 0.0, deg=False)
    return tuple(float(from_si(np.asarray(v), "km")) for v in (east, north))  # type: ignore[return-value]
