"""Several drives in one recording: parted at pauses, long stops, trailers and splices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weighbridge.constants import EARTH_RADIUS
from weighbridge.limits import DRIVES, STANDS
from weighbridge.messages import Problem, phrase
from weighbridge.signals.drive import Drive
from weighbridge.signals.instants import instant, span
from weighbridge.signals.signal import Floats, Signal
from weighbridge.signals.timeline import STANDS_FOR

PAUSE: Final = 300.0
"""Where nothing is recorded for so long a drive ends, unless the vehicle moves on after it [s]."""

STANDING: Final = 600.0
"""Where the vehicle means so long a drive ends [s]."""

KEPT: Final = 60.0
"""Of such a stop the drives to both sides keep so much at most [s]."""

DRIVEN: Final = 30.0
"""A part in which the vehicle moves for less is no drive [s]."""

COUPLED: Final = 60.0
"""A trailer that is reported, or no more, for less is a bad contact [s]; chosen."""

_AS_BEFORE: Final = 3.0  # speeds to both sides of a clock that was set [m/s]

# A splice: samples so near in time that differ as no vehicle's do, and so do those around them.
_NEAR: Final = 5.0  # [s]
_AROUND: Final = 5  # samples compared to each side
_FASTER: Final = 7.0  # tyres drive a road vehicle no harder [m/s^2]
_SLOWER: Final = 11.0  # nor brake it harder [m/s^2]
_STEP: Final = 2.0  # of speed, beside that [m/s]
_ALONE: Final = 0.35  # steps around a splice over its own [-]
_FALLS: Final = 2.0 / 3.0  # engine or ground speed after a splice over that before it [-]
_FASTEST: Final = 100.0  # between two positions [m/s]
_FAR: Final = 300.0  # beside that [m]
_BEYOND: Final = 1.2  # of the way that a speed shows, which may be off [-]
_HIGHER: Final = 8.0  # of the altitude, beside what a road rises in that way [m]
_STEEPEST: Final = 0.15  # rise of a road over its length [-]
_COOLED: Final = 10.0  # of the coolant: the engine was parked [K]
_GOES_ON: Final = 2.0  # step of a signal that goes on over the largest around it [-]
_NEARLY: Final = 0.02  # nor is it more of the value [-]
_RARELY: Final = 10.0  # period of signals that are sent now and then [s]


class Cut(NamedTuple):
    """Where one drive ends and the next begins [s], and why."""

    end: float
    begin: float
    why: str


def find_cuts(drive: Drive) -> list[Cut]:
    """Find where a recording holds the end of one drive and the begin of the next, in order.

    Parameters
    ----------
    drive : as read; empty where it has no speed
    """
    speed = drive.speed
    if speed is None or len(speed) < 2 * _AROUND:
        return []
    found = [*_pauses(drive, speed), *_stops(speed), *find_splices(drive)]
    found += _couplings(drive, speed)
    cuts: list[Cut] = []
    for cut in sorted(found):
        if not cuts or cut.end >= cuts[-1].begin:
            cuts.append(cut)
    return cuts


def parted(drive: Drive) -> tuple[Drive, ...]:
    """Part a recording into its drives; the drive itself where it is one.

    Parameters
    ----------
    drive : as read

    Returns
    -------
    In order, named ``NAME part 1 of 3``, each with a note in its ``problems``. Parts in which
    the vehicle hardly moves are left out.
    """
    cuts = find_cuts(drive)
    if not cuts:
        return (drive,)
    driven = _driven_parts(drive, cuts)
    if len(driven) < 2:
        return (drive,)
    why = " and ".join(dict.fromkeys(c.why for c in cuts))
    return numbered(drive.name, driven, why, len(cuts) + 1 - len(driven))


def longest_part(drive: Drive) -> Drive:
    """Leave the longest of several recordings that were joined: each has a mass of its own.

    Pauses and long stops stay: whoever reads a recording as one drive knows of them.

    Parameters
    ----------
    drive : on clocks that rise

    Returns
    -------
    Drive
        The drive itself where it is one; else what was left out is in its ``problems``.
    """
    cuts = find_splices(drive)
    parts = _driven_parts(drive, cuts) if cuts else []
    if len(parts) < 2:
        return drive
    longest = max(parts, key=lambda part: part.duration)
    times = phrase("times_first", count=len(cuts)) if len(cuts) > 1 else "once,"
    return longest.with_problems(
        Problem.of(
            "clock.splices",
            start=cuts[0].end,
            end=cuts[-1].end,
            why=cuts[0].why,
            times=times,
            at=instant(cuts[0].end),
            span=span(round(longest.start), round(longest.end)),
        )
    )


def _driven_parts(drive: Drive, cuts: Sequence[Cut]) -> list[Drive]:
    """Parts of a drive between cuts, in order, without those in which the vehicle hardly moves."""
    starts = [-np.inf, *(c.begin for c in cuts)]
    ends = [*(c.end for c in cuts), np.inf]
    parts = [_between(drive, a, b) for a, b in zip(starts, ends, strict=True)]
    return [part for part in parts if _driven(part)]


def numbered(name: str, parts: Sequence[Drive], why: str, idle: int = 0) -> tuple[Drive, ...]:
    """Name the drives of one recording, and report it in each.

    Parameters
    ----------
    name : of the recording
    parts : its drives
    why : by what they are parted
    idle : parts left out
    """
    left = f"; {idle} part(s) in which the vehicle hardly moves are left out" if idle else ""
    return tuple(
        replace(part, name=f"{name} part {k} of {len(parts)}").with_problems(
            Problem.of(
                "file.part",
                start=part.start,
                end=part.end,
                name=name,
                parts=len(parts),
                why=why,
                k=k,
                span=span(round(part.start), round(part.end)),
                left=left,
            )
        )
        for k, part in enumerate(parts, start=1)
    )


@np.errstate(invalid="ignore", over="ignore")
def find_splices(drive: Drive) -> list[Cut]:
    """Find where speed, position or coolant jump as no vehicle's do, and stay where they are.

    That is how recordings look that were put one behind another on one clock. A signal that a
    person vouches for (``drive.info.trusted``) shows none.
    """
    found: list[Cut] = []
    drive = drive.without(*drive.info.trusted)
    speed = drive.speed
    if speed is not None and len(speed) > 2 * _AROUND:
        witnesses = _witnesses(drive, speed)
        height = drive.get("altitude")
        if height is not None and len(height) > 2 * _AROUND:
            found += _leaps(speed, height)
            found += _speed_jumps(speed, [*witnesses, height])
        else:
            found += _speed_jumps(speed, witnesses)
        found += _starts_anew(speed, witnesses)
    lat, lon = drive.get("latitude"), drive.get("longitude")
    if lat is not None and lon is not None and len(lat) > 2 * _AROUND:
        found += _position_jumps(lat, lon.at(lat.time), speed)
    coolant = drive.get("coolant_temperature")
    if coolant is not None and len(coolant) > 2 * _AROUND:
        found += _coolant_jumps(coolant)
    found.sort()
    # What several signals show at once is one splice.
    return [c for k, c in enumerate(found) if k == 0 or c.end > found[k - 1].begin + _NEAR]


def _speed_jumps(speed: Signal, witnesses: Sequence[Signal]) -> list[Cut]:
    """Find steps that no tyre could make since the value before was new, amid steady driving.

    A splice breaks every signal. Where others go on, the speed alone has changed, as its unit does.
    So none of 19 pairs of the corpus whose unit changes is taken for a splice. The splices of 960
    drives of six vehicles, joined at speed, are found as often as without.

    Over 92 hours of recorded and simulated drives, thinned to as little as a value in 2 s, and 795
    of them with values held, dropped or spiked, none was found. Of pairs of them put one behind the
    other every second was, from 30 km/h on at 2 Hz or more, from 45 km/h on at 1 Hz; at a value in
    2 s every third, from 60 km/h on.
    """
    time, values = speed.time, speed.values
    change = np.abs(np.diff(values))
    places = np.flatnonzero((np.diff(time) < _NEAR) & (change > _possible(speed)))
    if not places.size:
        return []
    before, after = (np.abs(w) for w in _windows(values, places))
    around = np.abs(np.concatenate((np.diff(before, axis=1), np.diff(after, axis=1)), axis=1))
    stays = np.abs(_rise(before, after)) > 0.6 * change[places]
    stays &= np.nanmax(around, axis=1) < _ALONE * change[places]
    # A source that reads zero for a while jumps as well.
    for side in (before, after):
        stays &= np.nanmin(side, axis=1) > STANDS
    alone = [_go_on(witnesses, float(time[k]), float(time[k + 1])) for k in places[stays]]
    return _reported(time, places[stays][~np.array(alone, dtype=bool)], "jumps of the speed")


def _go_on(witnesses: Sequence[Signal], before: float, after: float) -> bool:
    """Whether all signals that are sampled finely enough go on from one instant to another."""
    seen = []
    for signal in witnesses:
        a = int(np.searchsorted(signal.time, before, side="right"))
        b = int(np.searchsorted(signal.time, after))
        around = signal.values[max(a - _AROUND, 0) : b + _AROUND]
        steps = np.abs(np.diff(around))
        if around.size < b - a + 2 * _AROUND or signal.time[b] - signal.time[a - 1] > 1.0:
            continue
        across = abs(float(signal.values[b] - signal.values[a - 1]))
        usual = float(np.max(np.delete(steps, slice(_AROUND - 1, _AROUND + b - a))))
        least = _NEARLY * abs(float(signal.values[b]))
        seen.append(across <= min(_GOES_ON * (1 + b - a) * usual, least))
    return bool(seen) and all(seen)


def _leaps(speed: Signal, height: Signal) -> list[Cut]:
    """Find steps of the speed at which the height steps too, as no road does.

    A speed that stayed the same for some samples may be old, and its step an honest one. Where the
    height leaps at that instant it is not.
    """
    time, size = speed.time, np.abs(speed.values)
    step = np.diff(time)
    change = np.abs(np.diff(speed.values))
    hardest = np.where(size[1:] > size[:-1], _FASTER, _SLOWER)
    since = _since_new(height)
    found = []
    for k in np.flatnonzero((step < _NEAR) & (change > _STEP + hardest * step)):
        a = int(np.searchsorted(height.time, time[k], side="right")) - 1
        b = int(np.searchsorted(height.time, time[k + 1]))
        if not _AROUND <= a < b < len(height) - _AROUND:
            continue
        lasted = float(height.time[b] - since[a])
        rise = abs(float(height.values[b] - height.values[a]))
        stays = abs(float(_rise(*_windows(height.values, np.array([a])))[0])) > 0.6 * rise
        road = _STEEPEST * lasted * float(np.max(size[k : k + 2]))
        if lasted < _NEAR and stays and rise > _HIGHER + road:
            found.append(k)
    return _reported(time, np.array(found, dtype=np.intp), "jumps of speed and height")


def _possible(speed: Signal) -> Floats:
    """Largest step to each sample from the one before that tyres can make (n - 1,) [m/s]."""
    time, size = speed.time, np.abs(speed.values)
    hardest = np.where(size[1:] > size[:-1], _FASTER, _SLOWER)
    return np.asarray(_STEP + hardest * (time[1:] - _since_new(speed)[:-1]))


def _since_new(signal: Signal) -> Floats:
    """Instant from which on each value has been the same (n,) [s]: it may be as old as that."""
    new = np.concatenate(([True], np.diff(signal.values) != 0.0))
    return signal.time[np.maximum.accumulate(np.where(new, np.arange(new.size), 0))]


def _witnesses(drive: Drive, speed: Signal) -> list[Signal]:
    """Other signals that step at a splice, and go on where a speed drops out."""
    others = (drive.get(name) for name in ("engine_speed", "gnss_speed", "vehicle_speed"))
    return [s for s in others if s is not None and s is not speed and len(s) > 2 * _AROUND]


def _starts_anew(speed: Signal, witnesses: Sequence[Signal]) -> list[Cut]:
    """Find steps from driving to standstill that no brake could make, after which it drives off.

    So look recordings that each begin at standstill. A speed that drops out looks so as well, but
    comes back with a step, and engine and satellites go on: each of them has to step too.
    """
    time, values = speed.time, np.abs(speed.values)
    possible = _possible(speed)
    hard = (np.diff(time) < _NEAR) & (values[:-1] - values[1:] > possible)
    places = np.flatnonzero(hard & (values[1:] < STANDS))
    kept = []
    for k in places:
        ahead = np.flatnonzero(values[k + 1 :] > STANDS)
        if not ahead.size or ahead[0] < _AROUND:
            continue
        off = k + 1 + int(ahead[0])
        gently = values[off] - values[off - 1] < possible[off - 1]
        fall = [_falls(s, float(time[k]), float(time[k + 1])) for s in witnesses]
        if gently and fall and all(fall):
            kept.append(k)
    return _reported(time, np.array(kept, dtype=np.intp), "starts from standstill amid driving")


def _falls(signal: Signal, before: float, after: float) -> bool:
    """Whether a signal falls by a third or more from one instant to another, and stays there."""
    a, b = np.searchsorted(signal.time, before, side="right"), np.searchsorted(signal.time, after)
    earlier, later = signal.values[max(a - _AROUND, 0) : a], signal.values[b : b + _AROUND]
    if earlier.size < _AROUND or later.size < _AROUND:
        return False
    near = signal.time[b] - signal.time[a - 1] < _NEAR
    # From one sample to the next, and for good.
    pairs = ((earlier[-1], later[0]), (np.median(earlier), np.median(later)))
    return bool(near and all(after < _FALLS * before for before, after in pairs))


def _position_jumps(lat: Signal, longitude: Floats, speed: Signal | None) -> list[Cut]:
    """Find steps of the position that no vehicle makes, nor one that drove on while it was held.

    A receiver without sight, or its logger, may repeat the last fix for as long as a tunnel takes.
    """
    step = np.diff(lat.time)
    driven = np.zeros(step.size)
    if speed is not None and len(speed) > 1:
        length = np.concatenate(([0.0], np.cumsum(np.diff(speed.time) * np.abs(speed.values[1:]))))
        moved = (np.diff(lat.values) != 0.0) | (np.diff(longitude) != 0.0)
        new = np.concatenate(([True], moved))
        since = lat.time[np.maximum.accumulate(np.where(new, np.arange(new.size), 0))]
        driven = np.diff(np.interp([since[:-1], lat.time[1:]], speed.time, length), axis=0)[0]
    east_per_angle = np.cos(lat.values[:-1])
    way = EARTH_RADIUS * np.hypot(np.diff(lat.values), np.diff(longitude) * east_per_angle)
    places = np.flatnonzero((step < _NEAR) & (way > _FAR + _FASTEST * step + _BEYOND * driven))
    north = _rise(*_windows(lat.values, places))
    east = _rise(*_windows(longitude, places)) * east_per_angle[places]
    stays = EARTH_RADIUS * np.hypot(north, east) > 0.6 * way[places]
    return _reported(lat.time, places[stays], "jumps of the position")


def _coolant_jumps(coolant: Signal) -> list[Cut]:
    places = np.flatnonzero((np.diff(coolant.time) < _NEAR) & (np.diff(coolant.values) < -_COOLED))
    stays = _rise(*_windows(coolant.values, places)) < -_COOLED
    return _reported(coolant.time, places[stays], "jumps of the coolant's temperature")


def _reported(time: Floats, places: NDArray[np.intp], why: str) -> list[Cut]:
    return [Cut(float(time[k]), float(time[k + 1]), why) for k in places]


def _windows(values: Floats, places: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Samples to both sides of steps, (m, k) each; NaN beyond the ends.

    Parameters
    ----------
    values : (n,)
    places : (m,) of the last sample before each step
    """
    beyond = np.full(_AROUND, np.nan)
    padded = np.concatenate((beyond, values, beyond))
    after = places[:, None] + 1 + np.arange(_AROUND)
    return padded[after], padded[after + _AROUND]


def _rise(before: Floats, after: Floats) -> Floats:
    """Median after each step minus that before it (m,)."""
    return np.asarray(np.nanmedian(after, axis=1) - np.nanmedian(before, axis=1))


def _pauses(drive: Drive, speed: Signal) -> list[Cut]:
    """Times in which no signal has a sample."""
    clocks = {id(s.time): s.time for s in drive.signals.values() if len(s)}
    found = []
    for k in np.flatnonzero(np.diff(speed.time) > PAUSE):
        begin, end = float(speed.time[k]), float(speed.time[k + 1])
        stamps = [np.array([begin, end])]
        stamps += [
            t[np.searchsorted(t, begin) : np.searchsorted(t, end, side="right")]
            for t in clocks.values()
        ]
        seen = np.unique(np.concatenate(stamps))
        step = np.diff(seen)
        at = int(np.argmax(step))
        before, after = float(speed.values[k]), float(speed.values[k + 1])
        # The clock was set while the vehicle moved on: one drive.
        on = min(before, after) > DRIVES and abs(after - before) < _AS_BEFORE
        if step[at] > PAUSE and not on:
            why = f"times of {PAUSE / 60.0:.0f} min or more in which nothing was recorded"
            found.append(Cut(float(seen[at]), float(seen[at + 1]), why))
    return found


def _stops(speed: Signal) -> list[Cut]:
    """Stops of `STANDING` or more."""
    still = np.abs(speed.values) < STANDS
    edges = np.flatnonzero(np.diff(np.concatenate(([0], still.view(np.int8), [0]))))
    first, last = speed.time[edges[0::2]], speed.time[edges[1::2] - 1]
    why = f"stops of {STANDING / 60.0:.0f} min or more"
    return [
        Cut(float(a) + KEPT, float(b) - KEPT, why)
        for a, b in zip(first, last, strict=True)
        if b - a >= STANDING
    ]


def _couplings(drive: Drive, speed: Signal) -> list[Cut]:
    """Find the stops at which the vehicle begins to report a trailer, or no longer does.

    It may notice only after it moves on: the last stop before counts.
    """
    bit = drive.get("trailer_connected")
    if bit is None or not len(bit):
        return []
    on = bit.values > 0.5
    first = np.flatnonzero(np.concatenate(([True], on[1:] != on[:-1])))
    begins, states = bit.time[first], on[first]
    stays = np.diff(np.append(begins, bit.time[-1])) >= COUPLED
    begins, states = begins[stays], states[stays]
    still = np.flatnonzero(np.abs(speed.values[:-1]) < STANDS)
    found = []
    for begin in begins[1:][states[1:] != states[:-1]]:
        before = still[speed.time[still] <= begin]
        if before.size:
            found.append(int(before[-1]))
    return _reported(
        speed.time, np.array(found, dtype=np.intp), "a trailer that was coupled or uncoupled"
    )


def _between(drive: Drive, start: float, end: float) -> Drive:
    """Samples from one instant to another, not copied; what is sent rarely goes on to hold."""
    clocks: dict[int, tuple[slice, Floats]] = {}
    signals = {}
    for name, s in drive.signals.items():
        if id(s.time) not in clocks:
            a, b = np.searchsorted(s.time, start), np.searchsorted(s.time, end, side="right")
            clocks[id(s.time)] = slice(int(a), int(b)), s.time[a:b]
        rows, time = clocks[id(s.time)]
        if time.size:
            signals[name] = Signal(name, time, s.values[rows])
    begin = min((float(s.time[0]) for s in signals.values()), default=start)
    for name, s in drive.signals.items():
        rows, time = clocks[id(s.time)]
        rare = len(s) < _AROUND or s.period > _RARELY
        if not time.size and rows.start > 0 and rare:
            signals[name] = Signal(name, np.array([begin]), s.values[rows.start - 1 : rows.start])
    return replace(drive, signals=signals)


def _driven(drive: Drive) -> bool:
    speed = drive.speed
    if speed is None or len(speed) < 2:
        return False
    step = np.minimum(np.diff(speed.time), STANDS_FOR)
    return bool(np.sum(step[np.abs(speed.values[1:]) > DRIVES]) >= DRIVEN)


def find_restarts(time: Floats) -> list[slice]:
    """Find the recordings of a table whose clock begins anew in places.

    Parameters
    ----------
    time : (n,) as recorded; NaN where missing [s]

    Returns
    -------
    Rows of each recording; empty where there is one alone
    """
    places = np.flatnonzero(np.isfinite(time))
    known = time[places]
    if known.size < 4 * _AROUND:
        return []
    back = np.flatnonzero(np.diff(known) < -_NEAR)
    back = back[_rise(*_windows(known, back)) < -_NEAR]
    if not back.size:
        return []
    # Where rows are out of order for a while, the clock comes back to where it had been.
    begins = np.concatenate(([0], back + 1, [known.size]))
    usual = [float(np.median(known[a:b])) for a, b in pairwise(begins)]
    back = back[known[back + 1] < np.array(usual[:-1])]
    edges = [0, *places[back + 1].tolist(), time.size]
    rows = [slice(a, b) for a, b in pairwise(edges)]
    long = [r for r in rows if np.nansum(np.clip(np.diff(time[r]), 0.0, STANDS_FOR)) >= DRIVEN]
    return long if len(long) > 1 and len(long) >= 0.5 * len(rows) else []
