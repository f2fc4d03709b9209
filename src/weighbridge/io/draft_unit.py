"""The unit of a speed that a log does not state, judged by its values and by what moves with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from weighbridge.io.columns import suffixes_of, unit_suffix
from weighbridge.io.draft_column import Columns, changed
from weighbridge.io.naming import unit_of
from weighbridge.io.way import way_ratio
from weighbridge.signals import QUANTITIES, UNITS, Floats, to_si

SPEEDS: Final = ("kmh", "mph", "mps", "kn")
"""Units in which loggers write speeds."""

NEAR: Final = 0.08
"""A ratio of two speeds is that of two units within this part [-]: indicated speeds read up to a
tenth too much, satellites miss the peaks."""

SLOWEST: Final = 3.0
"""Slower, nothing is compared: gears and clutches hide how engine and vehicle go together [m/s]."""

_WHOLE: Final = 0.1
"""Part of a step by which a rounded value may miss a whole number of them [-]."""

_FEWEST: Final = 10
"""Different values that show a step."""

_PART: Final = 0.95
"""Part of them that lie on it [-]."""

VACUUM: Final = 8_000.0
"""Pressure in a manifold, at least: engines pull down to some 20 kPa [Pa]."""

_BEYOND: Final = 0.01
"""Part of the values that may be impossible in a unit: sensors fail now and then [-]."""

_FAST: Final = 10.0
"""Faster, a vehicle is in one of its highest gears now and then [m/s]."""

_TURNS_PER_METRE: Final = 38.0
"""Engine speed over vehicle speed in the highest gears: trucks have 50 rpm and more to 1 m/s, and
cars with a motor and one gear 30 rad/s and less [rpm/(m/s)] or [rad/m]."""

_TOP: Final = 60.0
"""Speed of a vehicle at most, as `plausible_unit` has it [m/s]."""

_HARDEST: Final = 0.99
"""Part of the changes of speed that are smaller than the hardest braking [-]."""

_GENTLE: Final = 0.45
"""Deceleration of a stop at least, in the hardest of a drive: trucks reach 0.8 [m/s^2]."""

WHILE: Final = 3.0
"""Time over which a speed changes by more than its steps [s]."""

TOGETHER: Final = 0.6
"""Correlation of what goes together, at least: grade is in an acceleration and not in the change of
speed, gears are changed, in overrun little air flows, and a battery has a resistance [-]."""

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

    def rising(self) -> tuple[Floats, Floats]:
        """Return the instants of known values in their order, and these values; in SI of a unit."""
        there = np.isfinite(self.time) & np.isfinite(self.values)
        order = np.argsort(self.time[there], kind="stable")
        values = self.values[there][order]
        return self.time[there][order], to_si(values, self.unit) if self.unit else values

    def at(self, time: Floats) -> Floats:
        """Return these values at other instants; NaN outside."""
        x, y = self.rising()
        if x.size < 2:
            return np.full(time.size, np.nan)
        return np.asarray(np.interp(time, x, y, left=np.nan, right=np.nan))


Reported: TypeAlias = Mapping[str, Values]
"""What a log holds in numbers, by its names; columns that are nothing to a drive too."""


def unit_in_name(name: str, stated: str | None) -> str:
    """Suffix of the unit that a log states of a column; empty for none."""
    suffix = unit_of(name)[0] or (unit_suffix(stated) if stated else None) or stated or ""
    return suffix if suffix in UNITS else ""


def with_judged_units(columns: Columns, reported: Reported) -> Columns:
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
    return _with_judged_turns(_with_judged_accelerations(tuple(judged), reported), reported)


def _with_judged_turns(columns: Columns, reported: Reported) -> Columns:
    """Give an engine's speed without a stated unit the one that the vehicle's speed shows."""
    speed = next((c for c in columns if c.quantity in ("vehicle_speed", "gnss_speed")), None)
    engine = next((c for c in columns if c.quantity == "engine_speed" and not c.stated), None)
    if speed is None or engine is None:
        return columns
    way = reported[speed.name]
    v, turns = to_si(way.values, speed.unit), reported[engine.name]
    n = turns.at(way.time)
    fast = np.isfinite(n + v) & (v > _FAST)
    if np.count_nonzero(fast) < _FEWEST or np.quantile(n[fast] / v[fast], 0.1) > _TURNS_PER_METRE:
        return columns
    question = "states no unit; taken as radps, for so few turns to the way are none of an engine"
    return changed(columns, [engine], unit="radps", question=question)


def _with_judged_accelerations(columns: Columns, reported: Reported) -> Columns:
    """Give accelerations without a stated unit the one in which one of them is how the speed
    changes; three axes show theirs by gravity.
    """
    axes = [
        c for c in columns if c.quantity == "longitudinal_accel" or c.quantity.startswith("accel_")
    ]
    speed = next((c for c in columns if c.quantity in ("vehicle_speed", "gnss_speed")), None)
    if speed is None or len(axes) > 2 or any(c.stated for c in axes):
        return columns
    values = replace(reported[speed.name], unit=speed.unit)
    gains = [_gain(values, reported[c.name]) for c in axes]
    gain = max(gains, key=lambda pair: pair[1], default=(0.0, 0.0))
    if gain[1] < TOGETHER:
        return columns
    unit = min(
        (u for u, other in UNITS.items() if other.dimension == "m/s^2"),
        key=lambda u: abs(np.log(abs(gain[0]) * UNITS[u].factor)),
    )
    question = f"states no unit; taken as {unit}, for {speed.name!r} changes by that"
    return changed(columns, axes, unit=unit, question=question)


def _gain(speed: Values, accel: Values) -> tuple[float, float]:
    """Of an acceleration how much there is per change of speed, and how sure that is.

    Returns
    -------
    gain : [unit of the acceleration / (m/s^2)]
    correlation : [-]
    """
    (t, v), (at, a) = speed.rising(), accel.rising()
    if min(t.size, at.size) < _FEWEST:
        return 0.0, 0.0
    whole = np.concatenate([[0.0], np.cumsum(0.5 * (a[1:] + a[:-1]) * np.diff(at))])
    begin = np.arange(max(t[0], at[0]), min(t[-1], at[-1]), WHILE)
    change, sum_ = np.diff(np.interp(begin, t, v)), np.diff(np.interp(begin, at, whole))
    if change.size < _FEWEST or np.ptp(change) == 0.0 or np.ptp(sum_) == 0.0:
        return 0.0, 0.0
    gain = float(np.polyfit(change, sum_, 1)[0])
    return gain, float(abs(np.corrcoef(change, sum_)[0, 1]))


def _judged(
    speed: Values, fixes: Sequence[tuple[Floats, Floats]] | None, others: Reported
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
    unit, why = _by_steps(speed.values)
    return (unit, why) if unit else _by_pace(speed)


def _by_pace(speed: Values) -> tuple[str, str]:
    """Unit of a speed of a vehicle that stops and goes: in another one it would hardly brake."""
    time, values = speed.rising()
    values = np.abs(values)
    if values.size < _FEWEST or values.min() > 1.0 or values.max() > _TOP:
        return "", ""
    begin = np.arange(time[0], time[-1], WHILE)
    changes = np.abs(np.diff(np.interp(begin, time, values))) / WHILE
    if changes.size < _FEWEST or not np.quantile(changes, _HARDEST) > 0.0:
        return "", ""
    hardest = float(np.quantile(changes, _HARDEST))
    slow = hardest * UNITS["kmh"].factor < _GENTLE
    return ("mps", "in km/h it would hardly brake") if slow else ("", "")


def _nearest(factor: float) -> str:
    """Unit of a factor to m/s; empty where none is near."""
    unit = min(SPEEDS, key=lambda u: abs(np.log(max(factor, 1e-9) / UNITS[u].factor)))
    return unit if abs(factor / UNITS[unit].factor - 1.0) < NEAR else ""


def _ratio(speed: Values, other: Values) -> float:
    """What a speed has to be multiplied by to be the other one [m/s]; NaN where they differ."""
    at = other.at(speed.time)
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


def plausible_unit(name: str, quantity: str, values: Floats) -> tuple[str, str]:
    """Unit in which values are those of a drive, the usual one first, and a question.

    The unit is empty where they fit none.
    """
    q = QUANTITIES[quantity]
    high = float(np.percentile(np.abs(values), 99.5))
    if quantity in ("vehicle_speed", "gnss_speed"):
        if "ego" in name.lower():
            return "mps", "states no unit; of names with ego it is mps"
        # Few drives stay below 60 km/h, and none is faster than 60 m/s.
        unit = "kmh" if high > 45.0 or (quantity == "vehicle_speed" and high > 28.0) else "mps"
        return unit, f"states no unit; its highest is {high:.3g}, taken as {unit}"
    if quantity.startswith("gyro_"):
        unit = "degps" if high > 3.0 else "radps"
        return unit, f"states no unit; its highest is {high:.3g}, taken as {unit}"
    if q.suffix == "pct":
        unit = "ratio" if high <= 1.02 else "pct"
        si = to_si(values, unit)
        if np.mean((si < q.low) | (si > q.high)) > _BEYOND:
            return "", f"not taken for {quantity}: its highest is {high:.3g}, and it states no unit"
        return unit, f"states no unit; its highest is {high:.3g}, taken as {unit}"
    usual = [q.suffix, *(s for s in suffixes_of(q) if s != q.suffix)]
    low = VACUUM if quantity == "intake_pressure" else q.low
    for unit in usual:
        si = to_si(values, unit)
        if np.mean((si < low) | (si > q.high)) <= _BEYOND:
            sure = q.suffix in ("deg", "rpm", "v", "a") and unit == q.suffix
            return unit, "" if sure else f"states no unit; taken as {unit}"
    return "", f"not taken for {quantity}: it states no unit, and its values fit none"
