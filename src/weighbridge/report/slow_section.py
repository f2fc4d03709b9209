"""What was estimated beside the mass: disturbance, slow resistance and wind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.balance.instants import WIND_AT_VEHICLE
from weighbridge.constants import GRAVITY
from weighbridge.customary import shown_amount, shown_unit
from weighbridge.estimators.joint.slow_errors import Found, SlowErrors
from weighbridge.estimators.joint.terms import TERMS, WIND_STD
from weighbridge.report.maps import mark, positions, track_map
from weighbridge.report.style import (
    BLUE,
    GREY,
    REACH,
    TIME_AXIS,
    VERMILLION,
    Panel,
    Section,
    band,
    blank,
    dots,
    line,
    minutes,
)
from weighbridge.report.table import Table
from weighbridge.report.text import amount
from weighbridge.report.thinning import SCATTER_POINTS, single, thin_line
from weighbridge.signals import Bools, Drive, Floats, from_si, scalar_from_si

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

    from weighbridge.report.tiles import Tiles
    from weighbridge.results.weighing import MassResult

ARROWS: Final = 12
"""Arrows of wind along a drive."""

LONGEST_ARROW: Final = 46.0
"""Length of the arrow of the strongest wind [pixel]."""

SEEN: Final = 0.75
"""A component of the wind is seen where its standard deviation has fallen below this part of
what it was before the drive [-]."""

POINTS: Final = 800
"""Points of a line of which several stand together."""

COMPASS: Final = (
    "north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Wind:
    """Wind at the vehicle, the reported and the estimated part together; rows are windows.

    Attributes
    ----------
    time : (m,) [s]
    north, east : (m,) how much of it comes from north and from east [m/s]
    std : (m, 2) their standard deviations [m/s]
    reported : (2,) the part of the weather report, the same all along [m/s]
    """

    time: Floats
    north: Floats
    east: Floats
    std: Floats
    reported: tuple[float, float]

    @property
    def strength(self) -> Floats:
        """(m,) [m/s]."""
        return np.hypot(self.north, self.east)

    @property
    def blows_to(self) -> Floats:
        """(m,) where it goes, clockwise from north [rad]."""
        return np.arctan2(-self.east, -self.north)

    @property
    def seen(self) -> Bools:
        """(m,) whether the drive showed both components."""
        return np.asarray((self.std < SEEN * WIND_STD).all(axis=1))


def wind_at_vehicle(slow: SlowErrors, drive: Drive) -> Wind:
    """Add what was estimated to what the weather report says.

    The drag is taken in the reported wind, so the estimate is what that leaves.
    """
    speed, direction = drive.info.wind_speed, drive.info.wind_from
    north = east = 0.0
    if speed and direction is not None:
        north = float(WIND_AT_VEHICLE * speed * np.cos(direction))
        east = float(WIND_AT_VEHICLE * speed * np.sin(direction))
    from_north, from_east = (slow.of(name) for name in ("wind_north", "wind_east"))
    return Wind(
        time=slow.time,
        north=from_north.value + north,
        east=from_east.value + east,
        std=np.column_stack([from_north.std, from_east.std]),
        reported=(north, east),
    )


def slow_section(weighing: MassResult, tiles: Tiles | None = None) -> Section:
    """Return disturbance, slow resistance and wind, over time and on the map."""
    key, title = "slow", "Disturbance and wind"
    result = weighing.result
    if result is None or result.slow_errors is None or not result.slow_errors.time.size:
        # That another method estimates none is said where the information is left out.
        return Section(key=key, title=title)
    slow = result.slow_errors
    wind = wind_at_vehicle(slow, weighing.drive)
    blind = not np.isfinite(result.balance.table.heading).any()
    return Section(
        key=key,
        title=title,
        lead="These forces look like mass; where a line leaves zero by more than its band, they "
        "were there, and the mass was freed of them.",
        table=constants_table(slow),
        panels=(
            force_panel(
                weighing,
                "Force that lasts half a minute",
                "gusts, faults of grade and torque, unseen braking",
                slow.of("disturbance"),
            ),
            force_panel(
                weighing,
                "Force that lasts a quarter of an hour",
                "tyres and oil that warm, an accelerometer that drifts",
                slow.of("resistance"),
            ),
            *accessory_panels(weighing),
            *further_panels(weighing, slow),
            wind_panel(weighing, wind, blind),
            wind_map(weighing, wind, blind, tiles),
            disturbance_map(weighing, slow, tiles),
        ),
    )


def accessory_panels(weighing: MassResult) -> tuple[Panel, ...]:
    """Draw the power that an engine gives on and off beside the wheels; nothing without."""
    found = weighing.result.switched if weighing.result is not None else None
    if found is None:
        return ()
    figure = blank(TIME_AXIS, "Power at the engine [kW]")
    x, power = thin_line(
        minutes(weighing.drive, found.time), 1e-3 * found.power * found.on, points=POINTS
    )
    line(figure, x, power, "taken out", BLUE, line_width=1.6)
    kilowatts, share = 1e-3 * found.power, 100.0 * float(np.mean(found.on))
    return (
        Panel(
            title=f"Accessories that go on and off: {kilowatts:.1f} kW, {share:.0f} % of the time",
            caption="A compressor or a fan takes the same power whenever it is on. The torque "
            "counts it as traction; it was found by its steps and taken out.",
            figure=figure,
        ),
    )


def constants_table(slow: SlowErrors) -> Table | None:
    """List what was found beside the mass that does not change over the drive."""
    rows = tuple(
        (
            term.title,
            *_with_digits(shown_amount(value, term.unit), shown_amount(REACH * std, term.unit)),
            shown_unit(term.unit),
        )
        for name, (value, std) in slow.constants.items()
        for term in [TERMS[name]]
        if std > 0.0
    )
    if not rows:
        return None
    return Table("", ("The same all along", "found", "±", "unit"), rows)


def _with_digits(value: float, half: float) -> tuple[str, str]:
    """Print a value and half its interval to the two leading digits of the latter."""
    places = max(1 - math.floor(math.log10(half)), 0)
    return f"{value:+.{places}f}".replace("-", "−"), f"{half:.{places}f}"


def band_over_time(weighing: MassResult, found: Found, axis: str) -> Figure:
    """Draw a state over time with its band."""
    assert weighing.result is not None
    assert weighing.result.slow_errors is not None
    time = minutes(weighing.drive, weighing.result.slow_errors.time)
    figure, half = blank(TIME_AXIS, axis), REACH * found.std
    x, middle, low, high = thin_line(
        time, found.value, found.value - half, found.value + half, points=POINTS
    )
    band(figure, x, low, high, "95 % band")
    line(figure, x, middle, "estimated", BLUE, line_width=1.6)
    figure.add_hline(y=0.0, line={"color": GREY, "width": 1})
    return figure


def further_panels(weighing: MassResult, slow: SlowErrors) -> tuple[Panel, ...]:
    """Draw what comes and goes beside force and wind: terms of other packages."""
    shown = ("disturbance", "resistance", "wind_north", "wind_east")
    return tuple(
        Panel(
            title=f"{term.title[:1].upper()}{term.title[1:]}",
            caption="The band is of 95 %.",
            figure=band_over_time(weighing, found, f"{name} [{shown_unit(term.unit)}]"),
        )
        for name, found in slow.found.items()
        for term in [TERMS[name]]
        if not found.lasting and name not in shown
    )


def force_panel(weighing: MassResult, what: str, causes: str, found: Found) -> Panel:
    """Draw a force over time with its band."""
    assert weighing.result is not None
    figure = band_over_time(weighing, found, "Force against the motion [N]")
    size = float(np.sqrt(np.mean(found.value**2)))
    slope = 100.0 * size / (weighing.result.mass * GRAVITY)
    return Panel(
        title=f"{what}: {amount(size, 'N')}, as a slope of {slope:.2f} %"
        if stands_out(found)
        else f"{what}: none stands out",
        caption=f"{amount(size, 'N')} root mean square over the drive; causes are {causes}. "
        "Positive holds back.",
        figure=figure,
    )


def wind_panel(weighing: MassResult, wind: Wind, blind: bool) -> Panel:
    """Draw both components of the wind over time with their bands."""
    if blind:
        return Panel(
            title="Wind over time", absent="no wind: the heading of this drive is not known."
        )
    figure = blank(TIME_AXIS, "Wind at the vehicle [m/s]", height=460)
    time = minutes(weighing.drive, wind.time)
    ends = [float(time[0]), float(time[-1])]
    for k, (values, name, colour) in enumerate(
        ((wind.north, "from north", BLUE), (wind.east, "from east", VERMILLION))
    ):
        half = REACH * wind.std[:, k]
        x, middle, low, high = thin_line(time, values, values - half, values + half, points=POINTS)
        band(figure, x, low, high, f"95 % band, {name}", colour, showlegend=False)
        line(figure, x, middle, name, colour)
        if any(wind.reported):
            line(
                figure, ends, [wind.reported[k]] * 2, f"reported, {name}", colour, dash="dash",
                line_width=1, meta={"short": f"reported {name[5:]}"},
            )  # fmt: skip
    figure.add_hline(y=0.0, line={"color": GREY, "width": 1})
    return Panel(
        title=_wind_title(wind),
        caption="At the height of the vehicle, about half of what a weather report says for "
        + amount(10.0, "m")
        + (", which is taken in and dashed" if any(wind.reported) else "")
        + "; bands are of 95 %; a negative line is wind from south or west. Where the vehicle "
        "drives slowly or always one way, the band stays as wide as it was before the drive, "
        f"± {amount(REACH * WIND_STD, 'm/s', '.1f')}.",
        figure=figure,
    )


def disturbance_map(weighing: MassResult, slow: SlowErrors, tiles: Tiles | None) -> Panel:
    """Draw where the disturbance was."""
    track = positions(weighing)
    if track is None:
        # The map of the road says so.
        return Panel(title="Disturbance on the map")
    disturbance = slow.of("disturbance")
    if not stands_out(disturbance):
        return Panel(
            title="Disturbance on the map",
            absent="no map of the half-minute force: none stands out.",
        )
    rows = np.unique(np.linspace(0, slow.time.size - 1, SCATTER_POINTS).astype(np.int64))
    figure = track_map(track, tiles)
    reach = float(np.percentile(np.abs(disturbance.value), 98.0))
    mark(
        figure, track.at(slow.time[rows]), disturbance.value[rows], "Force [N]", "RdBu",
        (-reach, reach), size=6, reversescale=True,
    )  # fmt: skip
    return Panel(
        title="Where the half-minute force was",
        caption="Red holds back, blue pushes. The same colour on every pass of a place is the "
        "road, or its grade; another each time is traffic or gusts."
        + (f" {tiles.credit}" if tiles is not None else ""),
        figure=figure,
    )


def stands_out(found: Found) -> bool:
    """Whether a force is larger on the whole than what is not known of it."""
    return bool(np.mean(found.value**2) > np.mean(found.std**2))


def wind_map(weighing: MassResult, wind: Wind, blind: bool, tiles: Tiles | None) -> Panel:
    """Draw the wind where the drive showed it."""
    title = "Wind on the map"
    track = positions(weighing)
    if track is None or blind:
        return Panel(title=title)
    rows = np.flatnonzero(wind.seen)
    if not rows.size:
        return Panel(
            title=title,
            absent="no wind on the map: the drive is too slow, or has too few directions, to "
            "show it.",
        )
    places = track.at(wind.time[rows])
    rows = rows[_evenly(places.east, places.north)]
    figure = track_map(track, tiles)
    strength = wind.strength[rows]
    top = max(float(np.max(strength)), 1.0)
    there = track.at(wind.time[rows])
    origin = np.mod(from_si(wind.blows_to[rows], "deg") + 180.0, 360.0)
    dots(
        figure, single(there.east), single(there.north), "wind", BLUE, size=6.0, opacity=1.0,
        hovertext=[
            f"{amount(s, 'm/s', '.1f')} from {o:.0f}°"
            for s, o in zip(strength, origin, strict=True)
        ],
        hoverinfo="text",
    )  # fmt: skip
    for east, north, speed, to in zip(
        there.east, there.north, strength, wind.blows_to[rows], strict=True
    ):
        # Pixels: an arrow is read at any zoom. Its head is at the place.
        length = LONGEST_ARROW * speed / top
        figure.add_annotation(
            x=float(east), y=float(north), axref="pixel", ayref="pixel", text="",
            ax=float(-length * np.sin(to)), ay=float(length * np.cos(to)),
            showarrow=True, arrowhead=2, arrowsize=1.2, arrowwidth=2, arrowcolor=BLUE,
        )  # fmt: skip
    return Panel(
        title=f"How the wind blew: up to {amount(float(np.max(strength)), 'm/s', '.1f')}",
        caption="Arrows point where the wind goes and end at the place; the longest is the "
        "strongest. They are drawn where the drive shows both components."
        + (f" {tiles.credit}" if tiles is not None else ""),
        figure=figure,
    )


def _wind_title(wind: Wind) -> str:
    """Say the mean wind of the drive, if it is more than its uncertainty."""
    if not wind.seen.any():
        return "The drive does not show the wind"
    north, east = float(np.mean(wind.north[wind.seen])), float(np.mean(wind.east[wind.seen]))
    std = float(np.mean(np.hypot(*wind.std[wind.seen].T))) / np.sqrt(2.0)
    strength = float(np.hypot(north, east))
    size = f"{shown_amount(strength, 'm/s'):.1f} ± {amount(REACH * std, 'm/s', '.1f')}"
    if strength < REACH * std:
        return f"No wind stands out: {size} on the whole"
    origin = scalar_from_si(float(np.arctan2(east, north)), "deg")
    name = COMPASS[round(origin / 45.0) % 8]
    return f"Wind from the {name}, {size} on the whole"


def _evenly(east: Floats, north: Floats) -> Sequence[int]:
    """Choose `ARROWS` places evenly along the way."""
    way = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(east), np.diff(north)))))
    return list(np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], ARROWS))))
