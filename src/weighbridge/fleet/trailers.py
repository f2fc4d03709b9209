"""Which legs had a trailer that nobody announced: by mass, drag area and wheel slip."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import polars as pl

from weighbridge.signals import Floats

SHOWN: Final = (
    "drag_area_m2", "drag_area_std_m2", "slip", "slip_std", "late_s", "late_std_s", "slip_late",
)  # fmt: skip
"""Columns of a drive that show a trailer beside the mass: see `weighbridge.fleet.schema.DRIVES`."""

SHARE: Final = 0.10
"""Part of the legs that have a trailer, before they show anything [-]; chosen."""

OVERLOAD: Final = (0.10, 0.10)
"""Part of the legs without a trailer whose mass is above the permitted one, and the mean of their
excess over it [-]; chosen, and larger than in most fleets, so that an overload is not taken for a
trailer."""

TRAILER_MASS: Final = (0.25, 1.0)
"""Mass of a trailer over the permitted mass of the truck, from and to [-]: the standard trailer of
VECTO weighs 5.4 t empty and 18 t at most, behind trucks of 16 to 18 t."""

TRAILER_AREA: Final = (1.5, 0.6)
"""What a trailer adds to the drag area of a truck, and its standard deviation [m^2]: 1.5 for the
standard trailer T2 of VECTO (Body_Trailers_Weights.csv); the standard deviation is chosen so that
flat ones lie within two."""

FILE_AREA: Final = 1.5
"""Standard deviation of a vehicle's drag area around that of its file [m^2], as of the class of
trucks (`weighbridge.vehicle.classes`)."""

DRAWN_BY: Final = ("truck",)
"""Classes whose trailers the drag area can show. Of others no fleet with trailers was at hand:
their mass alone counts."""

CARRIED: Final = (0.7, 0.3)
"""How much more the driven wheels slip with a trailer than with the same mass on the vehicle, and
its standard deviation, relative [-]: half to the whole of the truck's own mass is behind it."""

SLIP_SCATTER: Final = 0.2
"""Scatter of the slip of a vehicle's tyres from drive to drive, relative [-]: temperature, pressure
and surface."""

_STEP: Final = 0.01  # of the masses that densities are summed over [of the permitted mass]
_AREAS: Final = np.linspace(-6.0, 6.0, 81)  # of a vehicle without trailer, above its file [m^2]
_SLIPS: Final = np.geomspace(0.008, 0.10, 41)  # of a vehicle without trailer, likewise [-]
_BLOCK: Final = 500  # legs whose densities are in memory at once, 13 MB each table
_LEAST_STD: Final = 0.01  # of a mass, so that the sum above meets it [of the permitted mass]


def with_trailers(legs: pl.DataFrame) -> pl.DataFrame:
    """Add the probability that each leg had a trailer.

    A leg has a trailer or none. Without one, its mass is that of a load or of an overload, and drag
    area and wheel slip are those of the vehicle. With one, the mass is that of a vehicle with a
    load and of a trailer, the drag area is larger, and the driven wheels slip more, for they carry
    less of what they draw. What the vehicle has without a trailer is not known and is the same in
    all its legs. It is summed over, and so is what every other leg had.

    Parameters
    ----------
    legs : with the columns ``vehicle_id``, ``vehicle_digest``, ``vehicle_class``, ``mass_kg``,
        ``std_kg``, ``tare_kg``, ``gross_kg``, ``coupled``, ``trailer_connected`` and those of
        `SHOWN`

    Returns
    -------
    The legs, in their order, with ``trailer_probability``: null where mass, empty mass or
    permitted mass is not known, 1 where a trailer is known to be coupled, and 0 where the vehicle
    reports that it has none
    """
    rows = legs.with_row_index("_row")
    found = np.full(legs.height, np.nan)
    for own in rows.partition_by("vehicle_id", "vehicle_digest"):
        found[own["_row"].to_numpy()] = _probabilities(own)
    return legs.with_columns(pl.Series("trailer_probability", found).fill_nan(None))


def _probabilities(legs: pl.DataFrame) -> Floats:
    """Return the probability of a trailer for each leg of one vehicle (n,); NaN where unknown."""

    def column(name: str) -> Floats:
        return np.asarray(legs[name].cast(pl.Float64).fill_null(float("nan")).to_numpy())

    gross = column("gross_kg")
    mass, std, tare = (column(name) / gross for name in ("mass_kg", "std_kg", "tare_kg"))
    odds = SHARE / (1.0 - SHARE) * _mass_odds(mass, std, tare)
    none = (~legs["trailer_connected"]).fill_null(value=False).to_numpy()
    towed = np.select([legs["coupled"].to_numpy(), none], [1.0, 0.0], odds / (1.0 + odds))
    drawn = np.isin(legs["vehicle_class"].to_numpy(), DRAWN_BY)
    if not (np.isfinite(towed) & drawn).any():
        return np.asarray(towed)
    known = np.flatnonzero(np.isfinite(towed) & drawn)
    slip, slip_std = _slip(column)
    seen = (column("drag_area_m2"), column("drag_area_std_m2"), slip, slip_std)
    blocks = np.array_split(known, -(-known.size // _BLOCK))
    # Each leg is weighed by what all others show of the vehicle.
    shown = -0.5 * np.broadcast_to((_AREAS[:, None] / FILE_AREA) ** 2, (_AREAS.size, _SLIPS.size))
    for rows in blocks:
        _, each = _densities(towed[rows], *(values[rows] for values in seen))
        shown = shown + np.log(each).sum(axis=0)
    found = towed.copy()
    for rows in blocks:
        with_one, each = _densities(towed[rows], *(values[rows] for values in seen))
        others = shown - np.log(each)
        weight = np.exp(others - others.max(axis=(1, 2), keepdims=True))
        found[rows] = (weight * with_one).sum(axis=(1, 2)) / (weight * each).sum(axis=(1, 2))
    return np.asarray(found)


def _densities(
    towed: Floats, area: Floats, area_std: Floats, slip: Floats, slip_std: Floats
) -> tuple[Floats, Floats]:
    """Density of what legs (n,) show, for each drag area and slip of the vehicle (n, j, k).

    Returns
    -------
    with_one, each : times the probability of a trailer by the mass, and the sum of both cases
    """
    more, spread = TRAILER_AREA
    far, variance = area[:, None] - _AREAS, area_std[:, None] ** 2
    alone, both = _normal(far, variance), _normal(far - more, variance + spread**2)
    more, spread = CARRIED
    far, variance = slip[:, None] - _SLIPS, slip_std[:, None] ** 2 + (SLIP_SCATTER * _SLIPS) ** 2
    held = _normal(far, variance)
    behind = _normal(far - more * _SLIPS, variance + (spread * _SLIPS) ** 2)
    # What a drive does not show is as likely with a trailer as without.
    for unseen, pair in ((~np.isfinite(area), (alone, both)), (~np.isfinite(slip), (held, behind))):
        for density in pair:
            density[unseen] = 1.0
    part = towed[:, None, None]
    with_one = part * both[:, :, None] * behind[:, None, :]
    each = with_one + (1.0 - part) * alone[:, :, None] * held[:, None, :]
    return with_one, np.maximum(each, np.finfo(float).tiny)


def _slip(column: Callable[[str], Floats]) -> tuple[Floats, Floats]:
    """Return slip and its standard deviation (n,) at the lateness that all legs together show."""
    slip, std, late, late_std, both = (
        column(name) for name in ("slip", "slip_std", "late_s", "late_std_s", "slip_late")
    )
    seen = np.isfinite(slip) & (late_std > 0.0)
    if not seen.any():
        return slip, std
    weight = np.where(seen, late_std, np.inf) ** -2.0
    shared = float(np.nansum(weight * late) / weight.sum())
    gain = both * std / late_std
    moved = slip - gain * (late - shared)
    left = std**2 * (1.0 - both**2) + gain**2 / weight.sum()
    return moved, np.sqrt(left)


def _mass_odds(mass: Floats, std: Floats, tare: Floats) -> Floats:
    """Density of the masses (n,) with a trailer over that without; all over the permitted mass.

    Where nothing is known it is NaN.
    """
    found = np.full(mass.size, np.nan)
    known = np.isfinite(mass) & np.isfinite(std) & (tare > 0.0) & (tare < 1.0)
    if not known.any():
        return found
    at = np.arange(0.5 * _STEP, 4.0, _STEP)
    tare, mass = tare[known, None], mass[known, None]
    width = np.maximum(std[known, None], _LEAST_STD)
    beyond, excess = OVERLOAD
    loaded = (1.0 - beyond) / (1.0 - tare) * ((at >= tare) & (at < 1.0))
    alone = loaded + beyond / excess * np.exp(-np.maximum(at - 1.0, 0.0) / excess) * (at >= 1.0)
    low, high = TRAILER_MASS
    # The vehicle with its load and the trailer, each evenly spread: their sum is a trapezoid.
    least, most = np.maximum(tare, at - high), np.minimum(1.0, at - low)
    both = np.maximum(most - least, 0.0) / ((1.0 - tare) * (high - low))
    seen = _normal(mass - at, width**2)
    # Farther than the law reaches, both are as unlikely.
    floor = 1e-9
    found[known] = ((seen * both).sum(axis=1) + floor) / ((seen * alone).sum(axis=1) + floor)
    return found


def _normal(distance: Floats, variance: Floats) -> Floats:
    """Density of a normal distribution."""
    return np.asarray(np.exp(-0.5 * distance**2 / variance) / np.sqrt(variance))
