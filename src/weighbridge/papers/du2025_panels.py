"""The figures of Du et al. 2025 from our drives."""

from __future__ import annotations

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.estimators import MassTrack, hybrid
from weighbridge.papers.du2025_bus import LOADS
from weighbridge.papers.du2025_methods import BAND, COLOURS, FORMS
from weighbridge.papers.du2025_results import Reproduction
from weighbridge.report.style import BLUE, GREY, VERMILLION, Panel, blank, line
from weighbridge.signals import from_si


def panels(done: Reproduction) -> tuple[Panel, ...]:
    """Draw figs. 4 to 7 of the paper from our data."""
    drawn = []
    first = {d.load: d for d in reversed(done.drives)}
    for number, load in enumerate(LOADS):
        d = first[load]
        letter = "a" if number == 0 else ""
        for form in FORMS:
            drawn.append(
                mass_panel(
                    d.printed_tracks[form.code],
                    f"Fig. {5 + number}{letter}: mass, {load}, {form.name}",
                    f"Running mass of the paper's three filters, seed {d.seed}; true mass "
                    f"{d.true_mass:.0f} kg, dotted at 10 % of it.",
                    true_mass=d.true_mass,
                )
            )
        drawn.append(
            mass_panel(
                d.tracks,
                f"The same drive by our filters: mass, {load}",
                f"Running mass of the three methods, rolling of the tyres given, seed {d.seed}.",
                true_mass=d.true_mass,
            )
        )
    empty = first["no-load"].tracks["hybrid"].balance
    drawn += motion_panels(empty)
    drawn.append(share_panel())
    for d in done.road[:: max(1, len(done.road) // len(LOADS))]:
        drawn.append(
            mass_panel(
                d.tracks,
                f"With all effects: mass, {d.load}",
                f"The same as figs. 5 to 7 on a simulated road, the bus calibrated; seed {d.seed}.",
                true_mass=d.true_mass,
            )
        )
    return tuple(drawn)


def mass_panel(
    tracks: dict[str, MassTrack], title: str, caption: str, *, true_mass: float | None = None
) -> Panel:
    """Draw the running masses of some methods."""
    figure = blank("time s", "mass kg")
    for name, track in tracks.items():
        rows = slice(None, None, max(1, track.time.size // 1500))
        line(figure, track.time[rows], track.running_mass[rows], name, COLOURS.get(name, GREY))
    if true_mass is not None:
        ends = [float(x) for x in next(iter(tracks.values())).time[[0, -1]]]
        line(figure, ends, [true_mass, true_mass], "true", VERMILLION, dash="dash")
        for factor in (1.0 - BAND, 1.0 + BAND):
            level = factor * true_mass
            line(figure, ends, [level, level], "10 %", GREY, dash="dot", showlegend=factor < 1.0)
        figure.update_layout(yaxis_range=[0.8 * true_mass, 1.2 * true_mass])
    return Panel(title=title, caption=caption, figure=figure)


def motion_panels(balance: ForceBalance) -> list[Panel]:
    """Draw torque, speed and acceleration of a drive."""
    table = balance.table
    rows = slice(None, None, max(1, table.time.size // 1500))
    drawn = []
    for letter, name, unit, values in (
        ("b", "Engine torque", "N m", table.torque),
        ("c", "Speed", "km/h", from_si(table.speed, "kmh")),
        ("d", "Acceleration", "m/s²", table.accel),
    ):
        figure = blank("time s", f"{name.lower()} {unit}", height=300)
        line(figure, table.time[rows], values[rows], name.lower(), BLUE)
        drawn.append(
            Panel(title=f"Fig. 5{letter}: {name.lower()}", caption="No-load.", figure=figure)
        )
    return drawn


def share_panel() -> Panel:
    """Draw h(v)."""
    from weighbridge.kernels.hybrid_mass import share_at

    both = hybrid.HybridSettings()
    speed = np.linspace(0.0, 25.0, 126)
    share = [share_at(v, both.blend_speed, both.blend_width) for v in speed]
    figure = blank("speed km/h", "share of the least squares", height=300)
    line(figure, from_si(speed, "kmh"), share, "h(v)", BLUE)
    return Panel(
        title="Fig. 4: h(v)",
        caption="Our logistic curve; the paper's is only drawn.",
        figure=figure,
    )
