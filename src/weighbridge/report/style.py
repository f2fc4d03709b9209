"""How every figure of the report looks."""

from __future__ import annotations

import re
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go

from weighbridge.balance import REASON_TEXT, Reason
from weighbridge.customary import shown_amount, shown_unit
from weighbridge.report.table import Table
from weighbridge.signals import Drive, Floats, from_si

BLUE: Final = "#2b7bba"
VERMILLION: Final = "#d55e00"
GREEN: Final = "#009e73"
GREY: Final = "#8a8a8a"
PURPLE: Final = "#b0679b"
ORANGE: Final = "#c08300"
BROWN: Final = "#a67c52"
"""Mid tones separated with any colour vision; after Okabe and Ito, Color Universal Design, 2008.
Each has a contrast of 3 or more on light and dark paper (WCAG 2.2, 1.4.11)."""

REACH: Final = NormalDist().inv_cdf(0.975)
"""Half of a 95 % interval over the standard deviation, where that is known [-]."""

TIME_AXIS: Final = "Time since start [min]"

AXIS: Final = {
    "gridcolor": "rgba(128,128,128,0.22)",
    "zerolinecolor": "rgba(128,128,128,0.45)",
    "linecolor": GREY,
    "showline": True,
    "ticks": "outside",
    "automargin": True,
    "exponentformat": "none",
}
"""Every axis, on light and on dark paper."""

REASON_STYLE: Final[dict[Reason, tuple[str, str]]] = {
    Reason.USED: (BLUE, "circle"),
    Reason.STANDING: ("#858585", "square"),
    Reason.NO_MOTION: ("#6b7a99", "x"),
    Reason.NO_TORQUE: ("#2f95cf", "cross"),
    Reason.BRAKING: (VERMILLION, "triangle-down"),
    Reason.SHIFTING: (PURPLE, "diamond"),
    Reason.CLUTCH_SLIPPING: ("#b8508f", "star"),
    Reason.OVERRUN: (ORANGE, "triangle-left"),
    Reason.EXTRAPOLATED: (GREEN, "triangle-up"),
    Reason.NOT_ACCELERATING: ("#9a8a2e", "circle-open"),
    Reason.BAD_FIT: ("#d1483a", "x-thin-open"),
    Reason.TOO_SHORT: ("#8f8f8f", "diamond-open"),
    Reason.CORNERING: (BROWN, "triangle-right"),
}
"""Colour and marker of used and excluded samples."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One figure of the page, or the sentence that says why it is not there.

    Attributes
    ----------
    title : what to see
    caption : one sentence on how to read it
    figure : None where there is nothing to draw
    absent : then why
    wide : takes the full width of the page
    """

    title: str
    caption: str = ""
    figure: go.Figure | None = None
    absent: str = ""
    wide: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of a drive's report, or the sentence that says why it is not there.

    Attributes
    ----------
    key : its anchor on the page
    title : what it is about
    lead : one sentence on what to read from it
    panels : its figures
    table : above them
    absent : why there is nothing to show, where panels and table are missing
    """

    key: str
    title: str
    lead: str = ""
    panels: tuple[Panel, ...] = ()
    table: Table | None = None
    absent: str = ""

    @property
    def present(self) -> bool:
        """Whether there is anything to show."""
        return self.table is not None or any(p.figure is not None for p in self.panels)

    @property
    def missing(self) -> tuple[str, ...]:
        """Why the section, or some of its figures, are not there."""
        absent_notes = (self.absent, *(p.absent for p in self.panels if p.figure is None))
        return tuple(text for text in absent_notes if text)


def reason_name(reason: Reason) -> str:
    """Name a reason in a legend."""
    return "used" if reason is Reason.USED else REASON_TEXT[reason]


_AXIS_UNIT: Final = re.compile(r"(.*)\[([^\[\]]+)\]$")


def title_in_shown_units(title: str | None) -> tuple[str, str] | None:
    """Return a title with the unit that is shown, and its own unit; None where nothing changes."""
    titled = _AXIS_UNIT.fullmatch(title or "")
    if titled is None or shown_unit(titled[2]) == titled[2]:
        return None
    return f"{titled[1]}[{shown_unit(titled[2])}]", titled[2]


def in_shown_units(figure: go.Figure) -> go.Figure:
    """Turn the axes of a figure to the units that are shown, with what is drawn along them."""
    for axis in (*figure.select_xaxes(), *figure.select_yaxes()):
        letter, number = axis.plotly_name[0], axis.plotly_name[5:]
        turned = title_in_shown_units(axis.title.text)
        if turned is None:
            continue
        axis.title.text, unit = turned
        name = f"{letter}{number}"
        if axis.range is not None:
            axis.range = [shown_amount(end, unit) for end in axis.range]
        for trace in figure.data:
            if (trace[f"{letter}axis"] or letter) == name and trace[letter] is not None:
                trace[letter] = shown_amount(np.asarray(trace[letter]), unit)
        layout = figure.layout
        # Without a reference a picture is placed on the paper, and the others along the first axis.
        drawn = [(d, letter) for d in (*layout.shapes, *layout.annotations)]
        for item, usual in (*drawn, *((image, "paper") for image in layout.images)):
            if (item[f"{letter}ref"] or usual) == name:
                _turn(item, letter, unit)
    return figure


def _turn(drawn: Any, letter: str, unit: str) -> None:
    """Turn a shape, a text or a picture along one axis."""
    for key in (letter, f"{letter}0", f"{letter}1", f"size{letter}"):
        if key in drawn and drawn[key] is not None:
            drawn[key] = shown_amount(drawn[key], unit)


def blank(x: str, y: str, *, height: int = 380, **layout: Any) -> go.Figure:
    """Return an empty figure with titled axes; text in ``x`` and ``y`` carries the unit."""
    return go.Figure(
        layout={
            "template": "none",
            "height": height,
            "margin": {"l": 60, "r": 20, "t": 20, "b": 50},
            "font": {"family": "system-ui, sans-serif", "size": 13, "color": "#444"},
            "legend": {
                "orientation": "h",
                "y": 1.02,
                "yanchor": "bottom",
                "x": 0,
                "itemsizing": "constant",
                "traceorder": "normal",
            },
            "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": GREY, "activecolor": BLUE},
            "hovermode": "closest",
            "xaxis": {**AXIS, "title": {"text": x}},
            "yaxis": {**AXIS, "title": {"text": y}},
            **layout,
        }
    )


def line(
    figure: go.Figure, x: Any, y: Any, name: str, colour: str, *, dash: str = "solid", **more: Any
) -> None:
    """Add a line."""
    figure.add_scatter(
        x=x,
        y=y,
        name=name,
        mode="lines",
        line={"color": colour, "width": 2 if dash == "solid" else 1.6, "dash": dash},
        **more,
    )


def tint(colour: str, opacity: float = 0.22) -> str:
    """Return a hex colour as one that lets through what lies below."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"


def band(
    figure: go.Figure, x: Any, low: Any, high: Any, name: str, colour: str = BLUE, **more: Any
) -> None:
    """Add the area between two lines; where one of them is not known there is none."""
    along, edge = outline(x, low, high)
    line(
        figure, along, edge, name, tint(colour),
        fill="toself", fillcolor=tint(colour), hoverinfo="skip", line_width=0, **more,
    )  # fmt: skip


def outline(x: Any, low: Any, high: Any) -> tuple[Any, Any]:
    """Go round the area between two lines, run by run of values that are known.

    Parameters
    ----------
    x : (n,) along the lines
    low, high : (n,) NaN where unknown

    Returns
    -------
    x, y : (m,) there along ``low`` and back along ``high``; NaN between two runs
    """
    known = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], known, [False])).astype(np.int8)))
    along: list[Any] = []
    edge: list[Any] = []
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        gap = np.full(min(len(along), 1), np.nan, dtype=x.dtype)
        run = slice(first, end)
        along += [gap, x[run], x[run][::-1]]
        edge += [gap, low[run], high[run][::-1]]
    if not along:
        return x[:0], x[:0]
    return np.concatenate(along), np.concatenate(edge)


def minutes(drive: Drive, time: Floats) -> Floats:
    """Return instants of a drive as minutes since its start, for `TIME_AXIS`."""
    return from_si(time - drive.start, "min")


def dots(
    figure: go.Figure,
    x: Any,
    y: Any,
    name: str,
    colour: str,
    *,
    symbol: str = "circle",
    size: float = 4.0,
    opacity: float = 0.6,
    **more: Any,
) -> None:
    """Add markers."""
    figure.add_scatter(
        x=x,
        y=y,
        name=name,
        mode="markers",
        marker={"color": colour, "size": size, "symbol": symbol, "opacity": opacity},
        **more,
    )
