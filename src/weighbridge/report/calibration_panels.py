"""Figures of a calibration (Jensen et al. 2022, figs. 6 to 9)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from weighbridge.balance import Reason
from weighbridge.report.style import BLUE, GREY, ORANGE, VERMILLION, Panel, blank, dots, line
from weighbridge.report.text import amount
from weighbridge.report.thinning import single, spread, thin_line
from weighbridge.signals import Floats, from_si, scalar_from_si

if TYPE_CHECKING:
    from weighbridge.results import Calibration

GEAR_COLOURS = (BLUE, ORANGE, "#009e73", "#b0679b", VERMILLION, "#2f95cf", "#9a8a2e", "#6b7a99")

RATIO_TICKS = (3, 4, 5, 6, 8, 10, 14, 20, 30, 40, 60, 80, 100, 140)


def calibration_panels(calibration: Calibration) -> list[Panel]:
    """Return all figures of a calibration, in the order to show them."""
    return [
        ratio_panel(calibration),
        gear_panel(calibration),
        *torque_panels(calibration),
        agreement_panel(calibration),
        sequence_panel(calibration),
        delay_panel(calibration),
    ]


def ratio_panel(calibration: Calibration) -> Panel:
    """Distribution of the gear ratio with the gears found (fig. 6)."""
    title = "Gear ratios"
    gears = calibration.gears
    if gears is None:
        return Panel(
            title=title,
            absent="no distribution of gear ratios: they were given, not found from the drives.",
        )
    figure = blank(
        "Engine angle per distance [rad/m]",
        "Samples within 2 %",
        xaxis_type="log",
        xaxis_tickvals=RATIO_TICKS,
    )
    shown = np.flatnonzero(gears.density > 0)
    part = slice(shown[0], shown[-1] + 1) if shown.size else slice(None)
    line(
        figure,
        gears.grid[part].astype(np.float32),
        gears.density[part].astype(np.float32),
        "samples",
        BLUE,
        fill="tozeroy",
        fillcolor="rgba(43,123,186,0.22)",
        showlegend=False,
    )
    for k, gearing in enumerate(gears.gearings):
        figure.add_vline(x=float(gearing), line={"color": VERMILLION, "width": 1.4, "dash": "dash"})
        figure.add_annotation(
            x=float(np.log10(gearing)), y=1.0, yref="paper", yanchor="bottom", showarrow=False,
            text=f"{k + 1}", font={"color": VERMILLION, "size": 13},
        )  # fmt: skip
    figure.update_layout(margin_t=34)
    found = ", ".join(f"{g:.2f}" for g in gears.gearings)
    return Panel(
        title=f"{gears.gearings.size} gears stand out from the ratio of engine to vehicle speed",
        caption=f"Gears 1 to {gears.gearings.size} in rad/m: {found}.",
        figure=figure,
    )


def gear_panel(calibration: Calibration) -> Panel:
    """Engine speed over vehicle speed with the gears' lines (fig. 7)."""
    speed = np.concatenate([b.table.speed for b in calibration.balances])
    engine = np.concatenate([b.table.engine_speed for b in calibration.balances])
    gear = np.concatenate([b.table.gear for b in calibration.balances])
    reason = np.concatenate([b.table.reason for b in calibration.balances])
    known = np.isfinite(speed) & np.isfinite(engine)
    if not known.any():
        return Panel(
            title="Engine speed over vehicle speed",
            absent="no engine speed over vehicle speed: engine speed was not recorded.",
        )
    clean = (reason != Reason.SHIFTING) & (reason != Reason.CLUTCH_SLIPPING) & (gear > 0)
    kmh, rpm = from_si(speed, "kmh"), from_si(engine, "rpm")
    figure = blank("Speed [km/h]", "Engine speed [rpm]")
    other = spread(known & ~clean, 800)
    if other.size:
        dots(figure, single(kmh[other]), single(rpm[other]), "shifting or slipping", GREY,
             symbol="x-thin-open")  # fmt: skip
    gearings = calibration.vehicle.driveline.gearings
    top = float(np.max(engine[known]))
    share = max(150, 3000 // max(len(gearings), 1))
    for k, gearing in enumerate(gearings):
        colour = GEAR_COLOURS[k % len(GEAR_COLOURS)]
        index = spread(known & clean & (gear == k + 1), share)
        if index.size:
            dots(figure, single(kmh[index]), single(rpm[index]), f"gear {k + 1}", colour)
        fastest = min(top / gearing, float(np.max(speed[known])))
        line(
            figure,
            [0.0, scalar_from_si(fastest, "kmh")],
            [0.0, scalar_from_si(fastest * gearing, "rpm")],
            f"ratio of gear {k + 1}",
            colour,
            dash="dash",
            showlegend=False,
        )
    return Panel(
        title="Samples in gear should lie on the line of their gear",
        caption="Marks off the lines are shifts, the slipping clutch and idling.",
        figure=figure,
    )


def torque_panels(calibration: Calibration) -> list[Panel]:
    """Measured and fitted torque over the source and over engine speed (fig. 8)."""
    rows = calibration.rows
    source, motion = rows.source_torque, rows.motion_torque
    model = calibration.vehicle.torque
    read = model.of_source
    regressor = rows.reading
    if read.axis_suffix:
        regressor = from_si(regressor, read.axis_suffix)
    panels = [
        _both(
            regressor,
            read.axis,
            source,
            motion,
            "The fit should follow the torque over its source",
        )
    ]
    if len(model.coefficients) > 2 or model.curvature or model.knots:
        rpm = from_si(rows.engine_speed, "rpm")
        panels.append(
            _both(
                rpm,
                "Engine speed [rpm]",
                source,
                motion,
                "The fit should hold at every engine speed",
            )
        )
    else:
        panels.append(
            Panel(
                title="Torque over engine speed",
                absent="no torque over engine speed: the torque model does not use engine speed.",
            )
        )
    return panels


def agreement_panel(calibration: Calibration) -> Panel:
    """Torque of the source against torque of the motion."""
    rows = calibration.rows
    source, motion = rows.source_torque, rows.motion_torque
    index = spread(np.ones(source.size, dtype=bool))
    figure = blank("Torque from the motion [N m]", "Torque from the source [N m]")
    dots(figure, single(motion[index]), single(source[index]), "samples", BLUE)
    low, high = np.percentile(motion, [0.1, 99.9])
    line(figure, [low, high], [low, high], "equal", VERMILLION)
    return Panel(
        title=f"Torque from the source against torque from the motion: R² = {rows.r_squared:.3f}",
        caption="Robust standard deviation of the difference: "
        f"{amount(rows.residual_std, 'N m', '.1f')} over {source.size} samples.",
        figure=figure,
    )


def sequence_panel(calibration: Calibration) -> Panel:
    """Torque of the motion and of the source one after another (fig. 9)."""
    source, motion = calibration.rows.source_torque, calibration.rows.motion_torque
    minutes = from_si(calibration.rows.time, "min")
    # A line across minutes without samples would show what nobody measured.
    pause = np.flatnonzero(np.diff(minutes) > 0.1) + 1
    minutes, source, motion = (np.insert(x, pause, np.nan) for x in (minutes, source, motion))
    figure = blank("Time [min]", "Torque [N m]", height=420)
    for values, name, colour, width in (
        (motion, "from the motion", GREY, 2.4),
        (source, "from the source", BLUE, 1.2),
    ):
        x, y = thin_line(minutes, values)
        line(figure, x, y, name, colour, line_width=width)
    return Panel(
        title="The torque from the source should follow the torque that the motion needs",
        caption="Only the samples of the fit are shown; zoom in to compare single accelerations.",
        figure=figure,
        wide=True,
    )


def delay_panel(calibration: Calibration) -> Panel:
    """Misfit over the delays that were tried."""
    search = calibration.search
    if search.delay.size < 2:
        return Panel(
            title="Misfit over the delay",
            absent="no misfit over the delay: too few rows are usable at other delays.",
        )
    figure = blank("Delay and lag of the torque [s]", "Misfit above the least [-]")
    line(figure, search.delay.tolist(), search.misfit.tolist(), "misfit", BLUE)
    return Panel(
        title="The drives should fit best at one delay",
        caption="Negative logarithm of the likelihood, that of the best delay taken off.",
        figure=figure,
    )


def calibration_facts(calibration: Calibration) -> list[tuple[str, str]]:
    """What was found, with standard deviations, for a table: the numbers of the vehicle file."""
    vehicle = calibration.vehicle
    facts = [
        ("torque source", vehicle.torque.of_source.name.replace("_", " ")),
        ("drives", ", ".join(vehicle.provenance.drives)),
    ]
    for figure in calibration.figures:
        said = f"std {figure.std}" if figure.std[:1].isdigit() else figure.std
        facts.append((figure.name, f"{figure.value} ({said})" if said else figure.value))
    return facts


def _both(x: Floats, label: str, source: Floats, motion: Floats, title: str) -> Panel:
    index = spread(np.ones(x.size, dtype=bool), 2000)
    figure = blank(label, "Torque [N m]")
    dots(figure, single(x[index]), single(motion[index]), "from the motion", GREY)
    dots(figure, single(x[index]), single(source[index]), "fitted", BLUE, symbol="diamond")
    return Panel(
        title=title,
        caption="Grey is the torque that the motion of the known mass needs, blue what the fitted "
        "model makes of the source.",
        figure=figure,
    )
