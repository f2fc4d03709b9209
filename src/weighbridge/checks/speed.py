"""Is a speed, a position or an altitude in the unit its name says?

Each is compared with another source of the same motion; what remains is a
ratio, and a wrong unit shows as the ratio of two units.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from weighbridge.checks import windows
from weighbridge.messages import phrase
from weighbridge.signals import UNITS, Drive, Floats, Problem, Signal
from weighbridge.vehicle import Vehicle
from weighbridge.vehicle.classes import FASTEST, STRONGEST

_SPEEDS: Final = ("kmh", "mph", "kn", "mps")
# Unit the name says, unit the numbers are in, as they occur in practice.
_CONFUSIONS: Final = tuple(
    (said, meant, UNITS[said].factor / UNITS[meant].factor)
    for said, meant in (
        ("kmh", "mph"),
        ("mph", "kmh"),
        ("kmh", "mps"),
        ("mps", "kmh"),
        ("mph", "mps"),
        ("mps", "mph"),
        ("kmh", "kn"),
        ("mps", "kn"),
        ("kn", "mps"),
    )
)

# A speedometer reads up to a tenth more than the wheels do.
_TOLERANCE: Final = 0.10

# Windows over which a speed is judged by itself, and how many of them must be beyond belief [s].
_WINDOW: Final = 3.0
_WINDOWS: Final = 3
# No tyre holds more for so long [m/s^2].
_GRIP: Final = 10.0
# Engine over vehicle speed in the longest gears that are built is 4.3 rad/m or more.
_LONGEST_GEAR: Final = 3.3
# An engine that turns slower is none, or its speed is in another unit [rad/s].
_TURNS: Final = 62.0


def check_scales(drive: Drive, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Compare speeds with each other, with positions, gears and acceleration."""
    positions = list(_check_positions(drive))
    yield from positions
    trusted = None if positions else _position_speed(drive)
    gnss = drive.get("gnss_speed")
    if gnss is not None and trusted is not None:
        ratio = _ratio(gnss, trusted)
        if ratio is not None and (
            problem := _scale_problem(drive, "gnss_speed", ratio, "the positions")
        ):
            yield problem
            gnss = None
    speed = drive.get("vehicle_speed")
    if speed is None or len(speed) < 20:
        if gnss is not None and trusted is None:
            yield from _check_alone(drive, gnss, vehicle)
        return
    for reference, source in ((gnss, "gnss_speed"), (trusted, "the positions")):
        ratio = _ratio(speed, reference) if reference is not None else None
        if ratio is not None:
            if problem := _scale_problem(drive, "vehicle_speed", ratio, source):
                yield problem
            return
    found = _gear_ratio(drive, speed, vehicle)
    if found is not None:
        if problem := _scale_problem(drive, "vehicle_speed", found, phrase("by_gears"), 0.06):
            yield replace(problem, text=phrase("or_another_car", text=problem.text))
        return
    ratio = _accel_ratio(drive, speed)
    if ratio is not None:
        problem = _scale_problem(drive, "vehicle_speed", ratio, "the acceleration", only_units=True)
        if problem:
            yield problem
        if problem or abs(ratio - 1.0) < 2.0 * _TOLERANCE:
            return
    yield from _check_alone(drive, speed, vehicle)


def _check_alone(drive: Drive, speed: Signal, vehicle: Vehicle | None) -> Iterator[Problem]:
    """Question a speed that nothing else of the drive can be compared with."""
    why = _beyond_belief(drive, speed, vehicle)
    if why:
        stem = "speed" if speed.name == "gnss_speed" else speed.name
        said = drive.units.get(speed.name, "mps")
        smaller = [u for u in _SPEEDS if UNITS[u].factor < 0.9 * UNITS[said].factor]
        yield Problem.of(
            "speed.unit_doubtful" if smaller else "speed.factor_doubtful",
            speed.name,
            serious=True,
            why=why,
            stem=stem,
            said=said,
            smaller=" or ".join(smaller),
        )


def _beyond_belief(drive: Drive, speed: Signal, vehicle: Vehicle | None) -> str:
    """Say what no vehicle does; empty where nothing is."""
    # Recorded cars stay below 41 m/s and 55 W/kg; km/h under m/s multiplies by 3.6 and 13.
    fastest, strongest = FASTEST, STRONGEST
    if vehicle is not None:
        fastest, strongest = vehicle.of_class.fastest, vehicle.of_class.strongest
    at = windows.edges(float(speed.time[0]), float(speed.time[-1]), _WINDOW)
    if at.size < 10:
        return ""
    v = speed.at(at)
    known = np.isfinite(v) & (speed.age(at) < 0.5 * _WINDOW)
    mean = (0.5 * (v[1:] + v[:-1]))[known[1:] & known[:-1]]
    accel = (np.diff(v) / _WINDOW)[known[1:] & known[:-1]]
    if mean.size < 10:
        return ""
    top, power, change = (float(np.sort(x)[-_WINDOWS]) for x in (mean, mean * accel, np.abs(accel)))
    if top > fastest:
        return phrase("speed_too_fast", top=3.6 * top)
    if change > _GRIP:
        return phrase("speed_grip", change=change, window=_WINDOW)
    if power > strongest:
        return phrase("speed_power", power=power)
    gearing = _usual_gearing(drive, speed)
    if gearing is not None and gearing < _LONGEST_GEAR:
        return phrase("speed_gear", gearing=gearing)
    return ""


def _usual_gearing(drive: Drive, speed: Signal) -> float | None:
    """Median of engine over vehicle speed in the fast part of a drive [rad/m]."""
    engine = drive.get("engine_speed")
    if engine is None or not len(engine):
        return None
    v = speed.at(engine.time)
    near = np.isfinite(v) & (speed.age(engine.time) < 2.0)
    if not near.any() or float(np.max(engine.values[near])) < _TURNS:
        return None
    fast = near & (v > 5.0) & (v > 0.4 * float(np.percentile(v[near], 90)))
    # Engines that idle while the vehicle rolls say nothing of gears, nor do those that stand.
    fast &= engine.values > 1.4 * _TURNS
    if np.count_nonzero(fast) < 100:
        return None
    return float(np.median(engine.values[fast] / v[fast]))


def _scale_problem(
    drive: Drive, name: str, ratio: float, source: str, near: float = 0.08, *,
    only_units: bool = False,
) -> Problem | None:  # fmt: skip
    """Judge a speed that reads ``ratio`` times another source of it."""
    if abs(ratio - 1.0) < _TOLERANCE:
        return None
    if not ratio > 0.0:
        return Problem.of("speed.against", name, serious=True, source=source)
    pairs = list(_CONFUSIONS)
    if (said := drive.units.get(name)) is not None:
        pairs = [(said, m, UNITS[said].factor / UNITS[m].factor) for m in _SPEEDS if m != said]
    expected = min((c[2] for c in pairs), key=lambda e: abs(np.log(ratio / e)))
    stem = "speed" if name == "gnss_speed" else name
    if abs(np.log(ratio / expected)) < near:
        # Several pairs of units have one ratio: the name says which one it is.
        alike = [(s, m) for s, m, e in pairs if abs(np.log(e / expected)) < 0.02]
        texts = " or ".join(
            phrase("speed_unit_pair", unit=m, stem=stem, suffix=s) for s, m in alike
        )
        return Problem.of(
            "speed.unit",
            name,
            serious=True,
            ratio=ratio,
            source=source,
            texts=texts,
            stem=stem,
            alike=alike[0][1],
        )
    if said is not None and any(abs(np.log(ratio / c[2])) < near for c in _CONFUSIONS):
        # The ratio is that of two units, and none of them is the one that is declared.
        return Problem.of(
            "speed.factor",
            name,
            serious=True,
            ratio=ratio,
            source=source,
            said=said,
            factor=1.0 / ratio,
        )
    if only_units or abs(ratio - 1.0) < 0.2:
        return None
    return Problem.of("speed.scale", name, serious=True, ratio=ratio, source=source)


def _position_speed(drive: Drive) -> Signal | None:
    """Speed between fixes some 4 s apart, at the middle of each."""
    found = windows.track(drive, 4.0)
    if found is None:
        return None
    time, north, east = found
    step = np.diff(time)
    good = step < 10.0
    middle = 0.5 * (time[1:] + time[:-1])
    return Signal("gnss_speed", middle[good], (np.hypot(north, east) / step)[good])


def _ratio(speed: Signal, reference: Signal) -> float | None:
    """Median ratio of two speeds while both move."""
    if len(reference) < 10:
        return None
    usual = float(np.percentile(reference.values, 90))
    if usual < 1e-6:
        return None
    v = speed.at(reference.time)
    near = speed.age(reference.time) < 2.0
    # Relative to the fast part of the drive, so that a wrong unit does not hide it.
    moving = near & (reference.values > 0.4 * usual) & (np.abs(v) > 0.05)
    if np.count_nonzero(moving) < 10 or (usual < 2.0 and float(np.percentile(v[near], 90)) < 3.0):
        return None
    return float(np.median(v[moving] / reference.values[moving]))


def _check_positions(drive: Drive) -> Iterator[Problem]:
    """Find radians for degrees, and latitude and longitude swapped."""
    speed = drive.get("gnss_speed") or drive.get("vehicle_speed")
    if speed is None or len(speed) < 20:
        return
    lat, lon = drive.get("latitude"), drive.get("longitude")
    if lat is not None and lon is not None and len(lat) and len(lon):
        beyond = abs(float(np.median(lat.values))) > np.pi / 2.0
        if beyond and abs(float(np.median(lon.values))) < np.pi / 2.0:
            yield _swapped(lat, lon)
            return
    spreads: list[float] = []
    centres: list[float] = []
    bearings: list[float] = []
    course = drive.get("gnss_course")
    for swapped in (False, True):
        found = windows.track(drive, 4.0, swapped=swapped)
        if found is None:
            return
        time, north, east = found
        step, middle = np.diff(time), 0.5 * (time[1:] + time[:-1])
        v, way = speed.at(middle), np.hypot(north, east)
        good = (step < 10.0) & (v > 3.0) & (way > 0.0) & (speed.age(middle) < 2.0)
        if np.count_nonzero(good) < 10:
            return
        log = np.log(way[good] / (v[good] * step[good]))
        centres.append(float(np.median(log)))
        spreads.append(float(np.median(np.abs(log - np.median(log)))))
        if course is not None and len(course) >= 20:
            turn = np.arctan2(east, north) - course.held(middle)
            turn = np.abs((turn + np.pi) % (2.0 * np.pi) - np.pi)[good]
            bearings.append(float(np.nanmedian(turn)))
    if abs(centres[0] - np.log(np.pi / 180.0)) < 0.3:
        yield Problem.of("position.radians", "latitude", serious=True, share=np.exp(centres[0]))
        return
    # Swapped, east is stretched by 1/cos(latitude): distances fit only the other way round.
    crossed = spreads[0] > 0.05 and spreads[1] < 0.4 * spreads[0]
    turned = len(bearings) == 2 and bearings[0] > 0.6 and bearings[1] < 0.3
    if crossed or turned:
        yield _swapped(drive.signals["latitude"], drive.signals["longitude"])


def _swapped(lat: Signal, lon: Signal) -> Problem:
    return Problem.of(
        "position.swapped",
        "latitude",
        serious=True,
        latitude=np.degrees(np.median(lat.values)),
        longitude=np.degrees(np.median(lon.values)),
    )


def _gear_ratio(drive: Drive, speed: Signal, vehicle: Vehicle | None) -> float | None:
    """Scale of the speed that puts engine over vehicle speed onto the known gears."""
    engine = drive.get("engine_speed")
    if engine is None or vehicle is None or not vehicle.driveline.gearings or not len(engine):
        return None
    v = speed.at(engine.time)
    moving = (v > 0.3) & (speed.age(engine.time) < 1.0) & (engine.values > 30.0)
    # The fast part: a clutch slips and gears are sought in the slow one.
    moving &= v > 0.25 * np.nanmax(np.where(moving, v, 0.0), initial=0.0)
    if np.count_nonzero(moving) < 100:
        return None
    ratio = np.log(engine.values[moving] / v[moving])
    gears = np.log(np.array(vehicle.driveline.gearings) / vehicle.driveline.speed_scale)
    scales = np.array([1.0, *sorted({c[2] for c in _CONFUSIONS})])
    hits = np.array([_on_gears(ratio + np.log(c), gears) for c in scales])
    best = int(np.argmax(hits))
    # One that reads some percent off is nearer than another unit.
    near = [c for low in (0.88, 1.05) for c in np.geomspace(low, 1.08 * low, 9)]
    slight = max(_on_gears(ratio + np.log(c), gears) for c in near)
    if hits[0] > 0.5 or slight > hits[best] + 0.1:
        return 1.0
    return float(scales[best]) if hits[best] > 0.6 and hits[best] > 2.0 * hits[0] else None


def _on_gears(ratio: Floats, gears: Floats) -> float:
    """Part of the samples within 4 % of a gear."""
    near = np.min(np.abs(ratio[:, None] - gears[None, :]), axis=1)
    return float(np.mean(near < 0.04))


def _accel_ratio(drive: Drive, speed: Signal) -> float | None:
    """Change of speed over specific force along the vehicle, whatever its axes."""
    axes = [drive.get("longitudinal_accel")]
    if axes[0] is None:
        axes = [drive.get(f"accel_{a}") for a in "xyz"]
    present = [s for s in axes if s is not None and len(s) > 20]
    if len(present) != len(axes):
        return None
    start = max(float(s.time[0]) for s in (*present, speed))
    end = min(float(s.time[-1]) for s in (*present, speed))
    length = 4.0
    if end - start < 30 * length or speed.period > 1.5:
        return None
    at = windows.edges(start, end, length)
    full = np.ones(at.size - 1, dtype=bool)
    force = np.empty((at.size - 1, len(present)))
    for k, s in enumerate(present):
        force[:, k], ok = windows.means(s, at)
        full &= ok
    full &= (speed.age(at[1:]) < 0.5) & (speed.age(at[:-1]) < 0.5)
    accel = np.diff(speed.at(at)) / length
    full &= np.isfinite(accel)
    # Differences of neighbours take out grade, bias and gravity, which change slowly.
    pairs = full[1:] & full[:-1]
    x, y = np.diff(accel)[pairs], np.diff(force, axis=0)[pairs]
    if x.size < 30 or float(np.std(x)) < 0.05:
        return None
    slope = x @ y / (x @ x)
    size = float(np.linalg.norm(slope))
    if size == 0.0:
        return None
    along = y @ (slope / size)
    agreement = float(np.corrcoef(along, x)[0, 1])
    return 1.0 / size if agreement > 0.9 else None
