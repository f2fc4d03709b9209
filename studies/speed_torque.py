"""Speed and recorded torque, no accelerometer: ``speed-torque-ekf`` beside ``joint``. Run me.

    python studies/speed_torque.py [own|second|sheets|levels|electric|recorded|logs ...] [--tuning]

Each part prints its rows; ``python studies/galvao.py`` puts them all in ``galvao.md``. Every drive
is stripped of its accelerometer first. A vehicle is calibrated for each of the two methods on three
drives of known mass, and weighed on four others. With ``--tuning`` the seeds are those that
the settings were chosen on.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import polars as pl
import truck_fleet
from accuracy_drives import FULL, KINDS, bare, scenario
from other_simulators import CLASSES, DRIVER
from other_simulators import KINDS as SECOND_KINDS
from second_model import make_drive
from second_model import random_vehicle as second_vehicle

import weighbridge as wb
from weighbridge.errors import WeighbridgeError
from weighbridge.navigation.select import without_accelerometer
from weighbridge.papers.jensen2022_drives import without_weather
from weighbridge.signals import Drive, Floats, Signal
from weighbridge.simulation import SimulatedDrive, random_vehicle, simulate_car
from weighbridge.vehicle.known import Known, describe

METHODS: Final = ("speed-torque-ekf", "joint")
OWN: Final = {"judging": 164_000, "tuning": 163_000}
SECOND: Final = {"judging": 9520, "tuning": 9500}
OWN_LEVELS: Final = {"judging": 184_000, "tuning": 163_000}
SECOND_LEVELS: Final = {"judging": 9740, "tuning": 9500}
OWN_ELECTRIC: Final = {"judging": range(185_000, 185_080, 20), "tuning": (163_060, 163_180)}
SECOND_ELECTRIC: Final = {"judging": (9748, 9758), "tuning": (9508, 9518)}
KNOWN: Final = (0.0, 0.5, 0.9)
WEIGHED: Final = (0.0, 0.3, 0.7, 1.0)
SECOND_WEIGHED: Final = ((0.0, "ordinary"), (0.95, "ordinary"), (0.3, "city"), (0.6, "ordinary"))
DATA: Final = Path(__file__).parents[2] / "shared" / "data"
EXAMPLES: Final = Path(__file__).parents[1] / "examples"

MAP_ERROR: Final = 0.003
"""Standard deviation of a map's grade [rad], chosen."""

MAP_LENGTH: Final = 100.0
"""Way over which that error lasts [m], chosen."""

HEAD: Final = (
    "| drives | method | weighed | RMS % | mean % | worst % | reported, median ± % | within it |\n"
    "|---|---|---|---|---|---|---|---|"
)


class Recorded(NamedTuple):
    """A drive and its mass at the beginning and in the mean [kg]."""

    drive: Drive
    begin: float
    mean: float


class Result(NamedTuple):
    """Error and reported standard deviation over the true mass [-]; NaN where refused."""

    error: float
    std: float


Seen = Callable[[SimulatedDrive, int], Drive]


def heights(drive: Drive) -> Drive:
    """Leave speed, torque and positions."""
    return without_accelerometer(without_weather(drive)).without(
        "gnss_speed", "gnss_course", "hdop", "gnss_accuracy", "grade"
    )


def nowhere(drive: Drive) -> Drive:
    """Leave speed and torque alone: the slope is a state."""
    return heights(drive).without("altitude", "latitude", "longitude")


def on_a_map(drive: Drive, time: Floats, distance: Floats, grade: Floats, seed: int) -> Drive:
    """Give a drive the grade of a map: the true one with errors that last `MAP_LENGTH`.

    Parameters
    ----------
    time, distance, grade : (n,) of the truth [s], [m], [rad]
    """
    rng = np.random.default_rng([seed, 7])
    knots = np.arange(0.0, float(distance[-1]) + MAP_LENGTH, MAP_LENGTH / 4.0)
    kept, error = math.exp(-0.25), np.empty(knots.size)
    error[0] = rng.normal(scale=MAP_ERROR)
    for k in range(1, knots.size):
        error[k] = kept * error[k - 1] + rng.normal(scale=MAP_ERROR * math.sqrt(1.0 - kept**2))
    every = slice(None, None, max(1, round(1.0 / float(np.median(np.diff(time))))))
    mapped = grade[every] + np.interp(distance[every], knots, error)
    return nowhere(drive).with_signals(Signal("grade", time[every], mapped))


def compared(
    base: wb.Vehicle,
    known: Iterable[Recorded],
    weighed: Iterable[Recorded],
    *,
    sheet: bool = False,
) -> dict[str, list[Result]]:
    """Calibrate and weigh by each method; by ``base`` as it is where it is a data sheet."""
    known, weighed, found = list(known), list(weighed), {}
    for method in METHODS:
        car: wb.Vehicle | None = base
        if not sheet:
            settings = wb.CalibrationSettings(method=method)
            try:
                car = wb.calibrate(
                    [k.drive for k in known], [k.begin for k in known],
                    vehicle=base, settings=settings,
                )  # fmt: skip
            except WeighbridgeError as refused:
                sys.stderr.write(f"{method}: {refused}\n")
                car = None
        found[method] = [one(w, car, method) for w in weighed]
        told = " ".join(f"{100 * r.error:+.1f}" for r in found[method])
        sys.stderr.write(f"    {method}: {told}\n")
    return found


def one(made: Recorded, car: wb.Vehicle | None, method: str) -> Result:
    """Weigh one drive; joint tells the mass at its end, the other that of the whole drive."""
    if car is None:
        return Result(np.nan, np.nan)
    try:
        w = wb.weigh(made.drive, car, method)
    except WeighbridgeError as refused:
        sys.stderr.write(f"    {refused}\n")
        return Result(np.nan, np.nan)
    true = made.mean if method != "joint" else 2.0 * made.mean - made.begin
    return Result(w.mass / true - 1.0, w.std / true)


def rows(name: str, groups: Iterable[dict[str, list[Result]]]) -> str:
    """Write one line a method over all vehicles."""
    groups, lines = list(groups), []
    for method in METHODS:
        error, std = 100.0 * np.array([r for g in groups for r in g[method]]).T
        have = np.isfinite(error)
        error, std = error[have], std[have]
        if not error.size:
            lines.append(f"| {name} | {method} | 0 of {have.size} | | | | | |")
            continue
        lines.append(
            f"| {name} | {method} | {error.size} of {have.size} "
            f"| {np.sqrt(np.mean(error**2)):.2f} | {error.mean():+.2f} | {np.abs(error).max():.1f} "
            f"| {1.96 * np.median(std):.1f} | {np.mean(np.abs(error) < 1.96 * std):.0%} |"
        )
    return "\n".join(lines)


def by_heights(made: SimulatedDrive, seed: int) -> Drive:
    """See a drive with GNSS heights."""
    return heights(made.drive)


def by_map(made: SimulatedDrive, seed: int) -> Drive:
    """See a drive with the grade of a map."""
    truth = made.truth
    return on_a_map(made.drive, truth.time, truth.distance, truth.grade, seed)


def blind(made: SimulatedDrive, seed: int) -> Drive:
    """See a drive without a grade."""
    return nowhere(made.drive)


def own_vehicle(seed: int, kind: str, *seen: Seen) -> list[dict[str, list[Result]]]:
    """Compare on one vehicle of our own simulator, its drives seen in several ways."""
    rng = np.random.default_rng(seed)
    car = random_vehicle(rng, kind)

    def go(load: float, at: int) -> list[Recorded]:
        made = simulate_car(scenario(car, rng, load=load * FULL[car.kind] * car.mass, seed=at))
        mass = made.truth.mass
        return [Recorded(view(made, at), float(mass[0]), float(np.mean(mass))) for view in seen]

    known = [go(load, seed + k) for k, load in enumerate(KNOWN)]
    weighed = [go(load, seed + 5 + k) for k, load in enumerate(WEIGHED)]
    sys.stderr.write(f"{kind} {seed}\n")
    return [
        compared(bare(car), [k[view] for k in known], [w[view] for w in weighed])
        for view in range(len(seen))
    ]


def own(first: int, count: int = 12) -> str:
    """Vehicles of our own simulator, with GNSS heights."""
    found = [
        own_vehicle(first + 20 * k, KINDS[k % len(KINDS)], by_heights)[0] for k in range(count)
    ]
    return rows("own simulator, GNSS heights", found)


def levels(seeds: str, count: int = len(KINDS), second_count: int = 4) -> str:
    """Compare the same by what tells the grade: a map, or nothing."""
    own_found = [
        own_vehicle(OWN_LEVELS[seeds] + 20 * k, KINDS[k], by_map, blind) for k in range(count)
    ]
    second_found = [
        second_one(SECOND_LEVELS[seeds] + k, SECOND_KINDS[k], mapped=True)
        for k in range(second_count)
    ]
    return "\n".join(
        [
            rows("own simulator, grade of a map", [found[0] for found in own_found]),
            rows("own simulator, no grade", [found[1] for found in own_found]),
            rows("second model, grade of a map", second_found),
        ]
    )


def electric(seeds: str) -> str:
    """Compare on electric cars by the grade of a map, and by GNSS heights on the same drives."""
    found = [own_vehicle(seed, "electric", by_map, by_heights) for seed in OWN_ELECTRIC[seeds]]
    second_found = [
        second_one(seed, "electric_car", mapped=True) for seed in SECOND_ELECTRIC[seeds]
    ]
    return "\n".join(
        [
            rows("electric cars, own simulator, grade of a map", [f[0] for f in found]),
            rows("the same drives, GNSS heights", [f[1] for f in found]),
            rows("electric cars, second model, grade of a map", second_found),
        ]
    )


def second_one(seed: int, kind: str, *, mapped: bool = False) -> dict[str, list[Result]]:
    """Compare on one vehicle of the second model."""
    made = second_vehicle(kind, seed)
    base = wb.Vehicle(name=kind, kind=CLASSES.get(kind, "car"))
    sys.stderr.write(f"{kind} {seed}\n")
    with tempfile.TemporaryDirectory() as home:
        drives = [
            _second_drive(Path(home), made, seed, load, style, number, mapped=mapped)
            for number, (load, style) in enumerate(
                [(load, "ordinary") for load in KNOWN] + list(SECOND_WEIGHED)
            )
        ]
        return compared(base, drives[: len(KNOWN)], drives[len(KNOWN) :])


def second(first: int, count: int = 10) -> str:
    """Vehicles, roads and drivers of the second model, with GNSS heights."""
    kinds = [SECOND_KINDS[k % len(SECOND_KINDS)] for k in range(count)]
    found = [second_one(first + k, kind) for k, kind in enumerate(kinds)]
    heavy = [f for f, kind in zip(found, kinds, strict=True) if CLASSES.get(kind) in HEAVY]
    light = [f for f, kind in zip(found, kinds, strict=True) if CLASSES.get(kind) not in HEAVY]
    return "\n".join(
        [
            rows("second model, GNSS heights", found),
            rows("- its cars and vans", light),
            rows("- its trucks and buses", heavy),
        ]
    )


HEAVY: Final = ("truck", "bus")


def _second_drive(
    home: Path, made: object, seed: int, load: float, style: str, number: int, *, mapped: bool
) -> Recorded:
    folder = home / str(number)
    room = max(made.gross - made.tare - DRIVER, 0.0)
    mass = made.tare + DRIVER + load * room
    make_drive(folder, made, mass=mass, seed=100 * seed + number, style=style)
    truth = pl.read_parquet(folder / "truth.parquet")
    masses, drive = truth["mass_kg"], heights(wb.read_drive(folder))
    if mapped:
        course = (truth[name].to_numpy() for name in ("time_s", "distance_m", "grade_rad"))
        drive = on_a_map(drive, *course, 100 * seed + number)
    return Recorded(drive, float(masses[0]), float(masses.mean()))


def sheets(first: int, count: int = 6) -> str:
    """Trucks of the second model by data sheet: J1939 at 5 Hz, with brake, retarder and gear."""
    found = []
    for seed in range(first, first + count):
        truck = second_vehicle("truck", seed)
        papers = Known(
            kind="truck", tare=round(truck.tare), gross=round(truck.gross), torque="percent"
        )
        sys.stderr.write(f"truck {seed}\n")
        with tempfile.TemporaryDirectory() as home:
            made = [
                truck_fleet.drive(truck, 100 * seed + 50 + k, load, Path(home))
                for k, load in enumerate(truck_fleet.WEIGHED)
            ]
        # Fuel of half an hour is a thousandth of the mass.
        weighed = [Recorded(drive, mass, mass) for drive, mass in made]
        found.append(compared(describe(papers).vehicle, [], weighed, sheet=True))
    return rows("trucks by J1939, data sheet", found)


def foreign() -> Iterator[dict[str, list[Result]]]:
    """Two vehicles of the foreign simulator, three drives of calibration and four others."""
    for name in ("hatchback", "wagon"):
        made = []
        for drive in (
            *(f"calibration-{k}" for k in (1, 2, 3)),
            *(f"drive-{k}" for k in range(1, 5)),
        ):
            folder = DATA / "foreign-simulator" / name / drive
            mass = pl.read_parquet(folder / "truth.parquet")["mass_kg"]
            seen = heights(wb.read_drive(folder))
            made.append(Recorded(seen, float(mass[0]), float(mass.mean())))
        yield compared(wb.Vehicle(name=name), made[:3], made[3:])


def bmw_i3() -> str:
    """24 trips of one car by its data sheet: how far its masses scatter."""
    car = wb.Vehicle.load(EXAMPLES / "bmw-i3" / "vehicle.toml")
    mapping = EXAMPLES / "bmw-i3" / "mapping.toml"
    lines = [
        "| BMW i3, 24 trips, data sheet | weighed | median kg | off it, median % | reported ± % |",
        "|---|---|---|---|---|",
    ]
    for method in METHODS:
        masses, stds = [], []
        for path in sorted((DATA / "bmw-i3").glob("Trip*.csv")):
            drive = without_accelerometer(wb.read_drive(path, mapping))
            w = wb.weigh(drive, car, method)
            masses.append(w.mass)
            stds.append(w.std)
        mass, std = np.array(masses), np.array(stds)
        have = np.isfinite(mass)
        mass, std = mass[have], std[have]
        middle = float(np.median(mass)) if mass.size else np.nan
        lines.append(
            f"| {method} | {mass.size} of {have.size} | {middle:.0f} "
            f"| {100.0 * np.median(np.abs(mass / middle - 1.0)) if mass.size else np.nan:.1f} "
            f"| {196.0 * np.median(std / mass) if mass.size else np.nan:.1f} |"
        )
    return "\n".join(lines)


def canedge() -> str:
    """Eight files of one car whose mass and reference torque nobody tells: how far they agree."""
    home = EXAMPLES / "canedge"
    car = wb.Vehicle.load(home / "vehicle.toml")
    reference = car.torque.reference_torque
    folder = DATA / "canedge-obd-imu-gnss"
    lines = [
        "| CANedge file, no accelerometer | s | " + " | ".join(METHODS) + " |",
        "|---|---|---|---|",
    ]
    found: dict[str, list[float]] = {method: [] for method in METHODS}
    for path in sorted(folder.glob("*/*.MF4")):
        drive = heights(wb.read_drive(path, home / "mapping.toml", folder / "canmod-gps.dbc"))
        cells = []
        for method in METHODS:
            w = wb.weigh(drive, car, method)
            if w.status == "converged":
                found[method].append(w.mass / reference)
                cells.append(f"{w.mass / reference:.2f} ± {1.96 * w.std / reference:.2f}")
            else:
                cells.append(str(w.status))
        name = f"{path.parent.name}/{path.name[:8]}"
        lines.append(f"| {name} | {drive.duration:.0f} | {' | '.join(cells)} |")
    told = [
        f"{np.mean(x):.2f}, sd {100.0 * np.std(x, ddof=1) / np.mean(x):.1f} % ({len(x)} files)"
        if len(x) > 1
        else f"{len(x)} files"
        for x in found.values()
    ]
    lines.append(f"| mean | | {' | '.join(told)} |")
    return "\n".join(lines) + "\n\nMasses in kg per N m of reference torque, 95 %."


def single_logs() -> str:
    """What is reported of the truck of 30 s and of the car without a torque."""
    truck = wb.read_drive(DATA / "j1939-truck" / "normal.log")
    lines = ["| log | what `weigh --method speed-torque-ekf` says |", "|---|---|"]
    w = wb.weigh(truck, EXAMPLES / "j1939-truck" / "vehicle.toml", METHODS[0])
    lines.append(f"| J1939 truck, {truck.duration:.0f} s | `{w.status}`: {w.reason} |")
    seat = EXAMPLES / "seat-leon"
    for path in sorted((DATA / "seat-leon-obd").glob("*.csv")):
        w = wb.weigh(path, seat / "vehicle.toml", METHODS[0], mapping=seat / "mapping.toml")
        lines.append(f"| Seat Leon, {path.name[:10]} | `{w.status}`: {w.reason} |")
    return "\n".join(lines)


def recorded() -> str:
    """What the recorded and foreign logs allow."""
    if not DATA.is_dir():
        return "The recordings were not there when this page was made."
    simulated = f"{HEAD}\n{rows('foreign simulator, GNSS heights', foreign())}"
    return "\n\n".join([simulated, bmw_i3(), logs()])


def logs() -> str:
    """What the other recorded logs allow."""
    return f"{canedge()}\n\n{single_logs()}"


def parts(seeds: str) -> dict[str, Callable[[], str]]:
    """Every part by its name, for "judging" or "tuning"."""
    return {
        "own": lambda: own(OWN[seeds]),
        "second": lambda: second(SECOND[seeds]),
        "sheets": lambda: sheets(SECOND[seeds]),
        "levels": lambda: levels(seeds),
        "electric": lambda: electric(seeds),
        "recorded": recorded,
        "logs": logs,
    }


def main() -> None:
    seeds = "tuning" if "--tuning" in sys.argv else "judging"
    chosen = parts(seeds)
    asked = [name for name in sys.argv[1:] if not name.startswith("--")] or list(chosen)
    for name in asked:
        sys.stdout.write(f"### {name}, {seeds}\n{chosen[name]()}\n\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
