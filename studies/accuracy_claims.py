"""What the joint estimator is meant to stand: wind, other loggers, loading, no calibration.

Each part draws its vehicles and drives from seeds of `FIRST` up, used in no tuning, and
writes its figures as words and a table. `accuracy.py` runs them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from accuracy_drives import (
    FULL,
    KINDS,
    calibrated,
    compile_all,
    final_mass,
    known_drives,
    scenario,
    shared_out,
)
from fault_kinds.inertial import pitch_creeps
from scipy.special import ndtr

from weighbridge.errors import DriveError
from weighbridge.estimators.joint import batch
from weighbridge.papers.jensen2022_drives import without_weather
from weighbridge.pipeline.weighing import Weighing, weigh
from weighbridge.signals import Drive
from weighbridge.simulation import (
    Loading,
    Polling,
    Scenario,
    SimulatedCar,
    SimulatedDrive,
    flat_route,
    highway_route,
    mixed_route,
    random_vehicle,
    simulate_car,
)
from weighbridge.vehicle.classes import VEHICLE_CLASSES
from weighbridge.vehicle.data_sheet import friction_coefficients
from weighbridge.vehicle.model import (
    Driveline,
    Layout,
    RoadLoad,
    TorqueModel,
    Vehicle,
)

FIRST: Final = 198_000
"""First seed: those from 190 000 on are of the table of methods."""

Rows = list[tuple[Any, list[Any]]]


def fleet(number: int, part: int) -> tuple[str, SimulatedCar, np.random.Generator, int]:
    """Draw a vehicle: its kind, itself, the generator for its drives and their first seed."""
    kind = KINDS[number % len(KINDS)]
    rng = np.random.default_rng([FIRST, number])
    car = random_vehicle(rng, kind)
    return (
        kind,
        car,
        np.random.default_rng([FIRST, number, part]),
        FIRST + 1000 * part + 50 * number,
    )


def vehicle_file(number: int) -> list[Vehicle]:
    """Calibrate a vehicle of the fleet by three ordinary drives of known mass."""
    _, car, rng, seed = fleet(number, 9)
    return [calibrated(car, known_drives(car, rng, seed))]


def any_load(car: SimulatedCar, rng: np.random.Generator) -> float:
    return float(rng.uniform(0.0, FULL[car.kind] * car.mass))


def held(weighing: Weighing, mass: float) -> bool:
    low, high = weighing.interval(0.95)
    return low <= mass <= high


def spread(values: Sequence[float]) -> str:
    """RMS, mean, 95th percentile and worst, in percent."""
    x = 100.0 * np.asarray(values)
    x = x[np.isfinite(x)]
    if not x.size:
        return "| – | – | – | – "
    return (
        f"| {np.sqrt(np.mean(x**2)):.2f} | {x.mean():+.2f} "
        f"| {np.percentile(np.abs(x), 95):.2f} | {np.max(np.abs(x)):.2f} "
    )


def each(values: Sequence[float]) -> str:
    return ", ".join(f"{100.0 * v:+.1f}" for v in sorted(values))


# Wind: out and back on a highway.

TRIPS: Final[dict[str, tuple[float, float]]] = {
    "110 km/h": (110.0, 0.0),
    "120 km/h": (120.0, 0.0),
    "120 km/h in traffic": (120.0, 1.0),
}
"""Limit [km/h] and how much others slow down."""

WINDS: Final = (10.0, 0.0)
"""At 10 m height [m/s]; a car sees half of it."""


@dataclass(frozen=True)
class OutAndBack:
    """One trip; of what is a pair, first the way out, then the way back."""

    kind: str
    trip: str
    wind: float
    ahead: int
    """1 where the wind blows against the way out, -1 where against the way back."""
    errors: tuple[float, float]
    bounds: tuple[float, float]
    held: tuple[bool, bool]
    weighed: tuple[bool, bool]

    @property
    def apart(self) -> float:
        return self.errors[0] - self.errors[1]

    @property
    def apart_bound(self) -> float:
        return math.hypot(*self.bounds)


def highway(
    car: SimulatedCar, rng: np.random.Generator, seed: int, *, limit: float, traffic: float
) -> Scenario:
    """Draw a highway out and back, with a rest of a minute at the turn, in no wind yet."""
    route = highway_route(int(rng.integers(1000, 2000)))
    fast = route.limit > 25.0
    made = scenario(car, rng, load=any_load(car, rng), seed=seed)
    return replace(
        made,
        name="highway",
        route=replace(route, limit=np.where(fast, limit, route.limit)),
        loading=(Loading(distance=0.5 * route.length + 60.0, duration=60.0, load=0.0),),
        # Engine and tyres are warm: it is the wind that is looked at.
        effects=replace(made.effects, traffic=traffic, warm_up=0.0),
        sensors=replace(made.sensors, gnss_outages=()),
    )


def resting(made: SimulatedDrive) -> np.ndarray:
    """Where the drive stands at its stop for loading."""
    truth, (stop,) = made.truth, made.scenario.loading
    return (truth.speed < 0.05) & (np.abs(truth.distance - stop.distance) < 15.0)


def directions(made: SimulatedDrive) -> tuple[Drive, Drive]:
    """Cut the drive in the middle of the rest at the turn."""
    middle = float(np.mean(made.truth.time[resting(made)]))
    drive = without_weather(made.drive)
    return drive.between(drive.start, middle), drive.between(middle, drive.end)


def wind_job(number: int, vehicle: Vehicle) -> list[OutAndBack]:
    kind, car, rng, seed = fleet(number, 0)
    found = []
    for k, (trip, (limit, traffic)) in enumerate(TRIPS.items()):
        drawn = highway(car, rng, seed + 10 + k, limit=limit / 3.6, traffic=traffic)
        half = drawn.route.heading.size // 2
        course = float(np.median(drawn.route.heading[:half]))
        ahead = 1 if number % 2 == 0 else -1
        blows_from = math.remainder(course + (0.0 if ahead > 0 else math.pi), 2.0 * math.pi)
        for wind in WINDS:
            made = simulate_car(replace(drawn, wind_speed=wind, wind_from=blows_from))
            mass = final_mass(made)
            ways = [weigh(drive, vehicle) for drive in directions(made)]
            bounds = [w.result.bound_std / mass if w.result else math.nan for w in ways]
            found.append(
                OutAndBack(
                    kind,
                    trip,
                    wind,
                    ahead,
                    errors=(ways[0].mass / mass - 1.0, ways[1].mass / mass - 1.0),
                    bounds=(bounds[0], bounds[1]),
                    held=(held(ways[0], mass), held(ways[1], mass)),
                    weighed=(math.isfinite(ways[0].mass), math.isfinite(ways[1].mass)),
                )
            )
    return found


def write_wind(done: Rows) -> str:
    rows = [row for _, part in done for row in part]
    lines = [
        "| wind m/s | trip | trips | difference out − back: RMS % | mean % | 95th % | worst % "
        "| within 1.5 % | against − with the wind: mean ± standard error % "
        "| bound of a difference, RMS % | one direction: RMS % | intervals that hold |",
        "|---" * 12 + "|",
    ]
    for wind in WINDS:
        for trip in (*TRIPS, "all"):
            chosen = [r for r in rows if r.wind == wind and trip in (r.trip, "all")]
            known = [r for r in chosen if all(r.weighed)]
            apart = np.array([r.apart for r in known])
            signed = 100.0 * apart * np.array([r.ahead for r in known])
            ways = [(e, h) for r in chosen for e, h, w in zip(r.errors, r.held, r.weighed,
                                                             strict=True) if w]  # fmt: skip
            bound = 100.0 * np.sqrt(np.mean([r.apart_bound**2 for r in known]))
            alone = 100.0 * np.sqrt(np.mean([e**2 for e, _ in ways]))
            lines.append(
                f"| {wind:.0f} | {trip} | {len(chosen)} {spread(list(apart))}"
                f"| {np.mean(np.abs(apart) <= 0.015):.0%} "
                f"| {signed.mean():+.2f} ± {signed.std(ddof=1) / math.sqrt(signed.size):.2f} "
                f"| {bound:.2f} | {alone:.2f} | {sum(h for _, h in ways)} of {len(ways)} |"
            )
    windy = [r.apart for r in rows if r.wind and all(r.weighed)]
    refused = sum(not w for r in rows for w in r.weighed)
    lines += [
        "",
        f"Differences in 10 m/s, in percent: {each(windy)}. Directions refused: {refused}.",
    ]
    return "\n".join(lines)


# Noise on both sides: other loggers, the same drives.

STANDARD: Final = "4 Hz, noise as usual"
TORQUE_NOISE: Final = 0.02
"""White noise of the torque reading over full torque, as usual in this part [-]."""

LOGGERS: Final[dict[str, tuple[float, float, float]]] = {
    STANDARD: (4.0, 1.0, 1.0),
    "10 Hz": (10.0, 1.0, 1.0),
    "2 Hz": (2.0, 1.0, 1.0),
    "torque noise halved": (4.0, 0.5, 1.0),
    "torque noise doubled": (4.0, 2.0, 1.0),
    "motion noise halved": (4.0, 1.0, 0.5),
    "motion noise doubled": (4.0, 1.0, 2.0),
}
"""Poll rate [Hz], factors on the noise of torque and of motion [-]."""

MOTION_NOISE: Final = (
    "imu_noise",
    "imu_vibration",
    "imu_jitter",
    "imu_quantisation",
    "roughness",
    "gnss_white",
    "gnss_correlated",
)
LOGGED: Final = 8


def logged(made: Scenario, logger: str) -> Scenario:
    """Let another logger record the same drive."""
    rate, torque, motion = LOGGERS[logger]
    sizes = {name: motion * getattr(made.effects, name) for name in MOTION_NOISE}
    return replace(
        made,
        polling=replace(made.polling, rate=rate, torque_noise=torque * TORQUE_NOISE),
        effects=replace(made.effects, obd_jitter=torque, **sizes),
    )


def mixed(
    car: SimulatedCar,
    rng: np.random.Generator,
    *,
    load: float,
    seed: int,
    polling: Polling | None = None,
) -> Scenario:
    """Draw an ordinary drive on a third of the usual road, half an hour."""
    made = scenario(car, rng, load=load, seed=seed, polling=polling)
    route = mixed_route(
        int(rng.integers(1000, 2000)),
        out=[("city", 1500), ("country", 5000), ("highway", 5000), ("hills", 2500)],
        back=[("hills", 2500), ("highway", 5000), ("country", 5000), ("city", 1500)],
    )
    return replace(made, route=route)


def logger_job(number: int) -> list[dict[str, tuple[float, float]]]:
    """Weigh drives by every logger: with the vehicle file of the usual one, and with its own."""
    _, car, rng, seed = fleet(number, 1)
    full = FULL[car.kind] * car.mass
    known = [
        mixed(car, rng, load=part * full, seed=seed + k) for k, part in enumerate((0.0, 0.5, 0.9))
    ]
    drives = [mixed(car, rng, load=any_load(car, rng), seed=seed + 10 + k) for k in range(LOGGED)]
    files = {
        name: calibrated(car, [simulate_car(logged(s, name)) for s in known]) for name in LOGGERS
    }
    found: list[dict[str, tuple[float, float]]] = [{} for _ in drives]
    for drawn, masses in zip(drives, found, strict=True):
        for name, own in files.items():
            made = simulate_car(logged(drawn, name))
            mass, drive = final_mass(made), without_weather(made.drive)
            by_usual = weigh(drive, files[STANDARD]).mass / mass
            by_own = by_usual if name == STANDARD else weigh(drive, own).mass / mass
            masses[name] = by_usual, by_own
    return found


def write_logger(done: Rows) -> str:
    lines = [
        "| vehicle | logger | file of the usual logger: mean moves by % | standard error % "
        "| its own file: mean moves by % | standard error % | RMS error %, its own file |",
        "|---" * 7 + "|",
    ]
    largest = [0.0, 0.0]
    for number, drives in done:
        usual = np.array([masses[STANDARD] for masses in drives])
        for logger in LOGGERS:
            rows = np.array([masses[logger] for masses in drives])
            moved = 100.0 * (rows / usual - 1.0)
            mean = moved.mean(axis=0)
            error = moved.std(axis=0, ddof=1) / math.sqrt(len(moved))
            largest = [max(a, abs(b)) for a, b in zip(largest, mean, strict=True)]
            rms = 100.0 * np.sqrt(np.mean((rows[:, 1] - 1.0) ** 2))
            lines.append(
                f"| {KINDS[number % len(KINDS)]} | {logger} | {mean[0]:+.2f} | {error[0]:.2f} "
                f"| {mean[1]:+.2f} | {error[1]:.2f} | {rms:.2f} |"
            )
    lines += [
        "",
        f"Largest move of a mean: {largest[0]:.2f} % with the file of the usual logger, "
        f"{largest[1]:.2f} % with its own.",
    ]
    return "\n".join(lines)


# Loading at a stop.

LOADED: Final = 240.0
SOON: Final = 90.0


@dataclass(frozen=True)
class Loaded:
    kind: str
    soon: float
    tracked: float
    final: float
    found_at: float
    changes: int
    standing: float


def loading_job(number: int, vehicle: Vehicle) -> list[Loaded]:
    """Load at a stop on a country road, and look at the running mass after that."""
    kind, car, rng, seed = fleet(number, 2)
    found = []
    for k in range(5):
        room = FULL[car.kind] * car.mass
        # As heavy for a truck as 240 kg are for a car.
        load = LOADED if car.kind != "truck" else 0.15 * car.mass
        drawn = scenario(car, rng, load=float(rng.uniform(0.0, max(room - load, 0.0))),
                         seed=seed + 10 + k)  # fmt: skip
        stop = Loading(distance=float(rng.uniform(6e3, 13e3)), duration=90.0, load=load)
        made = simulate_car(
            replace(drawn, loading=(stop,), duration=1800.0, name=f"loading {seed + 10 + k}")
        )
        truth = made.truth
        leaves = float(truth.time[resting(made)][-1])
        mass = float(truth.mass[-1])
        drive = without_weather(made.drive)
        whole = weigh(drive, vehicle).result
        # Nothing later is known: not to the navigation, nor to the levels of noise.
        early = weigh(drive.between(drive.start, leaves + SOON), vehicle).result
        assert whole is not None
        assert early is not None
        error = whole.running_mass / mass - 1.0
        after = whole.time > leaves
        off = np.flatnonzero(after & ~(np.abs(error) <= 0.03))
        ninety = truth.time <= leaves + SOON
        found.append(
            Loaded(
                kind,
                float(early.running_mass[-1]) / mass - 1.0,
                float(error[np.searchsorted(whole.time, leaves + SOON) - 1]),
                whole.mass / mass - 1.0,
                float(whole.time[min(off[-1] + 1, whole.time.size - 1)]) - leaves
                if off.size
                else 0.0,
                len(whole.segments) - 1,
                float(np.mean(truth.speed[ninety & (truth.time > leaves)] < 0.5)) * SOON,
            )
        )
    return found


def write_loading(done: Rows) -> str:
    rows = [row for _, part in done for row in part]
    lines = [
        "| vehicle | drives | within 3 % after 90 s | in the track of the whole drive "
        "| error after 90 s: RMS % | mean % | 95th % | worst % | median time to stay within 3 %, s "
        "| final error, RMS % | changes found |",
        "|---" * 11 + "|",
    ]
    for kind in (*dict.fromkeys(r.kind for r in rows), "all"):
        chosen = [r for r in rows if kind in (r.kind, "all")]
        final = [r.final for r in chosen]
        lines.append(
            f"| {kind} | {len(chosen)} | {np.mean([abs(r.soon) <= 0.03 for r in chosen]):.0%} "
            f"| {np.mean([abs(r.tracked) <= 0.03 for r in chosen]):.0%} "
            f"{spread([r.soon for r in chosen])}"
            f"| {np.median([r.found_at for r in chosen]):.0f} "
            f"| {100.0 * np.sqrt(np.mean(np.square(final))):.2f} "
            f"| {sum(r.changes == 1 for r in chosen)} |"
        )
    lines += ["", f"Errors after 90 s, in percent: {each([r.soon for r in rows])}."]
    return "\n".join(lines)


# No calibration.

OBD_TORQUE: Final = Polling(
    fast=("vehicle_speed", "engine_speed", "engine_torque_fraction"),
    slow=("reference_torque", "ambient_temperature", "barometric_pressure"),
)
"""PIDs 62 and 63 beside the speeds."""

UNCALIBRATED: Final = (3, 9, 0, 1, 2, 8, 5, 11)
TORQUE_SCALE_STD: Final = 0.03
"""What control units are wrong by in their torque [-]: chosen; emission rules grant them 7 %
of the full-load torque."""


def data_sheet(car: SimulatedCar, rng: np.random.Generator, idle: float | None) -> Vehicle:
    """Write the vehicle file that a data sheet and the tyres' size give.

    Ratios are exact. The rolling radius, from the size of the tyres, is 1 % off. C_d A is
    a car's by its maker, from a wind tunnel, 7 % off; a van's or truck's that of its
    class. C_r and inertias are those of the class. Of the driveline the file says how a
    car's engine lies, lengthwise with the automatic (its gears are those of a gearbox for
    such cars), else across, and not how efficient it is.

    Parameters
    ----------
    car, rng
    idle : reading of the torque at idle, where friction is in it [-]
    """
    single = car.transmission == "single"
    mean, _ = VEHICLE_CLASSES[car.kind].road_prior(single_speed=single)
    radius = car.wheel_radius * float(rng.normal(1.0, 0.01))
    known = car.drag_area * float(rng.normal(1.0, 0.07)), 0.07 * car.drag_area
    drag, drag_std = known if car.kind == "car" else (float(mean[0]), None)
    source = "measured" if car.electric else "percent"
    friction: tuple[float, ...] = ()
    if idle is not None:
        w0, w2, w3 = friction_coefficients(
            idle * round(max(car.curve_torque)),
            car.idle_speed,
            "diesel" if car.engine == "diesel" else "petrol",
        )
        friction = (-w0, 1.0, -w2, -w3)
    layout: Layout = "longitudinal" if car.transmission == "automatic" else "transverse"
    return Vehicle(
        name="data sheet",
        kind=car.kind,
        tare=car.mass,
        driveline=Driveline(
            gearings=tuple(g * car.final_drive / radius for g in car.gear_ratios),
            engine_inertia=float(mean[2]),
            wheel_inertia=float(mean[3]),
            wheel_radius=radius,
            layout=layout if car.kind == "car" and not single else None,
        ),
        torque=TorqueModel(source=source, coefficients=friction),
        road_load=RoadLoad(
            drag_area=drag, drag_area_std=drag_std, rolling_coefficient=float(mean[1])
        ),
    )


def idle_reading(drive: Drive) -> float:
    """Torque that the engine reads standing at idle, by `inspect` [-]."""
    torque, speed = drive.signals["engine_torque_fraction"], drive.signals["vehicle_speed"]
    still = np.all([np.abs(speed.at(torque.time + s)) < 0.3 for s in (-2.0, 0.0, 2.0)], axis=0)
    return float(np.percentile(torque.values[still], 10.0))


@dataclass(frozen=True)
class Uncalibrated:
    kind: str
    error: float
    std: float
    held: bool
    scaled_error: float
    scaled_held: bool
    mean_part: float


def data_sheet_job(number: int) -> list[Uncalibrated]:
    kind, car, rng, seed = fleet(number, 3)
    scale = float(rng.normal(1.0, TORQUE_SCALE_STD))
    polling = None if car.electric or car.kind == "truck" else OBD_TORQUE
    vehicle = None
    found = []
    for k in range(4):
        made = simulate_car(
            mixed(car, rng, load=any_load(car, rng), seed=seed + 10 + k, polling=polling)
        )
        mass, drive = final_mass(made), without_weather(made.drive)
        if vehicle is None:
            # PID 62 has friction in it; its reading at idle is taken off for every drive.
            vehicle = data_sheet(car, rng, idle_reading(drive) if polling is OBD_TORQUE else None)
        right = weigh(drive, vehicle)
        off, on, *friction = vehicle.torque.coefficients or (0.0, 1.0)
        wrong = weigh(
            drive,
            replace(
                vehicle, torque=replace(vehicle.torque, coefficients=(off, on * scale, *friction))
            ),
        )
        found.append(
            Uncalibrated(
                kind,
                right.mass / mass - 1.0,
                right.std / mass,
                held(right, mass),
                wrong.mass / mass - 1.0,
                held(wrong, mass),
                scale,
            )
        )
    return found


def write_data_sheet(done: Rows) -> str:
    rows = [row for _, part in done for row in part]
    lines = [
        "| vehicle | torque read | drives | RMS % | mean % | 95th % | worst % | within 5 % "
        "| intervals that hold | standard deviation reported % |",
        "|---" * 10 + "|",
    ]
    for kind in (*dict.fromkeys(r.kind for r in rows), "all"):
        chosen = [r for r in rows if kind in (r.kind, "all")]
        for name, errors, holds in (
            ("right", [r.error for r in chosen], [r.held for r in chosen]),
            ("3 % off", [r.scaled_error for r in chosen], [r.scaled_held for r in chosen]),
        ):
            lines.append(
                f"| {kind} | {name} | {len(chosen)} {spread(errors)}"
                f"| {np.mean(np.abs(errors) <= 0.05):.0%} | {np.mean(holds):.0%} "
                f"| {100.0 * np.nanmean([r.std for r in chosen]):.1f} |"
            )
    return "\n".join(lines)


# A cruise, and a wrong start.


@dataclass(frozen=True)
class Cruise:
    kind: str
    step: float
    launched: bool
    status: str
    error: float
    std: float
    held: bool


CRUISE: Final = 1200.0
"""Length [s]."""

SPEED_STEPS: Final = (1.0, 1.0 / 256.0)
"""Resolution of the speed by OBD and on the bus [km/h]."""


def cruise_job(number: int, vehicle: Vehicle) -> list[Cruise]:
    """Drive twenty minutes on the flat; with the launch and the last stop, and without."""
    kind, car, rng, seed = fleet(number, 4)
    found = []
    for k in range(4):
        speed = float(rng.choice([70.0, 90.0, 100.0, 110.0])) / 3.6
        made = scenario(car, rng, load=any_load(car, rng), seed=seed + 10 + k)
        made = simulate_car(
            replace(
                made,
                route=flat_route(speed * CRUISE + 6000.0, limit=speed,
                                 heading=float(rng.uniform(0.0, 6.28))),
                effects=replace(made.effects, traffic=0.0),
                sensors=replace(made.sensors, gnss_outages=()),
                polling=replace(made.polling, speed_step=SPEED_STEPS[k % 2]),
                duration=CRUISE + 180.0,
            )
        )  # fmt: skip
        mass, drive = final_mass(made), without_weather(made.drive)
        for begin in (0.0, 150.0):
            try:
                w = weigh(drive.between(begin, 150.0 + CRUISE), vehicle)
            except DriveError as refusal:
                found.append(
                    Cruise(
                        kind,
                        SPEED_STEPS[k % 2],
                        begin == 0.0,
                        f"refused: {refusal}",
                        math.nan,
                        math.nan,
                        True,
                    )
                )
                continue
            result = w.result
            assert result is not None
            found.append(
                Cruise(
                    kind,
                    SPEED_STEPS[k % 2],
                    begin == 0.0,
                    str(w.status),
                    result.mass / mass - 1.0,
                    result.std / mass,
                    abs(result.mass - mass) <= 1.96 * result.std,
                )
            )
    return found


def write_cruise(done: Rows) -> str:
    rows = [row for _, part in done for row in part]
    lines = [
        "| recorded | drives | refused as bad data | not_excited | weighed, interval holds "
        "| weighed, interval does not | std reported %, least to largest "
        "| errors of what was weighed % |",
        "|---" * 8 + "|",
    ]
    for launched, step in itertools.product((False, True), SPEED_STEPS):
        name = f"{'with the launch' if launched else 'the cruise alone'}, steps of {step:.2g} km/h"
        chosen = [r for r in rows if r.launched == launched and r.step == step]
        weighed = [r for r in chosen if r.status == "converged"]
        refused = [r for r in chosen if r.status.startswith("refused")]
        stds = [100.0 * r.std for r in chosen if math.isfinite(r.std)] or [math.nan]
        lines.append(
            f"| {name} | {len(chosen)} | {len(refused)} "
            f"| {sum(r.status == 'not_excited' for r in chosen)} "
            f"| {sum(r.held for r in weighed)} | {sum(not r.held for r in weighed)} "
            f"| {min(stds):.1f} to {max(stds):.1f} | {each([r.error for r in weighed])} |"
        )
    return "\n".join(lines)


STARTS: Final = (1.0 / 3.0, 1.0, 3.0)


@contextmanager
def started(factor: float) -> Iterator[None]:
    """Let the filter start at a multiple of its guess."""
    guess = batch.first_guess
    batch.first_guess = lambda phi, y: factor * guess(phi, y)
    try:
        yield
    finally:
        batch.first_guess = guess


def start_job(number: int, vehicle: Vehicle) -> list[tuple[float, ...]]:
    _, car, rng, seed = fleet(number, 5)
    found = []
    for k in range(3):
        made = simulate_car(mixed(car, rng, load=any_load(car, rng), seed=seed + 10 + k))
        mass, drive = final_mass(made), without_weather(made.drive)
        masses = []
        for factor in STARTS:
            with started(factor):
                masses.append(weigh(drive, vehicle).mass / mass - 1.0)
        found.append(tuple(masses))
    return found


def write_start(done: Rows) -> str:
    rows = np.array([row for _, part in done for row in part])
    moved = rows - rows[:, 1:2]
    lines = [
        "| start | drives | error: RMS % | mean % | 95th % | worst % | moved by at most % |",
        "|---" * 7 + "|",
    ]
    for k, name in enumerate(("a third of the guess", "the guess", "three times the guess")):
        most = 100.0 * np.max(np.abs(moved[:, k]))
        lines.append(f"| {name} | {len(rows)} {spread(rows[:, k])}| {most:.2f} |")
    return "\n".join(lines)


# What changes between calibration and drive: the road, the tyres, the mounting.

CONDITIONS: Final = ("ordinary", "first five minutes", "wet road", "larger tyres", "creeping mount")
WET: Final = 1.25
"""Rolling resistance on a wet road over that on a dry one [-]."""

LARGER: Final = 1.012
"""Rolling radius of other tyres over that of the calibration [-]."""

CREEP: Final = 1.0
"""Pitch by which a phone holder gives way over a drive [deg]."""

FIRST_MINUTES: Final = 300.0
"""On the move [s]."""

LIMITS: Final = np.linspace(-0.04, 0.04, 9)
"""Permitted masses that are asked about, over the true mass less one [-]."""


@dataclass(frozen=True)
class InCondition:
    """One drive in one condition, weighed; error and std relative to the mass, NaN without one."""

    kind: str
    number: int
    condition: str
    mass: float
    error: float
    std: float

    @property
    def holds(self) -> bool:
        return abs(self.error) <= 1.96 * self.std


def in_condition(made: Scenario, condition: str) -> SimulatedDrive:
    """Drive the same way under another condition."""
    car, polling = made.car, made.polling
    if condition == "wet road":
        made = replace(made, car=replace(car, rolling_coefficient=WET * car.rolling_coefficient))
    if condition == "larger tyres":
        # The control unit does not know of them.
        polling = replace(polling, speed_scale=polling.speed_scale / LARGER)
        made = replace(
            made, car=replace(car, wheel_radius=LARGER * car.wheel_radius), polling=polling
        )
    return simulate_car(made)


def seen_in(made: SimulatedDrive, condition: str) -> Drive:
    """Return what is weighed of a drive."""
    drive = without_weather(made.drive)
    if condition == "first five minutes":
        moving = np.cumsum((made.truth.speed > 0.5) * np.gradient(made.truth.time))
        end = made.truth.time[np.searchsorted(moving, FIRST_MINUTES)]
        return drive.between(drive.start, float(end))
    if condition == "creeping mount":
        return pitch_creeps(drive, CREEP, np.random.default_rng(0))
    return drive


def condition_job(number: int, vehicle: Vehicle) -> list[InCondition]:
    """Weigh three loads of a vehicle in each condition."""
    kind, car, rng, seed = fleet(number, 6)
    found = []
    for k, part in enumerate((0.0, 0.5, 0.95)):
        drawn = mixed(car, rng, load=part * FULL[car.kind] * car.mass, seed=seed + 10 + k)
        for condition in CONDITIONS:
            made = in_condition(drawn, condition)
            mass = float(made.truth.mass[0])
            try:
                w = weigh(seen_in(made, condition), vehicle)
            except DriveError:
                found.append(InCondition(kind, number, condition, mass, math.nan, math.nan))
                continue
            end = float(np.interp(w.drive.end, made.truth.time, made.truth.mass))
            shown = w.status == "converged"
            error = w.mass / end - 1.0
            found.append(
                InCondition(kind, number, condition, end, error if shown else math.nan, w.std / end)
            )
    return found


def overload_figures(rows: Sequence[InCondition]) -> list[str]:
    """Compare what is reported as the probability of an overload with how often it is one."""
    reported, true = [], []
    for row in rows:
        if math.isfinite(row.error):
            for limit in LIMITS:
                reported.append(float(ndtr((row.error - limit) / row.std)))
                true.append(limit < 0.0)
    shares = np.array(reported)
    lines = ["| probability reported | times | mean reported | overloaded |", "|---|---|---|---|"]
    for low, high in ((0.9, 0.99), (0.5, 0.9), (0.1, 0.5), (0.01, 0.1)):
        chosen = (shares >= low) & (shares < high)
        so = np.array(true)[chosen]
        lines.append(
            f"| {low:.0%} to {high:.0%} | {chosen.sum()} | {shares[chosen].mean():.0%} "
            f"| {so.mean():.0%} |"
            if so.size
            else f"| {low:.0%} to {high:.0%} | 0 | | |"
        )
    return lines


def write_conditions(done: Rows) -> str:
    rows = [row for _, part in done for row in part]
    usual = {(r.number, k): r.error for r, k in _numbered(rows, "ordinary")}
    lines = [
        "| condition | weighed | RMS % | mean % | 95th % | worst % "
        "| mean beside the ordinary drive % | intervals that hold | (error / std)², mean |",
        "|---" * 9 + "|",
    ]
    for condition in CONDITIONS:
        chosen = [r for r in rows if r.condition == condition]
        known = [r for r in chosen if math.isfinite(r.error)]
        moved = [r.error - usual[r.number, k] for r, k in _numbered(rows, condition)]
        scaled = np.array([r.error / r.std for r in known])
        lines.append(
            f"| {condition} | {len(known)} of {len(chosen)} {spread([r.error for r in known])}"
            f"| {100.0 * np.nanmean(moved):+.2f} | {np.mean([r.holds for r in known]):.0%} "
            f"| {np.mean(scaled**2):.2f} |"
        )
    gains: dict[str, list[str]] = {}
    for number in dict.fromkeys(r.number for r in rows):
        own = [
            r for r in rows
            if r.number == number and r.condition == "ordinary" and math.isfinite(r.error)
        ]  # fmt: skip
        true = np.array([r.mass for r in own])
        slope = np.polyfit(true, true * (1.0 + np.array([r.error for r in own])), 1)[0]
        gains.setdefault(own[0].kind, []).append(f"{slope:.3f}")
    by_kind = "; ".join(f"{kind} {', '.join(many)}" for kind, many in gains.items())
    return "\n".join(
        [*lines, "", f"Gain of load by vehicle: {by_kind}.", "", *overload_figures(rows)]
    )


def _numbered(rows: Sequence[InCondition], condition: str) -> Iterator[tuple[InCondition, int]]:
    """Rows of a condition, each with the number of its drive among those of its vehicle."""
    count: dict[int, int] = {}
    for row in rows:
        if row.condition == condition:
            yield row, count.setdefault(row.number, 0)
            count[row.number] += 1


@dataclass(frozen=True)
class Part:
    """One claim: what is to be done, how, and how its figures are written.

    Attributes
    ----------
    jobs : numbers of vehicles, or what else ``work`` is given
    work : makes rows of figures of a job, and of the vehicle's file where it is ``filed``
    write : writes the figures of all jobs
    filed : whether vehicles calibrated by ordinary drives are weighed
    """

    jobs: tuple[Any, ...]
    work: Callable[..., list[Any]]
    write: Callable[[Rows], str]
    filed: bool = True


PARTS: Final[dict[str, Part]] = {
    "logger": Part((1, 3), logger_job, write_logger, filed=False),
    "wind": Part(tuple(n for n in range(12) if n % 6 != 5), wind_job, write_wind),
    "loading": Part(tuple(range(6)), loading_job, write_loading),
    "data-sheet": Part(UNCALIBRATED, data_sheet_job, write_data_sheet, filed=False),
    "cruise": Part(tuple(range(6)), cruise_job, write_cruise),
    "start": Part(tuple(range(6)), start_job, write_start),
    "conditions": Part(tuple(range(12)), condition_job, write_conditions),
}


def run_parts(parts: Mapping[str, Part]) -> dict[str, str]:
    """Return the figures of each part, as it writes them."""
    numbers = {n for part in parts.values() if part.filed for n in part.jobs}
    compile_all()
    files = dict(zip(numbers, shared_out([(vehicle_file, (n,)) for n in numbers]), strict=True))
    work = [
        (name, job, (part.work, (job, *files[job]) if part.filed else (job,)))
        for name, part in parts.items()
        for job in part.jobs
    ]
    rows = shared_out([do for _, _, do in work])
    done: dict[str, Rows] = {name: [] for name in parts}
    for (name, job, _), found in zip(work, rows, strict=True):
        done[name].append((job, found))
    return {name: part.write(done[name]) for name, part in parts.items()}
