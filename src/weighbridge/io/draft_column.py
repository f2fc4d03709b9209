"""A column of a drafted mapping, and what columns of one log report each other's units."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import Any, Final, TypeAlias

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.io.naming import words_of
from weighbridge.io.vocabulary import WORDS
from weighbridge.signals import QUANTITIES, UNITS
from weighbridge.signals.signal import Bools, Floats

PERCENT: Final = (-130.0, 130.0)
"""Values of a torque in percent, at least and at most; J1939 has -125 to 125 %."""

_SPEEDS: Final = {
    "vehicle_speed": "the speed of the wheels, not of satellites (gnss_speed)",
    "gnss_speed": "the speed of satellites, not of the wheels (vehicle_speed)",
}

_NULL_ISLAND: Final = 0.01
"""Positions nearer to 0 are those of a receiver that has none [rad] or [deg]."""


def is_calculated(name: str, quantity: str) -> bool:
    """Whether a name says of an acceleration that it was calculated."""
    accel = quantity == "longitudinal_accel" or quantity.startswith("accel_")
    return accel and bool(WORDS["calculated"] & set(words_of(name)))


@dataclass(frozen=True, slots=True)
class DraftColumn:
    """One column of a log and what it is taken for.

    Attributes
    ----------
    name : as it is in the log
    quantity : canonical name; empty where it is not known or not needed
    unit : suffix; empty for a quantity without one
    stated : whether the log itself states that unit
    low, usual, high : lowest, median and highest value in that unit; NaN where there is none
    count : cells with a number
    question : what is not sure, one sentence; empty where it is
    valid : signal of the same message that says whether it counts; empty for none
    unsure : whether what it is taken for is not sure: its name says more, or fits two quantities
    rows : (n,) which rows of its table have a number; None where it is not known
    rate : values per second, in the median: gaps do not lower it [Hz]; NaN where it is not known
    """

    name: str
    quantity: str
    unit: str
    stated: bool
    low: float = math.nan
    usual: float = math.nan
    high: float = math.nan
    count: int = 0
    question: str = ""
    valid: str = ""
    unsure: bool = False
    rows: Bools | None = field(default=None, compare=False, repr=False)
    rate: float = math.nan


Columns: TypeAlias = tuple[DraftColumn, ...]
"""Of one log."""


def measured(values: Floats) -> dict[str, Any]:
    """Fields of a column that its values show, of which one at least is a number."""
    rows = np.isfinite(values)
    low, usual, high = map(float, np.quantile(values[rows], (0.0, 0.5, 1.0)))
    count = int(np.count_nonzero(rows))
    return {"low": low, "usual": usual, "high": high, "count": count, "rows": rows}


def changed(columns: Columns, those: Collection[DraftColumn], **changes: Any) -> Columns:
    """Columns of one log, of which those have other fields."""
    return tuple(replace(c, **changes) if c in those else c for c in columns)


def usual_rate(time: Floats) -> float:
    """Values per second, in the median [Hz]; NaN where fewer than two instants are known.

    Parameters
    ----------
    time : (n,) of the values; it may begin anew [s]
    """
    steps = np.diff(time[np.isfinite(time)])
    ahead = steps[steps > 0.0]
    # Stamps are rounded: 0.02 s between them is 50 a second.
    return round(1.0 / float(np.median(ahead)), 9) if ahead.size else float("nan")


def checked(columns: Columns) -> Columns:
    """Say what the columns of one log report each other's units."""
    columns = gyro_checked(gravity_checked(position_checked(columns)))
    return speed_checked(retarder_checked(percent_checked(columns)))


def gyro_checked(columns: Columns) -> Columns:
    """Give the axes of a gyroscope one unit: a stated one, else that of the largest values."""
    axes = [c for c in columns if c.quantity.startswith("gyro_")]
    reported = max(axes, key=lambda c: (c.stated, max(abs(c.low), abs(c.high))), default=None)
    if reported is None:
        return columns
    question = f"states no unit; taken as {reported.unit}, as {reported.name!r} is"
    others = [c for c in axes if c is not reported and not c.stated]
    return changed(columns, others, unit=reported.unit, question=question)


def position_checked(columns: Columns) -> Columns:
    """Give both coordinates one unit. They are in radians if they would lie at sea in degrees:
    there is no land within 1.57 degrees of the equator and 3.15 degrees of Greenwich.
    """
    place = {c.quantity: c for c in columns if c.quantity in ("latitude", "longitude")}
    if {c.unit for c in place.values() if not c.stated} == {"dege7", "semicircle"}:
        question = "states no unit; taken as semicircle: 180 degrees are 1.8e9 at most in 1e-7 deg"
        return changed(columns, place.values(), unit="semicircle", question=question)
    sizes = {q: max(abs(c.low), abs(c.high)) for q, c in place.items() if not c.stated}
    if sizes.keys() != {"latitude", "longitude"} or max(sizes.values()) < _NULL_ISLAND:
        return columns
    if sizes["latitude"] > np.pi / 2.0 or sizes["longitude"] > np.pi:
        return columns
    question = "states no unit; taken as rad, for in degrees it would lie at sea"
    return changed(columns, place.values(), unit="rad", question=question)


def speed_checked(columns: Columns) -> Columns:
    """Question whose the one speed of a table of car and position is, if its name does not show."""
    tables = {QUANTITIES[c.quantity].table for c in columns if c.quantity not in ("", *_SPEEDS)}
    if not {"obd", "gnss"} <= tables:
        return columns
    speeds = [c for c in columns if c.quantity in _SPEEDS]
    if len(speeds) != 1 or WORDS["of_a_speed"] & set(words_of(speeds[0].name)):
        return columns
    question = f"taken for {_SPEEDS[speeds[0].quantity]}; its name does not say which"
    questions = [q for q in (speeds[0].question, question) if q]
    return changed(columns, speeds, question="; ".join(questions), unsure=True)


def gravity_checked(columns: Columns) -> Columns:
    """Distinguish m/s^2 from g by gravity where the log states no unit; find it missing."""
    axes = [c for c in columns if c.quantity.startswith("accel_")]
    if len(axes) < 3:
        return columns
    size = float(np.linalg.norm([c.usual * UNITS[c.unit].factor for c in axes if c.stated]))
    question = ""
    unit = axes[0].unit
    if not axes[0].stated:
        read = float(np.linalg.norm([c.usual for c in axes]))
        unit = "g" if 0.7 < read < 1.4 else "mps2"
        size = read * UNITS[unit].factor
        question = f"states no unit; taken as {unit}, for it reads {read:.2g} in the median"
    if size < 0.5 * GRAVITY:
        question = (
            f"reads {size:.2g} m/s^2 in the median: gravity was taken out of it; record the raw "
            "accelerometer"
        )
    return tuple(
        replace(c, unit=unit, question=question or c.question) if c in axes else c for c in columns
    )


def retarder_checked(columns: Columns) -> Columns:
    """Question a retarder's torque that counts braking positive: SPN 520 counts it negative."""
    question = "counts braking positive, SPN 520 negative: add factor = -1, or leave it out"
    those = [c for c in columns if c.quantity == "retarder_torque"]
    positive = [c for c in those if c.low >= 0.0 and c.high > 0.0]
    return changed(columns, positive, question=question)


def percent_checked(columns: Columns) -> Columns:
    """Distinguish a torque in percent from one in N m where the log states no unit of it.

    A reference torque beside it is what it is a part of, and it stays within what percents are.
    """
    torques = [c for c in columns if c.quantity == "engine_torque" and not c.stated]
    known = {c.quantity: c for c in columns}
    reference = known.get("reference_torque")
    if not torques or reference is None or "engine_torque_fraction" in known:
        return columns
    torque = torques[0]
    within = PERCENT[0] <= torque.low and torque.high <= PERCENT[1]
    if not within or not torque.high < reference.low:
        return columns
    unit = "ratio" if max(abs(torque.low), torque.high) <= PERCENT[1] / 100.0 else "pct"
    question = f"states no unit; taken as a part of {reference.name!r}, for it stays within 130 %"
    fraction = "engine_torque_fraction"
    return changed(columns, [torque], quantity=fraction, unit=unit, question=question)
