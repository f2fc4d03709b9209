"""Tables whose clock is off, drifts or jumps against another's, brought back onto one clock."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.limits import FEWEST_PIECES
from weighbridge.messages import phrase
from weighbridge.navigation.aiding import read_fixes, speed_from_fixes
from weighbridge.navigation.clock_lag import (
    Integrated,
    Lags,
    find_lags,
    find_offset,
    locate_step,
    whole_lag,
)
from weighbridge.navigation.frozen import without_frozen
from weighbridge.signals import (
    QUANTITIES,
    Bools,
    ClockShift,
    Drive,
    Floats,
    Problem,
    Signal,
    huber,
    median_of_three,
    median_slope,
    spread,
)
from weighbridge.signals.instants import instant

_LOG = logging.getLogger(__name__)

# Sound clocks of 15 simulated drives of five vehicles stay within 0.08 s of their mean (GNSS within
# 0.15 s) and 10 ppm. 0.15 s over a drive is worth 0.05 to 0.2 % of the mass.
_DRIFT: Final = 0.15
_SURE: Final = 6.0
# Range of the lag over a drive, beyond the scatter of its pieces, that is no sound clock's [s].
_WANDER: Final = 0.3
# Pieces overlap, so that they repeat each other's noise [-].
_OVERLAP: Final = 2.0
# A change from one piece to the next that is a step of the clock [s].
_STEP: Final = 0.4
_MOST_STEPS: Final = 4
# A piece so far off its neighbour holds both sides of a step [s].
_MIXED: Final = 0.12
# Clocks are looked at again once they were moved; so often at most.
_ROUNDS: Final = 4
# Pieces that must show a lag, and lie on what is corrected [-].
_SHOWN: Final = 0.6
_FOLLOWS: Final = 0.9
# How far a piece may lie off what is corrected [s].
_NEAR: Final = 0.25
# A quarter of a piece [s]: the error of its lag per drift.
_BLUR: Final = 45.0
# A sensor's own lateness: speeds are late by this where nothing else is known, and by no more or
# less than that where their clock is right [s]. Beyond, the torque of the same table is as far off,
# and no delay of a calibration.
_USUAL: Final = 0.1
_OWN: Final = (-0.5, 1.5)
# The same of GNSS against the vehicle speed, without an inertial sensor [s]: -0.34 to 0.11 in 21
# undamaged drives of fourteen vehicles (`studies/clocks.md`).
_OWN_OF_GNSS: Final = (-0.8, 0.8)
# Of a clock that was right when the recording began [s].
_BEGUN: Final = (-0.3, 0.8)
# Two tables that drift alike against the third: it is the third whose clock is wrong [s].
_ALIKE: Final = 0.15


@dataclass(frozen=True, slots=True)
class _Path:
    """Lag over time: a line or a broken one, with the steps cut out.

    Attributes
    ----------
    time, lag : (k,) knots [s]; beyond them ``slope`` goes on
    slope : at both ends [-]
    cuts : (start, end) of times in which a step lies [s]
    text : what was found, for the sentence
    """

    time: Floats
    lag: Floats
    slope: float
    cuts: tuple[tuple[float, float], ...]
    text: str

    def at(self, time: Floats) -> Floats:
        """Lag at instants of the table's clock [s]."""
        inner = np.interp(time, self.time, self.lag)
        before = np.minimum(time - self.time[0], 0.0)
        after = np.maximum(time - self.time[-1], 0.0)
        return np.asarray(inner + self.slope * (before + after))


def correct_clocks(drive: Drive) -> Drive:
    """Bring tables back onto the clock of the inertial sensor, or of the bus, where they leave it.

    The lag of vehicle speed and of speed over ground against the accelerometer is found in
    pieces of a few minutes. Where it changes over the drive, by drift, by a step or by rows that
    were lost, the table is moved so that it stays what it was at the beginning; rows about a step
    are left out. Where both drift alike, the inertial sensor is moved. Without one, GNSS is moved
    onto the clock of the vehicle speed. Sound clocks are left as they are, to the last bit.

    Parameters
    ----------
    drive : with a speed, and an accelerometer of three axes or a second speed, else it is returned
        as it is

    Returns
    -------
    Drive
        What was moved is in its ``problems``; serious where the clocks cannot be brought together.
    """
    corrected = _round(drive)
    for _ in range(_ROUNDS - 1):
        if corrected is drive or any(p.serious for p in corrected.problems[len(drive.problems) :]):
            return corrected
        drive, corrected = corrected, _round(corrected)
    if all(corrected.get(name) is drive.get(name) for name in ("vehicle_speed", "accel_x")):
        return corrected
    return corrected.with_problems(_hopeless("obd", phrase("clocks_tried")))


def _round(drive: Drive) -> Drive:
    """Move what is seen to be off; the drive itself where nothing is."""
    axes = [f"accel_{a}" for a in "xyz"]
    unfrozen = without_frozen(drive, axes)
    accel = [s for name in axes if (s := unfrozen.get(name)) is not None and len(s) > 50]
    tables = {"obd": drive.get("vehicle_speed"), "gnss": _gnss_speed(drive)}
    if len(accel) == len(axes):
        other, own, force = "imu", _OWN, Integrated.of(accel)
    else:
        reference = tables.pop("obd")
        if reference is None or len(reference) < 50:
            return drive
        other, own, force = "obd", _OWN_OF_GNSS, Integrated.of_speed(reference)
    found = {}
    for table, speed in tables.items():
        if speed is None or len(speed) < 50:
            continue
        lags = _lags(force, speed)
        path = _judged(lags, table, own)
        # Of 750 sound cuts of 3 to 7 minutes none is moved so; of 500 with GNSS 7 s late 490 are.
        few = lags.lag.size < max(FEWEST_PIECES, _SHOWN * lags.pieces)
        if path is None and table == "gnss" and few:
            lag = whole_lag(force, speed, own)
            if lag is not None:
                path = _Path(speed.time[[0, -1]], np.full(2, lag), 0.0, (), "")
        if isinstance(path, Problem):
            return drive.with_problems(path)
        if path is not None:
            path = _narrowed(path, force, speed)
            found[table] = path
    if len(found) == 2 and _alike(found["obd"], found["gnss"]):
        return _imu_moved(drive, found["obd"])
    for table, path in found.items():
        drive = _table_moved(drive, table, other, path)
    return drive


def _narrowed(path: _Path, force: Integrated, speed: Signal) -> _Path:
    """Cut out no more about each step than is uncertain, and keep both its sides to the edge."""
    time, lag, cuts = path.time, path.lag, []
    for cut in path.cuts:
        sides = (float(lag[time <= cut[0]][-1]), float(lag[time >= cut[1]][0]))
        near = locate_step(force, speed, cut, sides)
        cuts.append(near)
        time, lag = np.append(time, near), np.append(lag, sides)
    time, first = np.unique(time, return_index=True)
    return replace(path, time=time, lag=lag[first], cuts=tuple(cuts))


def _gnss_speed(drive: Drive) -> Signal | None:
    """Speed over ground, else between fixes."""
    speed = drive.get("gnss_speed")
    if speed is not None:
        return speed
    fixes = read_fixes(drive, -np.inf, np.inf)
    return speed_from_fixes(fixes) if fixes is not None and fixes.time.size > 50 else None


def _lags(force: Integrated, speed: Signal) -> Lags:
    """Lags about zero, or about where else the drive fits."""
    lags = find_lags(force, speed)
    if lags.pieces >= FEWEST_PIECES and lags.lag.size < 0.3 * lags.pieces:
        offset = find_offset(force, speed)
        if offset is not None:
            other = find_lags(force, speed, centre=offset)
            if other.lag.size >= _SHOWN * other.pieces:
                return other
    return lags


def _judged(lags: Lags, table: str, own: tuple[float, float]) -> _Path | Problem | None:
    """Say how a table is to be moved, that it cannot be, or None where its clock is sound.

    Parameters
    ----------
    lags, table
    own : lags that a sensor may have itself [s]
    """
    if not lags.lag.size:
        return None
    if lags.lag.size < FEWEST_PIECES:
        return _constant(lags, own)
    time, lag = lags.time, lags.lag
    # By second differences, so that neither drift nor step counts as scatter.
    scatter = max(spread(np.diff(lag, 2)) / np.sqrt(6.0), float(np.median(lags.std)))
    slope, slope_std, fit = _line(time, lag, scatter)
    length = float(time[-1] - time[0])
    drifts = abs(slope) * length > _DRIFT and abs(slope) > _SURE * slope_std
    allowed = _WANDER + 4.0 * scatter
    wanders = float(np.ptp(median_of_three(lag))) > allowed
    apart = not own[0] < float(np.median(lag)) < own[1]
    if not (drifts or wanders or apart):
        return None
    if lags.lag.size < _SHOWN * lags.pieces:
        # What does not fit of the fixes, the filter leaves out.
        return _hopeless(table, phrase("clocks_hidden")) if table == "obd" else None
    # In a piece of a clock that drifts fast the lag is less sure; the next round sees to the rest.
    more = _BLUR * abs(slope)
    follows = float(np.mean(np.abs(lag - fit) < _NEAR + more)) >= _FOLLOWS
    if follows and np.ptp(median_of_three(lag - fit)) <= allowed + 2.0 * more:
        slope = slope if drifts else 0.0
        knots = time[[0, -1]]
        text = phrase("clock_drifts", slope=1e6 * slope) if drifts else ""
        return _Path(knots, float(np.mean(fit)) + slope * (knots - time.mean()), slope, (), text)
    return _broken(time, lag, table)


def _constant(lags: Lags, own: tuple[float, float]) -> _Path | None:
    """Lag of a short drive, where its pieces show one alike and no sensor is so late itself."""
    middle = float(np.average(lags.lag, weights=1.0 / lags.std**2))
    apart = np.ptp(lags.lag) > _WANDER or lags.lag.size < _SHOWN * lags.pieces
    if apart or own[0] < middle < own[1]:
        return None
    return _Path(lags.time, np.full(lags.time.size, middle), 0.0, (), "")


def _broken(time: Floats, lag: Floats, table: str) -> _Path | Problem | None:
    """Follow a lag that changes by steps, or slowly but not evenly."""
    level_lag = median_of_three(lag)
    jumps = np.flatnonzero(np.abs(np.diff(level_lag)) > _STEP)
    # One step shows as two or three where a piece holds both sides of it.
    groups = np.split(jumps, np.flatnonzero(np.diff(jumps) > 2) + 1) if jumps.size else []
    cuts, sizes, blended = [], [], np.zeros(lag.size, dtype=bool)
    for g in groups:
        first, last = int(g[0]), int(g[-1]) + 1
        # A piece that holds a little of the other side lies a little off its own.
        first -= first > 0 and abs(lag[first] - lag[first - 1]) > _MIXED
        last += last + 1 < lag.size and abs(lag[last] - lag[last + 1]) > _MIXED
        cuts.append((float(time[first]), float(time[last])))
        sizes.append(float(lag[last] - lag[first]))
        blended[first + 1 : last] = True
    time, lag = time[~blended], lag[~blended]
    ends = [float(b) for _, b in cuts]
    parts = np.split(np.arange(lag.size), np.searchsorted(time, ends))
    level = np.concatenate([median_of_three(lag[p]) for p in parts])
    follows = np.count_nonzero(np.abs(lag - level) < _NEAR) + np.count_nonzero(blended)
    if len(cuts) > _MOST_STEPS or follows < _FOLLOWS * blended.size:
        return _hopeless(table, phrase("clocks_jump")) if table == "obd" else None
    text = phrase("clock_late", least=float(level.min()), most=float(level.max()))
    if cuts:
        several = ", ".join(f"{s:+.2f} s" for s in sizes)
        text = phrase("clock_jumps", several=several)
    return _Path(time, level, 0.0, tuple(cuts), text)


def _hopeless(table: str, why: str) -> Problem:
    return Problem.of("clock.hopeless", serious=True, table=table, why=why)


def _line(time: Floats, lag: Floats, scatter: float) -> tuple[float, float, Floats]:
    """Robust line: slope, its standard deviation, and its values (k,)."""
    t = time - time.mean()
    slope = median_slope(t, lag)
    middle = float(np.median(lag - slope * t))
    weight = np.ones(t.size)
    for _ in range(20):
        left = lag - middle - slope * t
        weight = huber(left, max(spread(left), 0.01), 2.0)
        total = np.sum(weight)
        off = t - np.sum(t * weight) / total
        slope = float(np.sum(weight * off * lag) / max(np.sum(weight * off**2), 1e-9))
        middle = float(np.sum((lag - slope * t) * weight) / total)
    std = scatter * float(np.sqrt(_OVERLAP / max(np.sum(weight * t**2), 1e-9)))
    return slope, std, middle + slope * t


def _alike(a: _Path, b: _Path) -> bool:
    if a.cuts or b.cuts:
        return False
    time = np.linspace(max(a.time[0], b.time[0]), min(a.time[-1], b.time[-1]), 50)
    apart = a.at(time) - b.at(time)
    return bool(np.ptp(apart) < _ALIKE)


def _level(path: _Path) -> float:
    """Lag to leave: that of the beginning where it is a sensor's own, else a usual one [s]."""
    first = float(path.lag[0])
    return first if _BEGUN[0] < first < _BEGUN[1] else _USUAL


def _table_moved(drive: Drive, table: str, other: str, path: _Path) -> Drive:
    """Move the signals of a table onto the clock of another; leave out rows about a step."""
    level = _level(path)
    return _moved(
        drive, table, lambda t: t - path.at(t) + level, path.cuts, -path.slope
    ).with_problems(_note(table, other, path, level))  # fmt: skip


def _imu_moved(drive: Drive, path: _Path) -> Drive:
    """Move the inertial signals onto the clock that the other tables share."""
    level = _level(path)
    ends = [f(s.time) for n, s in drive.signals.items() if _of(n, "imu") for f in (np.min, np.max)]
    reach = max(ends) - min(ends)
    knots = np.concatenate((path.time[:1] - reach, path.time, path.time[-1:] + reach))
    own = knots - path.at(knots) + level
    drift = path.slope / (1.0 - path.slope)
    return _moved(drive, "imu", lambda t: np.interp(t, own, knots), (), drift).with_problems(
        _note("obd and gnss", "imu", path, level)
    )


def _of(name: str, table: str) -> bool:
    return QUANTITIES[name].table == table


def _moved(
    drive: Drive,
    table: str,
    onto: Callable[[Floats], Floats],
    cuts: tuple[tuple[float, float], ...],
    drift: float,
) -> Drive:
    """Give the signals of a table other stamps; those that share a clock go on sharing one.

    The last ones are moved by ``drift`` more for each second [-].
    """
    clocks: dict[int, tuple[Floats, Bools | None]] = {}
    signals = dict(drive.signals)
    end = max(float(s.time[-1]) for n, s in drive.signals.items() if _of(n, table) and len(s))
    shift = ClockShift(end, float(onto(np.array([end]))[0]) - end, drift)
    before = drive.shifts.get(table)
    shifts = {**drive.shifts, table: shift if before is None else before.then(shift)}
    for name, s in drive.signals.items():
        if not _of(name, table):
            continue
        if id(s.time) not in clocks:
            keep = np.ones(len(s), dtype=bool)
            for a, b in cuts:
                keep &= (s.time < a) | (s.time > b)
            clocks[id(s.time)] = (onto(s.time[keep]), None if keep.all() else keep)
        time, kept = clocks[id(s.time)]
        signals[name] = Signal(name, time, s.values if kept is None else s.values[kept])
    return replace(drive, signals=signals, shifts=shifts)


def _note(table: str, other: str, path: _Path, level: float) -> Problem:
    most = path.lag - level
    far = float(most[int(np.argmax(np.abs(most)))])
    at = ", ".join(instant(round(0.5 * (a + b))) for a, b in path.cuts)
    return Problem.of(
        "clock.moved",
        table=table,
        what=path.text or phrase("clock_off", far=far),
        other=other,
        most=abs(far),
        left_out=phrase("about_step", at=at) if path.cuts else "",
    )
