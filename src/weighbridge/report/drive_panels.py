"""Figures of one weighing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pymap3d

from weighbridge.balance import Reason
from weighbridge.estimators import SPEED_ALONE, MassTrack, Status
from weighbridge.estimators.rls import regression
from weighbridge.report.style import (
    AXIS,
    BAND,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    REASON_STYLE,
    VERMILLION,
    Panel,
    blank,
    dots,
    line,
    reason_name,
)
from weighbridge.report.thinning import SCATTER_POINTS, single, spread, thin_line
from weighbridge.signals import Floats
from weighbridge.signals.units import from_si

if TYPE_CHECKING:
    from weighbridge.pipeline.weighing import Weighing

TIME_AXIS = "Time since start [min]"
SLOPE_BASE = 200.0
"""Length over which the slope of the recorded altitude is taken [m]."""


def drive_panels(weighing: Weighing, truth: float | None) -> list[Panel]:
    """Return all figures of one weighing, in the order to show them."""
    panels = [mass_panel(weighing, truth), speed_panel(weighing)]
    if weighing.result is not None:
        panels += [
            fit_panel(weighing),
            residual_panel(weighing, weighing.result),
            share_panel(weighing.result),
        ]
    panels.append(map_panel(weighing))
    if weighing.result is not None:
        panels += [grade_panel(weighing.result), pitch_panel(weighing, weighing.result)]
    return panels


def mass_panel(weighing: Weighing, truth: float | None) -> Panel:
    """Mass with its band over time."""
    result = weighing.result
    if result is None or not (result.used & np.isfinite(result.running_mass)).any():
        return Panel(
            title="Mass over time",
            absent="no mass over time, for not one sample could be used.",
        )
    first = int(np.argmax(result.used))
    mass = np.where(np.arange(result.time.size) >= first, result.running_mass, np.nan)
    half = 1.96 * result.running_std
    time = _minutes(weighing, result.time)
    x, running, low, high = thin_line(time, mass, mass - half, mass + half)
    figure = blank(TIME_AXIS, "Mass [kg]", height=420)
    line(figure, x, low, "", BAND, showlegend=False, hoverinfo="skip", line_width=0)
    line(
        figure, x, high, "95 % band of the running mass", BAND,
        fill="tonexty", fillcolor=BAND, hoverinfo="skip", line_width=0,
    )  # fmt: skip
    line(figure, x, running, "running mass", BLUE)
    legs = [s for s in result.segments if np.isfinite(s.mass)]
    if len(legs) > 1:
        edges = np.array([[s.start, s.end, np.nan] for s in legs]).ravel()
        levels = np.array([[s.mass, s.mass, np.nan] for s in legs]).ravel()
        line(figure, _minutes(weighing, edges), levels, "mass between stops", PURPLE)
    ends = np.array([time[0], time[-1]], dtype=np.float32)
    converged = weighing.status is Status.CONVERGED
    marks = [truth] if truth is not None else []
    if converged:
        for factor, name in ((0.95, "±5 % of the final mass"), (1.05, "")):
            line(
                figure, ends, np.full(2, factor * weighing.mass), name, GREY,
                dash="dot", showlegend=bool(name),
            )  # fmt: skip
        line(
            figure, ends, np.full(2, weighing.mass), f"final mass {weighing.mass:.0f} kg",
            VERMILLION, dash="dash",
        )  # fmt: skip
        marks += [0.9 * weighing.mass, 1.1 * weighing.mass]
    if truth is not None:
        line(
            figure, ends, np.full(2, truth), f"true mass {truth:.0f} kg", GREEN, dash="longdashdot"
        )
    figure.update_layout(yaxis_range=_mass_range(mass, half, result.used, marks))
    if converged:
        title = f"The final mass, {weighing.mass:.0f} kg, and what was known on the way"
        caption = (
            "The running mass is what was known at each moment and forgets the far past; the "
            "final mass is made from the whole drive."
        )
    else:
        title = "The running mass, which ended in no result"
        caption = "No mass is given for this drive, so the line is for finding out why only."
    return Panel(title=title, caption=caption, figure=figure, wide=True)


def speed_panel(weighing: Weighing) -> Panel:
    """Speed over time with used and excluded samples."""
    result = weighing.result
    figure = blank(TIME_AXIS, "Speed [km/h]", height=420)
    if result is None:
        signal = weighing.drive.get("vehicle_speed") or weighing.drive.get("gnss_speed")
        if signal is None or not len(signal):
            return Panel(title="Speed over time", absent="no speed over time: none was recorded.")
        time = _minutes(weighing, signal.time)
        x, y = thin_line(time, from_si(signal.values, "kmh"))
        line(figure, x, y, "recorded speed", GREY)
        return Panel(
            title="Speed as recorded",
            caption="No sample was used: the weighing ended before.",
            figure=figure,
            wide=True,
        )
    motion = result.balance.motion
    speed = np.where(motion.valid, motion.speed, np.nan)
    x, y = thin_line(_minutes(weighing, motion.time), from_si(speed, "kmh"))
    figure.add_scatter(
        x=x, y=y, mode="lines", name="speed", line={"color": GREY, "width": 1}, hoverinfo="skip"
    )
    time = _minutes(weighing, result.time)
    rows = from_si(result.balance.merged.speed, "kmh")
    total = result.reason.size
    for reason in Reason:
        those = result.reason == reason
        count = int(np.count_nonzero(those))
        if not count:
            continue
        # Rare reasons stay visible; frequent ones are thinned by their share.
        index = spread(those, max(150, round(SCATTER_POINTS * count / total)))
        colour, symbol = REASON_STYLE[reason]
        dots(
            figure, single(time[index]), single(rows[index]), f"{reason_name(reason)} ({count})",
            colour, symbol=symbol, size=5, opacity=0.85,
        )  # fmt: skip
    used = int(np.count_nonzero(result.used))
    return Panel(
        title=f"{used} of {total} samples were used",
        caption="Each mark is one force sample, of frequent kinds every few; colour and shape "
        "say why it was left out. Click a name in the legend to hide it.",
        figure=figure,
        wide=True,
    )


def fit_panel(weighing: Weighing) -> Panel:
    """Force left for the mass against specific force, with the line of the answer."""
    title = "Force against specific force"
    result = weighing.result
    if result is None or not result.used.any():
        return Panel(title=title, absent="no force over specific force: not one sample was used.")
    phi, y = regression(result.balance.merged, weighing.vehicle)
    known = result.used & np.isfinite(phi) & np.isfinite(y)
    if not known.any():
        return Panel(title=title, absent="no force over specific force: the grade is not known.")
    index = spread(known)
    figure = blank("Specific force with rolling resistance [m/s²]", "Force on the mass [N]")
    dots(figure, single(phi[index]), single(y[index]), "used samples", BLUE)
    ends = np.array([0.0, float(np.max(phi[known]))])
    name = f"{result.mass:.0f} kg"
    title = f"The slope of force over specific force is the mass: {name}"
    if weighing.status is not Status.CONVERGED:
        name = f"least squares, {name}, no result"
        title = "Force over specific force lies on no line that could be trusted"
    line(figure, ends, ends * result.mass, name, VERMILLION)
    return Panel(
        title=title,
        caption="Traction less air drag and what the rotating parts take; the closer the marks "
        "lie to the line and the further it reaches, the surer the mass.",
        figure=figure,
    )


def residual_panel(weighing: Weighing, result: MassTrack) -> Panel:
    """Residual of the used samples over speed, with its median."""
    rows = result.used & np.isfinite(result.residual)
    if not rows.any():
        return Panel(
            title="Residual over speed", absent="no residual over speed: not one sample was used."
        )
    speed = from_si(result.balance.merged.speed, "kmh")
    index = spread(rows)
    alone = weighing.method in SPEED_ALONE
    figure = blank(
        "Speed [km/h]", "Innovation times mass [N]" if alone else "Measured less modelled force [N]"
    )
    dots(figure, single(speed[index]), single(result.residual[index]), "used samples", BLUE)
    bins = (speed[rows] // 10.0).astype(np.int64)
    centres, medians = [], []
    for b in np.unique(bins):
        inside = bins == b
        if np.count_nonzero(inside) >= 10:
            centres.append(10.0 * b + 5.0)
            medians.append(float(np.median(result.residual[rows][inside])))
    if centres:
        figure.add_scatter(
            x=centres, y=medians, mode="lines+markers", name="median per 10 km/h",
            line={"color": VERMILLION, "width": 2}, marker={"size": 7},
        )  # fmt: skip
    return Panel(
        title="The residual should not depend on speed",
        caption="The change of speed that the filter did not expect, as a force; it is not a "
        "measured one, and says how well the speed model tells the next sample."
        if alone
        else "A median that leaves zero at high speed points to air drag or wind, at low "
        "speed to torque or rolling resistance.",
        figure=figure,
    )


def share_panel(result: MassTrack) -> Panel:
    """Share of samples by reason."""
    counts = np.bincount(result.reason, minlength=len(Reason))
    present = sorted((r for r in Reason if counts[r]), key=lambda r: int(counts[r]))
    figure = blank("Share of all samples [%]", "", height=460)
    shares = [100.0 * float(counts[r]) / result.reason.size for r in present]
    figure.add_bar(
        x=shares,
        y=[reason_name(r) for r in present],
        orientation="h",
        marker_color=[REASON_STYLE[r][0] for r in present],
        text=[f"{share:.1f} %" for share in shares],
        textposition="outside",
        cliponaxis=False,
        showlegend=False,
        hovertext=[f"{counts[r]} samples" for r in present],
    )
    figure.update_layout(xaxis_range=[0, 1.18 * max(shares, default=1.0)])
    excluded = [r for r in reversed(present) if r is not Reason.USED]
    title = "No sample was excluded"
    if excluded:
        title = f"Most often excluded: {reason_name(excluded[0])}"
    return Panel(
        title=title,
        caption="The first reason that applies is the one counted.",
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
    half = 1.96 * motion.grade_std
    moving = _advancing(motion.distance)
    x, middle, low, high = (
        part
        for part in thin_line(
            distance[moving],
            *(_percent(g[moving]) for g in (grade, grade - half, grade + half)),
        )
    )
    figure = blank("Distance [km]", "Road grade [%]")
    if np.isfinite(low).any():
        line(figure, x, low, "", BAND, showlegend=False, hoverinfo="skip", line_width=0)
        line(
            figure, x, high, "95 % band", BAND,
            fill="tonexty", fillcolor=BAND, hoverinfo="skip", line_width=0,
        )  # fmt: skip
    line(figure, x, middle, "road grade", BLUE, line_width=1.4)
    lowest, highest = np.nanpercentile(_percent(grade), [1.0, 99.0])
    return Panel(
        title=f"The road rises and falls between {lowest:+.1f} and {highest:+.1f} %",
        caption="Positive uphill; 98 % of the time lies between the two numbers."
        + (
            " The pitching of the body under acceleration is taken out."
            if motion.squat is not None
            else ""
        ),
        figure=figure,
        wide=True,
    )


def pitch_panel(weighing: Weighing, result: MassTrack) -> Panel:
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
        name = f"slope of the altitude over {SLOPE_BASE:.0f} m"
        line(figure, x, slope_deg, name, GREEN, yaxis="y2", line_width=1.4)
    return Panel(
        title="Pitch and grade should follow the hills",
        caption="Where the altitude climbs, pitch and grade should be positive and near the "
        "slope of the altitude.",
        figure=figure,
        wide=True,
    )


def map_panel(weighing: Weighing) -> Panel:
    """Track of the drive in local metres, coloured by speed."""
    title = "Map of the drive"
    found = _positions(weighing)
    if found is None:
        return Panel(title=title, absent="no map: no position is known for this drive.")
    latitude, longitude, speed = found
    middle = float(np.median(latitude)), float(np.median(longitude))
    east, north, _ = pymap3d.geodetic2enu(latitude, longitude, 0.0, *middle, 0.0, deg=False)
    index = spread(np.ones(latitude.size, dtype=bool))
    x, y = single(east[index]), single(north[index])
    figure = blank("East [m]", "North [m]", height=460)
    figure.add_scatter(
        x=x, y=y, mode="lines", line={"color": GREY, "width": 1}, showlegend=False,
        hoverinfo="skip",
    )  # fmt: skip
    figure.add_scatter(
        x=x,
        y=y,
        mode="markers",
        showlegend=False,
        marker={
            "size": 4,
            "color": single(from_si(speed[index], "kmh")),
            "colorscale": "Cividis",
            "showscale": True,
            "colorbar": {"title": {"text": "Speed [km/h]", "side": "right"}, "thickness": 12},
        },
    )
    for k, name, colour, symbol in ((0, "start", GREEN, "square"), (-1, "end", VERMILLION, "x")):
        figure.add_scatter(
            x=[float(x[k])], y=[float(y[k])], mode="markers", name=name,
            marker={"size": 12, "color": colour, "symbol": symbol},
        )  # fmt: skip
    figure.update_layout(yaxis_scaleanchor="x", yaxis_constrain="domain", xaxis_constrain="domain")
    return Panel(
        title="Where the drive went, and how fast",
        caption="Metres east and north of the middle of the drive, to one scale.",
        figure=figure,
    )


def _positions(weighing: Weighing) -> tuple[Floats, Floats, Floats] | None:
    """Latitude, longitude and speed where known, from the motion or the recorded fixes."""
    if weighing.result is not None:
        motion = weighing.result.balance.motion
        known = np.isfinite(motion.latitude) & np.isfinite(motion.longitude) & motion.valid
        if np.count_nonzero(known) > 1:
            return motion.latitude[known], motion.longitude[known], motion.speed[known]
    latitude, longitude = weighing.drive.get("latitude"), weighing.drive.get("longitude")
    if latitude is None or longitude is None or len(latitude) < 2:
        return None
    east = longitude.at(latitude.time)
    speed = weighing.drive.get("vehicle_speed") or weighing.drive.get("gnss_speed")
    pace = speed.at(latitude.time) if speed is not None else np.full(len(latitude), np.nan)
    known = np.isfinite(east)
    if np.count_nonzero(known) < 2:
        return None
    return latitude.values[known], east[known], pace[known]


def _altitude_slope(distance: Floats, altitude: Floats) -> tuple[Floats, Floats]:
    """Slope of the altitude over `SLOPE_BASE` [rad], on an even grid of distance [m]."""
    grid = np.arange(distance[0] + SLOPE_BASE / 2, distance[-1] - SLOPE_BASE / 2, SLOPE_BASE / 8)
    ahead = np.interp(grid + SLOPE_BASE / 2, distance, altitude)
    behind = np.interp(grid - SLOPE_BASE / 2, distance, altitude)
    return grid, np.arctan((ahead - behind) / SLOPE_BASE)


def _mass_range(
    mass: Floats, half: Floats, used: np.ndarray, marks: list[float]
) -> tuple[float, float]:
    """Axis that shows the settled band and the marks, not the first leaps."""
    rows = np.flatnonzero(used & np.isfinite(mass))
    late = rows[rows.size // 4 :]
    low, high = np.percentile(mass[late], [0.5, 99.5])
    reach = float(np.median(np.nan_to_num(half[late], posinf=0.0)))
    low, high = min([low - reach, *marks]), max([high + reach, *marks])
    margin = 0.05 * (high - low) + 1e-3 * abs(high)
    return max(float(low - margin), 0.0), float(high + margin)


def _advancing(distance: Floats) -> np.ndarray:
    """Mark rows further on than all before, so that distance may serve as an axis."""
    best = np.maximum.accumulate(np.nan_to_num(distance, nan=-np.inf))
    return np.concatenate(([True], best[1:] > best[:-1])) & np.isfinite(distance)


def _percent(grade: Floats) -> Floats:
    return from_si(np.tan(grade), "pct")


def _minutes(weighing: Weighing, time: Floats) -> Floats:
    return from_si(time - weighing.drive.start, "min")
