"""The road: where the drive went, and how it rose and fell."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from weighbridge.estimators import MassTrack
from weighbridge.report.maps import mark, positions, track_map
from weighbridge.report.style import (
    AXIS,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    REACH,
    Panel,
    Section,
    band,
    blank,
    line,
)
from weighbridge.report.text import amount
from weighbridge.report.thinning import spread, thin_line
from weighbridge.signals import Floats, from_si

if TYPE_CHECKING:
    from weighbridge.report.tiles import Tiles
    from weighbridge.results.weighing import MassResult

SLOPE_BASE = 200.0
"""Length over which the slope of the recorded altitude is taken [m]."""


def road_section(weighing: MassResult, tiles: Tiles | None = None) -> Section:
    """Return map, grade and altitude; the map over tiles where a server is named."""
    panels = [map_panel(weighing, tiles)]
    if weighing.result is not None:
        panels += [grade_panel(weighing.result), pitch_panel(weighing, weighing.result)]
    return Section(
        key="road",
        title="Road",
        lead="A grade that does not follow the hills is a sensor that moved or a height that "
        "drifts, and bends the mass.",
        panels=tuple(panels),
    )


def map_panel(weighing: MassResult, tiles: Tiles | None = None) -> Panel:
    """Track of the drive in local kilometres, coloured by speed."""
    title = "Map of the drive"
    found = positions(weighing)
    if found is None:
        return Panel(title=title, absent="no map: no position is known for this drive.")
    figure = track_map(found, tiles)
    index = spread(np.ones(found.time.size, dtype=bool))
    places = found.at(found.time[index])
    mark(figure, places, from_si(places.speed, "kmh"), "Speed [km/h]", "Cividis")
    return Panel(
        title="Where the drive went, and how fast",
        caption="East and north of the middle of the drive, to one scale; the bar shows lengths."
        + (f" {tiles.credit}" if tiles is not None else ""),
        figure=figure,
    )


def grade_panel(result: MassTrack) -> Panel:
    """Road grade over distance."""
    motion = result.balance.motion
    grade = np.where(motion.valid, motion.grade, np.nan)
    if not np.isfinite(grade).any():
        return Panel(
            title="Road grade over distance",
            absent="no road grade: it is not known for this drive.",
        )
    distance = from_si(motion.distance, "km")
    half = REACH * motion.grade_std
    moving = _advancing(motion.distance)
    x, middle, low, high = (
        part
        for part in thin_line(
            distance[moving],
            *(_percent(g[moving]) for g in (grade, grade - half, grade + half)),
        )
    )
    figure = blank("Distance [km]", "Road grade [%]", height=460)
    if np.isfinite(low).any():
        band(figure, x, low, high, "95 % band")
    line(figure, x, middle, "road grade", BLUE, line_width=1.4)
    lowest, highest = np.nanpercentile(_percent(grade), [1.0, 99.0])
    between = f"{lowest:+.1f} and {highest:+.1f} %".replace("-", "−")
    return Panel(
        title=f"The road rises and falls between {between}",
        caption="Positive uphill; 98 % of the time lies between the two numbers."
        + (
            " The pitching of the body under acceleration is taken out."
            if motion.squat is not None
            else ""
        ),
        figure=figure,
    )


def pitch_panel(weighing: MassResult, result: MassTrack) -> Panel:
    """Pitch of the body and grade against the altitude profile."""
    title = "Pitch against altitude"
    motion = result.balance.motion
    altitude = motion.altitude
    recorded = weighing.drive.get("altitude")
    if not np.isfinite(altitude).any() and recorded is not None:
        altitude = recorded.at(motion.time)
    moving = _advancing(motion.distance) & motion.valid
    known = moving & np.isfinite(altitude)
    if np.count_nonzero(known) < 2:
        return Panel(
            title=title,
            absent="no pitch against altitude: no altitude is known for this drive.",
        )
    if not np.isfinite(motion.grade).any():
        return Panel(title=title, absent="no pitch against altitude: the grade is not known.")
    distance = from_si(motion.distance, "km")
    figure = blank("Distance [km]", "Altitude [m]", height=460)
    figure.update_layout(
        xaxis_anchor="y2",
        yaxis_domain=[0.62, 1.0],
        yaxis2={**AXIS, "domain": [0.0, 0.54], "anchor": "x", "title": {"text": "Angle [deg]"}},
    )
    x, height = thin_line(distance[known], altitude[known])
    line(figure, x, height, "altitude", GREY)
    pitched = not np.array_equal(motion.pitch, motion.grade)
    if pitched and np.isfinite(motion.pitch).any():
        x, pitch = thin_line(distance[moving], from_si(motion.pitch[moving], "deg"))
        line(figure, x, pitch, "pitch of the body", ORANGE, yaxis="y2", line_width=1)
    x, grade = thin_line(distance[moving], from_si(motion.grade[moving], "deg"))
    line(figure, x, grade, "road grade", BLUE, yaxis="y2", line_width=1.4)
    along, slope = _altitude_slope(motion.distance[known], altitude[known])
    if along.size:
        x, slope_deg = thin_line(from_si(along, "km"), from_si(slope, "deg"))
        name = f"slope of the altitude over {amount(SLOPE_BASE, 'm')}"
        line(figure, x, slope_deg, name, GREEN, yaxis="y2", line_width=1.4,
             meta={"short": "slope of it"})  # fmt: skip
    return Panel(
        title="Pitch and grade should follow the hills",
        caption="Where the altitude climbs, pitch and grade should be positive and near the "
        "slope of the altitude.",
        figure=figure,
        wide=True,
    )


def _altitude_slope(distance: Floats, altitude: Floats) -> tuple[Floats, Floats]:
    """Slope of the altitude over `SLOPE_BASE` [rad], on an even grid of distance [m]."""
    grid = np.arange(distance[0] + SLOPE_BASE / 2, distance[-1] - SLOPE_BASE / 2, SLOPE_BASE / 8)
    ahead = np.interp(grid + SLOPE_BASE / 2, distance, altitude)
    behind = np.interp(grid - SLOPE_BASE / 2, distance, altitude)
    return grid, np.arctan((ahead - behind) / SLOPE_BASE)


def _advancing(distance: Floats) -> np.ndarray:
    """Mark rows further on than all before, so that distance may serve as an axis."""
    best = np.maximum.accumulate(np.nan_to_num(distance, nan=-np.inf))
    return np.concatenate(([True], best[1:] > best[:-1])) & np.isfinite(distance)


def _percent(grade: Floats) -> Floats:
    return from_si(np.tan(grade), "pct")
