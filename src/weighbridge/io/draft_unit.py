"""The unit of a speed that a log does not state, judged by its values and by what moves with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.io.columns import unit_suffix
from weighbridge.io.draft_column import DraftColumn
from weighbridge.io.naming import unit_of
from weighbridge.io.way import way_ratio
from weighbridge.signals import Floats
from weighbridge.signals.units import UNITS, to_si

SPEEDS: Final = ("kmh", "mph", "mps", "kn")
"""Units in which loggers write speeds."""

NEAR: Final = 0.08
"""A ratio of two speeds is that of two units within this part [-]: indicated speeds read up to a
tenth too much, satellites miss the peaks."""

SLOWEST: Final = 3.0
"""Slower in the median, or in the highest, nothing is compared [m/s]."""

_WHOLE: Final = 0.1
"""Part of a step by which a rounded value may miss a whole number of them [-]."""

_FEWEST: Final = 10
"""Different values that show a step."""

_PART: Final = 0.95
"""Part of them that lie on it [-]."""

_ALIKE: Final = 0.98
"""Correlation of two speeds of one vehicle, at least [-]."""


@dataclass(frozen=True, slots=True)
class Values:
    """A column of a log with its clock.

    Attributes
    ----------
    time : (n,) [s]
    values : (n,) as they stand in the log
    unit : suffix of its unit; empty where the log states none
    """

    time: Floats
    values: Floats
    unit: str


def unit_in_name(name: str, stated: str | None) -> str:
    """Suffix of the unit that a log states of a column; empty for none."""
    suffix = unit_of(name)[0] or (unit_suffix(stated) if stated else None) or stated or ""
    return suffix if suffix in UNITS else ""


def with_judged_units(
    columns: tuple[DraftColumn, ...], reported: Mapping[str, Values]
) -> tuple[DraftColumn, ...]:
    """Give the speeds without a stated unit the one that their values and others show.

    Parameters
    ----------
    columns : of the log
    reported : what the log holds, by its names; columns that are nothing to a drive too
    """
    by_quantity = {c.quantity: c for c in columns if c.quantity}
    place = tuple(by_quantity.get(q) for q in ("latitude", "longitude"))
    judged = []
    for column in columns:
        if column.quantity in ("vehicle_speed", "gnss_speed") and not column.stated:
            speed = reported[column.name]
            fixes = None
            if place[0] is not None and place[1] is not None:
                fixes = tuple(
                    (reported[c.name].time, to_si(reported[c.name].values, c.unit))
                    for c in place
                    if c
                )
            others = {n: v for n, v in reported.items() if n != column.name and v.unit in SPEEDS}
            unit, why = _judged(speed, fixes, others)
            if unit:
                question = f"states no unit; taken as {unit}, for {why}"
                column = replace(column, unit=unit, question=question)
        judged.append(column)
    return tuple(judged)


def _judged(
    speed: Values, fixes: Sequence[tuple[Floats, Floats]] | None, others: Mapping[str, Values]
) -> tuple[str, str]:
    """Unit of a speed and what shows it; empty where nothing does."""
    if fixes is not None:
        (time, latitude), (_, longitude) = fixes
        ratio = way_ratio(speed.time, speed.values, time, latitude, longitude)
        if unit := _nearest(ratio):
            return unit, "the positions cover that way"
    for name, other in others.items():
        ratio = _ratio(speed, other)
        if unit := _nearest(ratio):
            return unit, f"{name!r} shows that speed"
    return _by_steps(speed.values)


def _nearest(factor: float) -> str:
    """Unit of a factor to m/s; empty where none is near."""
    unit = min(SPEEDS, key=lambda u: abs(np.log(max(factor, 1e-9) / UNITS[u].factor)))
    return unit if abs(factor / UNITS[unit].factor - 1.0) < NEAR else ""


def _ratio(speed: Values, other: Values) -> float:
    """What a speed has to be multiplied by to be the other one [m/s]; NaN where they differ."""
    known = np.isfinite(other.time) & np.isfinite(other.values)
    if np.count_nonzero(known) < _FEWEST:
        return float("nan")
    at = np.interp(speed.time, other.time[known], to_si(other.values[known], other.unit))
    both = np.isfinite(speed.time + speed.values) & (np.abs(speed.values) > 0.0)
    both &= np.abs(at) > SLOWEST
    if np.count_nonzero(both) < _FEWEST or np.ptp(speed.values[both]) == 0.0:
        return float("nan")
    if np.ptp(at[both]) == 0.0 or np.corrcoef(at[both], speed.values[both])[0, 1] < _ALIKE:
        return float("nan")
    return float(np.median(np.abs(at[both] / speed.values[both])))


def _by_steps(values: Floats) -> tuple[str, str]:
    """Unit of a speed that another unit's whole numbers were turned into: 61 km/h are 37.9 mph."""
    kinds = np.unique(np.round(np.abs(values[np.isfinite(values)]), 6))
    kinds = kinds[kinds > 0.0]
    if kinds.size < _FEWEST or np.mean(kinds == np.round(kinds)) > 0.5:
        return "", ""
    for unit in SPEEDS:
        for whole in SPEEDS[:2]:
            if whole == unit:
                continue
            steps = kinds * UNITS[unit].factor / UNITS[whole].factor
            if np.mean(np.abs(steps - np.round(steps)) < _WHOLE) >= _PART:
                return unit, f"its values are whole {whole}"
    return "", ""
