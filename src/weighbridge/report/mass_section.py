"""The mass over time, and the samples it was made from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from weighbridge.balance import Reason
from weighbridge.estimators import MassTrack, Status
from weighbridge.estimators.regression import regression
from weighbridge.report.style import (
    BLUE,
    GREEN,
    GREY,
    PURPLE,
    REACH,
    REASON_STYLE,
    TIME_AXIS,
    VERMILLION,
    Panel,
    Section,
    band,
    blank,
    dots,
    line,
    minutes,
    reason_name,
)
from weighbridge.report.text import kg
from weighbridge.report.thinning import SCATTER_POINTS, single, spread, thin_line
from weighbridge.signals import Floats, from_si

if TYPE_CHECKING:
    from weighbridge.results.weighing import MassResult


def mass_section(weighing: MassResult, truth: float | None) -> Section:
    """Return the mass over time and what was used for it."""
    panels = [mass_panel(weighing, truth), speed_panel(weighing)]
    alone = weighing.estimator.speed_alone
    if weighing.result is not None:
        # Without a torque there is no force to draw over the specific force.
        panels += [] if alone else [fit_panel(weighing)]
        panels.append(share_panel(weighing.result))
    lead = (
        "Trust a running mass that settles early and stays within its band while the used samples "
        "come from all parts of the drive."
    )
    if alone:
        lead = (
            "Do not read a mass off this line: it begins at the mass of the calibration and stays "
            "near it on every drive and with every load, and its band is that of the start. That "
            "it settles early and hardly moves says nothing about the vehicle."
        )
    return Section(key="mass", title="Mass over time", lead=lead, panels=tuple(panels))


def mass_panel(weighing: MassResult, truth: float | None) -> Panel:
    """Mass with its band over time."""
    result = weighing.result
    if result is None or not (result.used & np.isfinite(result.running_mass)).any():
        return Panel(
            title="Mass over time",
            absent="no mass over time, for not one sample could be used.",
        )
    first = int(np.argmax(result.used))
    mass = np.where(np.arange(result.time.size) >= first, result.running_mass, np.nan)
    half = REACH * result.running_std
    time = minutes(weighing.drive, result.time)
    x, running, low, high = thin_line(time, mass, mass - half, mass + half)
    figure = blank(TIME_AXIS, "Mass [kg]", height=420)
    band(figure, x, low, high, "95 % band of the running mass", meta={"short": "95 % band"})
    line(figure, x, running, "running mass", BLUE, meta={"short": "running"})
    legs = [s for s in result.segments if np.isfinite(s.mass)]
    if len(legs) > 1:
        edges = np.array([[s.start, s.end, np.nan] for s in legs]).ravel()
        levels = np.array([[s.mass, s.mass, np.nan] for s in legs]).ravel()
        line(figure, minutes(weighing.drive, edges), levels, "mass between stops", PURPLE,
             meta={"short": "between stops"})  # fmt: skip
    begun = max(_load_since(weighing), float(result.time[0]))
    ends = minutes(weighing.drive, np.array([begun, result.time[-1]])).astype(np.float32)
    converged = weighing.status is Status.CONVERGED
    marks = [truth] if truth is not None else []
    marks += [x * s.mass for s in legs for x in (0.95, 1.05) if weighing.load_changed]
    if converged:
        for factor, name in ((0.95, "±5 % of the final mass"), (1.05, "")):
            line(
                figure, ends, np.full(2, factor * weighing.mass), name, GREY,
                dash="dot", showlegend=bool(name), meta={"short": "±5 %"},
            )  # fmt: skip
        line(
            figure, ends, np.full(2, weighing.mass), f"final mass {kg(weighing.mass)}",
            VERMILLION, dash="dash", meta={"short": "final"},
        )  # fmt: skip
        marks += [0.9 * weighing.mass, 1.1 * weighing.mass]
    if truth is not None:
        line(
            figure, ends, np.full(2, truth), f"true mass {kg(truth)}", GREEN,
            dash="longdashdot", meta={"short": "true"},
        )  # fmt: skip
    figure.update_layout(yaxis_range=_mass_range(mass, half, result.used, marks))
    if converged:
        title = f"The final mass, {kg(weighing.mass)}, and what was known on the way"
        caption = (
            "The running mass is what the data until each moment make of it, with motion and noise "
            "as the whole drive shows them; the final mass is made from the whole drive."
        )
    else:
        title = "The running mass, which ended in no result"
        caption = "No mass is given for this drive, so the line is for finding out why only."
    return Panel(title=title, caption=caption, figure=figure, wide=True)


def speed_panel(weighing: MassResult) -> Panel:
    """Speed over time with used and excluded samples."""
    result = weighing.result
    figure = blank(TIME_AXIS, "Speed [km/h]", height=420)
    if result is None:
        signal = weighing.drive.speed
        if signal is None or not len(signal):
            return Panel(title="Speed over time", absent="no speed over time: none was recorded.")
        time = minutes(weighing.drive, signal.time)
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
    x, y = thin_line(minutes(weighing.drive, motion.time), from_si(speed, "kmh"))
    figure.add_scatter(
        x=x, y=y, mode="lines", name="speed", line={"color": GREY, "width": 1}, hoverinfo="skip"
    )
    time = minutes(weighing.drive, result.time)
    rows = from_si(result.balance.table.speed, "kmh")
    total = result.row_reason.size
    for reason in Reason:
        those = result.row_reason == reason
        count = int(np.count_nonzero(those))
        if not count:
            continue
        # Rare reasons stay visible; frequent ones are thinned by their share.
        index = spread(those, max(150, round(SCATTER_POINTS * count / total)))
        colour, symbol = REASON_STYLE[reason]
        dots(
            figure, single(time[index]), single(rows[index]), f"{reason_name(reason)} ({count})",
            colour, symbol=symbol, size=5, opacity=0.85, meta={"short": reason_name(reason)},
        )  # fmt: skip
    used = int(np.count_nonzero(result.used))
    return Panel(
        title=f"{used} of {total} samples were used",
        caption=f"Each mark is one {_sample(weighing)}, of frequent kinds every few; colour and "
        "shape say why it was left out. Click a name in the legend to hide it.",
        figure=figure,
        wide=True,
    )


def _load_since(weighing: MassResult) -> float:
    """Instant since which the load is the last one; minus infinity where it never changed [s]."""
    return weighing.segments[-1].start if weighing.load_changed else -np.inf


def _sample(weighing: MassResult) -> str:
    return "mean of the speed" if weighing.estimator.speed_alone else "force sample"


def fit_panel(weighing: MassResult) -> Panel:
    """Force left for the mass against specific force, with the line of the answer."""
    title = "Force against specific force"
    result = weighing.result
    if result is None or not result.used.any():
        return Panel(title=title, absent="no force over specific force: not one sample was used.")
    phi, y = regression(result.balance.table, weighing.seen)
    known = result.used & np.isfinite(phi) & np.isfinite(y)
    known &= result.time >= _load_since(weighing)
    if not known.any():
        return Panel(title=title, absent="no force over specific force: the grade is not known.")
    index = spread(known)
    figure = blank("Specific force with rolling [m/s²]", "Force on the mass [N]")
    dots(figure, single(phi[index]), single(y[index]), "used samples", BLUE)
    ends = np.array([0.0, float(np.max(phi[known]))])
    name = kg(result.mass)
    title = f"The slope of force over specific force is the mass: {name}"
    if weighing.status is not Status.CONVERGED:
        name = f"least squares, {name}, no result"
        title = "Force over specific force lies on no line that could be trusted"
    line(figure, ends, ends * result.mass, name, VERMILLION)
    return Panel(
        title=title,
        caption="Traction less air drag and what the rotating parts take; the closer the marks "
        "lie to the line and the further it reaches, the surer the mass."
        + (" Only samples since the load changed last." if weighing.load_changed else ""),
        figure=figure,
    )


def share_panel(result: MassTrack) -> Panel:
    """Share of samples by reason."""
    counts = np.bincount(result.row_reason, minlength=len(Reason))
    present = sorted((r for r in Reason if counts[r]), key=lambda r: int(counts[r]))
    figure = blank("Share of all samples [%]", "", height=460)
    shares = [100.0 * float(counts[r]) / result.row_reason.size for r in present]
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
    figure.update_layout(xaxis_range=[0, 1.35 * max(shares, default=1.0)])
    excluded = [r for r in reversed(present) if r is not Reason.USED]
    title = "No sample was excluded"
    if excluded:
        title = f"Most often excluded: {reason_name(excluded[0])}"
    return Panel(
        title=title,
        caption="The first reason that applies is the one counted.",
        figure=figure,
    )


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
