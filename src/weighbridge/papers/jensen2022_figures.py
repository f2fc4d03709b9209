"""Figures 4, 8-19 of Jensen et al. 2022 from our drives, for the report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go
from scipy.stats import gaussian_kde

from weighbridge.estimators import run_in_turn
from weighbridge.papers.jensen2022_judged import BAND, DriveResult, Torques, joined, kilometres
from weighbridge.papers.jensen2022_reproduction import LOADED, Reproduction, Sample, gradient_panel
from weighbridge.papers.jensen2022_tables import (
    PERTURBED_DRIVE,
    highways,
    in_turn,
    perturbations,
    ways,
)
from weighbridge.report.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    VERMILLION,
    Panel,
    blank,
    dots,
    line,
)
from weighbridge.report.thinning import single, spread, thin_line
from weighbridge.signals import Floats, from_si

COLOURS: Final = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE)
NAMES: Final = {"printed": "the paper's own rules", "ours": "ours"}
_DAYS: Final = (
    ("11", "drives without load", (1, 2, 3)),
    ("12", "drives with loads", (4, 5, 6, 7, 8)),
    ("14", "drives with tyre pressures", (9, 10, 11, 12, 13)),
    ("15", "drives with open windows", (14, 15, 16, 17, 18)),
)
_KM: Final = "Distance [km]"
_MASS: Final = "Mass [kg]"
_CELLS: Final = 500
"""Points of one cell of the scatter matrix."""


def panels(done: Reproduction) -> tuple[Panel, ...]:
    """Return every figure of the paper that shows data of a drive, in its order."""
    found = [_scatter_matrix(done.sample), gradient_panel(done.gradient)]
    for way, parts in (("printed", done.printed_loads), ("ours", done.loads)):
        if parts:
            found.append(_torque_panel(joined(parts), way))
    found.append(_sequence_panel(done.sample.torques))
    found.append(_pitch_panel(done))
    for way, drives, car, rls in ways(done):
        found += [_day_panel(number, text, rows, drives, way) for number, text, rows in _DAYS]
        memory = in_turn(done, drives, car, rls)
        if memory:
            found.append(_memory_panel(memory, drives, way))
        for wind in ("high", "low"):
            trips = highways(done, way, wind)
            if trips:
                masses = run_in_turn([h.balance for h in trips], car, rls)
                found.append(_highway_panel(done, way, wind, masses))
        found += _perturbed_panels(drives, perturbations(done, drives, car, rls), way)
    return tuple(found)


def _scatter_matrix(sample: Sample) -> Panel:
    """Attributes of drive 1 against each other, their densities on the diagonal (fig. 4)."""
    drive, torques = sample.drive, sample.torques
    stamps = drive.signals["engine_load"].time
    columns: list[tuple[str, Floats]] = [
        ("Engine [rpm]", from_si(drive.signals["engine_speed"].at(stamps), "rpm")),
        ("Speed [km/h]", from_si(drive.signals["vehicle_speed"].at(stamps), "kmh")),
        ("Load [%]", from_si(drive.signals["engine_load"].values, "pct")),
    ]
    throttle = drive.get("throttle")
    if throttle is not None:
        columns.append(("Throttle [%]", from_si(throttle.at(stamps), "pct")))
    air = np.interp(stamps, torques.time, torques.air)
    columns.append(("Air torque [N m]", air))
    known = np.all([np.isfinite(c) for _, c in columns], axis=0)
    at = spread(known, _CELLS)
    figure, n = blank("", "", height=760, showlegend=False), len(columns)
    layout: dict[str, Any] = {}
    room, gap = 1.0 / n, 0.035
    for row, (y_name, y) in enumerate(columns):
        for col, (x_name, x) in enumerate(columns):
            place = row * n + col + 1
            key = "" if place == 1 else str(place)
            if row == col:
                along, density = _density(x[known])
                line(figure, along, density, x_name, VERMILLION, xaxis=f"x{key}", yaxis=f"y{key}")
            else:
                dots(figure, single(x[at]), single(y[at]), "", BLUE, size=2.0, opacity=0.5,
                     xaxis=f"x{key}", yaxis=f"y{key}")  # fmt: skip
            domain = [col * room + gap, (col + 1) * room]
            layout[f"xaxis{key}"] = _cell_axis(domain, f"y{key}", x_name if row == n - 1 else "")
            domain = [1.0 - (row + 1) * room + gap, 1.0 - row * room]
            layout[f"yaxis{key}"] = _cell_axis(domain, f"x{key}", y_name if col == 0 else "")
            if row == col:
                layout[f"yaxis{key}"]["showticklabels"] = False
    figure.update_layout(**layout)
    return Panel(
        title="Fig. 4: what drive 1 recorded, each against each",
        caption="Red on the diagonal: kernel density. Lines of engine over vehicle speed are "
        "gears; torque by eq. 51 rises with the load.",
        figure=figure,
        wide=True,
    )


def _cell_axis(domain: list[float], anchor: str, title: str) -> dict[str, Any]:
    return {
        "domain": domain,
        "anchor": anchor,
        "title": {"text": title, "font": {"size": 11}},
        "showline": True,
        "linecolor": GREY,
        "showgrid": False,
        "zeroline": False,
        "tickfont": {"size": 9},
        "nticks": 4,
    }


def _density(values: Floats) -> tuple[Floats, Floats]:
    """Kernel density of values (n,) along their range."""
    some = values[np.linspace(0, values.size - 1, min(values.size, 4000)).astype(np.int64)]
    along = np.linspace(float(np.min(some)), float(np.max(some)), 120)
    return along, np.asarray(gaussian_kde(some)(along))


def _torque_panel(parts: Torques, way: str) -> Panel:
    """Torque of drives 4-8 over the load, coloured by engine speed (fig. 8b)."""
    at = spread(np.ones(parts.load.size, dtype=bool), 2500)
    figure = blank("Engine load [%]", "Torque [N m]", height=420)
    load = from_si(parts.load, "pct")
    dots(figure, single(load[at]), single(parts.motion[at]), "from the motion", GREY)
    figure.add_scatter(
        x=single(load[at]),
        y=single(parts.source[at]),
        name="regression",
        mode="markers",
        marker={
            "color": single(from_si(parts.engine_speed[at], "rpm")),
            "colorscale": "Viridis",
            "size": 4.0,
            "opacity": 0.7,
            "colorbar": {"title": {"text": "rpm"}, "thickness": 12},
        },
    )
    return Panel(
        title=f"Fig. 8b, {NAMES[way]}: torque of drives {LOADED[0]}-{LOADED[-1]} with loads, "
        f"R² = {parts.r_squared:.3f}",
        caption="The regression is of the empty car; grey is what the motion of the known mass "
        "needs.",
        figure=figure,
    )


def _sequence_panel(torques: Torques) -> Panel:
    """Torque three ways over time (fig. 9)."""
    minutes = from_si(torques.time - torques.time[0], "min")
    pause = np.flatnonzero(np.diff(minutes) > 0.1) + 1
    figure = blank("Time [min]", "Torque [N m]", height=420)
    for values, name, colour in (
        (torques.motion, "from the motion", GREY),
        (torques.source, "from load and engine speed", BLUE),
        (torques.air, "from intake air flow, eq. 51", ORANGE),
    ):
        x, y = thin_line(np.insert(minutes, pause, np.nan), np.insert(values, pause, np.nan))
        line(figure, x, y, name, colour, line_width=1.3)
    return Panel(
        title="Fig. 9, the paper's own rules: torque of drive 1 three ways",
        caption="Torque from air flow is that of the engine; the others are less the losses of "
        f"the driveline. It is {torques.air_over_source:.3f} times that from load.",
        figure=figure,
        wide=True,
    )


def _pitch_panel(done: Reproduction) -> Panel:
    """Pitch of drives 1-3 over distance (fig. 10)."""
    figure = blank(_KM, "Pitch [°]", height=380)
    for k, d in enumerate(done.printed[:3]):
        motion = d.balance.motion
        x, y = thin_line(motion.distance / 1e3, from_si(motion.pitch, "deg"))
        line(figure, x, y, f"drive {d.drive.number}", COLOURS[k], line_width=1.2)
    return Panel(
        title="Fig. 10, the paper's own rules: pitch of drives 1-3",
        caption="The same hills on each drive should give the same pitch.",
        figure=figure,
        wide=True,
    )


def _band(figure: go.Figure, mass: float) -> None:
    """Draw a true mass with the paper's band."""
    figure.add_hline(y=mass, line={"color": GREY, "width": 1.4})
    for side in (1.0 - BAND, 1.0 + BAND):
        figure.add_hline(y=side * mass, line={"color": GREY, "width": 1.0, "dash": "dot"})


def _day_panel(
    number: str, text: str, numbers: Sequence[int], drives: Sequence[DriveResult], way: str
) -> Panel:
    """Running masses of one day over distance (figs. 11, 12, 14, 15)."""
    title = f"Fig. {number}, {NAMES[way]}: {text}"
    chosen = [d for d in drives if d.drive.number in numbers]
    if not chosen:
        return Panel(title=title, absent=f"fig. {number}: these drives were not asked for.")
    figure = blank(_KM, _MASS, height=420, yaxis_range=[1300, 2100])
    for k, d in enumerate(chosen):
        x, y = thin_line(kilometres(d.balance.motion, d.track.time), d.track.running_mass)
        line(figure, x, y, f"{d.drive.number}: {d.drive.kind}", COLOURS[k], line_width=1.5)
    for mass in dict.fromkeys(round(d.true_mass) for d in chosen):
        _band(figure, float(mass))
    return Panel(
        title=title,
        caption="Grey: true mass; dotted: ±5 % of it.",
        figure=figure,
    )


def _memory_panel(
    memory: dict[float, tuple[Floats, ...]], drives: Sequence[DriveResult], way: str
) -> Panel:
    """Drives 4-8 one after another for three forgetting factors (fig. 13)."""
    loaded = [d for d in drives if d.drive.number in LOADED]
    figure = blank(_KM, _MASS, height=420, yaxis_range=[1300, 2100])
    starts = np.cumsum([0.0, *(d.balance.motion.distance[-1] / 1e3 for d in loaded)])
    km = np.concatenate(
        [
            s + kilometres(d.balance.motion, d.track.time)
            for s, d in zip(starts, loaded, strict=False)
        ]
    )
    for k, (forgetting, masses) in enumerate(memory.items()):
        x, y = thin_line(km, np.concatenate(masses))
        line(figure, x, y, f"λ = {forgetting:g}", COLOURS[k], line_width=1.4)
    for start, end, d in zip(starts[:-1], starts[1:], loaded, strict=True):
        line(
            figure, [start, end], [d.true_mass] * 2, "true mass", GREY, showlegend=bool(start == 0)
        )
    return Panel(
        title=f"Fig. 13, {NAMES[way]}: drives 4-8 in turn for three forgetting factors",
        caption="A high factor follows a new load late, a low one is restless.",
        figure=figure,
        wide=True,
    )


def _highway_panel(done: Reproduction, way: str, wind: str, masses: tuple[Floats, ...]) -> Panel:
    """Running mass north and south on the highway (fig. 16)."""
    trips = highways(done, way, wind)
    figure = blank(_KM, _MASS, height=420, yaxis_range=[1000, 2400])
    begin = 0.0
    for k, (h, mass) in enumerate(zip(trips, masses, strict=True)):
        km = kilometres(h.balance.motion, h.balance.table.time)
        x, y = thin_line(begin + km, mass)
        line(figure, x, y, f"{h.trip.speeds} km/h", COLOURS[k], line_width=1.5)
        north = np.cos(np.nan_to_num(h.balance.table.heading)) > 0.0
        turn = begin + float(km[np.flatnonzero(north)[-1]]) if north.any() else begin
        figure.add_vrect(x0=begin, x1=turn, fillcolor=GREY, opacity=0.12, line_width=0)
        begin += float(km[-1])
    _band(figure, trips[0].true_mass)
    speed = getattr(done.settings.conditions, f"{wind}_wind")
    return Panel(
        title=f"Fig. 16, {NAMES[way]}: highway in {wind} wind, {speed:g} m/s",
        caption="Shaded: driving north. Wind from ahead looks like mass.",
        figure=figure,
    )


def _perturbed_panels(
    drives: Sequence[DriveResult], found: dict[str, dict[float, Floats]], way: str
) -> list[Panel]:
    """Running mass of the loaded drive with a perturbed model (figs. 17-19)."""
    d = next((d for d in drives if d.drive.number == PERTURBED_DRIVE), drives[0])
    km = kilometres(d.balance.motion, d.track.time)
    made = []
    for number, kind, words, unit in (
        ("17", "wind", "constant wind in the model", "{:g} m/s"),
        ("18", "drag", "product of drag coefficient and frontal area", "{:g} times"),
        ("19", "rolling", "rolling resistance coefficient", "{:g} times"),
    ):
        figure = blank(_KM, _MASS, height=400, yaxis_range=[1300, 2400])
        for k, (value, mass) in enumerate(found[kind].items()):
            x, y = thin_line(km, mass)
            line(figure, x, y, unit.format(value), COLOURS[k], line_width=1.5)
        _band(figure, d.true_mass)
        made.append(
            Panel(
                title=f"Fig. {number}, {NAMES[way]}: {words}",
                caption=f"Drive {d.drive.number}, {d.drive.kind}; grey: true mass and ±5 %.",
                figure=figure,
            )
        )
    return made
