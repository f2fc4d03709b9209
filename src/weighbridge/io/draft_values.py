"""What the columns of a log are, judged by their values beside their names.

A name may fit where the values do not: the battery of 12 V is no traction battery, and a pressure
over that of the air is none of the manifold. And a unit with values that move as a vehicle's do
shows what a name does not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.io.draft_column import Columns, DraftColumn, measured
from weighbridge.io.draft_time import FASTEST
from weighbridge.io.draft_unit import (
    SLOWEST,
    TOGETHER,
    VACUUM,
    WHILE,
    Reported,
    Values,
    plausible_unit,
    with_judged_units,
)
from weighbridge.io.naming import bare_quantities, means_another, words_of
from weighbridge.signals import QUANTITIES, UNITS, to_si

ON_BOARD: Final = 32.0
"""Battery that feeds control units, at most: those of trucks are charged at 29 V, and batteries
that drive anything have 36 V or more [V]."""

_BELOW: Final = 0.2
"""Part of the values of a pressure that may lie below: sensors fail now and then [-]."""

_DEVICE: Final = 6.0
"""Battery of a telephone or a tracker, at most: those of motorcycles have 6 V or 12 V [V]."""

FOUND: Final = ("vehicle_speed", "engine_speed", "mass_air_flow")
"""Quantities that a unit and the values may show without a name."""

_DRIVEN: Final = frozenset(("engine_torque", "engine_torque_fraction", "engine_power"))
"""Quantities that change while a vehicle drives."""

ACCEL: Final = ("accel_x", "accel_y", "accel_z")

_NEAR_GRAVITY: Final = 0.15
"""Part by which the size of an acceleration may differ from gravity in the median [-]."""

_SWITCHES: Final = frozenset(("brake_switch", "clutch_switch", "trailer_connected"))

_STATES: Final = 4
"""Values of a switch, at most: J1939 has off, on, error and not available."""

_MASS_WINDOW: Final = 60.0
"""Time in which a vehicle's own estimate of its mass mostly stays: loads change at stops [s]."""

_MASS_STAYS: Final = 1.1
"""Highest over lowest value of such an estimate in that time, at most in half of the times [-]:
steps of 200 kg, as some cars have, are 12 % of 1700 kg and are rare."""

_DROPPED: Final = 0.02
"""Part of a battery's voltages that may be lower: contactors open [-]."""

_EMPTY: Final = 0.5
"""Voltage of an empty battery under load over the usual one, at least [-]."""

_BRAKED: Final = 0.3
"""Deceleration that is none of a coasting vehicle [m/s^2]."""

_FEWEST: Final = 20
"""Rows in which something is to be seen."""

_TURNS: Final = 50.0
"""An engine turns faster while it drives the vehicle [rad/s]."""

_WINDOW: Final = 8.0
"""Time in which a vehicle mostly stays in one gear [s]."""

_ROWS: Final = 6
"""Rows in such a time, at least."""

_WINDOWS: Final = 4
"""Such times in which the speed changes, at least."""

_CHANGES: Final = 0.1
"""Change of a speed over its mean by which something is to be seen [-]."""

_STEADY: Final = 0.02
"""Change of a speed over that of all rows which is no change [-]."""

_SLOWEST: Final = 0.02
"""Mean size of its acceleration in either half of a drive, at least [m/s^2]."""

_SETTLED: Final = 0.25
"""Range of an average in the second half of a drive over that in all of it, at most [-]."""

_TOP: Final = 95.0
"""Speed of a road vehicle, at most [m/s]."""


def judged(columns: Columns, reported: Reported) -> Columns:
    """Judge columns by their values: what they are, what names do not show, and units of speeds.

    Parameters
    ----------
    columns : of one log
    reported : what the log holds in numbers, by its names
    """
    columns = tuple(_without_gauge(c, reported) for c in _on_board(columns))
    columns = _without_constants(_without_levels(columns, reported))
    columns = tuple(_without_set_mass(c, columns, reported) for c in columns)
    columns = _with_gravity(columns, reported)
    for quantity, fits in (
        *zip(FOUND, (_moves, _turns, _breathes), strict=True),
        ("battery_voltage", _feeds),
        ("battery_current", _sags),
        ("brake_switch", _brakes),
    ):
        columns = _found_by_values(columns, reported, quantity, fits)
    return with_judged_units(columns, reported)


def _on_board(columns: Columns) -> Columns:
    """Take a battery that feeds control units for what it is, and its current for nothing."""
    volts = {
        c.name: c.usual * UNITS[c.unit].factor
        for c in columns
        if c.quantity in ("battery_voltage", "module_voltage") and c.unit
    }
    device = {name for name, usual in volts.items() if usual < _DEVICE}
    columns = tuple(
        _nothing(c, f"reads {c.usual:.3g} {c.unit}, as the battery of a device")
        if c.name in device
        else c
        for c in columns
    )
    named = {c.name for c in columns if c.quantity == "battery_voltage"}
    low = {name for name in named if volts[name] < ON_BOARD}
    if not low and not (device and not named):
        return columns
    taken = any(c.quantity == "module_voltage" for c in columns)
    found = []
    for c in columns:
        if c.name in low and not taken:
            found.append(replace(c, quantity="module_voltage", unsure=False))
        elif c.name in low:
            found.append(_nothing(c, f"reads {c.usual:.3g} {c.unit}: no traction battery"))
        elif c.quantity == "battery_current":
            found.append(_nothing(c, f"is of a battery of less than {ON_BOARD:.0f} V"))
        else:
            found.append(c)
    return tuple(found)


def _without_gauge(column: DraftColumn, reported: Reported) -> DraftColumn:
    """Take no pressure over that of the air, and no number, for the pressure of the manifold."""
    if column.quantity != "intake_pressure" or column.name not in reported:
        return column
    values = reported[column.name].values
    values = values[np.isfinite(values)]
    if not column.stated and values.size >= _FEWEST and np.ptp(values) == 0.0:
        return _nothing(column, "states no unit and never changes, as the number of a map")
    below = to_si(values, column.unit) < VACUUM
    if not below.size or np.mean(below) <= _BELOW:
        return column
    return _nothing(column, f"goes below {VACUUM / 1000.0:.0f} kPa, to which no engine pulls down")


def _without_levels(columns: Columns, reported: Reported) -> Columns:
    """Take no pressure and no position of a pedal for its switch."""
    found = []
    for c in columns:
        if c.quantity in _SWITCHES and c.name in reported:
            states = np.unique(reported[c.name].values[np.isfinite(reported[c.name].values)])
            if states.size > _STATES or states.min() < 0.0 or states.max() >= _STATES:
                c = _nothing(c, "has more values than a switch")
        found.append(c)
    return tuple(found)


def _with_gravity(columns: Columns, reported: Reported) -> Columns:
    """Take three columns that gravity is in for a sensor's: ROS calls them linear, others G-X."""
    axes = [
        next((c for c in columns if not c.quantity and q in bare_quantities(c.name)), None)
        for q in ACCEL
    ]
    if any(c is None for c in axes) or any(c.quantity in ACCEL for c in columns):
        return columns
    three = {c.name: q for c, q in zip(axes, ACCEL, strict=True) if c is not None}
    values = {name: reported[name] for name in three if name in reported}
    # One that is called linear reads 1 m/s^2 without gravity.
    linear = any("linear" in words_of(name) for name in three)
    units = ("mps2",) if linear else ("g", "mps2", "mg")
    if len(values) < len(ACCEL) or any(v.unit not in ("", *units) for v in values.values()):
        return columns
    size = float(np.nanmedian(np.linalg.norm([v.values for v in values.values()], axis=0)))
    near = [u for u in units if abs(size * UNITS[u].factor / GRAVITY - 1.0) < _NEAR_GRAVITY]
    if not near:
        return columns
    return tuple(
        _taken(c, three[c.name], replace(values[c.name], unit=near[0]), "has gravity in it")
        if c.name in three
        else c
        for c in columns
    )


def _without_constants(columns: Columns) -> Columns:
    """Take no constant, such as an engine's rated power, for what changes in a drive."""
    drives = any(
        c.quantity in ("vehicle_speed", "gnss_speed")
        and (c.high - c.low) * UNITS[c.unit].factor > SLOWEST
        for c in columns
    )
    return tuple(
        _nothing(c, "hardly changes while the vehicle drives")
        if drives and c.quantity in _DRIVEN and c.low >= _EMPTY * c.high and c.count >= _FEWEST
        else c
        for c in columns
    )


def _without_set_mass(column: DraftColumn, columns: Columns, reported: Reported) -> DraftColumn:
    """Take no set-point, and nothing that changes as the drive goes, for the maker's mass."""
    if column.quantity != "maker_mass" or column.name not in reported:
        return column
    values = reported[column.name]
    time, mass = values.time, to_si(values.values, column.unit)
    quantity = QUANTITIES["maker_mass"]
    there = np.isfinite(time) & (mass >= quantity.low) & (mass <= quantity.high)
    speed = next((c for c in columns if c.quantity in ("vehicle_speed", "gnss_speed")), None)
    if speed is not None:
        with np.errstate(invalid="ignore"):
            there &= replace(reported[speed.name], unit=speed.unit).at(time) > SLOWEST
    time, mass = time[there], mass[there]
    if time.size < _FEWEST:
        return _nothing(column, "shows no mass of a vehicle while it moves")
    if np.ptp(mass) == 0.0:
        return _nothing(column, "never changes, as a mass that was set")
    window = np.floor(time / _MASS_WINDOW)
    starts = np.flatnonzero(np.diff(window, prepend=-np.inf))
    spread = np.maximum.reduceat(mass, starts) / np.minimum.reduceat(mass, starts)
    if float(np.median(spread)) > _MASS_STAYS:
        return _nothing(column, "changes while the vehicle drives, as no load does")
    return column


def _nothing(column: DraftColumn, why: str) -> DraftColumn:
    """Take a column for nothing, and say why."""
    question = f"not taken for {column.quantity}: it {why}"
    return replace(column, quantity="", unit="", stated=False, question=question, unsure=False)


def _found_by_values(
    columns: Columns,
    reported: Reported,
    quantity: str,
    fits: Callable[[Values, Reported], bool],
) -> Columns:
    """Take the one column whose values move as a quantity does, by its unit or a name that only
    says in what it is measured.

    Columns that read alike are one: the first is taken.
    """
    taken = {c.quantity for c in columns}
    if quantity in taken or (quantity == "vehicle_speed" and "gnss_speed" in taken):
        return columns
    suffix = QUANTITIES[quantity].suffix
    dimension = UNITS[suffix or "ratio"].dimension
    known = {
        c.quantity: replace(reported[c.name], unit=c.unit)
        for c in columns
        if c.quantity and c.unit and c.name in reported
    }
    fitting: list[tuple[DraftColumn, Values]] = []
    for c in columns:
        if c.quantity or c.name not in reported:
            continue
        values, bare = reported[c.name], quantity in bare_quantities(c.name)
        if not suffix:
            values = replace(values, unit="ratio")
        if bare and suffix and not values.unit and np.any(np.isfinite(values.values)):
            finite = values.values[np.isfinite(values.values)]
            values = replace(values, unit=plausible_unit(c.name, quantity, finite)[0])
        by_unit = values.unit in UNITS and UNITS[values.unit].dimension == dimension
        named = bare or (quantity in FOUND and not means_another(c.name, quantity))
        if by_unit and named and fits(values, known):
            fitting.append((c, values))
    if not fitting or not _alike([values for _, values in fitting]):
        return columns
    taken_for, values = fitting[0]
    found = _taken(taken_for, quantity, values, "its name does not show it, but how it moves does")
    found = replace(found, stated=bool(reported[taken_for.name].unit))
    return tuple(found if c is taken_for else c for c in columns)


def _taken(column: DraftColumn, quantity: str, values: Values, why: str) -> DraftColumn:
    """Take a column that was nothing for a quantity."""
    return replace(
        column,
        quantity=quantity,
        unit=values.unit if QUANTITIES[quantity].suffix else "",
        stated=False,
        question=f"taken for {quantity}: {why}",
        unsure=True,
        **measured(values.values),
    )


def _alike(several: Sequence[Values]) -> bool:
    """Whether columns read alike, but for a delay."""
    first = several[0]
    for other in several[1:]:
        at = other.at(first.time)
        here = to_si(first.values, first.unit)
        both = np.isfinite(here + at)
        if np.count_nonzero(both) < _FEWEST:
            return False
        spread = float(np.ptp(here[both]))
        if float(np.median(np.abs(here[both] - at[both]))) > _STEADY * spread:
            return False
    return True


def _moves(values: Values, known: Reported) -> bool:
    """Whether values change as the speed of a vehicle: often, and no faster than tyres allow."""
    time, speed = values.rising()
    if speed.size < _FEWEST or speed.min() < -1.0 or speed.max() > _TOP or np.ptp(speed) < SLOWEST:
        return False
    swings = []
    for half in np.array_split(np.arange(time.size), 2):
        length = float(time[half[-1]] - time[half[0]])
        swings.append(float(np.sum(np.abs(np.diff(speed[half])))) / length if length > 0.0 else 0.0)
    settled = float(np.ptp(speed[speed.size // 2 :])) < _SETTLED * float(np.ptp(speed))
    # An average settles; a limit or a set-point stands, and jumps.
    return (
        min(swings) > _SLOWEST
        and not settled
        and max(swings) < FASTEST
        and float(np.max(np.abs(np.diff(speed)))) < 0.5 * float(np.ptp(speed))
        and ("engine_speed" not in known or _in_gear(values, known["engine_speed"]))
    )


def _turns(values: Values, known: Reported) -> bool:
    """Whether values turn as an engine does: with the vehicle, in one gear or several."""
    _, turns = values.rising()
    if turns.size < _FEWEST or turns.max() < 2.0 * _TURNS or np.ptp(turns) < _TURNS:
        return False
    speed = known.get("vehicle_speed") or known.get("gnss_speed")
    return speed is not None and _in_gear(speed, values)


def _in_gear(speed: Values, engine: Values) -> bool:
    """Whether engine and vehicle speed rise and fall together, as in a gear."""
    time, v = speed.rising()
    n = engine.at(time)
    moving = np.isfinite(n) & (v > SLOWEST) & (n > _TURNS)
    time, v, n = time[moving], v[moving], n[moving]
    if not time.size:
        return False
    # A window with few rows is joined to the next one.
    edges = np.searchsorted(time, np.arange(time[0], time[-1], _WINDOW))
    together = []
    begin = 0
    for end in edges.tolist():
        if end - begin < _ROWS:
            continue
        a, b = v[begin:end], n[begin:end]
        if np.ptp(a) > _CHANGES * float(a.mean()):
            moves = np.ptp(b) > 0.0
            together.append(float(np.corrcoef(a, b)[0, 1]) if moves else 0.0)
        begin = end
    return len(together) >= _WINDOWS and float(np.median(together)) > TOGETHER


def _breathes(values: Values, known: Reported) -> bool:
    """Whether values go with the engine's speed as the air does that it breathes."""
    engine = known.get("engine_speed")
    if engine is None:
        return False
    time, flow = values.rising()
    n = engine.at(time)
    both = np.isfinite(n)
    q = QUANTITIES["mass_air_flow"]
    if np.count_nonzero(both) < _FEWEST or flow.min() < 0.0 or flow.max() > q.high:
        return False
    if np.ptp(flow[both]) == 0.0 or np.ptp(n[both]) == 0.0:
        return False
    return float(np.corrcoef(flow[both], n[both])[0, 1]) > TOGETHER


def _feeds(values: Values, known: Reported) -> bool:
    """Whether a voltage is that of a battery that drives the vehicle."""
    _, volts = values.rising()
    q = QUANTITIES["battery_voltage"]
    if volts.size < _FEWEST or volts.max() > q.high:
        return False
    lowest, usual = np.quantile(volts, (_DROPPED, 0.5))
    return bool(usual >= ON_BOARD and lowest > _EMPTY * usual)


def _sags(values: Values, known: Reported) -> bool:
    """Whether a battery's voltage falls and rises with a current, by its resistance."""
    battery = known.get("battery_voltage")
    if battery is None:
        return False
    time, volts = battery.rising()
    amps, later = values.at(time), np.searchsorted(time, time + WHILE)
    first = np.flatnonzero(later < time.size)
    changes = [x[later[first]] - x[first] for x in (volts, amps)]
    both = np.isfinite(changes[0] + changes[1])
    a, b = (x[both] for x in changes)
    if a.size < _FEWEST or np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        return False
    return bool(abs(np.corrcoef(a, b)[0, 1]) > TOGETHER)


def _brakes(values: Values, known: Reported) -> bool:
    """Whether the vehicle slows down while a switch is on, and not while it is off."""
    speed = known.get("vehicle_speed") or known.get("gnss_speed")
    states = np.unique(values.values[np.isfinite(values.values)])
    if speed is None or states.size != 2 or states.tolist() != [0.0, 1.0]:
        return False
    time, v = speed.rising()
    later = np.searchsorted(time, time + WHILE)
    first = np.flatnonzero((later < time.size) & (v > SLOWEST))
    slowing = (v[later[first]] - v[first]) / (time[later[first]] - time[first])
    on = values.at(time[first]) > 0.5
    if min(np.count_nonzero(on), np.count_nonzero(~on)) < _FEWEST:
        return False
    return float(np.median(slowing[on])) < -_BRAKED < float(np.median(slowing[~on]))
