"""All methods on one drive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.estimators import ESTIMATORS
from weighbridge.report.answer import shown_reason
from weighbridge.report.style import (
    BLUE,
    BROWN,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    TIME_AXIS,
    VERMILLION,
    Panel,
    Section,
    blank,
    line,
    minutes,
    tint,
)
from weighbridge.report.table import Table
from weighbridge.report.text import NOTHING, error, interval, kg, signed_kg
from weighbridge.report.thinning import thin_line

if TYPE_CHECKING:
    from weighbridge.results.weighing import MassResult

METHOD_STYLES: Final = (
    (BLUE, "solid"),
    (VERMILLION, "dash"),
    (ORANGE, "dot"),
    (GREEN, "dashdot"),
    (PURPLE, "longdash"),
    (BROWN, "longdash"),
    (GREY, "longdashdot"),
    (GREEN, "longdashdot"),
)
"""Colour and dash of each method, in the order of `ESTIMATORS`."""

OTHER_STYLE: Final = (GREY, "dot")
"""Those of a method of another package."""

NOT_FITTING: Final = "does not fit"
"""Said of a mass that contradicts the answer."""

TRACK_POINTS: Final = 500
"""Points of a line where several are drawn together."""


def method_style(method: str) -> tuple[str, str]:
    """Return colour and dash of a method."""
    own = dict(zip(ESTIMATORS.own, METHOD_STYLES, strict=False))
    return own.get(method, OTHER_STYLE)


def fits(one: MassResult, other: MassResult) -> bool:
    """Whether two masses may be one: they differ by less than their 95 % intervals together.

    The intervals count as if each erred by itself. Methods share the errors of the data, so masses
    that differ more contradict each other.
    """
    return abs(one.mass - other.mass) <= math.hypot(half_width(one), half_width(other))


def half_width(weighing: MassResult) -> float:
    """Half of the 95 % interval [kg]; NaN where there is no mass."""
    low, high = weighing.interval(0.95)
    return 0.5 * (high - low)


def apart(weighing: MassResult, comparison: Sequence[MassResult]) -> list[MassResult]:
    """Return the weighings by other methods whose mass does not fit that of ``weighing``."""
    if not math.isfinite(weighing.mass):
        return []
    return [
        w
        for w in comparison
        if w.method != weighing.method and math.isfinite(w.mass) and not fits(w, weighing)
    ]


def methods_section(
    weighing: MassResult, comparison: Sequence[MassResult], truth: float | None
) -> Section:
    """Return every method's mass side by side.

    Parameters
    ----------
    weighing : whose mass is the answer of the page
    comparison : of one drive, one per method; empty where none was asked for
    truth : true mass [kg]; None where unknown
    """
    key, title = "methods", "All methods on this drive"
    if not comparison:
        return Section(key=key, title=title)
    fitted = comparison[0].vehicle.provenance.method
    others = {w.method for w in apart(weighing, comparison)}
    return Section(
        key=key,
        title=title,
        lead="Methods that agree within their intervals speak for the mass; one that stands "
        "apart has met what it does not model"
        + (
            f", or a torque that was fitted for another: this vehicle file's was for {fitted}."
            if fitted
            else "."
        ),
        table=_table(weighing, comparison, truth),
        panels=(
            interval_panel(weighing, comparison, truth),
            tracks_panel(comparison, truth, others),
        ),
    )


def _table(weighing: MassResult, comparison: Sequence[MassResult], truth: float | None) -> Table:
    judged = truth is not None
    others = {w.method for w in apart(weighing, comparison)}
    failed = any(w.reason for w in comparison)
    columns = (
        *("method", "mass", "95 % interval", "payload"),
        *(("error",) if judged else ()),
        *("used", "with the answer"),
        *(("why there is no mass",) if failed else ()),
    )
    rows = []
    for w in comparison:
        errors = (error(w.mass, truth),) if judged else ()
        used = f"{w.used_time / 60.0:.1f} min" if w.result is not None else NOTHING
        why = (shown_reason(w),) if failed else ()
        rows.append(
            (w.method, kg(w.mass), interval(w), signed_kg(w.payload), *errors, used,
             _agreement(w, weighing, others), *why)
        )  # fmt: skip
    marked = tuple(k for k, w in enumerate(comparison) if w.method in others)
    return Table("", columns, tuple(rows), marked)


def _agreement(w: MassResult, weighing: MassResult, others: set[str]) -> str:
    if w.method == weighing.method:
        return "the answer" if math.isfinite(w.mass) else NOTHING
    if not math.isfinite(w.mass) or not math.isfinite(weighing.mass):
        return NOTHING
    return NOT_FITTING if w.method in others else "fits"


def interval_panel(
    weighing: MassResult, comparison: Sequence[MassResult], truth: float | None
) -> Panel:
    """Mass and 95 % interval of each method, over the interval of the answer."""
    others = {w.method for w in apart(weighing, comparison)}
    found = [w for w in comparison if math.isfinite(w.mass)]
    if not found:
        return Panel(title="Masses", absent="no masses side by side: no method found one.")
    figure = blank("Mass [kg]", "", height=130 + 42 * len(found))
    if math.isfinite(weighing.mass):
        low, high = weighing.interval(0.95)
        figure.add_vrect(x0=low, x1=high, fillcolor=tint(BLUE, 0.15), line_width=0, layer="below")
    for w in reversed(found):
        low, high = w.interval(0.95)
        colour, _ = method_style(w.method)
        figure.add_scatter(
            x=[w.mass], y=[w.method], mode="markers", showlegend=False,
            marker={
                "color": colour, "size": 11,
                "symbol": "x" if w.method in others else "circle",
            },
            error_x={
                "type": "data", "symmetric": False, "array": [high - w.mass],
                "arrayminus": [w.mass - low], "color": colour, "thickness": 2.5, "width": 7,
            },
        )  # fmt: skip
        if w.method in others:
            figure.add_annotation(
                x=w.mass, y=w.method, yshift=14, showarrow=False, text=NOT_FITTING,
                font={"color": colour, "size": 12},
            )  # fmt: skip
    if truth is not None:
        figure.add_vline(x=truth, line={"color": GREEN, "width": 2, "dash": "longdashdot"})
        figure.add_annotation(
            x=truth, y=1.0, yref="paper", yanchor="bottom", showarrow=False,
            text=f"true mass {kg(truth)}", font={"color": GREEN},
        )  # fmt: skip
    masses = [w.mass for w in found]
    return Panel(
        title=f"{len(found)} of {len(comparison)} methods found a mass, "
        f"within {kg(max(masses) - min(masses))}" + _not_fitting(others),
        caption="Marks are the masses, lines their 95 % intervals; shaded is that of the answer. "
        "A cross does not fit: the two masses differ by more than both intervals together.",
        figure=figure,
    )


def _not_fitting(others: set[str]) -> str:
    if not others:
        return ""
    return f"; {len(others)} {'does' if len(others) == 1 else 'do'} not fit"


def tracks_panel(comparison: Sequence[MassResult], truth: float | None, others: set[str]) -> Panel:
    """Running mass of each method over time; ``others`` do not fit the answer."""
    figure = blank(TIME_AXIS, "Running mass [kg]", height=380)
    late: list[float] = []
    for w in comparison:
        result = w.result
        if result is None or not result.used.any():
            continue
        begun = np.cumsum(result.used) > 0
        mass = np.where(begun, result.running_mass, np.nan)
        if not np.isfinite(mass).any():
            continue
        colour, dash = method_style(w.method)
        name = w.method if math.isfinite(w.mass) else f"{w.method} (no mass)"
        name += f" ({NOT_FITTING})" if w.method in others else ""
        x, y = thin_line(minutes(w.drive, result.time), mass, points=TRACK_POINTS)
        line(figure, x, y, name, colour, dash=dash, meta={"short": w.method})
        if math.isfinite(w.mass):
            known = mass[np.isfinite(mass)]
            late += [float(v) for v in np.percentile(known[known.size // 8 :], [1.0, 99.0])]
    if not figure.data:
        return Panel(title="Running masses", absent="no running masses: no method has any.")
    if truth is not None:
        ends = [figure.data[0].x[0], figure.data[0].x[-1]]
        line(figure, ends, [truth, truth], "true mass", GREY, dash="solid", line_width=1)
        late.append(truth)
    if late:
        margin = 0.08 * (max(late) - min(late)) + 0.005 * max(late)
        figure.update_layout(yaxis_range=[min(late) - margin, max(late) + margin])
    return Panel(
        title="How each method came to its mass",
        caption="What each made of the data until then; the masses above are made from the whole "
        "drive.",
        figure=figure,
    )
