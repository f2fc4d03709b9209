"""What weighed the vehicle: the information about the mass that each part of the drive gave."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from weighbridge.balance import Reason, windows
from weighbridge.balance.table import ForceTable
from weighbridge.estimators import MassTrack
from weighbridge.report.style import (
    AXIS,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    REACH,
    TIME_AXIS,
    VERMILLION,
    Panel,
    Section,
    blank,
    line,
    minutes,
)
from weighbridge.report.table import Table
from weighbridge.report.text import amount
from weighbridge.report.thinning import thin_line
from weighbridge.signals import Bools, Floats, Ints, scalar_from_si, scalar_to_si

if TYPE_CHECKING:
    from weighbridge.results.weighing import MassResult

SPEEDING_UP: Final = 0.15
"""Acceleration that counts as speeding up, and with a minus as slowing down [m/s^2]."""

LAUNCH_SPEED: Final = scalar_to_si(30.0, "kmh")
"""Speeding up below this is a launch [m/s]."""

AFTER_SHIFT: Final = 5.0
"""Speeding up so soon after a change of gear counts as its work [s]."""

STEEP: Final = 0.02
"""Slope that counts as a hill [-]."""

_KILOGRAMS: Final = [n * 10.0**k for k in range(-1, 4) for n in (1, 2, 5)]
"""Ticks of a logarithmic axis."""

BARS: Final = 60
"""Bars of the figure, at most."""


class Manoeuvre(IntEnum):
    """What a window of the drive was; the first that holds."""

    LAUNCH = 0
    AFTER_SHIFT = 1
    ACCELERATION = 2
    SLOWING = 3
    HILL = 4
    CRUISE = 5


class _Shown(NamedTuple):
    """How a manoeuvre is shown: name, definition with ``{launch}``, as a cause, and colour."""

    name: str
    definition: str
    cause: str
    colour: str


_SHOWN: Final[dict[Manoeuvre, _Shown]] = {
    Manoeuvre.LAUNCH: _Shown("launch", "speeding up below {launch}", "launches", VERMILLION),
    Manoeuvre.AFTER_SHIFT: _Shown(
        "after a shift",
        f"speeding up within {AFTER_SHIFT:.0f} s of a change of gear, above {{launch}}",
        "speeding up after shifts",
        PURPLE,
    ),
    Manoeuvre.ACCELERATION: _Shown(
        "acceleration", "speeding up otherwise", "speeding up on the move", ORANGE
    ),
    Manoeuvre.SLOWING: _Shown("slowing", "slowing down without the brakes", "slowing down", BLUE),
    Manoeuvre.HILL: _Shown(
        "hill", "a slope of 2 % or more, up or down, at an even speed", "hills", GREEN
    ),
    Manoeuvre.CRUISE: _Shown("cruise", "an even speed on the flat", "cruising", GREY),
}


@dataclass(frozen=True, slots=True)
class Gained:
    """Information about the mass, one row per window.

    Attributes
    ----------
    time : (m,) middle of the window [s]
    duration : (m,) of its rows [s]
    gain : (m,) information gained, over all that was gained [-]; sums to one
    manoeuvre : (m,) `Manoeuvre`
    """

    time: Floats
    duration: Floats
    gain: Floats
    manoeuvre: Ints

    def shares(self, values: Floats) -> Floats:
        """Sum values by `Manoeuvre` (6,)."""
        return np.asarray(np.bincount(self.manoeuvre, values, len(Manoeuvre)), dtype=np.float64)


def information_gained(result: MassTrack) -> Gained | None:
    """Attribute the information about the mass to the windows that gave it.

    Information is one over the variance of the mass, as the noise of the
    drive alone leaves it. After a stop it dips, for the load may have changed,
    and comes back while the next windows show that it has not. So a window
    counts with its part of what was known more than ever before under that
    load, not with what it only brought back.

    Returns
    -------
    None where the method does not keep it.
    """
    slow = result.slow_errors
    if slow is None or slow.time.size == 0:
        return None
    table = result.balance.table
    cut = windows(table.time, windowed_rows(result))
    starts = np.array([s.start for s in result.segments[1:]])
    load = np.searchsorted(starts, slow.time, side="right")
    gain = np.zeros(slow.time.size)
    for k in np.unique(load):
        rows = load == k
        gain[rows] = _net_gain(1.0 / slow.mass_bound[rows] ** 2)
    period = float(np.median(np.diff(table.time)))
    return Gained(
        time=slow.time,
        duration=np.asarray(cut.count * period, dtype=np.float64),
        gain=gain / gain.sum(),
        manoeuvre=manoeuvres(
            slow.time,
            cut.mean(table.speed),
            cut.mean(table.accel),
            cut.mean(np.tan(table.grade)),
            shift_times(table),
        ),
    )


def windowed_rows(result: MassTrack) -> Bools:
    """Rows that the joint estimator cut into windows: taken, too short a stretch, or a bad fit."""
    kept = np.isin(result.row_reason, (Reason.USED, Reason.TOO_SHORT, Reason.BAD_FIT))
    return np.asarray(result.balance.table.usable & kept)


def manoeuvres(time: Floats, speed: Floats, accel: Floats, slope: Floats, shifts: Floats) -> Ints:
    """Name what each window was.

    Parameters
    ----------
    time, speed, accel : (m,) [s], [m/s], [m/s^2]
    slope : (m,) of the road [-]
    shifts : (k,) instants of changes of gear, rising [s]
    """
    before: Floats = np.concatenate(([-np.inf], shifts))[
        np.searchsorted(shifts, time, side="right")
    ]
    faster = accel > SPEEDING_UP
    return np.select(
        [
            faster & (speed < LAUNCH_SPEED),
            faster & (time - before < AFTER_SHIFT),
            faster,
            accel < -SPEEDING_UP,
            np.abs(slope) >= STEEP,
        ],
        [
            Manoeuvre.LAUNCH,
            Manoeuvre.AFTER_SHIFT,
            Manoeuvre.ACCELERATION,
            Manoeuvre.SLOWING,
            Manoeuvre.HILL,
        ],
        Manoeuvre.CRUISE,
    )


def shift_times(table: ForceTable) -> Floats:
    """Instants at which another gear than the last known one is in (k,) [s]."""
    known = np.flatnonzero(table.gear > 0)
    return np.asarray(table.time[known[1:]][np.diff(table.gear[known]) != 0])


def information_section(weighing: MassResult) -> Section:
    """Return which part of the drive showed the mass."""
    key, title = "information", "What weighed this vehicle"
    result = weighing.result
    gained = information_gained(result) if result is not None else None
    if result is None or gained is None:
        return Section(
            key=key,
            title=title,
            absent="what weighed this vehicle and the slow errors: only the method joint keeps "
            "account of them."
            if result is not None
            else "",
        )
    share = gained.shares(gained.gain)
    time = gained.shares(gained.duration)
    launch = amount(scalar_from_si(LAUNCH_SPEED, "kmh"), "km/h")
    rows = tuple(
        (
            _SHOWN[m].name,
            f"{100.0 * share[m]:.0f} %",
            f"{100.0 * time[m] / time.sum():.0f} %",
            f"{share[m] / (time[m] / time.sum()):.1f}",
            f"{scalar_from_si(float(time[m]), 'min'):.1f}",
            _SHOWN[m].definition.format(launch=launch),
        )
        for m in sorted(Manoeuvre, key=lambda m: -share[m])
        if time[m] > 0.0
    )
    return Section(
        key=key,
        title=title,
        lead="The shares of the information show which driving determined the mass. "
        "The next drive needs more of the kinds whose share is larger than their share of time.",
        table=Table(
            "",
            ("", "information", "time", "information over time", "minutes", "what counts as such"),
            rows,
        ),
        panels=(gain_panel(weighing, result, gained),),
    )


def gain_panel(weighing: MassResult, result: MassTrack, gained: Gained) -> Panel:
    """Information gained over time by manoeuvre, under what was known of the mass."""
    time = minutes(weighing.drive, gained.time)
    # Bars of whole minutes, so that the axis can be read.
    span = float(time[-1])
    width = next((w for w in (0.25, 0.5, 1.0, 2.0, 5.0) if span / w <= BARS), 10.0)
    bar = (time // width).astype(np.int64)
    count = int(bar[-1]) + 1
    figure = blank(TIME_AXIS, "± [kg]", height=480, barmode="stack", bargap=0.08)
    figure.update_layout(
        xaxis_anchor="y2",
        yaxis_domain=[0.58, 1.0],
        yaxis_type="log",
        yaxis_tickvals=_KILOGRAMS,
        yaxis2={
            **AXIS,
            "domain": [0.0, 0.5],
            "anchor": "x",
            "title": {"text": "Information [%]"},
        },
    )
    assert result.slow_errors is not None
    half = REACH * result.slow_errors.mass_bound
    x, bound = thin_line(time, half)
    line(figure, x, bound, "95 % interval of the mass, half", BLUE, meta={"short": "± mass"})
    figure.update_layout(yaxis_range=_decades(half))
    for m in Manoeuvre:
        rows = gained.manoeuvre == m
        if rows.any():
            height = 100.0 * np.bincount(bar[rows], gained.gain[rows], count)
            figure.add_bar(
                x=(np.arange(count) + 0.5) * width,
                y=height.astype(np.float32),
                width=width,
                yaxis="y2",
                name=_SHOWN[m].name,
                marker={"color": _SHOWN[m].colour, "line": {"width": 0}},
            )
    best = Manoeuvre(int(np.argmax(gained.shares(gained.gain))))
    part = gained.shares(gained.gain)[best]
    return Panel(
        title=f"Most of what is known, {100.0 * part:.0f} %, came from {_SHOWN[best].cause}",
        caption="Below, the information gained in each "
        + (f"{width:g} minutes" if width > 1.0 else f"{60.0 * width:.0f} s")
        + ", of all that was gained; above, how far the noise of the drive let the mass be "
        "known by then. It rises after stops, where the load may have changed; what only wins that "
        "back is not counted.",
        figure=figure,
        wide=True,
    )


def _net_gain(information: Floats) -> Floats:
    """Share what was known more than ever before among the windows that led there.

    Between one record and the next, each window counts by what it raised the
    information, all together as much as the record rose.
    """
    best = np.maximum.accumulate(information)
    record = np.diff(best, prepend=0.0)
    raised = np.maximum(np.diff(information, prepend=0.0), 0.0)
    # A window belongs to the record it led to: the next one, or that which it set itself.
    leads_to = np.concatenate(([0], np.cumsum(record > 0.0)[:-1]))
    rise = np.bincount(leads_to, record)
    total = np.bincount(leads_to, raised)
    part = np.divide(rise, total, out=np.zeros_like(rise), where=total > 0.0)
    return np.asarray(raised * part[leads_to])


def _decades(values: Floats) -> list[float]:
    """Range of a logarithmic axis that leaves out the first leap."""
    low, high = np.percentile(values, [0.0, 98.0])
    return [float(np.log10(0.8 * low)), float(np.log10(1.3 * high))]
