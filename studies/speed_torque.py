"""Speed and recorded torque, no accelerometer: ``speed-torque-ekf`` beside ``joint``. Run me.

    python studies/speed_torque.py [own|second|sheets|levels|recorded ...] [--tuning]

Each part prints its rows; ``python studies/galvao.py`` puts them all in ``galvao.md``. Every drive
is stripped of its accelerometer first. A vehicle is calibrated for each of the two methods on three
drives of known mass, and weighed on four others. With ``--tuning`` the seeds are those that
the settings were chosen on.
"""

from __future__ import annotations

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
from weighbridge.papers.jensen2022 import without_weather
from weighbridge.signals import Drive, Signal
from weighbridge.simulation import random_vehicle, simulate_car
from weighbridge.vehicle.known import Known, describe

METHODS: Final = ("speed-torque-ekf", "joint")
OWN: Final = {"judging": 164_000, "tuning": 163_000}
SECOND: Final = {"judging": 9520, "tuning": 9500}
KNOWN: Final = (0.0, 0.5, 0.9)
WEIGHED: Final = (0.0, 0.3, 0.7, 1.0)
SECOND_WEIGHED: Final = ((0.0, "ordinary"), (0.95, "ordinary"), (0.3, "city"), (0.6, "ordinary"))
DATA: Final = Path(__file__).parents[2] / "shared" / "data"
EXAMPLES: Final = Path(__file__).parents[1] / "examples"

HEAD: Final = (
    "| drives | method | weighed | RMS % | mean % | worst % | told, median ± % | within it |\n"
    "|---|---|---|---|---|---|---|---|"
)


class Recorded(NamedTuple):
    """A drive and its mass at the beginning and in the mean [kg]."""

    drive: Drive
    begin: float
    mean: float


class Result(NamedTuple):
    """Error and told standard deviation over the true mass [-]; NaN where refused."""

    error: float
    std: float


Seen = Callable[[Drive], Drive]


def heights(drive: Drive) -> Drive:
    """Leave speed, torque and positions."""
    return without_accelerometer(without_weather(drive)).without(
        "gnss_speed", "gnss_course", "hdop", "gnss_accuracy", "grade"
    )


def nowhere(drive: Drive) -> Drive:
    """Leave speed and torque alone: the slope is a state."""
    return heights(drive).without("altitude", "latitude", "longitude")


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


def own_vehicle(seed: int, kind: str, seen: Seen, *, mapped: bool = False) -> dict[str, list]:
    """Compare on one vehicle of our own simulator."""
    rng = np.random.default_rng(seed)
    car = random_vehicle(rng, kind)

    def go(load: float, at: int) -> Recorded:
        made = simulate_car(scenario(car, rng, load=load * FULL[car.kind] * car.mass, seed=at))
        mass, drive = made.truth.mass, seen(made.drive)
        if mapped:
            every = slice(None, None, max(1, made.truth.time.size // 5000))
            grade = Signal("grade", made.truth.time[every], made.truth.grade[every])
            drive = drive.with_signals(grade)
        return Recorded(drive, float(mass[0]), float(np.mean(mass)))

    known = [go(load, seed + k) for k, load in enumerate(KNOWN)]
    weighed = [go(load, seed + 5 + k) for k, load in enumerate(WEIGHED)]
    sys.stderr.write(f"{kind} {seed}\n")
    return compared(bare(car), known, weighed)


def own(first: int, count: int = 12) -> str:
    """Vehicles of our own simulator, with GNSS heights."""
    found = [own_vehicle(first + 20 * k, KINDS[k % len(KINDS)], heights) for k in range(count)]
    return rows("own simulator, GNSS heights", found)


def levels(first: int) -> str:
    """The same by what tells the grade: a map, or nothing."""
    seeds = [(first + 1000 + 20 * k, kind) for k, kind in enumerate(KINDS)]
    by_map = [own_vehicle(seed, kind, heights, mapped=True) for seed, kind in seeds]
    blind = [own_vehicle(seed, kind, nowhere) for seed, kind in seeds]
    return "\n".join(
        [
            rows("own simulator, grade of a map", by_map),
            rows("own simulator, no grade", blind),
        ]
    )


def second(first: int, count: int = 10) -> str:
    """Vehicles, roads and drivers of the second model, with GNSS heights."""
    found = []
    for k in range(count):
        seed, kind = first + k, SECOND_KINDS[k % len(SECOND_KINDS)]
        made = second_vehicle(kind, seed)
        base = wb.Vehicle(name=kind, kind=CLASSES.get(kind, "car"))
        sys.stderr.write(f"{kind} {seed}\n")
        with tempfile.TemporaryDirectory() as home:
            drives = [
                _second_drive(Path(home), made, seed, load, style, number)
                for number, (load, style) in enumerate(
                    [(load, "ordinary") for load in KNOWN] + list(SECOND_WEIGHED)
                )
            ]
            found.append(compared(base, drives[: len(KNOWN)], drives[len(KNOWN) :]))
    kinds = [SECOND_KINDS[k % len(SECOND_KINDS)] for k in range(count)]
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
    home: Path, made: object, seed: int, load: float, style: str, number: int
) -> Recorded:
    folder = home / str(number)
    room = max(made.gross - made.tare - DRIVER, 0.0)
    mass = made.tare + DRIVER + load * room
    make_drive(folder, made, mass=mass, seed=100 * seed + number, style=style)
    truth = pl.read_parquet(folder / "truth.parquet")["mass_kg"]
    return Recorded(heights(wb.read_drive(folder)), float(truth[0]), float(truth.mean()))


def sheets(first: int, count: int = 6) -> str:
    """Trucks of the second model by data sheet: J1939 at 5 Hz, brake, retarder and gear told."""
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
        "| BMW i3, 24 trips, data sheet | weighed | median kg | off it, median % | told ± % |",
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


def recorded() -> str:
    """What the recorded and foreign logs allow."""
    if not DATA.is_dir():
        return "The recordings were not there when this page was made."
    return "\n\n".join([f"{HEAD}\n{rows('foreign simulator, GNSS heights', foreign())}", bmw_i3()])


def parts(seeds: str) -> dict[str, Callable[[], str]]:
    """Every part by its name, for "judging" or "tuning"."""
    return {
        "own": lambda: own(OWN[seeds]),
        "second": lambda: second(SECOND[seeds]),
        "sheets": lambda: sheets(SECOND[seeds]),
        "levels": lambda: levels(OWN[seeds]),
        "recorded": recorded,
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
