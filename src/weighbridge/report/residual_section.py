"""What the model of each method leaves of the force, against what it should not depend on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.balance.table import ForceTable
from weighbridge.estimators import MassTrack
from weighbridge.estimators.joint.terms import TERMS
from weighbridge.report.methods_section import apart, method_style
from weighbridge.report.style import BLUE, GREY, VERMILLION, Panel, Section, blank, dots, line
from weighbridge.report.text import amount
from weighbridge.report.thinning import single, spread
from weighbridge.signals import Bools, Floats, from_si

if TYPE_CHECKING:
    from weighbridge.results.weighing import MassResult
    from weighbridge.vehicle import Vehicle

POINTS: Final = 600
"""Points of each cloud."""

FEWEST_SAMPLES: Final = 10
"""Samples below which a bin has no mean."""

SMALLEST: Final = 0.002
"""Part of all samples below which a bin has no mean [-]: a few seconds, all of one moment."""

WITH_SLOW: Final = "with slow forces"
"""Name of the means from which nothing is taken off."""

BINS: Final = 14
"""Bins of an axis that has no widths of its own, at most."""


@dataclass(frozen=True, slots=True)
class _Against:
    """What residuals are drawn against.

    Attributes
    ----------
    name : in words
    axis : title of the axis, with the unit
    values : of it, one per row of a table
    widths : of a bin, of which the first that gives at most `BINS` is taken
    says : what a mean that leaves zero points to
    absent : why it may be missing
    centred : bins lie around the multiples of their width
    around : where the axis comes back to its start; 0 where it does not
    """

    name: str
    axis: str
    values: Callable[[ForceTable], Floats]
    widths: tuple[float, ...]
    says: str
    absent: str
    centred: bool = False
    around: float = 0.0


def _compass(table: ForceTable) -> Floats:
    return np.mod(from_si(table.heading, "deg"), 360.0)


_AXES: Final = (
    _Against(
        "speed",
        "Speed [km/h]",
        lambda table: from_si(table.speed, "kmh"),
        (5.0, 10.0, 20.0),
        "A mean that leaves zero at high speed points to air drag or wind, at low speed to "
        "torque or rolling resistance.",
        "the speed is not known",
    ),
    _Against(
        "force",
        "Traction force [N]",
        lambda table: table.traction_force,
        (100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0, 10_000.0),
        "A bend points to the scale of the torque; a slight rise is natural, for the noise of "
        "the torque is in both.",
        "the force is not known",
    ),
    _Against(
        "gear",
        "Gear [-]",
        lambda table: np.where(table.gear > 0, table.gear, np.nan).astype(np.float64),
        (1.0,),
        "One gear that stands apart has a wrong ratio, inertia or efficiency.",
        "there is only one gear",
        centred=True,
    ),
    _Against(
        "heading",
        "Heading [deg]",
        _compass,
        (30.0,),
        "A wave of the dashed line with one crest in the round is wind, from where it is highest; "
        "0 is north, 90 east.",
        "the heading is not known",
        centred=True,
        around=360.0,
    ),
)


def residual_section(weighing: MassResult, comparison: Sequence[MassResult]) -> Section:
    """Return residuals against speed, force, gear and heading.

    Parameters
    ----------
    weighing : whose residuals are drawn whole
    comparison : of which the means are drawn beside; may be empty
    """
    key, title = "residuals", "Residuals"
    result = weighing.result
    if result is None:
        return Section(key=key, title=title)
    what = "the measured force less the model's at the final mass"
    if weighing.estimator.speed_alone:
        what = "the change of speed that the filter did not expect, as a force"
    beside = [w for w in comparison if w not in apart(weighing, comparison)]
    return Section(
        key=key,
        title=title,
        lead=f"A residual is {what}; its mean should stay near zero all along each axis."
        + _slow_part(result, weighing.seen),
        panels=tuple(residual_panel(weighing, beside, against) for against in _AXES),
    )


def slow_force(result: MassTrack, vehicle: Vehicle) -> Floats:
    """Force that was found beside the mass at each row and comes and goes (n,) [N].

    Disturbance, resistance and wind; zero where the method finds none.
    """
    table, slow = result.balance.table, result.slow_errors
    if slow is None or not slow.time.size:
        return np.zeros(table.time.size)

    force = np.zeros(table.time.size)
    for name, found in slow.found.items():
        if not found.lasting:
            term, value = TERMS[name], np.interp(table.time, slow.time, found.value)
            # What is levelled is a force already.
            column = 1.0 if term.levelled else np.nan_to_num(term.column(table, vehicle, 0.0))
            force += column * value
    return force


def _slow_part(result: MassTrack, vehicle: Vehicle) -> str:
    """Say how much of the mean residual was found to be slow forces; empty where none is kept."""
    known = result.used & np.isfinite(result.residual)
    if result.slow_errors is None or not known.any():
        return ""
    slow = slow_force(result, vehicle)
    mean, part = float(np.mean(result.residual[known])), float(np.mean(slow[known]))
    return (
        f" Of a mean of {_newton(mean)}, {_newton(part)} are slow resistance, disturbance and wind "
        f"that were found beside the mass: they are taken off, which leaves {_newton(mean - part)}."
        " The dashed line still has them."
    )


def _newton(force: float) -> str:
    return amount(force, "N", "+.0f").replace("+0 ", "0 ").replace("−0 ", "0 ")


def residual_panel(weighing: MassResult, beside: Sequence[MassResult], against: _Against) -> Panel:
    """Draw the cloud of one method with its mean and spread, and the means of the others.

    Parameters
    ----------
    weighing : of the cloud
    beside : the same drive by methods whose masses fit; may be empty
    against : what to draw over
    """
    title = f"Residual over {against.name}"
    result = weighing.result
    nothing = f"no residual over {against.name}"
    if result is None or not (result.used & np.isfinite(result.residual)).any():
        return Panel(title=title, absent=f"{nothing}: not one sample was used.")
    x, rows = _rows(result, against)
    if not rows.any() or (against.name == "gear" and np.unique(x[rows]).size < 2):
        return Panel(title=title, absent=f"{nothing}: {against.absent}.")
    width = bin_width(x[rows], against.widths)
    left = result.residual - slow_force(result, weighing.seen)
    index = spread(rows, POINTS)
    figure = blank(
        against.axis,
        "Innovation times mass [N]" if weighing.estimator.speed_alone else "Residual [N]",
    )
    dots(figure, single(x[index]), single(left[index]), f"samples, {weighing.method}",
         BLUE, opacity=0.45, meta={"short": "samples"})  # fmt: skip
    colour, _ = method_style(weighing.method) if beside else (VERMILLION, "")
    centres, mean, std = _means(x[rows], left[rows], width, against)
    figure.add_scatter(
        x=single(centres), y=single(mean), mode="lines+markers",
        name=f"mean, {weighing.method}" if beside else "mean and spread",
        line={"color": colour, "width": 2.5}, marker={"size": 7}, meta={"short": "mean"},
        error_y={"type": "data", "array": single(std), "color": colour, "thickness": 1.2},
    )  # fmt: skip
    reach = [*np.percentile(left[rows], [0.5, 99.5]), *mean]
    if result.slow_errors is not None:
        centres, mean, _ = _means(x[rows], result.residual[rows], width, against)
        line(figure, single(centres), single(mean), WITH_SLOW, colour, dash="dash")
        reach += [*mean]
    for other in beside:
        if other.method == weighing.method or other.result is None:
            continue
        ox, there = _rows(other.result, against)
        oc, om, _ = _means(ox[there], other.result.residual[there], width, against)
        if oc.size:
            colour, dash = method_style(other.method)
            figure.add_scatter(
                x=single(oc), y=single(om), mode="lines+markers", name=other.method,
                line={"color": colour, "width": 1.6, "dash": dash}, marker={"size": 5},
            )  # fmt: skip
            reach += [*om]
    figure.add_hline(y=0.0, line={"color": GREY, "width": 1})
    figure.update_layout(
        yaxis_range=[1.15 * float(np.nanmin(reach)), 1.15 * float(np.nanmax(reach))]
    )
    if against.name == "gear":
        figure.update_layout(xaxis_dtick=1)
    if against.around:
        figure.update_layout(xaxis_range=[0, against.around], xaxis_dtick=90)
    says = against.says
    if weighing.estimator.speed_alone:
        says = "It shows how well the speed model predicts the next sample; no force was measured."
    return Panel(
        title=f"The residual should not depend on {against.name}",
        caption=f"{says} Bars are one standard deviation of the samples of a bin.",
        figure=figure,
    )


def _means(x: Floats, y: Floats, width: float, against: _Against) -> tuple[Floats, Floats, Floats]:
    """Bins as of `binned`, with a gap where bins are missing, and closed where the axis is round.

    Returns
    -------
    centres, mean, std : (k,) NaN in gaps
    """
    if against.around:
        x = np.mod(x + 0.5 * width, against.around) - 0.5 * width
    found = binned(x, y, width, against.centred)
    centres, mean, std = found
    if against.around and centres.size and centres[0] == 0.0:
        centres = np.append(centres, against.around)
        mean, std = np.append(mean, mean[0]), np.append(std, std[0])
    gaps = np.flatnonzero(np.diff(centres) > 1.5 * width) + 1
    return (
        np.insert(centres, gaps, centres[gaps] - 0.5 * width),
        np.insert(mean, gaps, np.nan),
        np.insert(std, gaps, np.nan),
    )


def bin_width(x: Floats, widths: Sequence[float]) -> float:
    """Return the first width that cuts nearly all of ``x`` into at most `BINS` bins."""
    low, high = np.percentile(x, [0.5, 99.5])
    return next((w for w in widths if (high - low) / w <= BINS), widths[-1])


def binned(
    x: Floats, y: Floats, width: float, centred: bool = False
) -> tuple[Floats, Floats, Floats]:
    """Mean and standard deviation of ``y`` in bins of ``x``.

    Parameters
    ----------
    x, y : (n,)
    width : of a bin, in the unit of x
    centred : bins lie around the multiples of the width, not between them

    Returns
    -------
    centres, mean, std : (k,) of bins of at least `FEWEST_SAMPLES` samples and `SMALLEST` of all
    """
    number = np.floor(x / width + (0.5 if centred else 0.0)).astype(np.int64)
    bins, where = np.unique(number, return_inverse=True)
    count = np.bincount(where, minlength=bins.size)
    mean = np.bincount(where, y, bins.size) / np.maximum(count, 1)
    square = np.bincount(where, (y - mean[where]) ** 2, bins.size)
    full = count >= max(FEWEST_SAMPLES, SMALLEST * x.size)
    std = np.sqrt(square[full] / (count[full] - 1))
    centres = (bins[full] + (0.0 if centred else 0.5)) * width
    return np.asarray(centres), np.asarray(mean[full]), np.asarray(std)


def _rows(result: MassTrack, against: _Against) -> tuple[Floats, Bools]:
    """Values to draw against, and the rows that have both."""
    x = against.values(result.balance.table)
    return x, np.asarray(result.used & np.isfinite(result.residual) & np.isfinite(x))
