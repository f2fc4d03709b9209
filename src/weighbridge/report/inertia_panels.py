"""Figures and page of sprung mass and inertias."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.estimators import Status
from weighbridge.inertia import AXES, PARTS, UNKNOWN_FORCE_STD, InertiaTrack, SuspensionCheck
from weighbridge.report.answer import Answer, answer_block, grade, no_answer_block
from weighbridge.report.markup import remarks
from weighbridge.report.study import write_study
from weighbridge.report.style import BLUE, GREY, REACH, VERMILLION, Panel, band, blank, dots, line
from weighbridge.report.table import Table
from weighbridge.report.thinning import thin_line
from weighbridge.signals import Floats

if TYPE_CHECKING:
    from weighbridge.results.inertia import InertiaResult

REMEDY: Final[dict[Status, str]] = {
    Status.CONVERGED: "",
    Status.NOT_EXCITED: "Record a minute or more of one load, at 200 Hz, at 20 km/h or more.",
    Status.INCONSISTENT: "Check signs and units of the signals, and springs and dampers of the "
    "vehicle file; the figures below show where they do not fit.",
    Status.MISSING_SIGNALS: "Record suspension travel and rate at four wheels, vertical velocity, "
    "roll rate and pitch rate.",
}
"""What would let a ride without a mass carry one."""

UNITS = ("kg", "kg m²", "kg m²")
VELOCITIES = ("vertical velocity", "roll rate, right side down", "pitch rate, nose up")
VELOCITY_UNITS = ("m/s", "rad/s", "rad/s")

_WIDE = 0.3
"""Half of a 95 % interval that a figure need not show whole [-]."""


def parameter_panels(
    track: InertiaTrack, model_std: Floats, *, truth: Floats | None = None
) -> list[Panel]:
    """Draw each parameter over time with its 95 % interval.

    Parameters
    ----------
    track : of the filter
    model_std : (3,) relative standard deviation beside the filter's [-]
    truth : (n, 3) where it is known
    """
    panels = []
    relative = np.hypot(track.alpha_std / track.alpha, model_std)
    for k, (name, unit) in enumerate(zip(AXES, UNITS, strict=True)):
        values = track.parameters[:, k]
        reach = REACH * relative[:, k]
        low = values / (1.0 + reach)
        high = np.where(reach < 0.9, values / np.maximum(1.0 - reach, 0.1), 10.0 * values)
        x, y, bottom, top = thin_line(track.time, values, low, high)
        figure = blank("time [s]", f"{name} [{unit}]")
        band(figure, x, bottom, top, "95 %")
        line(figure, x, y, "estimated", BLUE)
        if truth is not None:
            tx, ty = thin_line(track.time, truth[:, k])
            line(figure, tx, ty, "true", VERMILLION, dash="dash")
        held = None if truth is None else truth[:, k]
        figure.update_yaxes(range=_seen(values, reach, held), autorange=False)
        panels.append(
            Panel(
                title=f"{name[0].upper()}{name[1:]}",
                caption="As known at each moment, not later. Where the interval is wider than "
                f"± {100.0 * _WIDE:.0f} %, as after the start, it may leave the figure.",
                figure=figure,
            )
        )
    return panels


def _seen(values: Floats, reach: Floats, truth: Floats | None) -> list[float]:
    """Range of an axis that shows a parameter and its interval wherever that is not wide.

    Parameters
    ----------
    values : (n,) of the parameter
    reach : (n,) half its 95 % interval, relative [-]
    truth : (n,) where it is known
    """
    known = reach < _WIDE
    if not known.any():
        known = reach <= np.min(reach)
    low = float(np.min(values[known] / (1.0 + reach[known])))
    high = float(np.max(values[known] * (1.0 + reach[known])))
    if truth is not None:
        low, high = min(low, float(np.min(truth))), max(high, float(np.max(truth)))
    margin = max(0.15 * (high - low), 0.01 * high)
    return [max(low - margin, 0.0), high + margin]


def velocity_panels(
    track: InertiaTrack, beside: Floats, label: str, seconds: float = 5.0
) -> list[Panel]:
    """Draw the first seconds of each velocity beside the measured or the true one.

    Parameters
    ----------
    track : of the filter
    beside : (n, 3) to draw beside
    label : what that is
    seconds : to draw, from a second after the start [s]
    """
    begin = float(track.time[0]) + 1.0
    shown = (track.time >= begin) & (track.time <= begin + seconds)
    panels = []
    for k, (name, unit) in enumerate(zip(VELOCITIES, VELOCITY_UNITS, strict=True)):
        figure = blank("time [s]", f"{name} [{unit}]", height=300)
        x, y = thin_line(track.time[shown], beside[shown, k])
        line(figure, x, y, label, GREY)
        x, y = thin_line(track.time[shown], track.velocity[shown, k])
        line(figure, x, y, "estimated", BLUE, dash="dot")
        panels.append(Panel(title=f"{name[0].upper()}{name[1:]}", figure=figure))
    return panels


def innovation_panel(track: InertiaTrack) -> Panel:
    """Draw the innovations against the size they should have, over seconds."""
    title = "Innovations"
    ratio = track.innovation**2 / track.innovation_var
    if not np.isfinite(ratio).any():
        return Panel(title=title, absent="this filter keeps no innovations")
    second = np.floor(track.time - track.time[0]).astype(np.int64)
    whole = int(second[-1])
    figure = blank("time [s]", "RMS over expected [-]", height=300)
    colours = (BLUE, VERMILLION, GREY)
    for k, name in enumerate(("heave", "roll", "pitch")):
        there = np.isfinite(ratio[:, k])
        count = np.bincount(second[there], minlength=int(second[-1]) + 1)
        total = np.bincount(second[there], weights=ratio[there, k], minlength=count.size)
        with np.errstate(invalid="ignore", divide="ignore"):
            size = np.sqrt(total / count)
        # The last second is not whole.
        line(figure, np.arange(whole) + track.time[0] + 0.5, size[:whole], name, colours[k])
    figure.add_hline(y=1.0, line={"color": GREY, "width": 1, "dash": "dot"})
    return Panel(
        title=title,
        caption="Measured less predicted velocity, each second. One where model and noise of the "
        "vehicle file hold.",
        figure=figure,
    )


def suspension_panel(check: SuspensionCheck | None) -> Panel:
    """Draw springs and dampers against the vehicle file."""
    title = "Springs and dampers"
    if check is None:
        return Panel(title=title, absent="the ride is too short to separate springs and dampers")
    figure = blank("over the vehicle file's value [-]", "", height=360)
    dots(
        figure, check.factor, list(PARTS), "found", BLUE, size=8.0, opacity=1.0,
        error_x={"type": "data", "array": REACH * check.std, "color": BLUE},
    )  # fmt: skip
    figure.add_vline(x=1.0, line={"color": GREY, "width": 1, "dash": "dot"})
    figure.update_yaxes(autorange="reversed")
    return Panel(
        title=title,
        caption="Each against the others, with 95 % intervals. What all have in common is in the "
        "mass and cannot be seen.",
        figure=figure,
    )


def write_inertia(result: InertiaResult, path: Path) -> None:
    """Write the page of one drive.

    Raises
    ------
    ConfigError
        The file cannot be written.
    """
    panels: Sequence[Panel] = ()
    if result.track is not None:
        measured = np.column_stack(
            [
                result.drive.signals[name].at(result.track.time)
                for name in ("vertical_velocity", "roll_rate", "pitch_rate")
            ]
        )
        panels = (
            *parameter_panels(result.track, result.model_std),
            innovation_panel(result.track),
            *velocity_panels(result.track, measured, "measured"),
            suspension_panel(result.suspension),
        )
    title = f"weighbridge: ride of {result.drive.name}"
    answer = _answer(result) + remarks(result.warnings)
    write_study(title, _tables(result), panels, path, answer=answer)


def _answer(result: InertiaResult) -> str:
    """Say first what the vehicle weighs, or why that is not known."""
    if result.status is not Status.CONVERGED or not math.isfinite(result.mass):
        return no_answer_block(result.status, result.reason, REMEDY[result.status])
    return answer_block(
        Answer(
            mass=result.mass,
            interval=result.mass_interval(),
            most=result.mass_interval(0.9)[1],
            tare=result.vehicle.tare,
            gross=result.vehicle.gross,
            payload=result.payload_interval(),
            file=_file_worth(result),
            advice=_advice(result),
        )
    )


def _file_worth(result: InertiaResult) -> str:
    """Say what the vehicle file leaves uncertain of the sprung mass."""
    std = result.ride.force_std
    if std is None:
        return (
            "It does not say how sure its springs and dampers are: "
            f"± {100.0 * REACH * UNKNOWN_FORCE_STD:.0f} % is taken."
        )
    return f"Its springs and dampers leave ± {100.0 * REACH * std:.1f} % of the sprung mass."


def _advice(result: InertiaResult) -> str:
    """Say what would make the mass surer: the vehicle file, or the ride."""
    low, high = result.mass_interval()
    if grade(result.mass, 0.5 * (high - low)) == "fine":
        return "Nothing is needed: the mass is known to within 2 %."
    by_model = float(result.model_std[0])
    whole = float(result.stds[0] / result.values[0])
    if 2.0 * by_model**2 < whole**2:
        return "Record longer, with one load: most of the interval is left by this ride."
    if result.ride.force_std is None:
        return (
            "Weigh the vehicle once, correct its springs by that, and state force_std: most of the "
            "interval is left by springs and dampers."
        )
    return "Measure springs and dampers better: most of the interval is left by them."


def _tables(result: InertiaResult) -> list[Table]:
    if result.status is not Status.CONVERGED:
        return []
    low, high = result.intervals()
    ride = result.ride
    rows = [
        (f"{AXES[k]} [{UNITS[k]}]", _plain(result.values[k]), _between(low[k], high[k]),
         _plain(start))
        for k, start in enumerate((ride.sprung_mass, ride.roll_inertia, ride.pitch_inertia))
    ]  # fmt: skip
    front, rear = result.axle_loads
    of_front, of_rear = result.axle_load_intervals()
    rows += [
        ("mass [kg]", _plain(result.mass), _between(*result.mass_interval()),
         _plain(result.vehicle.tare) if result.vehicle.tare else ""),
        ("front axle load [kg]", _plain(front), _between(*of_front), ""),
        ("rear axle load [kg]", _plain(rear), _between(*of_rear), ""),
    ]  # fmt: skip
    if math.isfinite(result.payload):
        bounds = _between(*result.payload_interval())
        rows.append(("payload [kg]", _plain(result.payload), bounds, ""))
    tables = [
        Table(
            "At the end of the drive",
            ("", "found", "95 % interval", "vehicle file"),
            tuple(rows),
        )
    ]
    if len(result.segments) > 1:
        tables.append(
            Table(
                "Between changes of load",
                ("from s to s", "sprung mass kg", "roll inertia kg m²", "pitch inertia kg m²"),
                tuple(
                    (
                        f"{s.start:.1f} to {s.end:.1f}",
                        *(
                            f"{v:.0f} ± {REACH * d:.0f}"
                            for v, d in zip(s.values, s.stds, strict=True)
                        ),
                    )
                    for s in result.segments
                ),
            )
        )
    return tables


def _plain(value: float) -> str:
    return f"{value:.0f}" if math.isfinite(value) else "unknown"


def _between(low: float, high: float) -> str:
    return f"{low:.0f} to {high:.0f}".replace("-", "−") if math.isfinite(high) else ""
