"""Maps of a drive in local kilometres: no network unless tiles are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import plotly.graph_objects as go
import pymap3d

from weighbridge.customary import shown_amount, shown_unit
from weighbridge.report.style import (
    GREEN,
    GREY,
    VERMILLION,
    blank,
    line,
    title_in_shown_units,
)
from weighbridge.report.thinning import single, spread
from weighbridge.signals import Bools, Floats, from_si

if TYPE_CHECKING:
    from weighbridge.report.tiles import Tiles
    from weighbridge.results.weighing import MassResult


@dataclass(frozen=True, slots=True)
class Positions:
    """Where the vehicle was, and when.

    Attributes
    ----------
    time : (n,) rising [s]
    latitude, longitude : (n,) [rad]
    east, north : (n,) of the middle of the drive [km]
    speed : (n,) [m/s]; NaN where unknown
    middle : latitude and longitude of it [rad]
    """

    time: Floats
    latitude: Floats
    longitude: Floats
    east: Floats
    north: Floats
    speed: Floats
    middle: tuple[float, float]

    def at(self, time: Floats) -> Positions:
        """Interpolate to the instants ``time`` [s]."""
        rows = (self.latitude, self.longitude, self.east, self.north, self.speed)
        latitude, longitude, east, north, speed = (np.interp(time, self.time, row) for row in rows)
        return Positions(time, latitude, longitude, east, north, speed, self.middle)


def positions(weighing: MassResult) -> Positions | None:
    """Find where the vehicle was, from the motion or the recorded fixes; None if unknown."""
    if weighing.result is not None:
        motion = weighing.result.balance.motion
        if motion.position is not None and np.count_nonzero(motion.valid) > 1:
            frame, ned = motion.position
            latitude, longitude, _ = frame.to_geodetic(ned)
            return _local(motion.time, latitude, longitude, motion.speed, motion.valid)
    north, east = weighing.drive.get("latitude"), weighing.drive.get("longitude")
    if north is None or east is None or len(north) < 2:
        return None
    beside = east.at(north.time)
    speed = weighing.drive.speed
    pace = speed.at(north.time) if speed is not None else np.full(len(north), np.nan)
    known = np.isfinite(beside)
    if np.count_nonzero(known) < 2:
        return None
    return _local(north.time, north.values, beside, pace, known)


def track_map(track: Positions, tiles: Tiles | None = None) -> go.Figure:
    """Draw the track with its start and end, over tiles where a server is named."""
    index = spread(np.ones(track.time.size, dtype=bool))
    figure = blank("East [km]", "North [km]", height=460)
    figure.add_scatter(
        x=single(track.east[index]), y=single(track.north[index]), mode="lines",
        line={"color": GREY, "width": 1}, showlegend=False, hoverinfo="skip",
    )  # fmt: skip
    for k, name, colour, symbol in ((0, "start", GREEN, "square"), (-1, "end", VERMILLION, "x")):
        figure.add_scatter(
            x=[float(track.east[k])], y=[float(track.north[k])], mode="markers", name=name,
            marker={"size": 12, "color": colour, "symbol": symbol},
        )  # fmt: skip
    figure.update_layout(yaxis_scaleanchor="x")
    if tiles is not None:
        figure.update_layout(images=tiles.images(track.latitude, track.longitude, track.middle))
    _add_scale(figure, track)
    return figure


def _add_scale(figure: go.Figure, track: Positions) -> None:
    """Draw a bar of a round length below the track."""
    east, north = np.ptp(track.east), np.ptp(track.north)
    unit = shown_amount(1.0, "km")
    widest = 0.35 * max(float(east), float(north), 0.05) * unit
    bar = max(n * 10.0**k for k in range(-3, 4) for n in (1, 2, 5) if n * 10.0**k <= widest)
    length = bar / unit
    west = float(np.mean((np.min(track.east), np.max(track.east)))) - 0.5 * length
    south = float(np.min(track.north)) - 0.12 * max(float(east), float(north), 0.05)
    metres = shown_unit("km") == "km" and length < 1.0
    said = f"{1e3 * length:.0f} m" if metres else f"{bar:g} {shown_unit('km')}"
    line(
        figure, [west, west + length], [south, south], "scale", GREY, showlegend=False,
        hoverinfo="skip", line_width=4,
    )  # fmt: skip
    figure.add_annotation(x=west + 0.5 * length, y=south, yanchor="top", showarrow=False, text=said)


def mark(
    figure: go.Figure,
    places: Positions,
    values: Floats,
    label: str,
    colours: str | Sequence[tuple[float, str]],
    limits: tuple[float | None, float | None] = (None, None),
    **marker: object,
) -> None:
    """Add marks to a map whose colour shows a value.

    Parameters
    ----------
    figure : of `track_map`
    places : (n,) where they stand
    values : (n,)
    label : of the colour bar, with the unit
    colours : name of a colour scale, or its colours
    limits : of the scale; those of the values where None
    marker : more of a plotly marker
    """
    turned = title_in_shown_units(label)
    if turned is not None:
        label, unit = turned
        values = shown_amount(values, unit)
        limits = (
            None if limits[0] is None else shown_amount(limits[0], unit),
            None if limits[1] is None else shown_amount(limits[1], unit),
        )
    figure.add_scatter(
        x=single(places.east),
        y=single(places.north),
        mode="markers",
        showlegend=False,
        marker={
            "size": 4,
            "color": single(values),
            "colorscale": colours,
            "cmin": limits[0],
            "cmax": limits[1],
            "showscale": True,
            "colorbar": {"title": {"text": label, "side": "right"}, "thickness": 12},
            **marker,
        },
    )


def _local(
    time: Floats, latitude: Floats, longitude: Floats, speed: Floats, known: Bools
) -> Positions:
    latitude, longitude = latitude[known], longitude[known]
    middle = float(np.median(latitude)), float(np.median(longitude))
    east, north, _ = pymap3d.geodetic2enu(latitude, longitude, 0.0, *middle, 0.0, deg=False)
    return Positions(
        time[known], latitude, longitude, from_si(east, "km"), from_si(north, "km"), speed[known],
        middle,
    )  # fmt: skip
