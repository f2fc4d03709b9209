"""Plausibility of a drive: wrong units, stuck or swapped signals, clocks that disagree.

A serious problem is one that would make a mass wrong without any other sign;
`weigh` refuses then. Thresholds leave room for real sensors: what a sane drive
can show never counts as serious.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations, permutations
from typing import Final

import numpy as np

from weighbridge.pipeline.imu_checks import check_imu
from weighbridge.pipeline.speed_checks import SETTLED, check_scales
from weighbridge.pipeline.vehicle_checks import check_vehicle
from weighbridge.signals import QUANTITIES, Bools, Drive, Floats, Problem, Signal
from weighbridge.signals.catalogue import TABLES
from weighbridge.signals.units import UNITS, scalar_from_si
from weighbridge.signals.words import counted
from weighbridge.vehicle.data_sheet import FRICTION_PRESSURE, friction_coefficients
from weighbridge.vehicle.model import TorqueModel, Vehicle
from weighbridge.vehicle.torque import SIGNALS

_IMU: Final = ("accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z")
_MOTION: Final = frozenset(
    (
        *_IMU,
        "longitudinal_accel",
        "vehicle_speed",
        "engine_speed",
        "latitude",
        "longitude",
        "gnss_speed",
        "grade",
    )
)
"""Signals a mass is made from beside the torque's: what is wrong with them is serious."""

_TORQUE: Final = frozenset(name for names in SIGNALS.values() for name in names) - _MOTION
"""Signals of torque: only what is wrong with those of the source in use is serious."""

_PERCENT: Final = (
    "engine_load",
    "engine_torque_fraction",
    "indicated_torque_fraction",
    "demanded_torque",
    "absolute_load",
    "throttle",
    "accelerator_pedal",
    "relative_pedal",
)
"""Signals in percent that a drive takes far beyond `_LEAST_PERCENT`."""

# No drive that gets anywhere stays below: 0 to 1 under a percent name ends near 1 %, of a torque
# with its boost below 2 %.
_LEAST_PERCENT: Final = 0.02

# Samples that a noisy sensor does not repeat by chance.
_FROZEN: Final = 200
# Engine speeds of an idle [rad/s], and coolant of an engine that is warm [K].
_IDLE: Final = (45.0, 135.0)
_WARM: Final = 343.0
# Torque at idle that alternator and pumps do not take [part of the reference torque].
_IDLE_TORQUE: Final = 0.03

# A pause in which nothing was recorded is told [s]; no drive has one so long [s].
_PAUSE: Final = 60.0
_NO_DRIVE: Final = 6 * 3600.0

_Check = Callable[[Drive, "Vehicle | None"], Iterator[Problem]]


def check_drive(drive: Drive, vehicle: Vehicle | None = None) -> tuple[Problem, ...]:
    """Look for what cannot be so in a drive.

    Parameters
    ----------
    drive : the drive as read
    vehicle : its gearings help to judge the speed's unit

    Returns
    -------
    What was found, serious problems first. The drive's own ``problems`` (from
    reading it) are not repeated. What is wrong with a signal that a person vouches for
    (``drive.info.trusted``) is never serious.
    """
    problems = [
        replace(p, serious=False) if p.signal in drive.info.trusted else p
        for check in _CHECKS
        for p in check(drive, vehicle)
    ]
    return tuple(sorted(problems, key=lambda p: not p.serious))


def _needed(drive: Drive, vehicle: Vehicle | None) -> frozenset[str]:
    """Signals a mass would be made from.

    The torque is that of the vehicle file; without one, of the source that a calibration takes.
    """
    sources = [source for source, names in SIGNALS.items() if drive.has(*names)]
    if vehicle is not None and replace(vehicle.torque, reference_torque=None) != TorqueModel():
        sources = [vehicle.torque.source]
    elif "percent" in sources[:1] and len(sources) > 1 and not drive.has("reference_torque"):
        # A vehicle file may yet give the reference torque.
        return _MOTION.union(SIGNALS["percent"], SIGNALS[sources[1]])
    return _MOTION.union(*(SIGNALS[source] for source in sources[:1]))


def _show(name: str, value: float) -> str:
    """Write an SI value in the quantity's own unit."""
    suffix = QUANTITIES[name].suffix
    return f"{scalar_from_si(value, suffix):.4g} {suffix}" if suffix else f"{value:.4g}"


def _check_rates(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find time columns in another unit than their name says."""
    for table in TABLES:
        signals = [s for s in drive.signals.values() if QUANTITIES[s.name].table == table]
        signals = [s for s in signals if len(s) >= 10]
        if not signals:
            continue
        s = max(signals, key=len)
        period, name = s.period, f"{table} ({s.name})"
        slow, fast = (0.5, 5e-5) if table in ("imu", "ride") else (30.0, 5e-4)
        if period > slow or (period > 2.0 and s.duration > 2 * 86_400.0):
            yield Problem(
                "",
                f"{name} has one sample every {period:.4g} s; if its time is in milliseconds, "
                "name the column time_ms or set the unit in [time] of the mapping",
                serious=True,
            )
        elif period < fast:
            yield Problem(
                "",
                f"{name} has {1.0 / period:.4g} samples per second; if its time is in seconds, "
                "name the column time_s or set the unit in [time] of the mapping",
                serious=True,
            )


def _check_overlap(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
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
            yield Problem(
                "",
                f"{a} runs from {a0:.6g} to {a1:.6g} s and {b} from {b0:.6g} to {b1:.6g} s: "
                "write both on one clock (a constant goes into offset_s in [time] of a mapping)",
                serious=True,
            )
        elif shared < 0.5 * max(a1 - a0, b1 - b0):
            yield Problem("", f"{a} and {b} were recorded together for {shared:.0f} s only")


def _check_long_gaps(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find jumps of the clock that no recording makes."""
    seen: set[int] = set()
    for s in drive.signals.values():
        if id(s.time) in seen or len(s) < 2:
            continue
        seen.add(id(s.time))
        step = np.diff(s.time)
        k = int(np.argmax(step))
        if step[k] > _NO_DRIVE:
            yield Problem(
                s.name,
                f"the clock of {s.name} jumps by {step[k]:.6g} s after {s.time[k]:.6g} s; "
                "cut the recording there, or correct that time stamp",
                serious=True,
            )


def _check_pauses(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Tell of times in which nothing was recorded, which a clock set forward looks like, too."""
    clocks: dict[str, dict[int, Floats]] = {}
    for s in drive.signals.values():
        clocks.setdefault(QUANTITIES[s.name].table, {})[id(s.time)] = s.time
    tables = {t: np.unique(np.concatenate(list(c.values()))) for t, c in clocks.items()}
    if not tables:
        return
    whole = _pauses(np.unique(np.concatenate(list(tables.values()))))
    if whole:
        start, length = max(whole, key=lambda p: p[1])
        speed = drive.get("vehicle_speed") or drive.get("gnss_speed")
        ends = np.array([start, start + length])
        moving = (
            speed is not None
            and bool(np.all(speed.age(ends) < 5.0))
            and float(np.min(np.abs(speed.at(ends)))) > 3.0
        )
        several = f"{len(whole)} times, the longest time " if len(whole) > 1 else ""
        why = (
            "while the vehicle moves: the clock was set forward, or a piece of the recording is "
            "missing"
            if moving
            else "as if the recording paused or its clock was set forward"
        )
        yield Problem(
            "",
            f"nothing was recorded {several}for {length:.0f} s from {start:.6g} s, {why}",
        )
    for table, time in tables.items():
        own = [p for p in _pauses(time) if not any(abs(p[0] - w[0]) < _PAUSE for w in whole)]
        if own:
            start, length = max(own, key=lambda p: p[1])
            several = f"{len(own)} times, the longest time " if len(own) > 1 else ""
            yield Problem(
                "",
                f"{table} pauses {several}for {length:.0f} s from {start:.6g} s while the rest "
                "goes on; if its clock was set there, cut the recording",
            )


def _pauses(time: Floats) -> list[tuple[float, float]]:
    """Start and length of the pauses of a clock [s]."""
    if time.size < 10:
        return []
    step = np.diff(time)
    pause = (step > max(_PAUSE, 10.0 * float(np.median(step)))) & (step <= _NO_DRIVE)
    return [(float(time[k]), float(step[k])) for k in np.flatnonzero(pause)]


def _check_range(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find values no road vehicle can have."""
    needed = _needed(drive, vehicle)
    for s in drive.signals.values():
        q = QUANTITIES[s.name]
        outside = (s.values < q.low) | (s.values > q.high)
        count = int(np.count_nonzero(outside))
        if count == 0:
            continue
        k = int(np.argmax(np.where(outside, np.abs(s.values), -1.0)))
        yield Problem(
            s.name,
            f"{count} of {len(s)} values of {s.name} are outside {_show(s.name, q.low)} to "
            f"{_show(s.name, q.high)}, such as {_show(s.name, float(s.values[k]))} at "
            f"{s.time[k]:.6g} s; check its unit",
            serious=s.name in needed and count > 0.01 * len(s),
        )


def _check_stuck(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find signals that never change, and sensors that froze on the way."""
    moving = _moves(drive)
    needed = _needed(drive, vehicle)
    for s in drive.signals.values():
        if s.name not in _MOTION | _TORQUE or s.name == "grade" or len(s) < 50 or s.duration < 20.0:
            continue
        value = float(s.values[0])
        if bool(np.all(s.values == value)):
            standing = s.name in ("vehicle_speed", "gnss_speed", "latitude", "longitude")
            if (standing or s.name not in _IMU) and not moving:
                continue
            if _along_an_axis(drive, s.name):
                continue
            yield Problem(
                s.name,
                f"{s.name} is {_show(s.name, value)} all the time; its source is stuck: "
                "leave the column out or record it again",
                serious=s.name in needed,
            )
        elif s.name in _IMU:
            run, at = _longest_run(s.values)
            length = float(s.time[at + run - 1] - s.time[at])
            if run > _FROZEN and length > 5.0:
                yield Problem(
                    s.name,
                    f"{s.name} repeats one value for {length:.1f} s from {s.time[at]:.6g} s",
                    serious=length > 0.2 * s.duration,
                )


def _along_an_axis(drive: Drive, name: str) -> bool:
    """Tell whether the course lets a latitude or longitude stay, as on a road due east."""
    part = {"latitude": np.cos, "longitude": np.sin}.get(name)
    course = drive.get("gnss_course")
    if part is None or course is None or not len(course):
        return False
    return bool(np.percentile(np.abs(part(course.values)), 90) < 0.02)


def _longest_run(values: Floats) -> tuple[int, int]:
    """Length and start of the longest run of one value; (1, 0) where none is long."""
    same = values[1:] == values[:-1]
    if np.count_nonzero(same) < _FROZEN:
        return 1, 0
    ends = np.flatnonzero(np.concatenate((~same, [True])))
    lengths = np.diff(np.concatenate(([-1], ends)))
    k = int(np.argmax(lengths))
    return int(lengths[k]), int(ends[k] - lengths[k] + 1)


def _moves(drive: Drive) -> bool:
    """Tell whether any source saw the vehicle move."""
    for name in ("vehicle_speed", "gnss_speed"):
        s = drive.get(name)
        if s is not None and len(s) and float(np.max(np.abs(s.values))) > 1.0:
            return True
    lat, lon = drive.get("latitude"), drive.get("longitude")
    if lat is None or lon is None or not len(lat) or not len(lon):
        return False
    return float(np.ptp(lat.values)) > 3e-5 or float(np.ptp(lon.values)) > 3e-5


def _check_load(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find parts of one under a percent name."""
    if not _moves(drive):
        return
    needed = _needed(drive, vehicle)
    for name in _PERCENT:
        s = drive.get(name)
        if s is None or len(s) < 50:
            continue
        highest = float(np.max(np.abs(s.values)))
        if 0.0 < highest <= _LEAST_PERCENT and np.unique(s.values).size > 5:
            column = QUANTITIES[name].stem
            yield Problem(
                name,
                f"{name} never exceeds {100 * highest:.3g} % though the vehicle drives; it seems "
                f"to run from 0 to {'1' if highest <= 0.0102 else f'{100 * highest:.2f}'}: name "
                f"the column {column}_ratio or set the unit ratio in the mapping{SETTLED}",
                serious=name in needed,
            )


def _check_pressure(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find a barometer in another unit: drag goes with the air's density."""
    s = drive.get("barometric_pressure")
    if s is None or not len(s):
        return
    usual = float(np.median(s.values))
    q = QUANTITIES[s.name]
    if q.low <= usual <= q.high:
        return
    swapped = next(
        (
            (said, meant)
            for said, meant in permutations(("pa", "hpa", "kpa"), 2)
            if q.low <= usual * UNITS[meant].factor / UNITS[said].factor <= q.high
        ),
        None,
    )
    remedy = (
        f"it seems to be in {swapped[1]} under {swapped[0]}: name the column {q.stem}_{swapped[1]}"
        if swapped
        else "check its unit, or leave the column out"
    )
    yield Problem(
        s.name,
        f"barometric_pressure is {_show(s.name, usual)} in the median, which is no air pressure; "
        f"{remedy}",
        serious=True,
    )


def _check_whole_torque(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Doubt a torque in N m that looks like one in percent."""
    s = drive.get("engine_torque")
    if s is None or len(s) < 200:
        return
    low, high = float(np.min(s.values)), float(np.max(s.values))
    whole = bool(np.all(np.abs(s.values - np.round(s.values)) < 1e-6))
    if whole and low >= -40.0 and 60.0 <= high <= 100.0 and np.unique(s.values).size > 20:
        yield Problem(
            s.name,
            f"engine_torque runs from {low:.0f} to {high:.0f} in whole N m; if that is percent of "
            "a reference torque, name the column engine_torque_pct",
        )


def _check_friction(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find friction of the engine in a torque that is taken for the one at its shaft."""
    torque = drive.get("engine_torque_fraction")
    if torque is None or (vehicle is not None and vehicle.torque.source != "percent"):
        return
    if vehicle is not None and vehicle.torque.coefficients and vehicle.torque.coefficients[0] < 0.0:
        return
    idle = _idle_torque(drive, torque)
    remedy = _friction_remedy(drive, vehicle, idle)
    if drive.has("indicated_torque_fraction"):
        seen = f" (at most {100.0 * idle:.0f} %, its reading at idle)" if idle is not None else ""
        yield Problem(
            "engine_torque_fraction",
            f"the torque is the engine's indicated one, friction included{seen}: log its nominal "
            f"friction (EEC3), or {remedy}",
            serious=vehicle is not None,
        )
    elif idle is not None and idle > _IDLE_TORQUE:
        yield Problem(
            "engine_torque_fraction",
            f"warm at idle and standing the torque reads {100.0 * idle:.0f} %: friction seems to "
            f"be in it, as PID 62 may have it, beside what alternator and pumps take; {remedy}",
        )


def _friction_remedy(drive: Drive, vehicle: Vehicle | None, idle: float | None) -> str:
    """Say what to write of the friction into a vehicle file."""
    reference = drive.get("reference_torque")
    if reference is not None and len(reference):
        full = float(np.median(reference.values))
    else:
        full = (vehicle.torque.reference_torque if vehicle is not None else None) or 0.0
    engine = drive.get("engine_speed")
    if idle is None or not full or engine is None or not len(engine):
        return (
            "state it as coefficients = [-F, 1.0], F the friction in N m, under [torque] of the "
            "vehicle file"
        )
    turning = engine.values[(engine.values > _IDLE[0]) & (engine.values < _IDLE[1])]
    told = []
    for fuel in FRICTION_PRESSURE:
        w0, w2, w3 = friction_coefficients(idle * full, float(np.median(turning)), fuel)
        told.append(f"[{-w0:.3g}, 1.0, {-w2:.3g}, {-w3:.3g}] for {fuel}")
    return (
        f"state it under [torque] of the vehicle file as coefficients = {' or '.join(told)}, which "
        "grows with engine speed; with an automatic stand in neutral for it: in gear the reading "
        "holds the drag of the converter as well"
    )


def _idle_torque(drive: Drive, torque: Signal) -> float | None:
    """Least torque of an engine that idles warm and standing; None where that was not seen."""
    engine, speed = drive.get("engine_speed"), drive.get("vehicle_speed")
    if engine is None or speed is None or not len(speed) or not len(engine):
        return None
    at = torque.time
    turning = engine.at(at)
    with np.errstate(invalid="ignore"):
        idle = (turning > _IDLE[0]) & (turning < _IDLE[1]) & (np.abs(speed.at(at)) < 0.3)
        # No pull-away just before or after.
        for side in (-2.0, 2.0):
            idle &= np.abs(speed.at(at + side)) < 0.3
        coolant = drive.get("coolant_temperature")
        if coolant is not None and len(coolant):
            idle &= coolant.at(at) > _WARM
    if np.count_nonzero(idle) < 20:
        return None
    # Fans, air conditioning and a gearbox in gear come and go.
    return float(np.percentile(torque.values[idle], 10.0))


def _check_engine_speed(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find an engine that would turn too slowly for the road speed."""
    engine, speed = drive.get("engine_speed"), drive.get("vehicle_speed")
    if engine is None or speed is None or not len(speed):
        return
    fast = speed.at(engine.time) > 10.0
    if np.count_nonzero(fast) < 20:
        return
    # Slower than any idle, but turning: rad/s or revolutions per second.
    highest = float(np.max(engine.values[fast]))
    if 1.0 < highest < 62.0:
        yield Problem(
            "engine_speed",
            f"engine_speed never exceeds {_show('engine_speed', highest)} while driving faster "
            "than 36 km/h; if it is in rad/s, name the column engine_speed_radps",
            serious=True,
        )


def _check_standstill(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Tell of long standstills and cuts; neither spoils a mass."""
    s = drive.get("vehicle_speed") or drive.get("gnss_speed")
    if s is None or len(s) < 2:
        return
    standing = np.abs(s.values) < 0.3
    if float(np.max(np.abs(s.values))) < 1.0:
        yield Problem(
            s.name,
            f"the vehicle stands all the time ({s.duration:.0f} s): there is nothing to weigh by",
        )
        return
    length, start = _longest_time(s, standing)
    if length > 600.0:
        yield Problem(
            s.name,
            f"the vehicle stands for {length / 60.0:.0f} min from {start:.6g} s; "
            "if it was loaded there, look at the mass of each segment",
        )
    # No car brakes or accelerates at 1.5 g: a piece of the recording is missing there.
    step, jump = np.diff(s.time), np.abs(np.diff(s.values))
    cut = (jump > 15.0 * step + 1.5) & (step < 1.0)
    if count := int(np.count_nonzero(cut)):
        k = int(np.argmax(np.where(cut, jump, 0.0)))
        yield Problem(
            s.name,
            f"{s.name} jumps {counted(count, 'time')}, as from "
            f"{_show(s.name, float(s.values[k]))} to {_show(s.name, float(s.values[k + 1]))} "
            f"within {step[k]:.2g} s at {s.time[k]:.6g} s; "
            "a piece may be cut out of the recording there",
        )


def _longest_time(s: Signal, mask: Bools) -> tuple[float, float]:
    """Duration and start of the longest run of True [s]."""
    edges = np.diff(np.concatenate(([0], mask.astype(np.int8), [0])))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    if starts.size == 0:
        return 0.0, 0.0
    lengths = s.time[ends] - s.time[starts]
    k = int(np.argmax(lengths))
    return float(lengths[k]), float(s.time[starts[k]])


def _check_sign(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Find a speed counted backwards."""
    s = drive.get("vehicle_speed")
    if s is None:
        return
    moving = np.abs(s.values) > 1.0
    backwards = int(np.count_nonzero(s.values[moving] < 0.0))
    if backwards > 0.5 * np.count_nonzero(moving):
        yield Problem(
            s.name,
            f"vehicle_speed is negative in {backwards} of {np.count_nonzero(moving)} samples in "
            "motion; if forward is negative there, set factor = -1 in the mapping",
            serious=True,
        )


_CHECKS: Final[tuple[_Check, ...]] = (
    _check_rates,
    _check_overlap,
    _check_long_gaps,
    _check_pauses,
    _check_stuck,
    _check_load,
    _check_pressure,
    _check_whole_torque,
    _check_friction,
    _check_engine_speed,
    _check_sign,
    check_scales,
    check_imu,
    check_vehicle,
    _check_range,
    _check_standstill,
)
