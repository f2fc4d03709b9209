"""Do the clocks of a drive run as a recording's do, and together?"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Final

import numpy as np

from weighbridge.constants import EARTH_RADIUS
from weighbridge.messages import phrase
from weighbridge.navigation.aiding import SLOWEST
from weighbridge.signals import NO_DRIVE, QUANTITIES, Drive, Floats, Problem, Signal
from weighbridge.signals.catalogue import IMU_SIGNALS, TABLES
from weighbridge.signals.instants import instant, span
from weighbridge.vehicle import Vehicle

# An inertial sensor with so much between its samples is slow, not in milliseconds [s], where it
# runs over this part of the time of the speed [-].
_SLOW_SENSOR: Final = 5.0
_SAME_TIME: Final = 0.5

# Samples of a packet lie nearer than those of any sensor of a vehicle [s], and nearer by this
# factor than samples in the mean [-].
_NO_SENSOR: Final = 1.5e-3
_APART: Final = 10.0

# A pause in which nothing was recorded is reported from this length on [s].
_PAUSE: Final = 60.0

# Way in a pause that is long enough to be compared with positions [m].
_WENT: Final = 200.0

# Straight distance over the way, of a tunnel that bends [-].
_BENT: Final = 0.5


def check_rates(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find time columns in another unit than their name says."""
    for table in TABLES:
        signals = [s for s in drive.signals.values() if QUANTITIES[s.name].table == table]
        signals = [s for s in signals if len(s) >= 10]
        if not signals:
            continue
        s = max(signals, key=len)
        period, name = s.period, f"{table} ({s.name})"
        slow, fast = (0.5, 5e-5) if table in ("imu", "ride") else (30.0, 5e-4)
        if slow < period < _SLOW_SENSOR and _as_long_as_speed(drive, s):
            continue
        if period > slow or (period > 2.0 and s.duration > 2 * 86_400.0):
            yield Problem.of("clock.milliseconds", serious=True, table=name, period=period)
        elif table == "imu" and (packets := _packets(s, name)):
            yield packets
        elif period < fast:
            yield Problem.of("clock.seconds", serious=True, table=name, rate=1.0 / period)


def without_slow(drive: Drive) -> Drive:
    """Leave out an inertial sensor, or an accelerometer alone, that is too slow beside a speed.

    Nothing filters what it samples, so that vibration passes for motion; see `SLOWEST`.
    """
    axes = [drive.signals[n] for n in IMU_SIGNALS if n in drive.signals and len(drive.signals[n])]
    if not (drive.has("vehicle_speed") and axes and axes[0].period > SLOWEST):
        return drive
    left_out = Problem.of("imu.slow_out", axes[0].name, period=axes[0].period)
    return drive.without(*IMU_SIGNALS).with_problems(left_out)


def _packets(signal: Signal, table: str) -> Problem | None:
    """Say that samples come in packets, each stamped as it arrived; None where they do not."""
    step = np.diff(signal.time)
    step = step[step <= _PAUSE]
    usual, between = signal.period, step > _APART * signal.period
    if usual > _NO_SENSOR or np.mean(step) < _APART * usual:
        return None
    return Problem.of(
        "clock.packets",
        table=table,
        samples=1.0 / np.mean(between),
        apart=1e3 * usual,
        every=np.median(step[between]),
        serious=True,
    )


def _as_long_as_speed(drive: Drive, signal: Signal) -> bool:
    """Say whether a signal of another table runs over the same time as the speed."""
    speed = drive.speed
    if speed is None or len(speed) < 10:
        return False
    shared = min(signal.time[-1], speed.time[-1]) - max(signal.time[0], speed.time[0])
    longer = max(signal.duration, speed.duration)
    return bool(shared > _SAME_TIME * longer)


def check_overlap(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find tables that were not recorded at the same time."""
    spans = {}
    for table in TABLES:
        signals = [
            s for s in drive.signals.values() if QUANTITIES[s.name].table == table and len(s)
        ]
        if signals:
            start = min(float(s.time[0]) for s in signals)
            spans[table] = (start, max(float(s.time[-1]) for s in signals))
    for (a, (a0, a1)), (b, (b0, b1)) in combinations(spans.items(), 2):
        shared = min(a1, b1) - max(a0, b0)
        shorter = min(a1 - a0, b1 - b0)
        if shared <= 0.1 * shorter:
            yield Problem.of(
                "clock.apart", serious=True, a=a, span_a=span(a0, a1), b=b, span_b=span(b0, b1)
            )
        elif shared < 0.5 * max(a1 - a0, b1 - b0):
            yield Problem.of("clock.overlap", a=a, b=b, shared=shared)


def check_pauses(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Report times in which nothing was recorded, which a clock set forward looks like, too."""
    clocks: dict[str, dict[int, Floats]] = {}
    for s in drive.signals.values():
        clocks.setdefault(QUANTITIES[s.name].table, {})[id(s.time)] = s.time
    tables = {t: _united(list(c.values())) for t, c in clocks.items()}
    if not tables:
        return
    whole = [] if _goes_on(list(tables.values())) else _pauses(_united(list(tables.values())))
    if whole:
        start, length = max(whole, key=lambda p: p[1])
        speed = drive.speed
        ends = np.array([start, start + length])
        moving = (
            speed is not None
            and bool(np.all(speed.age(ends) < 5.0))
            and float(np.min(np.abs(speed.at(ends)))) > 3.0
        )
        several = phrase("times_longest", count=len(whole)) if len(whole) > 1 else ""
        why = phrase("pause_moving") if moving else phrase("pause_standing")
        yield Problem.of(
            "clock.pause",
            start=start,
            end=start + length,
            several=several,
            length=length,
            at=instant(start),
            why=why,
        )
    for table, time in tables.items():
        own = [p for p in _pauses(time) if not any(abs(p[0] - w[0]) < _PAUSE for w in whole)]
        if table == "gnss":
            own = [p for p in own if not _way_agrees(drive, *p)]
        if own:
            start, length = max(own, key=lambda p: p[1])
            several = phrase("times_longest", count=len(own)) if len(own) > 1 else ""
            harmless = phrase("pause_harmless") if table == "gnss" else ""
            yield Problem.of(
                "clock.table_pause",
                start=start,
                end=start + length,
                table=table,
                several=several,
                length=length,
                at=instant(start),
                harmless=harmless,
            )


def _way_agrees(drive: Drive, start: float, length: float) -> bool:
    """Say whether positions before and after a pause are as far apart as the vehicle went.

    A tunnel bends less than `_BENT`; a clock set forward leaves the two side by side.
    """
    speed, lat, lon = drive.get("vehicle_speed"), drive.get("latitude"), drive.get("longitude")
    if speed is None or lat is None or lon is None or not (len(speed) and len(lat) and len(lon)):
        return False
    grid = np.linspace(start, start + length, max(int(length), 2))
    if np.any(speed.age(grid) > 5.0):
        return False
    gone = float(np.trapezoid(np.abs(speed.at(grid)), grid))
    ends = grid[[0, -1]]
    north = float(np.ptp(lat.at(ends)))
    east = float(np.ptp(lon.at(ends))) * float(np.cos(lat.at(ends)[0]))
    apart = EARTH_RADIUS * float(np.hypot(north, east))
    return gone > _WENT and _BENT * gone < apart < 1.1 * gone + 30.0


def _united(clocks: list[Floats]) -> Floats:
    """All instants of some clocks, in order [s]."""
    return clocks[0] if len(clocks) == 1 else np.unique(np.concatenate(clocks))


def _goes_on(clocks: list[Floats]) -> bool:
    """Say whether one clock alone shows that nothing paused."""
    clocks = [time for time in clocks if time.size]
    if not clocks:
        return False
    start, end = min(time[0] for time in clocks), max(time[-1] for time in clocks)
    return any(
        time[0] - start <= _PAUSE and end - time[-1] <= _PAUSE and np.diff(time).max() <= _PAUSE
        for time in clocks
        if time.size > 1
    )


def _pauses(time: Floats) -> list[tuple[float, float]]:
    """Start and length of the pauses of a clock [s]."""
    if time.size < 10:
        return []
    step = np.diff(time)
    if step.max() <= _PAUSE:
        return []
    pause = (step > max(_PAUSE, 10.0 * float(np.median(step)))) & (step <= NO_DRIVE)
    return [(float(time[k]), float(step[k])) for k in np.flatnonzero(pause)]
