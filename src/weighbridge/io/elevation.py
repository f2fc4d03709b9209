"""Heights along a drive from an elevation raster."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from weighbridge.arguments import check_path, check_type
from weighbridge.errors import DriveError
from weighbridge.io.libraries import importing
from weighbridge.messages import Problem
from weighbridge.signals import Drive, Floats, Signal

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLOCK: Final = 512
"""Rows and columns of a raster that are read at once."""

FEET: Final[dict[str, float]] = {"ft": 0.3048, "foot": 0.3048, "feet": 0.3048}
FEET_SURVEY: Final = 1200.0 / 3937.0
"""A foot of the United States' surveys [m]."""

OUTLIER: Final = 4.0
"""Standard deviations from the receiver's heights beyond which a bridge or a tunnel differs from
the ground [-]."""

RECEIVER_STD: Final = 3.0
"""Least standard deviation of a receiver's heights [m]."""


class NoHeightsError(DriveError):
    """A raster has no height for a drive: it has no positions, or they are outside of it."""


def with_elevation(drive: Drive, raster: str | Path) -> Drive:
    """Take the heights of a drive from an elevation raster, at the positions of its fixes.

    A receiver's heights wander by metres within minutes, which costs a truck without an inertial
    sensor half of its accuracy. The terrain of a survey does not. Fixes outside of the raster, and
    those where the receiver is on a bridge or in a tunnel, have no height then.

    Parameters
    ----------
    drive : with latitude and longitude
    raster : file that GDAL reads, such as a GeoTIFF, with a coordinate system; heights in metres,
        or in feet where it says so

    Returns
    -------
    Drive
        With ``altitude`` of the raster, and a problem that says so

    Raises
    ------
    ArgumentTypeError
        One of both is of another type.
    DriveError
        The drive has no positions, or the raster cannot be read or holds none of them.
    MissingExtraError
        The package ``rasterio`` is not there.
    """
    check_type("drive", drive, Drive, "a drive, as read_drive returns it")
    check_path("raster", raster)
    latitude, longitude = drive.get("latitude"), drive.get("longitude")
    if latitude is None or longitude is None or not len(latitude):
        raise NoHeightsError(f"{drive.name}: no positions, which heights of {raster} need")
    time = latitude.time
    heights = _heights(Path(raster), np.degrees(latitude.values), np.degrees(longitude.at(time)))
    inside = np.isfinite(heights)
    if np.count_nonzero(inside) < 2:
        raise NoHeightsError(
            f"{raster}: holds no height at the positions of {drive.name} (it begins at latitude "
            f"{np.degrees(latitude.values[0]):.3f}, longitude {np.degrees(longitude.values[0]):.3f}"
            "): give the raster of that region"
        )
    receiver = drive.get("altitude")
    if receiver is not None and len(receiver) > 1:
        apart = heights - np.interp(time, receiver.time, receiver.values)
        apart -= np.median(apart[inside])
        std = max(1.4826 * float(np.median(np.abs(apart[inside]))), RECEIVER_STD)
        inside &= np.abs(np.where(inside, apart, 0.0)) < OUTLIER * std
    share = 100.0 * float(np.mean(inside))
    return drive.with_signals(Signal("altitude", time[inside], heights[inside])).with_problems(
        Problem.of("altitude.raster", file=Path(raster).name, share=share)
    )


def refuse_raster(path: Path) -> None:
    """Raise where a raster cannot be used, as `with_elevation` does, before any drive is read."""
    _heights(path, np.empty(0), np.empty(0))


def _heights(path: Path, latitude: Floats, longitude: Floats) -> Floats:
    """Heights at places (n,) in degrees [m], between the middles of four cells; NaN without."""
    with importing("rasterio", "elevation", f"reading heights of {path}"):
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning, RasterioError
        from rasterio.warp import transform
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            opened = rasterio.open(path)
        with opened as raster:
            if raster.crs is None:
                raise DriveError(f"{path}: names no coordinate system: give one with gdal_edit")
            east, north = transform("EPSG:4326", raster.crs, longitude, latitude)
            a, b, c, d, e, f = (~raster.transform)[:6]
            column, row = (
                k * np.array(east) + m * np.array(north) + n for k, m, n in ((a, b, c), (d, e, f))
            )
            unit = (raster.units[0] or "").lower()
            scale = FEET_SURVEY if "us" in unit and "f" in unit else FEET.get(unit, 1.0)
            return scale * _between(raster, row - 0.5, column - 0.5)
    except (RasterioError, OSError) as error:
        raise DriveError(f"{path}: cannot be read as an elevation raster ({error})") from None


def _between(raster: Any, row: Floats, column: Floats) -> Floats:
    """Bilinear values of the first band at places in cells (n,), read block by block."""
    from rasterio.windows import Window

    found = np.full(row.size, np.nan)
    inside = (row >= 0.0) & (column >= 0.0)
    inside &= (row <= raster.height - 1) & (column <= raster.width - 1)
    if not inside.any():
        return found
    block = np.stack([row, column])[:, inside].astype(np.int64) // BLOCK
    at = np.flatnonzero(inside)
    for top, left in np.unique(block, axis=1).T * BLOCK:
        here = at[(block[0] * BLOCK == top) & (block[1] * BLOCK == left)]
        part = raster.read(1, window=Window(left, top, BLOCK + 1, BLOCK + 1), masked=True)
        values = part.astype(np.float64).filled(np.nan)
        found[here] = _bilinear(values, row[here] - top, column[here] - left)
    return found


def _bilinear(values: NDArray[np.float64], row: Floats, column: Floats) -> Floats:
    last = np.array(values.shape) - 1
    r, c = np.minimum(row.astype(np.int64), last[0]), np.minimum(column.astype(np.int64), last[1])
    down, right = np.minimum(r + 1, last[0]), np.minimum(c + 1, last[1])
    y, x = row - r, column - c
    upper = (1.0 - x) * values[r, c] + x * values[r, right]
    lower = (1.0 - x) * values[down, c] + x * values[down, right]
    return np.asarray((1.0 - y) * upper + y * lower)
