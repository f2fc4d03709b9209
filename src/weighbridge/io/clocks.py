"""Files of one drive whose clocks differ: put on one clock by what they share."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from weighbridge.constants import EARTH_RADIUS
from weighbridge.errors import DriveError
from weighbridge.io.log import Log
from weighbridge.messages import phrase, refused
from weighbridge.signals import Alignment, Bools, Floats, Problem, Signal, align

_Signals = Mapping[str, Signal]

# Course over ground says nothing of turning at walking pace.
_MOVING: Final = 3.0

# Gyroscopes feel the engine; turning is slower [s].
_TURN: Final = 0.5

# Sensors are late by up to this; a clock that is off by more is a wrong clock [s].
_LATE: Final = 1.5

# How late one sensor may be beside another, as a standard deviation: two recorded loggers, which
# stamp both by one clock, have GNSS 0.17 and 0.36 s behind the wheels (studies/recorded.md) [s].
_LATENESS: Final = 0.3

# Zones are whole or half hours from UTC [s]; so much of the shorter recording lies in the other.
_ZONE: Final = 1800.0
_SHARED: Final = 0.7


def settle_clocks(logs: Sequence[Log]) -> list[Problem]:
    """Put the files of a drive on one clock where they are not on one already.

    A file is moved where a mapping asks for it (`Log.align`), where only
    some files have dates, and where files that hold different signals do not
    overlap. Files with the same signals one after another are left alone:
    they are parts of one recording.

    Parameters
    ----------
    logs : of the drive; those moved are changed in place

    Returns
    -------
    What was moved, by how much and how sure that is.

    Raises
    ------
    DriveError
        A mapping asks for it or some files have dates and others none, and the
        offset is not to be found, or ambiguous.
    """
    logs = [log for log in logs if log.signals]
    problems: list[Problem] = []
    moved = [log for log in logs if log.align]
    fixed = [log for log in logs if not log.align]
    if moved and not fixed:
        moved, fixed = moved[1:], moved[:1]
    dated = [log for log in fixed if log.absolute]
    if dated and len(dated) < len(fixed):
        counted = [log for log in fixed if not log.absolute]
        of_day = all(log.of_day for log in counted)
        how = phrase("without_date") if of_day else "seconds"
        why = phrase("dates_and_counts", dated=_names(dated), counted=_names(counted), how=how)
        problems.append(_onto_day(dated, counted, why) if of_day else _move(dated, counted, why))
    for log in moved:
        problems.append(_move(fixed, [log], phrase("to_be_aligned", file=log.path.name)))
        fixed.append(log)
    problems += _apart(logs)
    problems += _doubts(logs)
    return problems


def shift_clock(log: Log, offset: float) -> None:
    """Add ``offset`` [s] to every stamp; signals that share a clock go on sharing one."""
    if offset == 0.0:
        return
    clocks: dict[int, Floats] = {}
    for k, s in enumerate(log.signals):
        if id(s.time) not in clocks:
            clocks[id(s.time)] = s.time + offset
        log.signals[k] = Signal(s.name, clocks[id(s.time)], s.values)


def _apart(logs: Sequence[Log]) -> list[Problem]:
    """Move files that share no time with the others, and no signal either."""
    groups = _overlapping(logs)
    if len(groups) < 2:
        return []
    names = [{s.name for log in g for s in log.signals} for g in groups]
    if any(a & b for k, a in enumerate(names) for b in names[:k]):
        return []
    # The longest recording is the one the others are put onto.
    groups.sort(key=lambda g: _span(g)[0] - _span(g)[1])
    fixed = list(groups[0])
    problems = []
    for group in groups[1:]:
        why = phrase("share_no_time", group=_names(group), fixed=_names(fixed))
        try:
            problems.append(_move(fixed, group, why))
        except DriveError as e:
            # What each file holds can still be looked at, though not weighed.
            problems.append(Problem.from_error(e))
            continue
        fixed += group
    return problems


def _doubts(logs: Sequence[Log]) -> list[Problem]:
    """Report files with dates that agree better under an offset."""
    problems = []
    dated = [log for log in logs if log.absolute]
    for k, log in enumerate(dated):
        for other in dated[:k]:
            if {s.name for s in log.signals} & {s.name for s in other.signals}:
                continue
            found, what = _offset([other], [log])
            if found is None or not found.found:
                continue
            apart = abs(found.offset) - 5.0 * found.std
            if apart > 2.0 * _LATENESS:
                problems.append(
                    Problem.of(
                        "clock.align_offered",
                        serious=apart > _LATE,
                        first=other.path.name,
                        second=log.path.name,
                        apart=_reported(found),
                        by=found.offset,
                        std=found.std,
                        what=what,
                    )
                )
    return problems


def _move(fixed: Sequence[Log], group: Sequence[Log], why: str) -> Problem:
    found, what = _offset(fixed, group)
    if found is None:
        raise refused("clock.nothing_shared", why=why)
    if not found.found:
        raise refused("clock.not_aligned", why=why, what=what, refusal=found.refusal)
    for log in group:
        shift_clock(log, found.offset)
        log.absolute = fixed[0].absolute
    return Problem.of(
        "clock.aligned",
        group=_names(group),
        offset=_reported(found),
        by=found.offset,
        std=found.std,
        fixed=_names(fixed),
        what=what,
        correlation=abs(found.correlation),
        overlap=found.overlap,
    )


def _onto_day(dated: Sequence[Log], counted: Sequence[Log], why: str) -> Problem:
    """Put times of day on the day of files with dates, by what they share, else by the hour.

    What they share shows how far the clocks are apart, tenths of a second included: every drive of
    the two devices is then on one clock. The hour alone leaves what the clocks differ by. It may be
    that of any zone, whole or half hours from UTC; where a mapping gives the offset, no more is
    sought.

    Raises
    ------
    DriveError
        Several hours of it would fit, or none.
    """
    shared_motion, what = _offset(dated, counted)
    if shared_motion is not None:
        if not shared_motion.found or not any(log.placed for log in counted):
            return _move(dated, counted, why)
        zone = _ZONE * round(shared_motion.offset / _ZONE)
        return _put(
            counted,
            zone,
            dated,
            phrase("off_by_motion", why=why, what=what, offset=_reported(shared_motion)),
        )
    (a0, a1), (b0, b1) = _span(dated), _span(counted)
    shorter = min(a1 - a0, b1 - b0)
    first = _ZONE * math.floor((a0 - b1) / _ZONE)
    offsets = first + _ZONE * np.arange(math.ceil((a1 - a0 + b1 - b0) / _ZONE) + 2)
    shared = np.minimum(a1, b1 + offsets) - np.maximum(a0, b0 + offsets)
    fits = shared >= _SHARED * shorter
    if np.count_nonzero(fits) != 1:
        many = phrase("several_half_hours" if fits.any() else "no_half_hour")
        raise refused("clock.day_ambiguous", why=why, many=many)
    offset = float(offsets[int(np.argmax(fits))])
    return _put(counted, offset, dated, phrase("overlap_once", why=why))


def _put(counted: Sequence[Log], offset: float, dated: Sequence[Log], why: str) -> Problem:
    """Move times of day onto a day, by whole half hours [s]."""
    for log in counted:
        shift_clock(log, offset)
        log.absolute = True
    day = dt.datetime.fromtimestamp(_span(dated)[0], dt.UTC)
    zone = math.remainder(-offset, 86_400.0) / 3600.0
    return Problem.of("clock.day_found", why=why, day=day, zone=zone)


def _offset(fixed: Sequence[Log], group: Sequence[Log]) -> tuple[Alignment | None, str]:
    """The surest offset of all that both sides share, and what it was found by."""
    a, b = _merged(fixed), _merged(group)
    tried: list[tuple[Alignment, str]] = []
    for what, make, signed in (
        ("speed", _speed, True),
        ("yaw rate", _yaw_rate, False),
        ("engine speed", _engine_speed, True),
    ):
        x, y = make(a), make(b)
        if x is not None and y is not None:
            tried.append((align(x, y, signed=signed), what))
    good = sorted((t for t in tried if t[0].found), key=lambda t: t[0].std)
    if not good:
        return tried[0] if tried else (None, "")
    best, what = good[0]
    for other, second in good[1:]:
        reach = _LATE + 4.0 * (best.std + other.std)
        if abs(other.offset - best.offset) > reach:
            text = phrase(
                "two_offsets",
                what=what,
                offset=_reported(best),
                second=second,
                other=_reported(other),
            )
            return (
                Alignment(best.offset, best.std, best.correlation, 1.0, best.overlap, text),
                what,
            )
    return best, what


def _reported(found: Alignment) -> str:
    """Offset with its standard deviations: how well the signals fit, and what that says of clocks.

    An offset takes in how late the sensors are: the signals lie on each other, the clocks may not.
    """
    digits = 3 if found.std < 0.1 else 2
    fit = f"{max(found.std, 10.0**-digits):.{digits}f}"
    clocks = math.hypot(found.std, _LATENESS)
    return phrase(
        "offset_with_std",
        offset=f"{found.offset:+.{digits}f}",
        clocks=clocks,
        fit=fit,
        late=_LATENESS,
    )


def _names(logs: Sequence[Log]) -> str:
    return ", ".join(log.path.name for log in logs)


def _span(logs: Sequence[Log]) -> tuple[float, float]:
    return min(log.span[0] for log in logs), max(log.span[1] for log in logs)


def _overlapping(logs: Sequence[Log]) -> list[list[Log]]:
    """Group files whose times overlap."""
    groups: list[list[Log]] = []
    end = -np.inf
    for log in sorted(logs, key=lambda log: log.span[0]):
        start, last = log.span
        if groups and start <= end:
            groups[-1].append(log)
        else:
            groups.append([log])
        end = max(end, last)
    return groups


def _merged(logs: Sequence[Log]) -> dict[str, Signal]:
    """Signals of files on one clock, parts of one signal joined where they follow each other."""
    parts: dict[str, list[Signal]] = {}
    for log in logs:
        for s in log.signals:
            parts.setdefault(s.name, []).append(s)
    merged = {}
    for name, pieces in parts.items():
        pieces.sort(key=lambda s: float(s.time[0]))
        kept = pieces[:1]
        for s in pieces[1:]:
            if s.time[0] > kept[-1].time[-1]:
                kept.append(s)
        merged[name] = Signal(
            name,
            np.concatenate([s.time for s in kept]),
            np.concatenate([s.values for s in kept]),
        )
    return merged


def _speed(signals: _Signals) -> Signal | None:
    """Speed from the wheels or over ground, else from the way between fixes."""
    for name in ("vehicle_speed", "gnss_speed"):
        if name in signals:
            return signals[name]
    lat, lon = signals.get("latitude"), signals.get("longitude")
    if lat is None or lon is None or len(lat) < 3:
        return None
    step = np.diff(lat.time)
    north = np.diff(lat.values)
    east = np.diff(np.unwrap(lon.at(lat.time))) * np.cos(lat.values[:-1])
    good = (step < 5.0) & np.isfinite(east)
    if not good.any():
        return None
    middle = 0.5 * (lat.time[1:] + lat.time[:-1])
    way = EARTH_RADIUS * np.hypot(north, east)
    return Signal("gnss_speed", middle[good], (way / step)[good])


def _engine_speed(signals: _Signals) -> Signal | None:
    return signals.get("engine_speed")


def _yaw_rate(signals: _Signals) -> Signal | None:
    """Turning: about the axis a gyroscope turns most about, else by the course over ground."""
    axes = [signals.get(f"gyro_{a}") for a in "xyz"]
    present = [s for s in axes if s is not None]
    if len(present) == 3:
        time = present[0].time
        rates = np.column_stack([s.at(time) for s in present])
        good = np.isfinite(rates).all(axis=1)
        bins = np.floor(time[good] / _TURN)
        _, which, count = np.unique(bins, return_inverse=True, return_counts=True)
        if count.size < 3:
            return None

        def mean(values: Floats) -> Floats:
            return np.asarray(np.bincount(which, values) / count)

        slow = np.column_stack([mean(rates[good, k]) for k in range(3)])
        _, _, directions = np.linalg.svd(slow - slow.mean(axis=0), full_matrices=False)
        return Signal("yaw_rate", mean(time[good]), slow @ directions[0])
    course, speed = signals.get("gnss_course"), signals.get("gnss_speed")
    if course is None or speed is None or len(course) < 3:
        return None
    fresh = _fresh(course, signals)
    if np.count_nonzero(fresh) < 3:
        return None
    time, values = course.time[fresh], course.values[fresh]
    step = np.diff(time)
    turn = (np.diff(values) + np.pi) % (2.0 * np.pi) - np.pi
    middle = 0.5 * (time[1:] + time[:-1])
    good = (step < 3.0) & (np.nan_to_num(speed.at(middle)) > _MOVING)
    return Signal("yaw_rate", middle[good], (turn / step)[good]) if good.any() else None


def _fresh(course: Signal, signals: _Signals) -> Bools:
    """Rows with a new fix: some apps repeat the last one until the next comes."""
    new = np.append(True, np.diff(course.values) != 0.0)
    for name in ("latitude", "longitude"):
        beside = signals.get(name)
        if beside is not None and np.array_equal(beside.time, course.time):
            new[1:] |= np.diff(beside.values) != 0.0
    return new
